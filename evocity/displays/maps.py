"""A map in a notebook: its picture with scale and attribution, and what it is."""

from pathlib import Path

from evocity.citymap import CityMap
from evocity.displays.pictures import LARGEST, fitted
from evocity.fitness import fsi, gsi
from evocity.pages import number, templates_of
from evocity.pictures import render

TEMPLATES = Path(__file__).parent / "templates"

# Pixels along a map up to which its picture is worth a second pixel a pixel.
_SMALL = LARGEST // 2


def map_html(city: CityMap) -> str:
    """A `CityMap` as HTML."""
    uri, width = fitted(render(city, zoom=max(1, _SMALL // max(city.shape))))
    return (
        templates_of(TEMPLATES)
        .get_template("map.html")
        .render(
            uri=uri,
            width=width,
            title=city.name,
            alt=alt_of(city),
            told=told_of(city),
            credit=city.attribution,
        )
    )


def alt_of(city: CityMap) -> str:
    return f"map of heights of {city.name}, north up, {extent_of(city)}"


def extent_of(city: CityMap) -> str:
    height, width = (side * city.metres_per_pixel for side in city.shape)
    return f"{width:.4g} × {height:.4g} m"


def told_of(city: CityMap) -> list[tuple[str, str]]:
    """(what, its value) of a map, for people."""
    height, width = city.shape
    told = [
        ("size", f"{height} × {width} px of {city.metres_per_pixel:g} m, {extent_of(city)}"),
        ("buildings", f"{len(city.buildings)}"),
        ("GSI", number(gsi(city))),
        ("FSI", number(fsi(city))),
        ("highest", number(float(city.heights.max(initial=0)), "m")),
    ]
    return [*told, ("lies in", city.crs)] if len(city.crs or "") in range(1, 40) else told


__all__ = ["TEMPLATES", "alt_of", "extent_of", "map_html", "told_of"]
