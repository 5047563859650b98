"""Plans in genomes: the source city whose plan a genome has, changes, face genes, edited faces."""

import hashlib
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
import scipy

from evocity.coding.decoding_cache import decoded
from evocity.errors import MapError
from evocity.genome import VOID, Genome, unpacked
from evocity.operators.plans.gene import FaceGene
from evocity.operators.plans.plan import Plan, plan_of

#: Version of the form in which `Genome.made` keeps a plan.
STATE_VERSION = 1
#: Key of a plan in `Genome.made`.
PLAN_KEY = "plan"

#: A face agrees with a plan if its built ground differs in at most this share of its area.
_DIFFERENT = 0.05
#: Least share of the area of lots that agrees with a plan, and the largest built share of its axes.
_AGREEING, _STRAY = 0.5, 0.02
#: Heights differ where they differ by more, metres; smaller spots than this are errors of codes,
#: m²; an edited face has such a mean difference on its lot, metres.
_STEP, _SPOT, _EDITED = 1.0, 16.0, 0.25
#: Side of the squares that record touched pixels, px.
_TILE = 16
#: Operators that make founders; encoded genomes name no operator.
_FOUNDING = (None, "encode", "source")
# Fields of a gene that may be None.
_OPTIONAL = tuple(one.name for one in fields(FaceGene) if one.default is None)


@dataclass(frozen=True)
class InheritedPlan:
    """A plan that a genome inherits, as `Genome.made` keeps it.

    The plan is that of the founder called ``city`` after ``changes``. It needs only the founders
    that stand among the parents of a birth, so workers and replays find the same plan.

    city : name of the source city.
    faces : number of faces of the plan, after the changes.
    changes : changes of the plan, as in `apply_changes`.
    genes : genes of faces by number. A face without a gene has its own buildings.
    halves : genes of second halves by the number of the face; ``genes`` has those of first halves.
    edited : numbers of the faces whose buildings differ from the gene, or from their own buildings.
    touched : row and column of pixels that operators without plans changed; their faces are edited,
        too.
    """

    city: str
    faces: int
    changes: tuple[Mapping[str, Any], ...] = ()
    genes: Mapping[int, FaceGene] = field(default_factory=dict)
    edited: frozenset[int] = frozenset()
    touched: tuple[tuple[int, int], ...] = ()
    halves: Mapping[int, FaceGene] = field(default_factory=dict)

    @classmethod
    def from_made(cls, made: Any) -> "InheritedPlan | None":
        """Read the plan in a genome's ``made``; None without a plan, and for a strange record."""
        state = made.get(PLAN_KEY) if isinstance(made, Mapping) else None
        try:
            return None if state is None else _read(state)
        except (KeyError, TypeError, ValueError, OverflowError):
            return None

    def as_dict(self) -> dict[str, Any]:
        """Return the plan as JSON-able data, for ``made["plan"]``."""
        data = {
            "version": STATE_VERSION,
            "city": self.city,
            "faces": self.faces,
            "changes": [dict(change) for change in self.changes],
            "genes": [gene.as_dict() for gene in self.all_genes],
            "edited": sorted(self.edited),
        }
        return data | ({"touched": [list(at) for at in self.touched]} if self.touched else {})

    @property
    def all_genes(self) -> list[FaceGene]:
        """The genes of all faces and halves, by face and part."""
        genes = [*self.genes.values(), *self.halves.values()]
        return sorted(genes, key=lambda gene: (gene.face, gene.part))

    @property
    def key(self) -> str:
        """The name of the city, with a digest of the changes if there are any."""
        if not self.changes:
            return self.city
        text = json.dumps([dict(change) for change in self.changes], sort_keys=True, default=str)
        return f"{self.city}+{hashlib.blake2b(text.encode(), digest_size=6).hexdigest()}"

    def settled(self, plan: Plan) -> "InheritedPlan":
        """Count the faces at the ``touched`` pixels among the ``edited`` ones."""
        if not self.touched:
            return self
        rows, columns = np.array(self.touched).T
        faces = np.unique(plan.labels[rows, columns]).tolist()
        return replace(self, edited=self.edited | (set(faces) - {0}), touched=())

    def suits(self, plan: Plan) -> bool:
        """Tell whether the numbers of faces and the pixels are those of the ``plan``."""
        height, width = plan.labels.shape
        inside = all(row < height and column < width for row, column in self.touched)
        return len(plan) == self.faces and inside


