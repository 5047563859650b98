"""Distributions of the buildings of an individual, its parents and its cities."""

import numpy as np
from matplotlib.axes import Axes

from evocity.analysis import Individual
from evocity.analysis.distributions import QUANTITIES, Distribution, distributions
from evocity.plot import style

_DASHES = ["--", "-.", (0, (1, 1.2)), (0, (6, 1.5, 1, 1.5, 1, 1.5))]


def buildings(
    individual: Individual, of: str = "area", parents: bool = True, ax: Axes | None = None
) -> Axes:
    """Draw the share of buildings up to each size. One line is for an individual, dashed lines are
    for its parents, and dotted grey lines for the reference cities. Each source city has a line in
    its own colour. The legend shows the number of buildings and the median size.

    individual : an individual of a run.
    of : the size to draw: "area", "height", "perimeter" or "volume".
    parents : whether to draw the parents.

    Raises `EvocityError` for any other ``of``, and for an object that is not an individual. Raises
    `RunError` if the individual has no map.
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
    ax.yaxis.set_major_formatter(lambda value, _: f"{value:.0%}")
    style.key(ax, ax.lines)
    return ax


def _steps(ax: Axes, one: Distribution, unit: str, line: dict) -> None:
    values = one.values
    shares = np.arange(1, len(values) + 1) / max(1, len(values))
    median = f", median {np.median(values):.3g} {unit}" if len(values) else ""
    label = f"{style.short(one.name)}\n{len(values)} buildings{median}"
    ax.plot(values, shares, drawstyle="steps-post", label=label, **line)
