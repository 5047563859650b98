"""A genome in a notebook: its decoded map, its code, the shares of its cities."""

from evocity.coding import decode
from evocity.genome import VOID, Genome
from evocity.notebook.maps import alt_of, map_picture, page

# Pixels of a map that is decoded for a display, at most; a larger one shows only its code.
_MOST_PIXELS = 1 << 22


def genome_html(genome: Genome) -> str:
    """Return a `Genome` as HTML."""
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
        ("lifs", f"{len(genome)}, {float(genome.uniform.mean()):.0%} of them uniform"),
        ("range blocks", f"{sides} px"),
        ("map", f"{p.height} × {p.width} px of {genome.metres_per_pixel:g} m"),
        ("roofs", "settled" if genome.settle else "as decoded"),
    ]
    if genome.condensation is not None:
        facts.append(("locked", f"{genome.condensation.mask.mean():.0%} of the pixels"))
    if "operator" in genome.made:
        facts.append(("made by", str(genome.made["operator"])))
    return [*facts, ("digest", genome.digest[:12])]


def stone_of(genome: Genome) -> list[tuple[str, str]]:
    """Return source city -> share of the map that is its stone, for people; without traces."""
    pairs = zip(genome.cities, genome.shares, strict=True)
    named = [("bare ground" if name == VOID else name, share) for name, share in pairs]
    return [(name, f"{share:.0%}") for name, share in named if share >= 0.005]
