"""How the buildings of an individual are distributed, beside those of its parents and cities."""

import numpy as np
from matplotlib.axes import Axes

from evocity.analysis import Individual
from evocity.citymap import CityMap
from evocity.errors import EvocityError, check_word, shown
from evocity.genome import VOID
from evocity.pictures import city_colours
from evocity.plot.chosen import city_of
from evocity.plot.style import FAINTS, LIVING, folded, key, name_axes, note, panel, short

#: What of buildings is drawn, its unit, and whether on a scale of powers.
QUANTITIES = {
    "area": ("footprint", "m²", True),
    "height": ("height", "m", False),
    "perimeter": ("perimeter", "m", True),
    "volume": ("volume", "m³", True),
}
_DASHES = ["--", "-.", (0, (1, 1.2)), (0, (6, 1.5, 1, 1.5, 1, 1.5))]


def buildings(
    individual: Individual, of: str = "area", parents: bool = True, ax: Axes | None = None
) -> Axes:
    """Which share of the buildings is at most so large: of an individual, of those it was bred from
    (dashed), of the run's source cities as read, each in its colour, and of the cities that its
    measures compare with (dotted grey); the legend tells how many there are and their median.

    individual : one of a run.
    of : "area", "height", "perimeter" or "volume".
    parents : whether those it was bred from are drawn.

    Raises `EvocityError` for another ``of``, and for what is no individual; `RunError` if it has no
    map.
    """
    if not isinstance(individual, Individual):
        raise EvocityError(shown(individual), "an individual of a run", "give run[97]")
    check_word("of", of, QUANTITIES, "leave it out for area")
    what, unit, powers = QUANTITIES[of]
    run = individual.run
    ax = panel(ax, 8.0, 4.2)
    cities = [source.city for source in run.sources()]
    colours = city_colours([c for c in run.header.cities if c != VOID] or [])
    lines = [(city, short(city.name), {"color": colour, "linewidth": 1.3})
             for city, colour in zip(cities, colours, strict=False)]  # fmt: skip
    for city in run.references():
        lines.append((city, short(city.name), {"color": FAINTS, "linestyle": ":", "linewidth": 1}))
    for number, one in enumerate(individual.parents if parents else ()):
        dashes = _DASHES[number % len(_DASHES)]
        style = {"color": FAINTS, "linestyle": dashes, "linewidth": 1.2}
        lines.append((one.city, f"parent {one.id}", style))
    lines.append((city_of(individual), f"individual {individual.id}",
                  {"color": LIVING, "linewidth": 2.0, "zorder": 4}))  # fmt: skip
    for city, name, style in reversed(lines):
        _steps(ax, city, of, unit, name, style)
    if powers and any(len(line.get_xdata()) for line in ax.lines):
        ax.set_xscale("log")
    if not any(len(line.get_xdata()) for line in ax.lines):
        note(ax, "there are no buildings")
    ax.set_ylim(0, 1.02)
    name_axes(ax, folded(f"{what} of a building, {unit}", 60), "share of the buildings up to it")
    ax.yaxis.set_major_formatter(lambda value, _: f"{value:.0%}")
    key(ax, ax.lines)
    return ax


def _steps(ax: Axes, city: CityMap, of: str, unit: str, name: str, style: dict) -> None:
    values = np.sort(getattr(city.buildings, of))
    shares = np.arange(1, len(values) + 1) / max(1, len(values))
    median = f", median {np.median(values):.3g} {unit}" if len(values) else ""
    label = f"{name}\n{len(values)} buildings{median}"
    ax.plot(values, shares, drawstyle="steps-post", label=label, **style)


__all__ = ["QUANTITIES", "buildings"]
