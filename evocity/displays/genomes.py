"""A genome in a notebook: the map it decodes to, its code, whose stone it is."""

from evocity.coding import decode
from evocity.displays.maps import TEMPLATES, alt_of
from evocity.displays.pictures import LARGEST, fitted
from evocity.genome import VOID, Genome
from evocity.pages import templates_of
from evocity.pictures import render

# Pixels of a map that is decoded for a glance; of a larger one the code is told alone.
_MOST_PIXELS = 1 << 22


def genome_html(genome: Genome) -> str:
    """A `Genome` as HTML."""
    pavement, city = genome.pavement, None
    if pavement.height * pavement.width <= _MOST_PIXELS:
        city = decode(genome).city
    picture = city and render(city, zoom=max(1, LARGEST // 2 // max(city.shape)))
    uri, width = fitted(picture) if picture else ("", 0)
    return (
        templates_of(TEMPLATES)
        .get_template("genome.html")
        .render(
            uri=uri,
            width=width,
            title=" × ".join(genome.cities),
            alt=f"decoded {alt_of(city)}" if city else "",
            told=_told(genome),
            shares=stone_of(genome),
            credit=genome.attribution,
        )
    )


def _told(genome: Genome) -> list[tuple[str, str]]:
    p = genome.pavement
    sides = f"{p.finest} to {p.coarsest}" if p.finest != p.coarsest else f"{p.finest}"
    flat = float(genome.uniform.mean())
    told = [
        ("lifs", f"{len(genome)}, {flat:.0%} of them uniform"),
        ("range blocks", f"{sides} px"),
        ("map", f"{p.height} × {p.width} px of {genome.metres_per_pixel:g} m"),
        ("roofs", "settled" if genome.settle else "as decoded"),
    ]
    if genome.condensation is not None:
        told.append(("locked", f"{genome.condensation.mask.mean():.0%} of the pixels"))
    if "operator" in genome.made:
        told.append(("made by", str(genome.made["operator"])))
    return [*told, ("digest", genome.digest[:12])]


def stone_of(genome: Genome) -> list[tuple[str, str]]:
    """(source city, share of the map that is its stone), for people; without traces."""
    named = zip(genome.cities, genome.shares, strict=True)
    told = [("bare ground" if name == VOID else name, share) for name, share in named]
    return [(name, f"{share:.0%}") for name, share in told if share >= 0.005]


__all__ = ["genome_html", "stone_of"]
