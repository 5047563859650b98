"""Maps of a genome's nucleotides and usage, and of the difference of two cities."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch

from evocity.analysis import Individual
from evocity.analysis.distributions import QUANTITIES, Distribution, distributions
from evocity.analysis.page.shortlist import city_labels
from evocity.citymap import CityMap
from evocity.coding import decode
from evocity.coding.ancestry import ancestry
from evocity.coding.usage import usage as usage_of
from evocity.errors import check_word
from evocity.genome import VOID, Genome
from evocity.pictures import Change, Shares, city_colours, render, render_shares
from evocity.pictures.colours import change_colours, field_colours, gradient, scale_end
from evocity.plot import style
from evocity.plot.births import city_of, genome_of
from evocity.plot.style import Panels

#: Values that `lifs` draws: σ, λ (the share of a lifs from its own city), the side of range blocks,
#: the number of lifs that call the same domain block, the city of the stone.
KINDS = ("sigma", "lambda", "side", "usage", "provenance")
_TITLES = {
    "sigma": ("σ of each lifs", "σ"),
    "lambda": ("λ, the share of a lifs from its own city", "λ"),
    "side": ("side of range blocks", "side, m"),
    "usage": ("lifs that call the same domain block", "lifs"),
}
_COUNTS = {
    "pixels": "lifs that call each pixel",
    "domains": "calls of the most called domain block",
    "ranges": "calls of what each range block is made of",
}


def lifs(genome: Genome | Individual, what: str = "sigma", ax: Axes | None = None) -> Axes:
    """Draw a map of a parameter of a genome's lifs. The colour of each range block shows the value
    of its lifs.

    genome : a `Genome`, or an individual of a run.
    what : name of the parameter to draw. The parameter "sigma" is drawn in blue below 0 and in red
        above 0. The parameter "lambda" is the share λ of a lifs that comes from its main source
        city. The parameter "side" is the width of the range block in metres. The parameter "usage"
        is the number of lifs that read the same domain block. With the name "provenance", the
        picture shows which source city each place of the map comes from.

    Raises `EvocityError` for an unknown parameter.
    """
    genome = genome_of(genome)
    check_word("what", what, KINDS)
    pavement, pixel = genome.pavement, genome.metres_per_pixel
    ax = style.panel(ax, 6.2, 5.6)
    name = " × ".join(city for city in genome.cities if city != VOID)
    if what == "provenance":
        _provenance(ax, genome, name)
    else:
        title, symbol = _TITLES[what]
        if what == "sigma":
            end = genome.sigma_max if np.isfinite(genome.sigma_max) else _end(abs(genome.sigma))
            scale = gradient((style.FIRST, "#f1eee7", style.LIVING))
            shares = (pavement.raster(genome.sigma) / end + 1) / 2
            style.map_on(ax, scale(np.clip(shares, 0, 1)), pixel, _titled(name, title))
            style.colour_scale(ax, scale(np.linspace(0, 1, 256)), -end, end, symbol)
        else:
            values = {
                "lambda": lambda: genome.part,
                "side": lambda: pavement.side * pixel,
                "usage": lambda: usage_of(genome).calls,
            }[what]()
            end = 1.0 if what == "lambda" else _end(values)
            raster = pavement.raster(values.astype(np.float32))
            style.map_on(ax, field_colours(raster, end), pixel, _titled(name, title))
            style.colour_scale(
                ax, field_colours(np.linspace(0, end, 256)[None], end)[0], 0, end, symbol
            )
    style.credit(ax, genome.attribution)
    return style.fit(ax)


def _end(values: np.ndarray) -> float:
    return float(np.max(values, initial=0)) or 1.0


def _titled(name: str, title: str) -> str:
    return f"{style.short(name, 60)}\n{title}"


def _provenance(ax: Axes, genome: Genome, name: str) -> None:
    city = decode(genome).city
    picture = render_shares(Shares(city, ancestry(genome), genome.cities, ""), legend=False)
    style.map_on(
        ax, np.asarray(picture), genome.metres_per_pixel, _titled(name, "cities of the stones")
    )
    style.key(ax, city_patches(genome.cities, genome.shares))


def city_patches(cities, shares=None) -> list[Patch]:
    """Return the entries of a legend for the ``cities``: colour, and share if given."""
    shares = [None] * len(cities) if shares is None else shares
    parts = zip(city_labels(cities), city_colours(cities), shares, strict=True)
    return [
        Patch(facecolor=colour, edgecolor=style.FAINTS, linewidth=0.4,
              label=style.short(city) + ("" if share is None else f", {100 * share:.0f} %"))
        for city, colour, share in parts
        if share is None or share > 0
    ]  # fmt: skip


def usage(genome: Genome | Individual, count: str = "pixels", ax: Axes | None = None) -> Axes:
    """Draw a map of μ, the number of lifs that copy from each part of the map.

    genome : a `Genome`, or an individual of a run.
    count : parts for which μ counts the lifs: "pixels", "domains" or "ranges", see
        `evocity.coding.usage.Usage`.

    Raises `EvocityError` for an unknown value of the argument ``count``.
    """
    genome = genome_of(genome)
    check_word("count", count, _COUNTS, "leave it out for pixels")
    values = getattr(usage_of(genome), count).astype(np.float32)
    # a few pixels are called so often that all others would be pale
    end = float(np.quantile(values, 0.995)) or _end(values)
    ax = style.panel(ax, 6.2, 5.6)
    name = " × ".join(city for city in genome.cities if city != VOID)
    style.map_on(
        ax, field_colours(values, end), genome.metres_per_pixel, _titled(name, _COUNTS[count])
    )
    most = f"\n(up to {values.max():.0f})" if values.max() > end else ""
    style.colour_scale(
        ax, field_colours(np.linspace(0, end, 256)[None], end)[0], 0, end, f"μ, lifs{most}"
    )
    style.credit(ax, genome.attribution)
    return style.fit(ax)


def difference(a: Individual | CityMap, b: Individual | CityMap, ax: object = None) -> Panels:
    """Draw two cities with one scale of heights, and a third panel with their difference in metres.
    In the third panel, red means that the second city is higher than the first, and blue means that
    the second city is lower.

    a, b : first and second city, as individuals of a run or as maps. Both cities need the same
        number of pixels and the same pixel size.

    Raises `EvocityError` if the two maps differ in the number or the size of their pixels.
    """
    first, second = city_of(a), city_of(b)
    change = Change(first, second)
    axes = style.panels(3, ax, columns=3, width=10.0, height=3.9)
    highest = scale_end(first, second)
    pixel = first.metres_per_pixel
    for one, city in zip(axes[:2], (first, second), strict=True):
        picture = render(city, highest=highest, legend=False)
        style.map_on(one, np.asarray(picture), pixel, style.short(city.name, 44))
    style.height_scale(axes[1], highest)
    style.map_on(axes[2], change_colours(change.metres, change.end), pixel,
           f"second minus first: {100 * change.apart:.0f} % by over a storey")  # fmt: skip
    scale = change_colours(np.linspace(-change.end, change.end, 256), change.end)
    style.colour_scale(axes[2], scale, -change.end, change.end, "m")
    style.credit(axes[0], change.attribution)
    style.fit(axes[0])
    return axes


_DASHES = ["--", "-.", (0, (1, 1.2)), (0, (6, 1.5, 1, 1.5, 1, 1.5))]


def buildings(
    individual: Individual, of: str = "area", parents: bool = True, ax: Axes | None = None
) -> Axes:
    """Draw cumulative distributions: the share of buildings up to each size. The continuous line
    shows the individual, and the dashed lines show its parents. Dotted grey lines show the
    reference cities. Each source city has a line in its own colour. The legend shows the number of
    buildings and the median size of each map.

    individual : the individual of a run to draw, for example ``run[97]``.
    of : kind of size to draw: "area", "height", "perimeter" or "volume".
    parents : whether to draw lines for the parents of the individual.

    Raises `EvocityError` for an unknown kind of size, and for an object that is not an individual.
    Raises `RunError` if the individual has no map.
    """
    listed = distributions(individual, of, parents)
    what, unit, powers = QUANTITIES[of]
    ax = style.panel(ax, 8.0, 4.2)
    bred = [one for one in listed if one.role == "parent"]
    for one in reversed(listed):
        line = {
            "source": {"color": one.colour, "linewidth": 1.3},
            "reference": {"color": style.FAINTS, "linestyle": ":", "linewidth": 1},
            "individual": {"color": style.LIVING, "linewidth": 2.0, "zorder": 4},
        }.get(one.role)
        if line is None:
            dashes = _DASHES[bred.index(one) % len(_DASHES)]
            line = {"color": style.FAINTS, "linestyle": dashes, "linewidth": 1.2}
        _steps(ax, one, unit, line)
    if not any(len(line.get_xdata()) for line in ax.lines):
        style.note(ax, "there are no buildings")
    elif powers:
        ax.set_xscale("log")
    ax.set_ylim(0, 1.02)
    label = style.fold(f"{what} of a building, {unit}", 60)
    style.name_axes(ax, label, "share of buildings up to this size")
    ax.yaxis.set_major_formatter(lambda value, _: f"{100 * value:.0f} %")
    style.key(ax, ax.lines)
    return ax


def _steps(ax: Axes, one: Distribution, unit: str, line: dict) -> None:
    values = one.values
    shares = np.arange(1, len(values) + 1) / max(1, len(values))
    median = f", median {np.median(values):.3g} {unit}" if len(values) else ""
    label = f"{style.short(one.name)}\n{len(values)} buildings{median}"
    ax.plot(values, shares, drawstyle="steps-post", label=label, **line)
