"""What the operators share: parents on one grid, children put together, parameters checked."""

from collections.abc import Mapping, Sequence

import numpy as np

from evocity.errors import OperatorError
from evocity.genome import FIELDS, Genome, merged_cities
from evocity.operators.repair import collage_repair


def check_parents(name: str, parents: Sequence[Genome], fewest: int, most: int | None) -> None:
    """Raise `OperatorError` unless the number suits and all share pavement and pixel size."""
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
    first = parents[0]
    for other in parents[1:]:
        if other.pavement != first.pavement or other.metres_per_pixel != first.metres_per_pixel:
            p, q = first.pavement, other.pavement
            raise OperatorError(
                f"{name}: parents of {p.height} × {p.width} px, B = {p.block}, "
                f"{first.metres_per_pixel:g} m and {q.height} × {q.width} px, B = {q.block}, "
                f"{other.metres_per_pixel:g} m",
                "parents on one pavement",
                "read the maps with the same pixels and metres_per_pixel, encode with one block",
            )


def check_parameters(name: str, faults: Mapping[str, tuple[bool, object, str]]) -> None:
    """Raise one `OperatorError` naming every parameter whose condition is false.

    ``faults`` maps a parameter to (condition that must hold, its value, what is allowed).
    """
    wrong = {key: (value, allowed) for key, (holds, value, allowed) in faults.items() if not holds}
    if wrong:
        raise OperatorError(
            f"{name}: " + ", ".join(f"{key} = {value!r}" for key, (value, _) in wrong.items()),
            ", ".join(f"{key} {allowed}" for key, (_, allowed) in wrong.items()),
            "change these parameters",
        )


def repair_faults(repair, reach, domains) -> dict[str, tuple[bool, object, str]]:
    """Checks of the three repair parameters every operator has, for `check_parameters`."""
    return {
        "repair": (repair is None or repair > 0, repair, "above 0 m, or None for no repair"),
        "reach": (reach is None or reach >= 0, reach, "0 px or more, or None for the whole map"),
        "domains": (
            len(domains) > 0 and all(int(m) == m and m >= 2 for m in domains),
            tuple(domains),
            "whole multiples of B, 2 or more",
        ),
    }


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


def finished(
    child: Genome,
    intended: np.ndarray,
    made: Mapping,
    *,
    repair: float | None,
    reach: int | None,
    domains: Sequence[int],
) -> Genome:
    """``child`` after collage repair towards ``intended`` (if wanted), told how it was made."""
    made = dict(made)
    if repair is not None:
        child, made["repaired"] = collage_repair(
            child, intended, threshold=repair, reach=reach, domains=domains
        )
    return child.replace(made=made)
