"""Populations: the first and the last, parallel coordinates, operators."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from evocity.analysis import Aim, Run
from evocity.analysis.births import Births
from evocity.plot import style
from evocity.plot.births import aims_on, axis_label, births_of, rows_of
from evocity.plot.generations import wanted_lines
from evocity.plot.style import Panels

_BINS = 24
_BLUE_TO_RED = LinearSegmentedColormap.from_list(
    "blue to red", [style.FIRST, style.OTHERS, style.LIVING]
)


def first_and_last(
    run: Run, measures: str | Sequence[str] | None = None, ax: object = None
) -> Panels:
    """Draw histograms of each measure for the first and for the last population, with one panel per
    measure. The histograms count only individuals that keep the constraints. Marks above each
    histogram show the median of each population. Dashed lines show the target and the bounds of the
    measure.

    measures : names of the measures to draw; by default the measures with a goal or bounds.
    ax : axes of matplotlib, one for each measure; by default the function makes new axes.

    Raises `RunError` if the run does not log a measure.
    """
    births = births_of(run)
    aims = aims_on(births, measures)
    axes = style.panels(len(aims), ax)
    living = [
        births.rows(np.unique(births.run.members(n)["id"].to_numpy())) for n in (0, births.last)
    ]
    for one, aim in zip(axes, aims, strict=True):
        values = [births.value(aim.name)[rows] for rows in living]
        values = [
            v[births.feasible[r] & np.isfinite(v)] for v, r in zip(values, living, strict=True)
        ]
        together = np.concatenate(values)
        if not len(together):
            style.note(one, "no individual of them has a value and keeps the constraints")
        else:
            edges = np.linspace(*_span(together), _BINS + 1)
            one.hist(values[0], edges, color=style.FIRST, alpha=0.45)
            one.hist(
                values[1], edges, color=style.LIVING, alpha=0.75, histtype="step", linewidth=1.6
            )
            for some, colour in zip(values, (style.FIRST, style.LIVING), strict=True):
                if len(some):
                    one.plot(np.median(some), 1, marker=7, color=colour, markersize=8,
                             transform=one.get_xaxis_transform(), clip_on=False)  # fmt: skip
        wanted_lines(one, aim, upright=True)
        one.locator_params(axis="y", nbins=5, integer=True)
        style.name_axes(one, style.fold(axis_label(aim), 40), "individuals")
    lost = [int(np.count_nonzero(~births.feasible[rows])) for rows in living]
    names = [
        f"{name}, generation {n}" + (f", {gone} that break a constraint left out" if gone else "")
        for name, n, gone in zip(("first", "last"), (0, births.last), lost, strict=True)
    ]
    handles = [
        Patch(color=style.FIRST, alpha=0.45, label=names[0]),
        Patch(edgecolor=style.LIVING, facecolor="none", linewidth=1.6, label=names[1]),
        Line2D([], [], color=style.INKS, linestyle="", marker=7, label="median"),
    ]
    style.shared_key(axes, handles)
    return axes


def _span(values: np.ndarray) -> tuple[float, float]:
    """The least and the largest of finite ``values``; a span around them where all are equal."""
    low, high = float(values.min()), float(values.max())
    if high - low <= 1e-9 * max(abs(low), abs(high)):
        air = 0.05 * abs(low) or 0.5
        return low - air, high + air
    return low, high


def parallel(
    run: Run, of: object = None, measures: str | Sequence[str] | None = None, ax: Axes | None = None
) -> Axes:
    """Draw parallel coordinates, with a line per individual and a vertical axis per measure. If the
    run has a goal for a measure, the top of the measure's axis shows the better values. If an
    individual keeps the constraints, the colour of the individual's line shows the first measure.
    Individuals that break a constraint have grey dotted lines.

    of : individuals to draw, as a data frame, ids or individuals; by default the living
        individuals.
    measures : names of the measures to draw; by default the measures with a goal or bounds.

    Raises `RunError` for a measure that the run does not log, and for an unknown id.
    """
    births = births_of(run)
    aims = aims_on(births, measures)
    rows = rows_of(births, of, births.ids[births.alive])
    width = min(10.0, max(5.0, 1.6 * len(aims)))
    ax = style.panel(ax, width, 4.2)
    spans = [_span_of(births, aim, rows) for aim in aims]
    heights = np.column_stack([
        _height(births.value(aim.name)[rows], span) for aim, span in zip(aims, spans, strict=True)
    ])  # fmt: skip
    lines = [np.column_stack([np.arange(len(aims)), one]) for one in heights]
    kept = births.feasible[rows]
    faint = float(np.clip(30 / max(1, len(rows)), 0.25, 0.85))
    for which, dotted in ((~kept, True), (kept, False)):
        some = [lines[n] for n in np.flatnonzero(which)]
        if not some:
            continue
        drawn = LineCollection(some, linewidth=1.1, alpha=faint, zorder=2 + (not dotted))
        if dotted:
            drawn.set(color=style.BROKEN, linestyle=":", label="breaks a constraint")
        else:
            drawn.set(array=np.nan_to_num(heights[which, 0], nan=0.0), cmap=_BLUE_TO_RED)
            drawn.set_clim(0, 1)
        ax.add_collection(drawn)
        # a value between two missing ones makes no line
        alone = heights[which] if len(aims) == 1 else _alone(heights[which])
        y, x = alone[~np.isnan(alone)], np.nonzero(~np.isnan(alone))[1]
        colour = style.BROKEN if dotted else style.LIVING
        ax.plot(x, y, linestyle="", marker="_", color=colour, markersize=5)
    if not len(rows):
        style.note(ax, "no individual")
    for place, (low, high) in enumerate(spans):
        ax.axvline(place, color=style.FAINTS, linewidth=0.8, zorder=1)
        ends = ((low, 0, -4, "top"), (high, 1, 4, "bottom"))
        for value, y, away, where in ends:
            ax.annotate(f"{value:.3g}", (place, y), (0, away), textcoords="offset points",
                        ha="center", va=where, **style.INK_TEXT)  # fmt: skip
    ax.set_xlim(-0.3, len(aims) - 0.7)
    ax.set_ylim(-0.09, 1.09)
    ax.set_yticks([])
    ax.grid(False)
    ax.spines["left"].set_visible(False)
    ax.spines["bottom"].set_visible(False)
    size = style.PLAIN if len(aims) < 8 else style.SMALL
    letters = max(9, int((width - 0.8) / len(aims) * 72 / (0.68 * size)))
    names = [style.fold(axis_label(aim), letters) for aim in aims]
    ax.set_xticks(range(len(aims)), names, fontsize=size, color=style.INKS)
    ax.tick_params(axis="x", length=0, pad=2)
    title = f"{np.count_nonzero(kept)} that keep the constraints"
    title += f", {np.count_nonzero(~kept)} that break one dotted" if not kept.all() else ""
    title += f", coloured by {aims[0].name}" if kept.any() else ""
    ax.set_title(style.plain(title), fontsize=style.PLAIN, color=style.FAINTS, loc="left")
    return ax


def _span_of(births: Births, aim: Aim, rows: np.ndarray) -> tuple[float, float]:
    """The values at the lower and the upper end of a measure's axis, the better above."""
    values = births.value(aim.name)[rows]
    values = values[np.isfinite(values)]
    low, high = _span(values) if len(values) else (0.0, 1.0)
    less = aim.goal == "min" or (aim.goal == "bounds" and aim.low is None)
    return (high, low) if less and aim.target is None else (low, high)


