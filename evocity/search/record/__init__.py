"""The record of a run: what its folder says of births.

- `aims`: raw values, losses and constraints
- `archive`, `grid`: the births that no other dominates; the best birth of each cell
- `commands`: the commands that a run was given
- `complete_run`: a run whose omitted genomes can be read too; differences of two births
"""
