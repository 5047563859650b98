"""What the operators share: parents on one grid, children put together."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from evocity.coding.decoded import decoded
from evocity.condensation import merged as merged_layers
from evocity.errors import OperatorError, shown
from evocity.genome import Genome, Pieces, laid, merged
from evocity.operators.parameters import Check, check_parameters, repair_checks
from evocity.operators.repair import collage_repair
from evocity.pavement import Pavement


def check_call(operator, parents: Sequence[Genome], rng: np.random.Generator) -> None:
    """Raise `OperatorError` unless the number of parents suits ``operator``, all share map size
    and pixel size, and ``rng`` can be drawn from."""
    name, (fewest, most) = operator.name, operator.parents
    if not isinstance(rng, np.random.Generator):
        raise OperatorError(
            f"{name}: rng = {shown(rng)}",
            "a NumPy Generator",
            "pass numpy.random.default_rng(seed)",
        )
    if not isinstance(parents, Sequence):
        raise OperatorError(
            f"{name}: parents is a {type(parents).__name__}",
            "a list of genomes",
            "put the genomes in square brackets",
        )
    if len(parents) < fewest or (most is not None and len(parents) > most):
        wanted = (
            f"{fewest}"
            if most == fewest
            else f"{fewest} or more"
            if most is None
            else f"{fewest}…{most}"
        )
        raise OperatorError(
            f"{name}: {len(parents)} parents",
            f"{wanted} parents",
            "pass a list of that many genomes",
        )
    strange = [type(one).__name__ for one in parents if not isinstance(one, Genome)]
    if strange:
        raise OperatorError(
            f"{name}: parents of type {', '.join(strange)}",
            "genomes",
            "encode the maps first: evocity.encode(city).genome",
        )
    first = parents[0]
    for other in parents[1:]:
        p, q = first.pavement, other.pavement
        apart = (p.height, p.width) != (q.height, q.width)
        if apart or other.metres_per_pixel != first.metres_per_pixel:
            raise OperatorError(
                f"{name}: parents of {p.height} × {p.width} px, {first.metres_per_pixel:g} m and "
                f"{q.height} × {q.width} px, {other.metres_per_pixel:g} m",
                "parents on one grid of pixels",
                "read the maps with the same pixels and metres_per_pixel",
            )


def assembled(parents: Sequence[Genome], owner: np.ndarray, grid: Pavement) -> Genome:
    """A child that has in cell i of the ``grid`` what ``parents[owner[i]]`` has there; owner is
    ``(n,)``. Range blocks are split where the owner changes within."""
    owner = owner.reshape(grid.rows, grid.columns)
    return laid(parents, Pieces.in_place(owner, grid.block)).genome


def raw_heights(genome: Genome) -> np.ndarray:
    """What a genome decodes to, float32 ``(H, W)``, metres, its roofs not settled: what breeding
    cuts and lays, so that a child of one parent is meant to be what that is."""
    return np.maximum(decoded(genome).attractor, 0)


@dataclass(frozen=True, eq=False)
class Draft:
    """A child as an operator drafts it, before collage repair.

    genome : the lifs, crossed.
    intended : float32 ``(H, W)``, metres: the map the operator means to lay.
    made : how it came about, for the genome's ``made``; the operator's name is added.
    most : range blocks that continue each other are merged to this side at most, px; None for
        the coarsest of the parents.
    """

    genome: Genome
    intended: np.ndarray
    made: Mapping
    most: int | None = None


@dataclass(frozen=True, kw_only=True)
class Drafting:
    """An operator that drafts its child, which is then repaired if wanted.

    A subclass is a frozen dataclass with ``name``, ``parents``, parameters of its own, their checks
    in ``_checks()`` (see `check_parameters`), and a method ``_draft(parents, rng) -> Draft``.

    Parameters
    ----------
    repair : blocks that decode further than this (root mean square, metres) from the map that is
        meant to be laid are matched again; None as in the papers, with their crumbling.
    reach, domains : where repair searches, as in `evocity.encode`.
    """

    #: Whether repair lowers range blocks in which ground would be built on.
    clears: ClassVar[bool] = False
    repair: float | None = 0.5
    reach: int | None = 24
    domains: Sequence[int] = (2,)

    def __post_init__(self):
        check_parameters(self, {**self._checks(), **repair_checks()})

    def _checks(self) -> dict[str, Check]:
        return {}

    def __call__(self, parents: Sequence[Genome], rng: np.random.Generator) -> Genome:
        """A child of ``parents``; its ``made`` tells how it came about.

        Raises `OperatorError` if the parents do not suit the operator or one another.
        """
        draft = self.draft(parents, rng)
        most = draft.most or max(parent.pavement.coarsest for parent in parents)
        child, made = merged(draft.genome, most), {"operator": self.name, **draft.made}
        if self.repair is not None:
            child, made["repaired"] = collage_repair(
                child,
                draft.intended,
                threshold=self.repair,
                reach=self.reach,
                domains=self.domains,
                clear=self.clears,
            )
            child = merged(child, most)
        return child.replace(made=made)

    def draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        """The child before repair, and the map it is meant to be; as the call draws it.

        What the parents condense stands in both; where several cover, what the first does.
        """
        check_call(self, parents, rng)
        kept = merged_layers(parent.condensation for parent in parents)
        if kept is None:
            return self._draft(parents, rng)
        # laid in all parents first, so that outlines and buildings are those that will stand
        draft = self._draft([parent.replace(condensation=kept) for parent in parents], rng)
        child = draft.genome.replace(condensation=kept)
        return replace(draft, genome=child, intended=kept.laid(draft.intended))
