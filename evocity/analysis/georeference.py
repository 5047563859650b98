"""Places on Earth: a bred city on the ground of one of its run's source cities."""

import shlex
from collections.abc import Mapping, Sequence

from evocity.errors import RunError, spell
from evocity.store import RunLog, Source


def place_of(run: RunLog, name: str) -> dict[str, object]:
    """Return ``origin`` and ``crs`` of the source city ``name`` of a ``run``, for the ``replace``
    of a map or a genome. Raises `RunError` for another name, and for a source without a place on
    Earth."""
    cities = {source.name: source.city for source in run.sources()}
    placed = [one for one, city in cities.items() if city.crs is not None]
    if name not in placed:
        fault = "lies nowhere on Earth" if name in cities else "is not a source city"
        raise RunError(
            f"{run.path}: at = {spell(name)}, which {fault}",
            f"one of {', '.join(placed)}" if placed else "a source city that lies on Earth",
            "choose one of these" if placed else "leave it out: .gpkg takes local metres",
        )
    return {"origin": cities[name].origin, "crs": cities[name].crs}


def ground_of(shares: Mapping[str, float], sources: Sequence[Source]) -> str | None:
    """Return the source city on whose ground a birth is laid best: of the ``sources`` on Earth the
    one with the largest of its ``shares`` (city -> 0…1). None where it has no stone of any."""
    placed = [one.name for one in sources if one.city.crs is not None and shares.get(one.name)]
    return max(placed, key=lambda name: shares[name], default=None)


def command_for_gis(run: str, identifier: int, ground: str | None) -> str:
    """Return the shell command that writes an individual as footprints, from the run in the folder
    ``run``, on the ``ground`` of a source city if one is named."""
    at = "" if ground is None else f" --at {shlex.quote(ground)}"
    return f"evocity decode {shlex.quote(run)} --id {identifier}{at} -o {identifier}.gpkg"


def command_for_blender(run: str, identifier: int) -> str:
    """Return the shell command that writes an individual of the run in a folder as a scene."""
    return f"evocity scene {shlex.quote(run)} --id {identifier} -o {identifier}.glb"
