"""Widths of streets between façades.

- `widths`: the distance across each street from façade to façade, at several places of an edge
"""
