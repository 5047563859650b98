"""What the operators share: parents on one grid, children put together."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from evocity.condensation import merged
from evocity.errors import OperatorError, shown
from evocity.genome import FIELDS, Genome, merged_cities
from evocity.operators.repair import collage_repair


def check_call(operator, parents: Sequence[Genome], rng: np.random.Generator) -> None:
    """Raise `OperatorError` unless the number of parents suits ``operator``, all share pavement
    and pixel size, and ``rng`` can be drawn from.

    Where the operator has an attribute ``any_partition`` that is true, their range blocks may
    differ in size."""
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
        apart = (p.height, p.width) != (q.height, q.width) or (
            p.block != q.block and not getattr(operator, "any_partition", False)
        )
        if apart or other.metres_per_pixel != first.metres_per_pixel:
            raise OperatorError(
                f"{name}: parents of {p.height} × {p.width} px, B = {p.block}, "
                f"{first.metres_per_pixel:g} m and {q.height} × {q.width} px, B = {q.block}, "
                f"{other.metres_per_pixel:g} m",
                "parents on one pavement",
                "read the maps with the same pixels and metres_per_pixel, encode with one block",
            )


def assembled(parents: Sequence[Genome], owner: np.ndarray) -> Genome:
    """A child whose lifs i is that of ``parents[owner[i]]``; owner is ``(n,)``."""
    cities, pointers, attribution = merged_cities(parents)
    each = np.arange(owner.size)
    columns = {
        name: np.stack([getattr(parent, name) for parent in parents])[owner, each]
        for name in FIELDS
        if name != "parent"
    }
    return parents[0].replace(
        **columns,
        parent=np.stack(pointers)[owner, each],
        cities=cities,
        attribution=attribution,
        sigma_max=max(parent.sigma_max for parent in parents),
    )


@dataclass(frozen=True, eq=False)
class Draft:
    """A child as an operator drafts it, before collage repair.

    genome : the lifs, crossed.
    intended : float32 ``(H, W)``, metres: the map the operator means to lay.
    made : how it came about, for the genome's ``made``; the operator's name is added.
    """

    genome: Genome
    intended: np.ndarray
    made: Mapping


class Drafting:
    """An operator that drafts its child, which is then repaired if wanted.

    A subclass is a frozen dataclass with ``name``, ``parents``, the parameters ``repair``,
    ``reach`` and ``domains`` (and its own), and a method ``_draft(parents, rng) -> Draft``.
    """

    def __call__(self, parents: Sequence[Genome], rng: np.random.Generator) -> Genome:
        """A child of ``parents``; its ``made`` tells how it came about.

        Raises `OperatorError` if the parents do not suit the operator or one another.
        """
        draft = self.draft(parents, rng)
        child, made = draft.genome, {"operator": self.name, **draft.made}
        if self.repair is not None:
            child, made["repaired"] = collage_repair(
                child,
                draft.intended,
                threshold=self.repair,
                reach=self.reach,
                domains=self.domains,
            )
        return child.replace(made=made)

    def draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        """The child before repair, and the map it is meant to be; as the call draws it.

        What the parents condense stands in both; where several cover, what the first does.
        """
        check_call(self, parents, rng)
        kept = merged(parent.condensation for parent in parents)
        if kept is None:
            return self._draft(parents, rng)
        # laid in all parents first, so that outlines and buildings are those that will stand
        draft = self._draft([parent.replace(condensation=kept) for parent in parents], rng)
        child = draft.genome.replace(condensation=kept)
        return replace(draft, genome=child, intended=kept.laid(draft.intended))