def plan_key(made: Any) -> str | None:
    """Return the name of the plan in a genome's ``made``: the source city, with a digest of the
    changes. Genomes with equal names have equal plans. None without an inherited plan."""
    state = InheritedPlan.from_made(made)
    return None if state is None else state.key


def founder_name(genome: Genome) -> str | None:
    """Return the name of the source city whose founder ``genome`` is; None for a child.

    A founder is a genome of one city that was encoded, or that a run took as a source: each lifs
    stands at its own place, and ``made`` names no operator that breeds.
    """
    made = genome.made
    if made.get("operator") not in _FOUNDING or PLAN_KEY in made or "refined" in made:
        return None
    present = np.flatnonzero(np.bincount(genome.parent)).tolist()
    if len(present) != 1 or genome.cities[present[0]] == VOID or np.any(genome.turn):
        return None
    places = zip(unpacked(genome.source), genome.pavement.corners, strict=True)
    in_place = all(np.array_equal(own, corner) for own, corner in places)
    return genome.cities[present[0]] if in_place else None


def founders_of(parents: Sequence[Genome]) -> dict[str, int]:
    """Find the founders among ``parents``: their numbers by the names of their source cities."""
    found: dict[str, int] = {}
    for number, parent in enumerate(parents):
        name = founder_name(parent)
        if name is not None:
            found.setdefault(name, number)
    return found


def find_plan(genome: Genome, founders: Mapping[str, Genome]) -> tuple[Plan, InheritedPlan | None]:
    """Find the plan of a ``genome``, and the state that its children inherit.

    founders : the founders that stand among the parents, by the names of their source cities.

    There are four cases. A founder has the plan of its map, without genes. A genome with a plan in
    ``made`` has the plan of the named founder, with the changes. A genome without one may have kept
    the streets of a founder: half of the lots and the axes look alike. It then has the plan of the
    founder whose lots agree most, and faces that look different are edited. Any other genome has
    the plan of its own decoded map, which children do not inherit; the state is None.
    """
    name = founder_name(genome)
    if name is not None:
        plan = plan_of(decoded(genome).city)
        return plan, InheritedPlan(name, len(plan))
    state = InheritedPlan.from_made(genome.made)
    if state is not None and state.city in founders:
        replayed = _replayed(state, founders)
        if replayed is not None and state.suits(replayed):
            return replayed, state.settled(replayed)
    return _compared(genome, founders) or (plan_of(decoded(genome).city), None)


