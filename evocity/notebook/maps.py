"""A map in a notebook: its picture with scale and attribution, and its numbers."""

from pathlib import Path

from PIL import Image

from evocity.analysis.page.shortlist import city_labels
from evocity.citymap import CityMap
from evocity.coding import decode
from evocity.fitness import fsi, gsi
from evocity.genome import Genome
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
    """Shrink a picture to at most ``most`` characters; return its address and the width in px."""
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
    uri, width = map_picture(city)
    alt, facts, credit = alt_of(city), facts_of(city), city.attribution
    return page("map.html", uri=uri, width=width, alt=alt, facts=facts, credit=credit)


def alt_of(city: CityMap) -> str:
    return f"map of heights of {city.name}, north up, {extent_of(city)}"


def extent_of(city: CityMap) -> str:
    height, width = (side * city.metres_per_pixel for side in city.shape)
    return f"{width:.4g} × {height:.4g} m"


def facts_of(city: CityMap) -> list[tuple[str, str]]:
    height, width = city.shape
    facts = [
        ("size", f"{height} × {width} px of {city.metres_per_pixel:g} m, {extent_of(city)}"),
        ("buildings", f"{len(city.buildings)}"),
        ("GSI", number(gsi(city))),
        ("FSI", number(fsi(city))),
        ("highest", number(float(city.heights.max(initial=0)), "m")),
    ]
    return [*facts, ("lies in", city.crs)] if len(city.crs or "") in range(1, 40) else facts


# Pixels of a map that is decoded for a display, at most; a larger one shows only its code.
_MOST_PIXELS = 1 << 22


def genome_html(genome: Genome) -> str:
    pavement, city = genome.pavement, None
    if pavement.height * pavement.width <= _MOST_PIXELS:
        city = decode(genome).city
    uri, width = map_picture(city) if city else ("", 0)
    return page(
        "genome.html",
        uri=uri,
        width=width,
        title=" × ".join(genome.cities),
        alt=f"decoded {alt_of(city)}" if city else "",
        facts=_facts(genome),
        shares=stone_of(genome),
        credit=genome.attribution,
    )


def _facts(genome: Genome) -> list[tuple[str, str]]:
    p = genome.pavement
    sides = f"{p.finest} to {p.coarsest}" if p.finest != p.coarsest else f"{p.finest}"
    facts = [
        ("lifs", f"{len(genome)}, {100 * float(genome.uniform.mean()):.0f} % of them uniform"),
        ("range blocks", f"{sides} px"),
        ("map", f"{p.height} × {p.width} px of {genome.metres_per_pixel:g} m"),
        ("roofs", "settled" if genome.settle else "as decoded"),
    ]
    if genome.condensation is not None:
        facts.append(("locked", f"{100 * genome.condensation.mask.mean():.0f} % of the pixels"))
    if "operator" in genome.made:
        facts.append(("made by", str(genome.made["operator"])))
    return [*facts, ("digest", genome.digest[:12])]


def stone_of(genome: Genome) -> list[tuple[str, str]]:
    """Return source city -> share of the map that is its stone, for people; without traces."""
    pairs = zip(city_labels(genome.cities), genome.shares, strict=True)
    return [(name, f"{100 * share:.0f} %") for name, share in pairs if share >= 0.005]
