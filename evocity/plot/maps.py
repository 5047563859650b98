"""Maps: what each lifs of a genome holds, how often what is called, two cities and their
difference."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch

from evocity.analysis import Individual
from evocity.citymap import CityMap
from evocity.coding import decode
from evocity.coding.ancestry import ancestry
from evocity.coding.usage import usage as usage_of
from evocity.errors import check_word
from evocity.genome import VOID, Genome
from evocity.pictures import Change, Shares, city_colours, render, render_shares
from evocity.pictures.colours import change_colours, even, gradient, scale_end
from evocity.plot.chosen import city_of, genome_of
from evocity.plot.style import (
    FAINTS,
    FIRST,
    LIVING,
    Panels,
    colour_scale,
    credit,
    fit,
    height_scale,
    key,
    map_on,
    panel,
    panels,
    short,
)

#: What `lifs` draws: σ, λ (the share of a lifs that is its own city's), the side of range blocks,
#: how many lifs call the same domain block, whose stone it is.
KINDS = ("sigma", "lambda", "side", "usage", "provenance")
_TITLES = {
    "sigma": ("σ of each lifs", "σ"),
    "lambda": ("λ, the share of a lifs that is its own city's", "λ"),
    "side": ("side of range blocks", "side, m"),
    "usage": ("lifs that call the same domain block", "lifs"),
}
_COUNTS = {
    "pixels": "lifs that call each pixel",
    "domains": "calls of the most called domain block",
    "ranges": "calls of what each range block is made of",
}


def lifs(genome: Genome | Individual, what: str = "sigma", ax: Axes | None = None) -> Axes:
    """A map of what each lifs of a genome holds, in its range block.

    genome : a `Genome`, or an individual of a run.
    what : "sigma" (blue below 0, red above), "lambda", "side" (metres), "usage" (how many lifs call
        its domain block) or "provenance" (which city its stone is of, and what that was made of).

    Raises `EvocityError` for another ``what``.
    """
    genome = genome_of(genome)
    check_word("what", what, KINDS)
    pavement, pixel = genome.pavement, genome.metres_per_pixel
    ax = panel(ax, 6.2, 5.6)
    name = " × ".join(city for city in genome.cities if city != VOID)
    if what == "provenance":
        _provenance(ax, genome, name)
    else:
        title, symbol = _TITLES[what]
        if what == "sigma":
            end = genome.sigma_max if np.isfinite(genome.sigma_max) else _end(abs(genome.sigma))
            scale = gradient((FIRST, "#f1eee7", LIVING))
            shares = (pavement.raster(genome.sigma) / end + 1) / 2
            map_on(ax, scale(np.clip(shares, 0, 1)), pixel, _titled(name, title))
            colour_scale(ax, scale(np.linspace(0, 1, 256)), -end, end, symbol)
        else:
            values = {
                "lambda": lambda: genome.part,
                "side": lambda: pavement.side * pixel,
                "usage": lambda: usage_of(genome).calls,
            }[what]()
            end = 1.0 if what == "lambda" else _end(values)
            raster = pavement.raster(values.astype(np.float32))
            map_on(ax, even(raster, end), pixel, _titled(name, title))
            colour_scale(ax, even(np.linspace(0, end, 256)[None], end)[0], 0, end, symbol)
    credit(ax, genome.attribution)
    return fit(ax)


def _end(values: np.ndarray) -> float:
    return float(np.max(values, initial=0)) or 1.0


def _titled(name: str, title: str) -> str:
    return f"{short(name, 60)}\n{title}"


def _provenance(ax: Axes, genome: Genome, name: str) -> None:
    city = decode(genome).city
    picture = render_shares(Shares(city, ancestry(genome), genome.cities, ""), legend=False)
    map_on(ax, np.asarray(picture), genome.metres_per_pixel, _titled(name, "whose stones"))
    key(ax, city_patches(genome.cities, genome.shares))


def city_patches(cities, shares=None) -> list[Patch]:
    """What a legend tells of each of the ``cities``: its colour, and its share where one is."""
    told = zip(cities, city_colours(cities), [None] * len(cities) if shares is None else shares,
               strict=True)  # fmt: skip
    return [
        Patch(facecolor=colour, edgecolor=FAINTS, linewidth=0.4,
              label=("bare ground" if city == VOID else short(city))
              + ("" if share is None else f", {share:.0%}"))
        for city, colour, share in told
        if share is None or share > 0
    ]  # fmt: skip


def usage(genome: Genome | Individual, count: str = "pixels", ax: Axes | None = None) -> Axes:
    """A map of how often a genome calls its own parts, μ.

    genome : a `Genome`, or an individual of a run.
    count : as in `evocity.coding.usage.Usage`: "pixels", "domains" or "ranges".

    Raises `EvocityError` for another ``count``.
    """
    genome = genome_of(genome)
    check_word("count", count, _COUNTS, "leave it out for pixels")
    values = getattr(usage_of(genome), count).astype(np.float32)
    # a few pixels are called so often that the others would all be pale
    end = float(np.quantile(values, 0.995)) or _end(values)
    ax = panel(ax, 6.2, 5.6)
    name = " × ".join(city for city in genome.cities if city != VOID)
    map_on(ax, even(values, end), genome.metres_per_pixel, _titled(name, _COUNTS[count]))
    most = f"\n(up to {values.max():.0f})" if values.max() > end else ""
    colour_scale(ax, even(np.linspace(0, end, 256)[None], end)[0], 0, end, f"μ, lifs{most}")
    credit(ax, genome.attribution)
    return fit(ax)


def difference(a: Individual | CityMap, b: Individual | CityMap, ax: object = None) -> Panels:
    """Two cities on one scale of heights, and what the second has more (red) and less (blue) than
    the first, in metres: three panels.

    a, b : individuals of a run, or maps, with as many pixels of one size.

    Raises `EvocityError` for maps that do not lie on each other.
    """
    first, second = city_of(a), city_of(b)
    change = Change(first, second)
    axes = panels(3, ax, columns=3, width=10.0, height=3.9)
    highest = scale_end(first, second)
    pixel = first.metres_per_pixel
    for one, city in zip(axes[:2], (first, second), strict=True):
        picture = render(city, highest=highest, legend=False)
        map_on(one, np.asarray(picture), pixel, short(city.name, 44))
    height_scale(axes[1], highest)
    map_on(axes[2], change_colours(change.metres, change.end), pixel,
           f"second less first: {change.apart:.0%} by over a storey")  # fmt: skip
    scale = change_colours(np.linspace(-change.end, change.end, 256), change.end)
    colour_scale(axes[2], scale, -change.end, change.end, "m")
    credit(axes[0], change.attribution)
    fit(axes[0])
    return axes


__all__ = ["KINDS", "city_patches", "difference", "lifs", "usage"]
