"""Maps of many individuals side by side, on one scale of heights."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from evocity.analysis import Run
from evocity.analysis.births import Told
from evocity.analysis.clusters import labelled, medoids
from evocity.analysis.likeness import Likeness
from evocity.errors import EvocityError, check_word, shown
from evocity.plot.chosen import (
    aim_named,
    aim_on,
    cities_of,
    highest_of,
    rows_of,
    thumbnail,
    told_of,
)
from evocity.plot.style import (
    BROKEN,
    DPI,
    FAINTS,
    GROUNDS,
    INKS,
    PLAIN,
    SMALL,
    bare,
    credit,
    fit,
    height_scale,
    lay,
    note,
    panel,
    plain,
    scale_bar,
    short,
)

#: So many maps at most stand in one gallery.
MOST = 400
_WIDTH, _LARGEST = 9.0, 2.6  # inches, of all and of one
_GAP = 0.08  # of a map's width


@dataclass(frozen=True)
class _Cell:
    """Where a map stands: ``left`` and ``top`` in widths of a map."""

    row: int
    left: float
    top: float


def gallery(
    run: Run,
    of: object = None,
    columns: int = 6,
    order: str | None = None,
    clusters: int | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Maps of individuals on one scale of heights, each with its id and the measure that they are
    ordered by; × marks those that break a constraint.

    of : a frame of births, ids or individuals, at most 400; who lives, the best first, unless it
        is given.
    columns : maps beside each other, 1 to 20.
    order : a measure, the best by it first; a column of numbers of a frame that is given, such as
        of `Run.score`; "looks", so that neighbours look alike; as they are given unless it is told.
    clusters : so many groups of those that look alike, each from a new line on, the one that all
        of a group are nearest to first.

    Raises `EvocityError` for other columns, orders and clusters, and for too many individuals;
    `RunError` for an id that is no birth's.
    """
    told = told_of(run)
    rows = rows_of(told, of, told.ranked()[0])
    _check(told, rows, columns, [*told.run.header.columns, *_numbers_in(of)], order, clusters)
    by = None if order in (None, "looks") else _By.of(told, rows, of, order)
    cities = cities_of(told, told.ids[rows].tolist())
    groups = _grouped(told, rows, cities, by, order == "looks", clusters)
    width = _WIDTH if ax is None else ax.get_position().width * ax.figure.get_figwidth()
    columns = min(columns, max([1, *(len(group) for _, group in groups)]))
    inch = min(_LARGEST, (width - 0.9) / (columns * (1 + _GAP)))
    caption = (1 + (by is not None)) * 1.3 * SMALL / 72 / inch
    header, tall = 0.0 if clusters is None else 2.2 * PLAIN / 72 / inch, 1.0
    if cities:
        height, across = next(iter(cities.values())).shape
        tall = height / across
    cells, lines, top = [], [], 0.0
    for name, group in groups:
        lines.append((name, top))
        top += header
        for place, row in enumerate(group):
            line, column = divmod(place, columns)
            left = column * (1 + _GAP)
            cells.append(_Cell(row, left, top + line * (tall + caption + _GAP)))
        top += -(-len(group) // columns) * (tall + caption + _GAP)
    ax = panel(ax, max(4.0, columns * (1 + _GAP) * inch + 0.9), max(1.0, top * inch) + 0.7)
    bare(ax)
    ax.set_xlim(0, columns * (1 + _GAP) - _GAP)
    ax.set_ylim(max(top, 0.2), 0)
    highest = highest_of(told)
    for name, at in lines if clusters is not None else ():
        ax.text(0, at + 0.75 * header, name, fontsize=PLAIN, color=INKS, va="bottom")
    for cell in cells:
        _draw(ax, told, cell, cities.get(int(told.ids[cell.row])), tall, highest, inch, by)
    if not cells:
        note(ax, "no individual")
    for city in [*cities.values()][:1]:
        scale_bar(ax, 0, 1, city.shape[1] * city.metres_per_pixel)
        height_scale(ax, highest)
    credit(ax, told.run.header.attribution)
    return fit(ax)


def _numbers_in(of: object) -> list[str]:
    """The names of the columns of numbers of a pandas frame; none of anything else."""
    if not hasattr(of, "select_dtypes"):
        return []
    return [str(name) for name in of.select_dtypes("number").columns]


@dataclass(frozen=True)
class _By:
    """What individuals are ordered by: ``values`` and ``losses``, by row of all births, NaN where
    there is none."""

    values: dict[int, float]
    losses: dict[int, float]
    unit: str

    @classmethod
    def of(cls, told: Told, rows: np.ndarray, given: object, order: str) -> "_By":
        """By the measure ``order`` of the run; else by that column of the frame ``given``, the
        highest first unless a measure is called so that should be low."""
        if order in told.run.header.columns:
            aim, values = aim_on(told, order), told.value(order)[rows]
            losses = aim.losses(values)
        else:
            aim, values = aim_named(order), np.asarray(given[order], float)
            losses = values if aim.goal == "min" else -values
        pairs = (dict(zip(rows.tolist(), one.tolist(), strict=True)) for one in (values, losses))
        return cls(*pairs, aim.unit)


def _draw(ax, told: Told, cell: _Cell, city, tall, highest, inch, by: _By | None) -> None:
    row = cell.row
    if city is None:
        ax.add_patch(Rectangle((cell.left, cell.top), 1, tall, facecolor=GROUNDS))
        ax.text(cell.left + 0.5, cell.top + tall / 2, short(str(told.status[row])), ha="center",
                va="center", fontsize=SMALL, color=FAINTS)  # fmt: skip
    else:
        picture = thumbnail(city, highest, max(16, int(1.25 * inch * DPI)))
        lay(ax, picture, (cell.left, cell.top, 1, tall))
    text = f"{told.ids[row]}" + ("" if told.feasible[row] else " ×")
    if by is not None:
        value = by.values[row]
        text += "\n" + ("–" if np.isnan(value) else f"{value:.4g} {by.unit}".rstrip())
    caption = ax.text(cell.left, cell.top + tall + 0.02, plain(text), va="top", fontsize=SMALL,
                      color=INKS if told.feasible[row] else BROKEN, linespacing=1.15)  # fmt: skip
    caption.set_in_layout(False)  # as its map


def _check(told: Told, rows, columns, measures, order, clusters) -> None:
    def whole(value, low, high):
        number = isinstance(value, int | np.integer) and not isinstance(value, bool)
        return number and low <= value <= high

    if not whole(columns, 1, 20):
        raise EvocityError(f"columns = {shown(columns)}", "1 to 20 maps in a line", "give 6")
    if len(rows) > MOST:
        raise EvocityError(
            f"a gallery of {len(rows)} individuals",
            f"at most {MOST}",
            "choose some: of=run.archive.ids[:100], or of=run.most_different(100)",
        )
    if order is not None:
        check_word(
            "order",
            order,
            ["looks", *dict.fromkeys(measures)],
            "leave it out for that in which they are given",
        )
    if clusters is not None and not whole(clusters, 1, max(1, len(rows))):
        raise EvocityError(
            f"clusters = {shown(clusters)}",
            f"a number of groups, 1 to {len(rows)}, as many as there are individuals at most",
            "give for example 4",
        )


def _grouped(
    told: Told, rows, cities, by: _By | None, looks: bool, clusters
) -> list[tuple[str, np.ndarray]]:
    """(heading, rows) of each group, in the order in which they stand."""
    matrix = None
    known = np.array([int(told.ids[row]) in cities for row in rows], bool)
    if (looks or clusters is not None) and known.any():
        matrix = Likeness(told).matrix(told.ids[rows[known]], "looks")
    if by is not None:
        losses = np.array([by.losses[row] for row in rows.tolist()])
        at = np.lexsort((np.arange(len(rows)), losses, np.isnan(losses), ~told.feasible[rows]))
    elif looks and matrix is not None:
        at = np.concatenate([np.flatnonzero(known)[_chain(matrix)], np.flatnonzero(~known)])
    else:
        at = np.arange(len(rows))
    if clusters is None:
        return [("", rows[at])]
    found, where = [], np.full(len(rows), -1)
    if matrix is not None:
        chosen = medoids(matrix, min(clusters, len(matrix)))
        where[known] = labelled(matrix, chosen)
        middle = np.flatnonzero(known)[chosen]
        sizes = np.bincount(where[known], minlength=len(chosen))
        for number in np.argsort(-sizes, kind="stable"):
            own = at[where[at] == number]
            own = np.concatenate([[middle[number]], own[own != middle[number]]])
            found.append((f"{len(own)} like {told.ids[rows[middle[number]]]}", rows[own]))
    if (where < 0).any():
        found.append(("without a map", rows[at[where[at] < 0]]))
    return found


def _chain(matrix: np.ndarray) -> np.ndarray:
    """An order in which each is followed by the nearest of those that are left, from the one that
    is farthest from all."""
    if not len(matrix):
        return np.zeros(0, np.intp)
    order, left = [int(matrix.sum(axis=0).argmax())], np.ones(len(matrix), bool)
    left[order] = False
    while left.any():
        order.append(int(np.where(left, matrix[order[-1]], np.inf).argmin()))
        left[order[-1]] = False
    return np.array(order)


__all__ = ["MOST", "gallery"]
