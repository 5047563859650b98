"""Where the range blocks lie.

- `pavement`: `Pavement`, squares of one side or of many that tile a map
- `levels`: partitions of many sides: which sides a map allows, what two partitions have in common
"""

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
