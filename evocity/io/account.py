"""Account of a file: how many features it has, and for which reasons features are no buildings."""

from collections import Counter
from dataclasses import dataclass, field

# Reasons, as a note about a map gives them after a number.
NO_POLYGON = "without a polygon"
EMPTY = "with an empty geometry"
DEGENERATE = "with a degenerate outline"
UNDERGROUND = "underground"
DELETED = "deleted"
INCOMPLETE = "with missing corners"
REPLACED = "replaced by building parts"
UNTAGGED = "not tagged as a building"
OUTSIDE = "outside the window"
# Remark on buildings that lose rings of too few points.
LOST_RINGS = "degenerate rings left out"


@dataclass
class Account:
    """Count of a file's features.

    features : number of features before any filter.
    dropped : number of features for each reason, of those that give no building.
    remarks : number of buildings, or of their rings, for each remark about them.
    """

    features: int = 0
    dropped: Counter[str] = field(default_factory=Counter)
    remarks: Counter[str] = field(default_factory=Counter)

    def drop(self, reason: str, count: int = 1) -> None:
        """Count features that give no building, for a ``reason``."""
        if count:
            self.dropped[reason] += count

    def remark(self, text: str, count: int = 1) -> None:
        """Count buildings, or rings of theirs, to which a remark applies."""
        if count:
            self.remarks[text] += count

    @property
    def buildings(self) -> int:
        """Number of features that give a building, as far as they are counted."""
        return self.features - self.dropped.total()

    @property
    def note(self) -> str:
        """The reasons with their counts, in plain words; "" if nothing was dropped."""
        return ", ".join(f"{count} {reason}" for reason, count in self.dropped.items())


__all__ = [
    "DEGENERATE",
    "DELETED",
    "EMPTY",
    "INCOMPLETE",
    "LOST_RINGS",
    "NO_POLYGON",
    "OUTSIDE",
    "REPLACED",
    "UNDERGROUND",
    "UNTAGGED",
    "Account",
]
