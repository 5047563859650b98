"""Towns drawn by a rule: maps without a file, for trials and as parents.

- `patterns`: concentric, chessboard and radial towns; the table `PATTERNS`
- `substitution`: towns of a motif that replaces its own shapes
- `houses`: houses along blocks, and checks of parameters
"""

from evocity.towns.patterns import (
    PATTERNS,
    chessboard_town,
    concentric_town,
    radial_town,
    substitution_town,
)

__all__ = [
    "PATTERNS",
    "chessboard_town",
    "concentric_town",
    "radial_town",
    "substitution_town",
]
