"""Pavements: the range blocks of a map, squares of one side or of many that tile it."""

from evocity.pavement.levels import (
    common_refinement,
    fitting_sides,
    halved_sides,
    quartered,
    read_sides,
    touched,
)
from evocity.pavement.pavement import Pavement

__all__ = [
    "Pavement",
    "common_refinement",
    "fitting_sides",
    "halved_sides",
    "quartered",
    "read_sides",
    "touched",
]