def carry_plan(parent: Genome, child: Genome) -> dict[str, Any] | None:
    """Return the plan in the ``made`` of ``parent`` for a ``child`` that has the same streets.

    Faces whose heights differ count as edited: the record lists a pixel of each changed part. None
    if the parent has no plan.
    """
    state = InheritedPlan.from_made(parent.made)
    if state is None:
        return None
    changed = np.abs(decoded(child).attractor - decoded(parent).attractor) > _STEP
    spots, _ = scipy.ndimage.label(changed)
    large = np.bincount(spots.ravel()) * parent.metres_per_pixel**2 >= _SPOT
    large[0] = False
    rows, columns = np.nonzero(large[spots])
    parts = np.stack([spots[rows, columns], rows // _TILE, columns // _TILE])
    _, first = np.unique(parts, axis=1, return_index=True)
    places = zip(rows[first].tolist(), columns[first].tolist(), strict=True)
    touched = tuple(sorted({*state.touched, *places}))
    return replace(state, touched=touched).as_dict()


def _read(state: Mapping) -> InheritedPlan | None:
    """Read a state; returns None or raises for a strange one."""
    if state["version"] != STATE_VERSION or not isinstance(state["city"], str):
        return None
    lists = state["changes"], state["genes"], state["edited"], state.get("touched", ())
    if not all(isinstance(one, list | tuple) for one in lists):
        return None
    count = _whole(state["faces"], 1)
    changes = tuple(state["changes"])
    if not all(isinstance(change, Mapping) for change in changes):
        return None
    genes: dict[int, FaceGene] = {}
    halves: dict[int, FaceGene] = {}
    for data in state["genes"]:
        gene = _read_gene(data)
        known = halves if gene.part == 2 else genes
        if not 1 <= gene.face <= count or gene.face in known:
            return None
        known[gene.face] = gene
    if set(halves) != {face for face, gene in genes.items() if gene.part}:
        return None
    edited = frozenset(_whole(face, 1) for face in state["edited"])
    if max(edited, default=1) > count:
        return None
    touched = tuple((_whole(row, 0), _whole(column, 0)) for row, column in state.get("touched", ()))
    return InheritedPlan(state["city"], count, changes, genes, edited, touched, halves)


def _read_gene(data: Mapping) -> FaceGene:
    """Read a gene; raises `ValueError` or `TypeError` for a strange one."""
    gene = FaceGene(**data)
    _whole(gene.face, 1)
    if not isinstance(gene.source, str) or not isinstance(gene.mirror, bool):
        raise ValueError
    for value in vars(gene).values():
        if isinstance(value, float) and not math.isfinite(value):
            raise ValueError
    needed = gene.row, gene.column, gene.angle, gene.scale, gene.lift
    optional = [value for value in _optional(gene) if value is not None]
    if not all(isinstance(number, int | float) for number in (*needed, *optional)):
        raise ValueError
    if gene.scale <= 0 or _whole(gene.part, 0) > 2:
        raise ValueError
    return gene


def _optional(gene: FaceGene) -> list[Any]:
    return [getattr(gene, name) for name in _OPTIONAL]


def _whole(value: Any, least: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        raise ValueError
    return value


def _replayed(state: InheritedPlan, founders: Mapping[str, Genome]) -> Plan | None:
    """Apply the changes of a state to the plan of its founder; None if they do not suit it."""
    plan = plan_of(decoded(founders[state.city]).city)
    if not state.changes:
        return plan
    from evocity.operators.plans.changes import apply_changes

    plans = {name: plan_of(decoded(founder).city) for name, founder in founders.items()}
    try:
        return apply_changes(plan, state.changes, plans)
    except MapError:
        return None


def _compared(genome: Genome, founders: Mapping[str, Genome]) -> tuple[Plan, InheritedPlan] | None:
    """Find the founder whose plan a genome without a state has kept; None without one."""
    best, most = None, _AGREEING
    for name, founder in founders.items():
        own, city = decoded(founder).city, decoded(genome).city
        plan = plan_of(own)
        axes = plan.labels == 0
        if not plan.lot_area.sum() or (city.built & axes).sum() > _STRAY * axes.sum():
            continue
        pixel = plan.metres_per_pixel**2
        wrong = _sums(plan.labels, own.built != city.built, len(plan)) * pixel
        agrees = wrong <= _DIFFERENT * plan.area
        share = float(plan.lot_area[agrees].sum() / plan.lot_area.sum())
        if share <= most:
            continue
        step = np.abs(decoded(genome).attractor - decoded(founder).attractor)
        edited = _sums(plan.labels, step, len(plan)) * pixel > _EDITED * plan.lot_area
        faces = frozenset((np.flatnonzero(edited | ~agrees) + 1).tolist())
        best, most = (plan, InheritedPlan(name, len(plan), edited=faces)), share
    return best


def _sums(labels: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    return np.bincount(labels.ravel(), values.ravel(), count + 1)[1:]


def names(genomes: Iterable[Genome]) -> list[str]:
    """Join the names of the cities whose lifs each genome has; in a run, genomes list all
    cities."""
    joined = []
    for genome in genomes:
        present = (genome.cities[k] for k in np.flatnonzero(np.bincount(genome.parent)).tolist())
        joined.append("; ".join(city for city in present if city != VOID) or VOID)
    return joined


__all__ = [
    "PLAN_KEY",
    "InheritedPlan",
    "carry_plan",
    "find_plan",
    "founder_name",
    "founders_of",
    "names",
    "plan_key",
]
