"""Where on Earth a bred city is laid: on the ground of one of its run's source cities."""

from collections.abc import Mapping, Sequence

from evocity.errors import RunError, shown
from evocity.store import Run, Source


def place_of(run: Run, name: str) -> dict[str, object]:
    """``origin`` and ``crs`` of the source city of a ``run`` that is called ``name``, for the
    ``replace`` of a map or a genome. Raises `RunError` for another name, and for a source that
    lies nowhere on Earth."""
    cities = {source.name: source.city for source in run.sources()}
    placed = [one for one, city in cities.items() if city.crs is not None]
    if name not in placed:
        there = "lies nowhere on Earth" if name in cities else "is none of its source cities"
        raise RunError(
            f"{run.path}: to be laid at {shown(name)}, which {there}",
            f"one of {', '.join(placed)}" if placed else "a source city that lies on Earth",
            "name one of these" if placed else "leave it out: .gpkg takes local metres",
        )
    return {"origin": cities[name].origin, "crs": cities[name].crs}


def ground_of(run: Run, shares: Mapping[str, float], sources: Sequence[Source]) -> str | None:
    """The source city that most of a birth's stones are from, by its ``shares``, of those that lie
    on Earth: on its ground it is laid best. None where all ``sources`` of the ``run`` lie in one
    place, where it lies as it is, and where it has no stone of any that lies on Earth."""
    placed = [one.name for one in sources if one.city.crs is not None and shares.get(one.name)]
    if run.header.crs is not None or not placed:
        return None
    return max(placed, key=lambda name: shares[name])


__all__ = ["ground_of", "place_of"]
