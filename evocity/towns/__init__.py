"""Towns drawn by a rule: maps without a file, for trials and as parents.

- `patterns`: concentric, chessboard and radial towns; the table `PATTERNS`
- `substitution`: towns of a pattern laid into itself
- `houses`: what they share
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
