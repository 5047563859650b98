"""Evaluation on many machines, through Dask.

- `engine`: the engine that hands chunks of jobs to the workers of a cluster
- `dask_link`: the connection to Dask; only this file imports Dask
- `host`: evocity's own worker processes inside a process of the cluster
- `parcel`: the setup and the files that another machine needs to breed and evaluate
"""
