"""A map in a notebook: its picture with scale and attribution, and its numbers."""

from pathlib import Path

from PIL import Image

from evocity.citymap import CityMap
from evocity.fitness import fsi, gsi
from evocity.pictures import render
from evocity.templates import data_uri, number, templates_of

TEMPLATES = Path(__file__).parent / "templates"
#: Longest side of a picture, px, and most characters of its address.
LARGEST = 560
_MOST = 110_000


def page(template: str, **values: object) -> str:
    """Fill a ``template`` with ``values``, all of them escaped."""
    return templates_of(TEMPLATES).get_template(template).render(values)


def fit_picture(picture: Image.Image, largest: int = LARGEST, most: int = _MOST) -> tuple[str, int]:
    """Shrink a picture until its ``data:`` address has at most ``most`` characters; return the
    address and the width in px."""
    while True:
        small = picture.copy()
        small.thumbnail((largest, largest), Image.Resampling.BOX)
        uri = data_uri(small)
        if len(uri) <= most or largest < 32:
            return uri, small.width
        largest = largest * 3 // 4


def map_picture(city: CityMap) -> tuple[str, int]:
    """Draw a map with its legend, enlarged if small; return the address and the width in px."""
    return fit_picture(render(city, zoom=max(1, LARGEST // 2 // max(city.shape))))


def map_html(city: CityMap) -> str:
    """Return a `CityMap` as HTML."""
    uri, width = map_picture(city)
    alt, facts, credit = alt_of(city), facts_of(city), city.attribution
    return page("map.html", uri=uri, width=width, alt=alt, facts=facts, credit=credit)


def alt_of(city: CityMap) -> str:
    """Return the alternative text of a map's picture."""
    return f"map of heights of {city.name}, north up, {extent_of(city)}"


def extent_of(city: CityMap) -> str:
    """Return width and height of a map in metres."""
    height, width = (side * city.metres_per_pixel for side in city.shape)
    return f"{width:.4g} × {height:.4g} m"


def facts_of(city: CityMap) -> list[tuple[str, str]]:
    """Return names and values of a map's numbers."""
    height, width = city.shape
    facts = [
        ("size", f"{height} × {width} px of {city.metres_per_pixel:g} m, {extent_of(city)}"),
        ("buildings", f"{len(city.buildings)}"),
        ("GSI", number(gsi(city))),
        ("FSI", number(fsi(city))),
        ("highest", number(float(city.heights.max(initial=0)), "m")),
    ]
    return [*facts, ("lies in", city.crs)] if len(city.crs or "") in range(1, 40) else facts
