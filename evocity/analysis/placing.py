"""Where on Earth a bred city is laid: on the ground of one of its run's source cities."""

import shlex
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


def ground_of(shares: Mapping[str, float], sources: Sequence[Source]) -> str | None:
    """The one of the ``sources`` that lie on Earth that most of a birth's stones are from, by its
    ``shares`` (city to 0…1): on its ground it is laid best. None where it has no stone of any."""
    placed = [one.name for one in sources if one.city.crs is not None and shares.get(one.name)]
    return max(placed, key=lambda name: shares[name], default=None)


def command_for_gis(run: str, identifier: int, ground: str | None) -> str:
    """What a shell takes to write one individual of the run in the folder ``run`` as footprints,
    laid on the ``ground`` of a source city if one is named."""
    at = "" if ground is None else f" --at {shlex.quote(ground)}"
    return f"evocity decode {shlex.quote(run)} --id {identifier}{at} -o {identifier}.gpkg"


def command_for_blender(run: str, identifier: int) -> str:
    """What a shell takes to write one individual of the run in the folder ``run`` as a scene."""
    return f"evocity scene {shlex.quote(run)} --id {identifier} -o {identifier}.glb"


__all__ = ["command_for_blender", "command_for_gis", "ground_of", "place_of"]
