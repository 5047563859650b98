"""One colour a source city, in every picture, plot and page."""

from collections.abc import Sequence

# Any two of them differ by .09 in OKLab at least, to those too who see two colours of three
# (Machado, Oliveira & Fernandes 2009); the first two, most runs' parents, by .3.
_CITIES = (
    "#33699e",
    "#e2a33a",
    "#5fa98f",
    "#8a3a66",
    "#a5cbe8",
    "#c2603a",
    "#443e09",
    "#293898",
)
#: Bare ground, laid where buildings were left out, is no city.
BARE = "#d9d2c6"
_VOID = "void"  # evocity.genome.VOID: genomes lie above pictures
#: What a key calls it.
VOID_TOLD = f"{_VOID} (bare ground)"


def city_colours(cities: Sequence[str]) -> list[str]:
    """The colour of each of a run's, or a genome's, ``cities`` in their order, ``#rrggbb``; of more
    cities than there are colours the others begin again."""
    found, place = [], 0
    for city in cities:
        bare = city in (_VOID, VOID_TOLD)
        found.append(BARE if bare else _CITIES[place % len(_CITIES)])
        place += not bare
    return found


__all__ = ["BARE", "VOID_TOLD", "city_colours"]
