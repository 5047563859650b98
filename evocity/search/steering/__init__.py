"""Steering: commands to a run in progress, reports of its progress, and its end.

- `execution`: commands carried out between two generations
- `stop_rules`: what ends a search: rules and signals
- `generation`, `observers`, `notification`: reports of a search, and their receivers
- `estimate`: disk and hours that a run takes
"""
