"""The districts that come with evocity, with their attribution and buildings."""

from pathlib import Path
from typing import NamedTuple

from evocity.errors import MapError, near_miss

_FOLDER = Path(__file__).parent.parent / "data" / "cities"

_OSM = "© OpenStreetMap contributors"


class District(NamedTuple):
    """Facts about a bundled district: the line that its licence asks for, the buildings in its
    window, and how many of these have no height in the source."""

    attribution: str
    buildings: int
    without_height: int


#: The districts by name, in order.
DISTRICTS = {
    "cape-town-salt-river": District(f"{_OSM}; geo3D, © 2025 Adrian Kriger", 699, 0),
    "lyon-1er": District("Source: IGN – BD TOPO®, édition 2021", 771, 0),
    "montpellier-pas-du-loup": District("Source: IGN – BD TOPO®, édition décembre 2021", 312, 18),
    "new-york-west-village": District(_OSM, 670, 5),
    "villeurbanne-gratte-ciel": District(_OSM, 367, 367),
}


def cities() -> list[str]:
    """List the names of the bundled districts, sorted. The function `evocity.read_map` accepts the
    names of bundled districts."""
    return sorted(DISTRICTS)


def attribution_of(name: str) -> str:
    """Return the attribution that the licence of a bundled district demands.

    Raises
    ------
    MapError : no district has the given name; the message lists the existing names.
    """
    _check(name)
    return DISTRICTS[name].attribution


def path_of(name: str) -> Path:
    """Return the GeoJSON file of a bundled district; raises `MapError` as `attribution_of`."""
    _check(name)
    return _FOLDER / f"{name}.geojson"


def _check(name: str) -> None:
    if name in DISTRICTS:
        return
    raise MapError(
        f"no file and no bundled city is called {name!r}",
        f"a file, or one of {', '.join(cities())}",
        near_miss(name, cities()) or "check the name, or give the path of a file",
    )
