"""The districts that come with evocity, and whom to thank for them."""

from pathlib import Path

from evocity.errors import MapError, near_miss

_FOLDER = Path(__file__).parent.parent / "data" / "cities"

_OSM = "© OpenStreetMap contributors"

_ATTRIBUTIONS = {
    "cape-town-salt-river": f"{_OSM}; geo3D, © 2025 Adrian Kriger",
    "lyon-1er": "Source: IGN – BD TOPO®, édition 2021",
    "montpellier-pas-du-loup": "Source: IGN – BD TOPO®, édition décembre 2021",
    "new-york-west-village": _OSM,
    "villeurbanne-gratte-ciel": _OSM,
}


def cities() -> list[str]:
    """Names of the bundled districts, sorted; `evocity.read_map` takes them for a file."""
    return sorted(_ATTRIBUTIONS)


def attribution_of(name: str) -> str:
    """The line the licence of a bundled district asks for.

    Raises
    ------
    MapError : no district has this name; those that exist are listed.
    """
    _check(name)
    return _ATTRIBUTIONS[name]


def path_of(name: str) -> Path:
    """The GeoJSON file of a bundled district; `MapError` as in `attribution_of`."""
    _check(name)
    return _FOLDER / f"{name}.geojson"


def _check(name: str) -> None:
    if name in _ATTRIBUTIONS:
        return
    raise MapError(
        f"no file and no bundled city is called {name!r}",
        f"a file, or one of {', '.join(cities())}",
        near_miss(name, cities()) or "check the name, or give the path of a file",
    )


__all__ = ["attribution_of", "cities", "path_of"]
