"""Arguments that choose births: ids, individuals, frames, conditions, counts."""

from collections.abc import Iterable
from numbers import Integral

import numpy as np

from evocity.analysis.births import Births
from evocity.analysis.condition import Condition
from evocity.errors import EvocityError, RunError, check_number, spell


def ids_of(which: object, births: Births) -> np.ndarray:
    """Return the ids, int64, that ``which`` names: ids, individuals, entries of `Run.keep`, a
    frame."""
    which = getattr(which, "individual", which)
    if isinstance(which, Integral) or hasattr(which, "birth"):
        which = [which]
    index = getattr(which, "index", None)
    listed = which if index is None or callable(index) else index  # of a pandas frame
    if not isinstance(listed, Iterable) or isinstance(listed, str):
        raise RunError(
            f"{births.run.path}: the argument {spell(which)} does not name births",
            "ids, individuals, or a data frame of births",
            "give the births, for example as run.archive.ids",
        )
    listed = [getattr(one, "individual", one) for one in listed]
    here = births.run.path.resolve()
    for one in listed:
        if hasattr(one, "birth") and one.run.path.resolve() != here:
            raise RunError(
                f"{births.run.path}: {one} belongs to another run",
                "an individual of this run",
                "call the method of the run that the individual belongs to",
            )
    return births.ids[births.rows([getattr(one, "id", one) for one in listed])]


def ids_of_any(which: object, births: Births) -> np.ndarray:
    """Return the ids that ``which`` names, as `ids_of` or by a condition, see `Run.where`."""
    if isinstance(which, str):
        return births.ids[mask_of(which, births)]
    return ids_of(which, births)


def mask_of(condition: str, births: Births) -> np.ndarray:
    """Return which births meet a ``condition``, bool ``(n,)``."""
    return Condition.read(condition, births.columns).kept(births.column, len(births))


def check_count(name: str, count: object, most: int | None = None) -> None:
    """Raise `EvocityError` unless ``count`` is a whole number from 1 to ``most``, if given."""
    example, expected = f"give for example {name} = 5", "a whole number, 1 or more"
    check_number(name, count, 1, np.inf, expected, remedy=example, whole=True)
    if most is not None and count > most:
        raise EvocityError(
            f"{name} = {count} of {most} births",
            f"a whole number from 1 to {most}" if most else "births to choose from",
            "choose a smaller one, or name other births with of=" if most else "name births: of=",
        )
