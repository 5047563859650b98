"""`Individual`: one of the living, as selection sees it."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from evocity.genome import Genome


@dataclass(frozen=True)
class Individual:
    """One of the living: ``values`` maps measures to raw values, ``losses`` are what selection
    makes small, in the order of the objectives; ``violation`` is how far constraints are broken, 0
    if they are kept; ``rank`` is its front, 0 the best; ``marks`` are what else the algorithm
    tells of it, by name."""

    id: int
    genome: Genome = field(repr=False)
    values: dict[str, float]
    losses: tuple[float, ...] = field(repr=False)
    violation: float = 0.0
    rank: int = 0
    marks: Mapping[str, float] = field(default_factory=dict)
