"""The class `Individual`: one of the living, as selection sees it."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from evocity.genome import Genome


@dataclass(frozen=True)
class Individual:
    """A living individual. The attribute ``values`` holds the raw value of each measure, and
    ``losses`` holds the numbers that selection minimises, in the order of the objectives. The
    number ``violation`` tells how far the individual violates constraints, 0 if all constraints
    hold. The attribute ``rank`` is the number of the individual's front, 0 for the best front. The
    attribute ``marks`` holds further numbers of the algorithm, by name."""

    id: int
    genome: Genome = field(repr=False)
    values: dict[str, float]
    losses: tuple[float, ...] = field(repr=False)
    violation: float = 0.0
    rank: int = 0
    marks: Mapping[str, float] = field(default_factory=dict)
