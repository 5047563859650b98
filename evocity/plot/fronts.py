"""The front of a run: two measures against each other, with the maps of some."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import ConnectionPatch

from evocity.analysis import Run
from evocity.analysis.births import Told
from evocity.analysis.spread import farthest_first
from evocity.errors import EvocityError, shown
from evocity.plot.chosen import (
    aim_on,
    cities_of,
    highest_of,
    rows_of,
    thumbnail,
    told_of,
    worded,
)
from evocity.plot.generations import wanted_lines
from evocity.plot.style import (
    BROKEN,
    FAINTS,
    FIRST,
    INKS,
    LIVING,
    OTHERS,
    PAPERS,
    SMALL,
    bare,
    credit,
    folded,
    key,
    lay,
    name_axes,
    note,
    panel,
    scale_bar,
)

#: Maps beside a front, at most, and px along each.
MOST_MAPS, _PX = 18, 200
_IN_A_COLUMN = 6
# Of a larger front so many, evenly along it, are compared with each other: the pairs fit in 72 MB.
_COMPARED = 3000


def front(
    run: Run,
    x: str,
    y: str,
    generation: int | None = None,
    of: object = None,
    thumbnails: int = 6,
    ax: Axes | None = None,
) -> Axes:
    """Two measures of births against each other: the front of a generation, those that lived then
    besides, the first population, all other births; those that break a constraint as crosses.
    Beside it the maps of some of the front, the farthest from each other, each with its id and a
    line to its point.

    x, y : names of measures.
    generation : whose front; the last unless it is given.
    of : the births to draw, a frame of them, ids or individuals; all until that generation unless
        it is given. Maps are of those among them.
    thumbnails : how many maps; 0 for none.

    Raises `RunError` for a measure that the run does not log, a generation that is not whole, an id
    that is no birth's; `EvocityError` for another number of ``thumbnails`` than 0 to 18.
    """
    told = told_of(run)
    aims = [aim_on(told, name) for name in (x, y)]
    whole = isinstance(thumbnails, int | np.integer) and not isinstance(thumbnails, bool)
    if not whole or not 0 <= thumbnails <= MOST_MAPS:
        raise EvocityError(
            f"thumbnails = {shown(thumbnails)}",
            f"how many maps stand beside the front, 0 to {MOST_MAPS}",
            "give for example 6",
        )
    ids, ranks = told.ranked(generation)
    until = told.last if generation is None else generation
    rows = rows_of(told, of, told.ids[told.generation <= until])
    best = np.intersect1d(told.rows(ids[ranks == 0]), rows)
    values = np.column_stack([told.value(aim.name) for aim in aims])
    values[~np.isfinite(values).all(axis=1)] = np.nan
    chosen = _wide_apart(values, best[told.feasible[best]], int(thumbnails))
    columns = -(-len(chosen) // _IN_A_COLUMN)
    ax = panel(ax, 6.5 + 1.1 * columns, 5.0 + 0.9 * (len(chosen) > 4))
    _dots(ax, told, values, rows, np.intersect1d(told.rows(ids), rows), best)
    wanted_lines(ax, aims[0], upright=True)
    wanted_lines(ax, aims[1])
    ax.margins(0.05)
    name_axes(ax, worded(aims[0]), folded(worded(aims[1]), 40))
    if len(chosen):
        _maps(ax, told, values, chosen)
    return ax


def _dots(ax: Axes, told: Told, values, rows, living, best) -> None:
    kept = told.feasible
    living = np.setdiff1d(living, best)
    first = np.setdiff1d(rows[told.generation[rows] == 0], np.union1d(best, living))
    others = np.setdiff1d(rows, np.concatenate([best, living, first]))
    layers = [
        (others[kept[others]], OTHERS, 9, "other births"),
        (first[kept[first]], FIRST, 14, "first population"),
        (living[kept[living]], INKS, 14, "the living"),
        (best[kept[best]], LIVING, 26, "the front"),
    ]
    lost = rows[~kept[rows]]
    if len(lost := lost[~np.isnan(values[lost, 0])]):
        ax.scatter(*values[lost].T, 12, BROKEN, marker="x", linewidths=0.7, alpha=0.6,
                   label="breaks a constraint")  # fmt: skip
    for some, colour, size, label in layers:
        if len(some := some[~np.isnan(values[some, 0])]):
            ax.scatter(*values[some].T, size, colour, linewidths=0, label=label)
    if ax.collections:
        key(ax, ax.collections, columns=5, loc="lower left", bbox_to_anchor=(0, 1.02))
    else:
        note(ax, "no birth has a value of both")


def _wide_apart(values: np.ndarray, rows: np.ndarray, count: int) -> np.ndarray:
    """Of ``rows`` those so many that lie farthest from each other, the highest first."""
    rows = rows[~np.isnan(values[rows, 0])]
    if not (len(rows) and count):
        return rows[:0]
    if len(rows) > _COMPARED:
        along = rows[np.argsort(values[rows, 0], kind="stable")]
        rows = along[np.linspace(0, len(along) - 1, _COMPARED).astype(np.intp)]
    points = values[rows] / 2
    ranges = np.ptp(points, axis=0)
    points = points / np.where(ranges > 0, ranges, 1)
    apart = np.sqrt(np.square(points[:, None] - points[None]).sum(axis=2))
    chosen = rows[farthest_first(apart, count)]
    return chosen[np.lexsort((chosen, -values[chosen, 1]))]


def _maps(ax: Axes, told: Told, values: np.ndarray, chosen: np.ndarray) -> None:
    """The maps of the ``chosen``, in columns to the right; of several columns those to the right
    lie between the rows of those to the left, so that their lines pass."""
    ids = told.ids[chosen].tolist()
    cities, highest = cities_of(told, ids), highest_of(told)
    columns = -(-len(ids) // _IN_A_COLUMN)
    lines = max(-(-len(ids) // columns), 4)
    tall = 1 / (lines + 0.5 * (columns > 1))
    box = ax.get_position()
    width, height = ax.figure.get_size_inches()
    wide = 0.84 * tall * box.height * height / (box.width * width)
    for place, (one, row) in enumerate(zip(ids, chosen, strict=True)):
        line, column = divmod(place, columns)
        low = 1 - (line + 1 + 0.5 * (column % 2)) * tall
        at = ax.inset_axes([1.06 + column * 1.25 * wide, low, 1.1 * wide, 0.84 * tall])
        bare(at)
        at.set_anchor("W")
        rows, across = (shape := cities[one].shape)
        at.set_xlim(0, across)
        at.set_ylim(rows, 0)
        lay(at, thumbnail(cities[one], highest, _PX), (0, 0, shape[1], shape[0]))
        at.annotate(f"{one}", (0, 0), (2, 2), "axes fraction", "offset points", fontsize=SMALL,
                    color=INKS, bbox={"facecolor": PAPERS, "pad": 1, "linewidth": 0})  # fmt: skip
        line = ConnectionPatch(
            (0, 0.5), values[row], "axes fraction", "data", axesA=at, axesB=ax, color=FAINTS,
            linewidth=0.6, alpha=0.8, zorder=1.5,
        )  # fmt: skip
        ax.add_artist(line)
        ax.scatter(*values[row][:, None], 44, "none", linewidths=1.2, edgecolors=INKS, zorder=4)
    scale_bar(at, 0, across, cities[one].metres_per_pixel, below=6)
    credit(ax, told.run.header.attribution, label=ax.get_xlabel())


__all__ = ["MOST_MAPS", "front"]
