"""The class `Individual`: one of the living, as selection sees it."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from evocity.genome import Genome


@dataclass(frozen=True)
class Individual:
    """A living individual. The attribute ``values`` holds the raw value of each measure, and
    ``losses`` holds the numbers that selection minimises, in the order of the objectives. The
    number ``violation`` tells how far the individual violates the constraints; 0 means that all
    constraints hold. The attribute ``rank`` is the number of the Pareto front to which the
    individual belongs, 0 for the best front. The attribute ``marks`` holds additional numbers that
    the algorithm gives to the individual, by name. The attribute ``plan`` names the plan of
    streets; individuals with the same plan have the same name. The attribute `plan` is None if the
    plan is unknown, or if the run has no niches of plans. The attribute ``changed`` tells whether
    the plan of streets differs from the plans of all source cities. The attribute ``founder`` tells
    whether the individual is a source city itself."""

    id: int
    genome: Genome = field(repr=False)
    values: dict[str, float]
    losses: tuple[float, ...] = field(repr=False)
    violation: float = 0.0
    rank: int = 0
    marks: Mapping[str, float] = field(default_factory=dict)
    plan: str | None = None
    changed: bool = False
    founder: bool = False
