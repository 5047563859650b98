"""The front of a run: two measures against each other, with some of the maps."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import ConnectionPatch

from evocity.analysis import Run
from evocity.analysis.births import Births
from evocity.analysis.clusters import farthest_first
from evocity.analysis.thumbnails import cities_of, highest_of, thumbnail
from evocity.errors import RunError, check_number
from evocity.plot import style
from evocity.plot.births import aim_on, axis_label, births_of, rows_of
from evocity.plot.generations import wanted_lines

#: Maps beside a front, at most, and px along each.
MOST_MAPS, _PX = 18, 200
_IN_A_COLUMN = 6
# Points of a front that are compared with each other, at most: the pairs fit in 72 MB.
_COMPARED = 3000


def front(
    run: Run,
    x: str | None = None,
    y: str | None = None,
    generation: int | None = None,
    of: object = None,
    thumbnails: int = 6,
    ax: Axes | None = None,
) -> Axes:
    """Draw births as points in a plot of two measures. Four kinds of points mark the front of a
    generation, the remaining individuals of the generation, the first population, and all other
    births. Crosses mark births that break a constraint. Maps beside the plot show births of the
    front whose values of the two measures differ strongly. Each map shows the id of its birth, and
    a line connects the map with its point.

    x, y : names of the measures for the horizontal and the vertical axis; by default the two
        measures with a goal, if the run has two.
    generation : number of the generation whose front to draw; by default the last generation.
    of : births to draw, as a data frame, ids or individuals; by default all births up to the
        ``generation``. The maps beside the plot show only births in ``of``.
    thumbnails : number of maps beside the plot, from 0 to 18.

    Raises `RunError` for a measure that the run does not log, for an incomplete generation, and for
    an unknown id. Raises `RunError` for a missing name, unless the run has two measures with a
    goal. Raises `EvocityError` if the number of maps is out of range.
    """
    births = births_of(run)
    aims = [aim_on(births, name) for name in _axes(births, x, y)]
    expected = f"a number of maps from 0 to {MOST_MAPS}"
    check_number("thumbnails", thumbnails, 0, MOST_MAPS, expected, whole=True)
    ids, ranks = births.ranked(generation)
    until = births.last if generation is None else generation
    rows = rows_of(births, of, births.ids[births.generation <= until])
    best = np.intersect1d(births.rows(ids[ranks == 0]), rows)
    values = np.column_stack([births.value(aim.name) for aim in aims])
    values[~np.isfinite(values).all(axis=1)] = np.nan
    chosen = _wide_apart(values, best[births.feasible[best]], int(thumbnails))
    columns = -(-len(chosen) // _IN_A_COLUMN)
    ax = style.panel(ax, 6.5 + 1.1 * columns, 5.0 + 0.9 * (len(chosen) > 4))
    _dots(ax, births, values, rows, np.intersect1d(births.rows(ids), rows), best)
    wanted_lines(ax, aims[0], upright=True)
    wanted_lines(ax, aims[1])
    ax.margins(0.05)
    style.name_axes(ax, axis_label(aims[0]), style.fold(axis_label(aims[1]), 40))
    if len(chosen):
        _maps(ax, births, values, chosen)
    return ax


def _axes(births: Births, x: str | None, y: str | None) -> tuple[str, str]:
    """Return the names of both axes; a missing name is that of the other measure with a goal."""
    if x is not None and y is not None:
        return x, y
    names = [aim.name for aim in births.sought]
    others = [name for name in names if name not in (x, y)]
    if len(names) != 2 or len(others) < (x, y).count(None):
        given = [f"{axis} = {name!r}" for axis, name in (("x", x), ("y", y)) if name is not None]
        raise RunError(
            f"{births.run.path}: the call names {' and '.join(given) or 'no measures'}; measures "
            f"with a goal in the run: {', '.join(names) or 'none'}",
            "the names of two measures, or a run with two measures that have a goal",
            'name both measures, for example evocity.plot.front(run, "gsi", "alignment")',
        )
    first = others.pop(0) if x is None else x
    return first, (others.pop(0) if y is None else y)


def _dots(ax: Axes, births: Births, values, rows, living, best) -> None:
    kept = births.feasible
    living = np.setdiff1d(living, best)
    first = np.setdiff1d(rows[births.generation[rows] == 0], np.union1d(best, living))
    others = np.setdiff1d(rows, np.concatenate([best, living, first]))
    layers = [
        (others[kept[others]], style.OTHERS, 9, "other births"),
        (first[kept[first]], style.FIRST, 14, "first population"),
        (living[kept[living]], style.INKS, 14, "the living"),
        (best[kept[best]], style.LIVING, 26, "the front"),
    ]
    lost = rows[~kept[rows]]
    if len(lost := lost[~np.isnan(values[lost, 0])]):
        ax.scatter(*values[lost].T, 12, style.BROKEN, marker="x", linewidths=0.7, alpha=0.6,
                   label="breaks a constraint")  # fmt: skip
    for some, colour, size, label in layers:
        if len(some := some[~np.isnan(values[some, 0])]):
            ax.scatter(*values[some].T, size, colour, linewidths=0, label=label)
    if ax.collections:
        style.key(ax, ax.collections, columns=5, loc="lower left", bbox_to_anchor=(0, 1.02))
    else:
        style.note(ax, "no birth has a value of both")


def _wide_apart(values: np.ndarray, rows: np.ndarray, count: int) -> np.ndarray:
    """Of ``rows`` the ``count`` that lie farthest from each other, the highest first."""
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


def _maps(ax: Axes, births: Births, values: np.ndarray, chosen: np.ndarray) -> None:
    """The maps of the ``chosen``, in columns to the right, staggered so that their lines pass."""
    ids = births.ids[chosen].tolist()
    cities, highest = cities_of(births, ids), highest_of(births)
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
        style.bare(at)
        at.set_anchor("W")
        rows, across = (shape := cities[one].shape)
        at.set_xlim(0, across)
        at.set_ylim(rows, 0)
        style.lay(at, thumbnail(cities[one], highest, _PX), (0, 0, shape[1], shape[0]))
        box = {"facecolor": style.PAPERS, "pad": 1, "linewidth": 0}
        at.annotate(f"{one}", (0, 0), (2, 2), "axes fraction", "offset points", bbox=box,
                    **style.INK_TEXT)  # fmt: skip
        line = ConnectionPatch(
            (0, 0.5), values[row], "axes fraction", "data", axesA=at, axesB=ax, color=style.FAINTS,
            linewidth=0.6, alpha=0.8, zorder=1.5
        )  # fmt: skip
        ax.add_artist(line)
        ax.scatter(
            *values[row][:, None], 44, "none", linewidths=1.2, edgecolors=style.INKS, zorder=4
        )
    style.scale_bar(at, 0, across, cities[one].metres_per_pixel, below=6)
    style.credit(ax, births.run.header.attribution, label=ax.get_xlabel())
