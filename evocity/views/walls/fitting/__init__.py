"""Fitting of straight lines to the staircases of walls.

- `lines`: straight runs of walls, the lines fitted to them, and the nodes where they meet
"""
