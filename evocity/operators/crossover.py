"""Base of operators of fabric: checks of the parents, drafts of children, collage repair."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from evocity.coding.decoding_cache import decoded
from evocity.condensation import merged as merged_layers
from evocity.errors import OperatorError
from evocity.genome import Genome, Pieces, laid, merged
from evocity.genome.genome import checked
from evocity.operators.parameters import Check, check_parameters, check_parents, repair_checks
from evocity.operators.plans.inheritance import PLAN_KEY, carry_plan
from evocity.operators.repair import collage_repair
from evocity.pavement import Pavement


def check_call(operator, parents: Sequence[Genome], rng: np.random.Generator) -> None:
    """Raise `OperatorError` unless the parents suit ``operator``, share map size and pixel size,
    and ``rng`` is a generator."""
    remedy = "encode the maps first: evocity.encode(city).genome"
    check_parents(operator, parents, rng, "genome", lambda item: isinstance(item, Genome), remedy)
    grids = dict.fromkeys(
        (parent.pavement.height, parent.pavement.width, parent.metres_per_pixel)
        for parent in parents
    )
    if len(grids) > 1:
        sizes = (f"{height} × {width} px, {pixel:g} m" for height, width, pixel in grids)
        raise OperatorError(
            f"{operator.name}: the parents have different grids, {' and '.join(sizes)}",
            "parents with the same number and size of pixels",
            "read the maps of all parents with the same 'pixels' and 'metres_per_pixel'",
        )


def assemble(parents: Sequence[Genome], owner: np.ndarray, grid: Pavement) -> Genome:
    """Make a child that has in cell i of the ``grid`` the content of ``parents[owner[i]]`` there;
    owner is ``(n,)``. Range blocks split where the owner changes within."""
    owner = owner.reshape(grid.rows, grid.columns)
    return laid(parents, Pieces.in_place(owner, grid.block)).genome


def raw_heights(genome: Genome) -> np.ndarray:
    """Decode a genome without settled roofs: float32 ``(H, W)``, metres. Breeding cuts and lays
    these heights, so that a child of one parent decodes to what that parent does."""
    return np.maximum(decoded(genome).attractor, 0)


@dataclass(frozen=True, eq=False)
class Draft:
    """Draft of a child before collage repair.

    genome : genome of the child after crossover, before collage repair.
    intended : heights that the operator intends, float32 ``(H, W)``, metres.
    made : description of how the child was bred, without the operator's name, for the field
        ``made`` of the genome.
    most : largest side, px, of the range blocks that repair makes by merging adjacent blocks that
        continue each other. If ``most`` is None, blocks merge up to the largest side of the
        parents' range blocks.
    """

    genome: Genome
    intended: np.ndarray
    made: Mapping
    most: int | None = None


@dataclass(frozen=True, kw_only=True)
class Drafting:
    """Base class of operators that first draft a child and then repair the draft.

    A subclass is a frozen dataclass with the attributes ``name`` and ``parents``, and with its own
    parameters. The method ``_checks()`` of a subclass returns checks of the subclass's parameters
    (see `check_parameters`). The method ``_draft(parents, rng)`` of a subclass returns a `Draft`.

    Parameters
    ----------
    repair : largest accepted difference of a decoded block from the intended map, metres (root mean
        square). Range blocks that differ from the intended map by more than ``repair`` metres get
        new lifs. If ``repair`` is None, the child is not repaired, and its fabric crumbles as in
        the papers.
    reach, domains : limits of the search for new domain blocks, as in `evocity.encode`.
    """

    #: Whether repair lowers range blocks where ground would become built.
    clears: ClassVar[bool] = False
    #: Whether the first parent's streets stay, so that a child inherits its plan. Only operators
    #: with a plan of their own drafts (see `PlanDrafting`) and these pass a plan on.
    keeps_streets: ClassVar[bool] = False
    repair: float | None = 0.5
    reach: int | None = 24
    domains: Sequence[int] = (2,)

    def __post_init__(self):
        check_parameters(self, {**self._checks(), **repair_checks()})

    def _checks(self) -> dict[str, Check]:
        return {}

    def __call__(self, parents: Sequence[Genome], rng: np.random.Generator) -> Genome:
        """Breed a child of ``parents``; its ``made`` tells how it came about.

        Raises `OperatorError` if the parents do not suit the operator or one another.
        """
        draft = self.draft(parents, rng)
        most = draft.most or max(parent.pavement.coarsest for parent in parents)
        child, made = merged(draft.genome, most), {"operator": self.name, **draft.made}
        if self.repair is not None:
            search = {"reach": self.reach, "domains": self.domains}
            child, made["repaired"] = collage_repair(
                child, draft.intended, threshold=self.repair, **search, clear=self.clears
            )
            child = merged(child, most)
        else:
            checked(child)
        if self.keeps_streets and (plan := carry_plan(parents[0], child)) is not None:
            made[PLAN_KEY] = plan
        return child.replace(made=made)

    def draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        """Draft a child: the genome before repair, and the intended map.

        The child contains the condensations of all parents. Where several condensations cover a
        pixel, the condensation of the first parent wins.
        """
        check_call(self, parents, rng)
        layer = merged_layers(parent.condensation for parent in parents)
        if layer is None:
            return self._draft(parents, rng)
        # all parents get the layer first, so outlines and buildings are those of the child
        draft = self._draft([parent.replace(condensation=layer) for parent in parents], rng)
        child = draft.genome.replace(condensation=layer)
        return replace(draft, genome=child, intended=layer.laid(draft.intended))
