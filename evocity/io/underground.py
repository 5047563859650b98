"""Tags of buildings that have nothing above ground."""

import math
from collections.abc import Mapping

from evocity.io.heights import height_of


def is_underground(tags: Mapping[str, object]) -> bool:
    """Tell whether a building has nothing above ground: it is underground by ``location`` or
    ``is_underground``, it is a tunnel of a ``layer`` below 0, or all its storeys are underground.
    """
    if tags.get("location") == "underground" or _is_yes(tags.get("is_underground")):
        return True
    if _is_yes(tags.get("tunnel")) and _number(tags.get("layer")) < 0:
        return True
    deep = _number(tags.get("building:levels:underground")) > 0
    storeys = _number(tags.get("building:levels"))
    return deep and storeys == 0 and height_of(tags, 0.0)[1] == "default"


def _is_yes(value: object) -> bool:
    if isinstance(value, str):
        return value.strip().lower() not in ("", "no", "false", "0")
    return value is not None and value == value and bool(value)


def _number(value: object) -> float:
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        return math.nan
