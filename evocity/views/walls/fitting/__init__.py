"""Straight lines in place of staircases.

- `lines`: the runs of a wall, the lines fitted to them, and where they meet
"""