def _height(values: np.ndarray, span: tuple[float, float]) -> np.ndarray:
    """The places of ``values`` on an axis, 0 below and 1 above; NaN for no value."""
    low, high = span
    share = (np.where(np.isfinite(values), values, np.nan) / 2 - low / 2) / (high / 2 - low / 2)
    return share


def _alone(heights: np.ndarray) -> np.ndarray:
    """The ``heights`` ``(n, k)`` without a known neighbour; the others NaN."""
    known = np.pad(~np.isnan(heights), ((0, 0), (1, 1)))
    return np.where(known[:, :-2] | known[:, 2:], np.nan, heights)


def credit(run: Run, ax: Axes | None = None) -> Axes:
    """Draw the success of each operator as bars. The bars count the births of the operator, the
    births that survived at least one generation, and the births that entered the archive. A text
    beside the bars gives the percentage of the living individuals' ancestors that the operator
    bred.

    Raises `RunError` if the run does not record its goals.
    """
    births_of(run)  # raises for an object that is not a run
    names, columns = run.operator_credit
    ax = style.panel(ax, 8.0, 1.3 + 0.42 * len(names))
    places = np.arange(len(names))
    counts = columns["births"]
    ax.barh(places, counts, 0.74, color=style.OTHERS, alpha=0.55, label="births")
    ax.barh(places, columns["survived"], 0.5, color=style.FIRST, label="survived")
    ax.barh(places, columns["entered"], 0.26, color=style.LIVING, label="entered the archive")
    for place in places:
        parts = [f"{100 * columns['survived'][place] / counts[place]:.0f} % survived"]
        parts += [f"{100 * columns['ancestors'][place]:.0f} % of the ancestors of the living"]
        if columns["failed"][place]:
            parts.append(f"{columns['failed'][place]} failed")
        ax.annotate(", ".join(parts), (counts[place], place), (5, 0), va="center",
                    textcoords="offset points", **style.FAINT_TEXT)  # fmt: skip
    ax.set_yticks(
        places, [style.fold(name.replace("_", " ")) for name in names], fontsize=style.PLAIN
    )
    ax.invert_yaxis()
    ax.grid(False, axis="y")
    ax.set_xlim(0, counts.max() * 1.7)
    ax.locator_params(axis="x", integer=True, nbins=6)
    style.name_axes(ax, "births")
    style.key(ax, ax.containers, columns=3, loc="lower left", bbox_to_anchor=(0, 1.02))
    return ax
