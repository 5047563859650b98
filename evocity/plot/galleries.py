"""Galleries: maps of many individuals side by side, on one scale of heights."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from evocity.analysis import Run
from evocity.analysis.births import Births
from evocity.analysis.clusters import label_clusters, medoids
from evocity.analysis.goals import stated_aim
from evocity.analysis.likeness import Likeness
from evocity.analysis.thumbnails import cities_of, highest_of, thumbnail
from evocity.errors import EvocityError, check_number, check_word
from evocity.plot import style
from evocity.plot.births import aim_on, births_of, rows_of

#: Maps in one gallery, at most.
MOST = 400
_WIDTH, _LARGEST = 9.0, 2.6  # inches, of all and of one
_GAP = 0.08  # of a map's width


@dataclass(frozen=True)
class _Cell:
    """The place of a map: ``left`` and ``top`` in widths of a map."""

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
    """Draw the maps of several individuals with one scale of heights. The label of a map shows the
    id and the measure that sorts the maps. The sign × marks individuals that break a constraint.

    of : individuals to draw, as a data frame, ids or individuals, at most 400. By default, the
        gallery shows the living individuals, with the best first.
    columns : number of maps in each row, from 1 to 20.
    order : name of a measure that sorts the maps, with the best first. The argument ``order`` can
        name a column of numbers in the given data frame, for example a column from `Run.score`.
        With ``order="looks"``, similar maps stand next to each other. By default, the maps keep the
        order in which the individuals are given.
    clusters : number of groups into which the individuals are divided, by the similarity of their
        maps. Each group starts on a new row with its medoid, the middle individual of the group.

    Raises `EvocityError` for an invalid number of columns or groups, for an invalid order, and for
    too many individuals. Raises `RunError` for an unknown id.
    """
    births = births_of(run)
    rows = rows_of(births, of, births.ranked()[0])
    _check(births, rows, columns, [*births.run.header.columns, *_numbers_in(of)], order, clusters)
    by = None if order in (None, "looks") else _By.of(births, rows, of, order)
    cities = cities_of(births, births.ids[rows].tolist())
    groups = _grouped(births, rows, cities, by, order == "looks", clusters)
    width = _WIDTH if ax is None else ax.get_position().width * ax.figure.get_figwidth()
    columns = min(columns, max([1, *(len(group) for _, group in groups)]))
    inch = min(_LARGEST, (width - 0.9) / (columns * (1 + _GAP)))
    caption = (1 + (by is not None)) * 1.3 * style.SMALL / 72 / inch
    header, tall = 0.0 if clusters is None else 2.2 * style.PLAIN / 72 / inch, 1.0
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
    ax = style.panel(ax, max(4.0, columns * (1 + _GAP) * inch + 0.9), max(1.0, top * inch) + 0.7)
    style.bare(ax)
    ax.set_xlim(0, columns * (1 + _GAP) - _GAP)
    ax.set_ylim(max(top, 0.2), 0)
    highest = highest_of(births)
    for name, at in lines if clusters is not None else ():
        ax.text(0, at + 0.75 * header, name, fontsize=style.PLAIN, color=style.INKS, va="bottom")
    for cell in cells:
        _draw(ax, births, cell, cities.get(int(births.ids[cell.row])), tall, highest, inch, by)
    if not cells:
        style.note(ax, "no individual")
    for city in [*cities.values()][:1]:
        style.scale_bar(ax, 0, 1, city.shape[1] * city.metres_per_pixel)
        style.height_scale(ax, highest)
    style.credit(ax, births.run.header.attribution)
    return style.fit(ax)


def _numbers_in(of: object) -> list[str]:
    """Names of the columns of numbers of a pandas frame; none for other objects."""
    if not hasattr(of, "select_dtypes"):
        return []
    return [str(name) for name in of.select_dtypes("number").columns]


@dataclass(frozen=True)
class _By:
    """The order of individuals: ``values`` and ``losses`` by row of all births, NaN for none."""

    values: dict[int, float]
    losses: dict[int, float]
    unit: str

    @classmethod
    def of(cls, births: Births, rows: np.ndarray, given: object, order: str) -> "_By":
        """By the measure ``order`` of the run; else by that column of the frame ``given``."""
        if order in births.run.header.columns:
            aim, values = aim_on(births, order), births.value(order)[rows]
            losses = aim.losses(values)
        else:
            aim, values = stated_aim(order, {}), np.asarray(given[order], float)
            losses = values if aim.goal == "min" else -values
        pairs = (dict(zip(rows.tolist(), one.tolist(), strict=True)) for one in (values, losses))
        return cls(*pairs, aim.unit)


def _draw(ax, births: Births, cell: _Cell, city, tall, highest, inch, by: _By | None) -> None:
    row = cell.row
    if city is None:
        ax.add_patch(Rectangle((cell.left, cell.top), 1, tall, facecolor=style.GROUNDS))
        status = style.short(str(births.status[row]))
        ax.text(cell.left + 0.5, cell.top + tall / 2, status, ha="center", va="center",
                **style.FAINT_TEXT)  # fmt: skip
    else:
        picture = thumbnail(city, highest, max(16, int(1.25 * inch * style.DPI)))
        style.lay(ax, picture, (cell.left, cell.top, 1, tall))
    text = f"{births.ids[row]}" + ("" if births.feasible[row] else " ×")
    if by is not None:
        value = by.values[row]
        text += "\n" + ("–" if np.isnan(value) else f"{value:.4g} {by.unit}".rstrip())
    colour = style.INKS if births.feasible[row] else style.BROKEN
    caption = ax.text(cell.left, cell.top + tall + 0.02, style.plain(text), va="top",
                      fontsize=style.SMALL, color=colour, linespacing=1.15)  # fmt: skip
    caption.set_in_layout(False)  # as its map


def _check(births: Births, rows, columns, measures, order, clusters) -> None:
    expected = "a number from 1 to 20, for the maps in a row"
    check_number("columns", columns, 1, 20, expected, whole=True)
    if len(rows) > MOST:
        raise EvocityError(
            f"{len(rows)} individuals are too many for a gallery",
            f"at most {MOST} individuals",
            "choose fewer individuals, for example of=run.archive.ids[:100] or "
            "of=run.most_different(100)",
        )
    if order is not None:
        check_word(
            "order",
            order,
            ["looks", *dict.fromkeys(measures)],
            "leave it out for the order of the births",
        )
    if clusters is not None:
        expected = f"a number of groups from 1 to {len(rows)}, the number of individuals"
        check_number("clusters", clusters, 1, max(1, len(rows)), expected, whole=True)


def _grouped(
    births: Births, rows, cities, by: _By | None, looks: bool, clusters
) -> list[tuple[str, np.ndarray]]:
    """Heading and rows of each group, in order."""
    matrix = None
    known = np.array([int(births.ids[row]) in cities for row in rows], bool)
    if (looks or clusters is not None) and known.any():
        matrix = Likeness(births).matrix(births.ids[rows[known]], "looks")
    if by is not None:
        losses = np.array([by.losses[row] for row in rows.tolist()])
        at = np.lexsort((np.arange(len(rows)), losses, np.isnan(losses), ~births.feasible[rows]))
    elif looks and matrix is not None:
        at = np.concatenate([np.flatnonzero(known)[_chain(matrix)], np.flatnonzero(~known)])
    else:
        at = np.arange(len(rows))
    if clusters is None:
        return [("", rows[at])]
    groups, where = [], np.full(len(rows), -1)
    if matrix is not None:
        chosen = medoids(matrix, min(clusters, len(matrix)))
        where[known] = label_clusters(matrix, chosen)
        middle = np.flatnonzero(known)[chosen]
        sizes = np.bincount(where[known], minlength=len(chosen))
        for number in np.argsort(-sizes, kind="stable"):
            own = at[where[at] == number]
            own = np.concatenate([[middle[number]], own[own != middle[number]]])
            groups.append((f"{len(own)} like {births.ids[rows[middle[number]]]}", rows[own]))
    if (where < 0).any():
        groups.append(("without a map", rows[at[where[at] < 0]]))
    return groups


def _chain(matrix: np.ndarray) -> np.ndarray:
    """An order from the one farthest from all, each followed by the nearest of those left."""
    if not len(matrix):
        return np.zeros(0, np.intp)
    order, left = [int(matrix.sum(axis=0).argmax())], np.ones(len(matrix), bool)
    left[order] = False
    while left.any():
        order.append(int(np.where(left, matrix[order[-1]], np.inf).argmin()))
        left[order[-1]] = False
    return np.array(order)
