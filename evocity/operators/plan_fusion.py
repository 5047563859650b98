"""Plan fusion: faces between the first parent's streets get buildings of source cities."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np

from evocity.citymap import BUILT_ABOVE, MAX_SIDE, CityMap
from evocity.coding.decoding_cache import decoded
from evocity.genome import VOID, Genome, Pieces, laid
from evocity.isometries import AFFINE
from evocity.operators.crossover import Draft, Drafting, raw_heights
from evocity.operators.grid import common_grid
from evocity.operators.parameters import MOST_METRES, SHARE, Check
from evocity.operators.pavement_fusion import ground
from evocity.operators.plans.fill import DRAWS, LOSS, REPEATS, SLACK, fill_face
from evocity.operators.plans.gene import FaceGene
from evocity.operators.plans.laying import Lot
from evocity.operators.plans.plan import plan_of
from evocity.operators.street_blocks.refill import Origins
from evocity.pavement import Pavement

#: Most candidates of a face.
_MOST_DRAWS = 100_000


@dataclass(frozen=True)
class PlanFusion(Drafting):
    """Keep the first parent's plan, and fill faces of it with buildings of source cities.

    The plan is that of the first parent's decoded map (see `evocity.operators.plans.plan_of`).
    Faces are drawn one after another, and each draws one of the other parents as the donor of its
    buildings. A donor with much built ground that is not on the map yet is drawn more often. If all
    faces are to be filled, a face tries all donors in a drawn order. The buildings come from the
    place that fits best (see `evocity.operators.plans.fill_face`). They turn to the walls of the
    face by any angle, and their fronts follow its outline. A face keeps its buildings in three
    cases: nothing fits; the face is open; a condensation locks something in the face.

    In a search, the other parents are the source cities of the run. Without other parents, the
    first parent is its own donor.

    Parameters
    ----------
    faces : number of faces to fill, 1 or more; None for all that something fits. The genome's
        ``made["faces"]`` holds the number of filled faces, and ``made["genes"]`` holds the face,
        the source city, the place, the angle, the mirror and the scale of each.
    area_min : smallest area of the lot of a face to fill, m².
    draws : number of places that are tried for each face, 1 or more.
    slack : largest difference of the new coverage of a lot from the old coverage, 0…1.
    loss : largest loss of built ground along the outline of a lot, as a share, 0…1.
    repeats : largest share of the new built ground in a face whose place in the source city stands
        on the map already, 0…1.
    repair, reach, domains : parameters of collage repair, as in `Drafting`.

    Source: this operator comes from evocity. Marsault 2002 §6.1 wishes for operators that keep the
    identity of buildings.
    """

    faces: int | None = 2
    area_min: float = 300.0
    draws: int = DRAWS
    slack: float = SLACK
    loss: float = LOSS
    repeats: float = REPEATS
    reach: int | None = field(default=48, kw_only=True)

    name = "plan_fusion"
    parents = (1, None)
    lays_void: ClassVar[bool] = True
    clears: ClassVar[bool] = True
    #: In a search the source cities are further parents, so buildings are never copies of copies.
    takes_founders: ClassVar[bool] = True
    #: Turned buildings need domain blocks from farther away than codes of cities do.
    own_defaults: ClassVar[tuple[str, ...]] = ("reach",)

    def _checks(self) -> dict[str, Check]:
        return {
            "faces": (
                lambda count: count is None or 1 <= count <= MAX_SIDE**2,
                f"1…{MAX_SIDE**2}, or none",
            ),
            "area_min": (lambda area: 0 <= area <= MOST_METRES**2, f"0…{MOST_METRES**2:g} m²"),
            "draws": (lambda count: 1 <= count <= _MOST_DRAWS, f"1…{_MOST_DRAWS}"),
            "slack": SHARE,
            "loss": SHARE,
            "repeats": SHARE,
        }

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        filling = _Filling(parents, common_grid(self.name, parents, 0.0))
        genes: list[FaceGene] = []
        how = {"draws": self.draws, "slack": self.slack, "loss": self.loss}
        for face in rng.permutation(filling.numbers(self.area_min)).tolist():
            if len(genes) == self.faces:
                break
            donors = filling.draw_donors(rng)
            # if all faces are wanted, no donor is left out
            for donor in donors[: None if self.faces is None else 1].tolist():
                result = fill_face(
                    filling.plan, face, filling.cities[donor], rng, used=filling.used(donor),
                    repeats=self.repeats, name=filling.names[donor], **how,
                )  # fmt: skip
                if result is not None:
                    filling.lay(donor, *result)
                    genes.append(result[0])
                    break
        made = {"faces": len(genes), "genes": [gene.as_dict() for gene in genes]}
        return Draft(filling.genome(), filling.intended, made)


class _Filling:
    """The first parent, while buildings of donors fill faces of its plan.

    plan : the plan of the first parent's decoded map. intended : float32 ``(H, W)``, metres.
    cities, names : decoded map and name of each parent. Donors are numbered as parents.
    """

    def __init__(self, parents: Sequence[Genome], grid: Pavement):
        self._parents, self._grid = parents, grid
        self.cities: list[CityMap] = [decoded(parent).city for parent in parents]
        self.names = [_name(parent) for parent in parents]
        self.plan = plan_of(self.cities[0])
        self.intended = raw_heights(parents[0]).copy()
        self._donors = np.arange(1, len(parents)) if len(parents) > 1 else np.zeros(1, np.int64)
        self._origins = Origins(parents, grid)
        self._origins.count(self._origins.of[0].ravel(), 1)
        self._built = [grid.blocks(city.built).any(axis=(1, 2)) for city in self.cities]
        shape = grid.rows, grid.columns
        self._built = [built.reshape(shape) for built in self._built]
        self._whose = np.zeros(shape, np.int64)
        self._cells = np.indices(shape)
        self._iso = np.zeros(shape, np.uint8)

    @cached_property
    def _locked(self) -> np.ndarray | None:
        layer = self._parents[0].condensation
        return None if layer is None else layer.mask

    def numbers(self, area_min: float) -> np.ndarray:
        """List the faces that may be filled: they are not open, their lots have ``area_min`` m² or
        more, and nothing in them is locked."""
        free = ~self.plan.open & (self.plan.lot_area >= max(area_min, 1e-9))
        if self._locked is not None:
            locked = np.unique(self.plan.labels[self._locked])
            free[locked[locked > 0] - 1] = False
        return np.flatnonzero(free) + 1

    def draw_donors(self, rng: np.random.Generator) -> np.ndarray:
        """Draw the order in which donors are tried, by their built ground that is not on the map
        yet."""
        fresh = np.array(
            [
                np.count_nonzero(self._built[donor] & ~self._stale(donor)) + 1.0
                for donor in self._donors
            ]
        )
        # the order of exponential variables, each by the ground of its donor
        return self._donors[np.argsort(rng.exponential(size=fresh.size) / fresh, kind="stable")]

    def used(self, donor: int) -> np.ndarray:
        """Mark the pixels of a donor that stand on the map already, or that a condensation locks:
        bool ``(H, W)``."""
        cell = self._grid.block
        used = self._stale(donor).repeat(cell, axis=0).repeat(cell, axis=1)
        return used if self._locked is None else used | self._locked

    def _stale(self, donor: int) -> np.ndarray:
        return self._origins.stale(donor, self._built[donor], 1.0) > 0

    def lay(self, donor: int, gene: FaceGene, heights: np.ndarray) -> None:
        """Lay the buildings of a ``gene`` with these ``heights`` in its face."""
        lot, grid = Lot(self.plan, gene.face), self._grid
        self.intended[lot.window][lot.mask] = heights
        cells = np.unique(
            (lot.rows + lot.window[0].start) // grid.block * grid.columns
            + (lot.columns + lot.window[1].start) // grid.block
        )
        here = np.divmod(cells, grid.columns)
        pixel, middle = self.plan.metres_per_pixel, (grid.block - 1) / 2
        row, column = self.plan.centre[gene.face - 1]
        down, along = gene.offsets(
            (here[0] * grid.block + middle - row) * pixel,
            (here[1] * grid.block + middle - column) * pixel,
        )
        there = [
            np.clip(np.floor((at + off / pixel + 0.5) / grid.block), 0, side - 1).astype(np.int64)
            for at, off, side in zip(
                (gene.row, gene.column), (down, along), self._whose.shape, strict=True
            )
        ]
        meant = grid.blocks(self.intended > BUILT_ABOVE).any(axis=(1, 2))[cells]
        bare = ~meant & self._built[donor][tuple(there)]
        self._count(here, -1)
        self._whose[here] = np.where(bare, len(self._parents), donor)
        for axis in range(2):
            self._cells[axis][here] = np.where(bare, here[axis], there[axis])
        self._iso[here] = np.where(bare, 0, _nearest_isometry(gene))
        self._count(here, 1)

    def _count(self, here, step: int) -> None:
        whose = self._whose[here]
        for parent in range(len(self._parents)):
            own = whose == parent
            places = tuple(axis[here][own] for axis in self._cells)
            self._origins.count(self._origins.of[parent][places], step)

    def genome(self) -> Genome:
        """Lay the lifs of all parents."""
        pieces = Pieces(self._grid.block, self._whose, *self._cells, self._iso)
        return laid([*self._parents, ground(self._parents[0])], pieces, carried=True).genome


def _name(genome: Genome) -> str:
    """Join the names of the cities whose lifs a genome has; in a run, genomes list all cities."""
    present = (genome.cities[number] for number in np.unique(genome.parent).tolist())
    return "; ".join(city for city in present if city != VOID) or VOID


def _nearest_isometry(gene: FaceGene) -> int:
    """Find the isometry of the square that is nearest to the turn and mirror of a gene."""
    steps = [gene.offsets(np.float64(down), np.float64(along)) for down, along in ((1, 0), (0, 1))]
    wanted = np.array(steps).ravel()
    return int((AFFINE[:, 2:] * wanted).sum(axis=1).argmax())
