"""The class `Individual`: one of the living, as selection sees it."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from evocity.genome import Genome


@dataclass(frozen=True)
class Individual:
    """A living individual. Its attributes are: ``values``, the raw value by measure; ``losses``,
    the numbers that selection minimises, in the order of the objectives; ``violation``, how far it
    breaks constraints, 0 if it keeps them; ``rank``, the number of its front, where 0 is the best;
    ``marks``, further numbers of the algorithm, by name."""

    id: int
    genome: Genome = field(repr=False)
    values: dict[str, float]
    losses: tuple[float, ...] = field(repr=False)
    violation: float = 0.0
    rank: int = 0
    marks: Mapping[str, float] = field(default_factory=dict)
