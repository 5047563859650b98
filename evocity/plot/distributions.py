"""How the buildings of an individual are distributed, beside those of its parents and cities."""

import numpy as np
from matplotlib.axes import Axes

from evocity.analysis import Individual
from evocity.analysis.distributions import QUANTITIES, Distribution, distributions
from evocity.plot.style import FAINTS, LIVING, folded, key, name_axes, note, panel, short

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
    found = distributions(individual, of, parents)
    what, unit, powers = QUANTITIES[of]
    ax = panel(ax, 8.0, 4.2)
    bred = [one for one in found if one.role == "parent"]
    for one in reversed(found):
        style = {
            "source": {"color": one.colour, "linewidth": 1.3},
            "reference": {"color": FAINTS, "linestyle": ":", "linewidth": 1},
            "individual": {"color": LIVING, "linewidth": 2.0, "zorder": 4},
        }.get(one.role)
        if style is None:
            dashes = _DASHES[bred.index(one) % len(_DASHES)]
            style = {"color": FAINTS, "linestyle": dashes, "linewidth": 1.2}
        _steps(ax, one, unit, style)
    if powers and any(len(line.get_xdata()) for line in ax.lines):
        ax.set_xscale("log")
    if not any(len(line.get_xdata()) for line in ax.lines):
        note(ax, "there are no buildings")
    ax.set_ylim(0, 1.02)
    name_axes(ax, folded(f"{what} of a building, {unit}", 60), "share of the buildings up to it")
    ax.yaxis.set_major_formatter(lambda value, _: f"{value:.0%}")
    key(ax, ax.lines)
    return ax


def _steps(ax: Axes, one: Distribution, unit: str, style: dict) -> None:
    values = one.values
    shares = np.arange(1, len(values) + 1) / max(1, len(values))
    median = f", median {np.median(values):.3g} {unit}" if len(values) else ""
    label = f"{short(one.name)}\n{len(values)} buildings{median}"
    ax.plot(values, shares, drawstyle="steps-post", label=label, **style)


__all__ = ["QUANTITIES", "buildings"]
