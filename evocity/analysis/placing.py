"""Where on Earth a bred city is laid: on the ground of one of its run's source cities."""

from evocity.errors import RunError, shown
from evocity.store import Run


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


__all__ = ["place_of"]
