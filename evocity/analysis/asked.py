"""What is asked for: which births, and how many."""

from collections.abc import Iterable
from numbers import Integral

import numpy as np

from evocity.analysis.births import Told
from evocity.analysis.condition import Condition
from evocity.errors import EvocityError, RunError, shown


def ids_of(which: object, told: Told) -> np.ndarray:
    """Int64: the ids that are asked for by ``which``: an id, an individual or what `Run.keep` tells
    of one, many of them, or a frame of births. Raises `RunError` for one that is none of the
    run's."""
    which = getattr(which, "individual", which)
    if isinstance(which, Integral) or hasattr(which, "birth"):
        which = [which]
    index = getattr(which, "index", None)
    listed = which if index is None or callable(index) else index  # of a pandas frame
    if not isinstance(listed, Iterable) or isinstance(listed, str):
        raise RunError(
            f"{told.run.path}: births {shown(which)}",
            "ids, individuals, or a frame of births",
            "give for example run.archive.ids",
        )
    listed = [getattr(one, "individual", one) for one in listed]
    here = told.run.path.resolve()
    for one in listed:
        if hasattr(one, "birth") and one.run.path.resolve() != here:
            raise RunError(
                f"{told.run.path}: {one}", "an individual of this run", "ask its own run for it"
            )
    return told.ids[told.rows([getattr(one, "id", one) for one in listed])]


def ids_of_any(which: object, told: Told) -> np.ndarray:
    """As `ids_of`, and of a condition, as `evocity.analysis.Run.where` has it, those that meet
    it."""
    if isinstance(which, str):
        return told.ids[kept_by(which, told)]
    return ids_of(which, told)


def kept_by(condition: str, told: Told) -> np.ndarray:
    """Bool ``(n,)``: which births meet a ``condition``."""
    return Condition.read(condition, told.columns).kept(told.column, len(told))


def check_count(name: str, count: object, most: int | None = None) -> None:
    """Raise `EvocityError` unless ``count`` is a whole number, 1 or more, and at most ``most``,
    which is how many births ``of=`` names."""
    whole = isinstance(count, Integral) and not isinstance(count, bool)
    if not whole or count < 1:
        raise EvocityError(
            f"{name} = {shown(count)}", "a whole number, 1 or more", "give for example 5"
        )
    if most is not None and count > most:
        raise EvocityError(
            f"{name} = {count} of {most} births",
            f"a whole number from 1 to {most}" if most else "births to choose from",
            "choose a smaller one, or name other births with of=" if most else "name births: of=",
        )


__all__ = ["check_count", "ids_of", "ids_of_any", "kept_by"]
