"""Many births side by side: first and last population, parallel coordinates, operators."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from evocity.analysis import Aim, Run
from evocity.analysis.births import Told
from evocity.analysis.credit import credit_of
from evocity.analysis.pedigree import Pedigree
from evocity.plot.chosen import aims_on, rows_of, told_of, worded
from evocity.plot.generations import wanted_lines
from evocity.plot.style import (
    BROKEN,
    FAINTS,
    FIRST,
    INKS,
    LIVING,
    OTHERS,
    PLAIN,
    SMALL,
    Panels,
    folded,
    key,
    name_axes,
    note,
    panel,
    panels,
    plain,
    shared_key,
)

_BINS = 24


def first_and_last(
    run: Run, measures: str | Sequence[str] | None = None, ax: object = None
) -> Panels:
    """How each measure is distributed in the first population and in the last, a panel each: of
    those that keep the constraints, how many have which value; medians as marks above, target and
    bounds dashed.

    measures : names; all that something was wanted of unless they are given.
    ax : as many of matplotlib's axes.

    Raises `RunError` for a measure that the run does not log.
    """
    told = told_of(run)
    aims = aims_on(told, measures)
    axes = panels(len(aims), ax)
    living = [told.rows(np.unique(told.run.members(n)["id"].to_numpy())) for n in (0, told.last)]
    for one, aim in zip(axes, aims, strict=True):
        values = [told.value(aim.name)[rows] for rows in living]
        values = [v[told.feasible[r] & np.isfinite(v)] for v, r in zip(values, living, strict=True)]
        together = np.concatenate(values)
        if not len(together):
            note(one, "nobody in them has a value, and keeps the constraints")
        else:
            edges = np.linspace(*_span(together), _BINS + 1)
            one.hist(values[0], edges, color=FIRST, alpha=0.45)
            one.hist(values[1], edges, color=LIVING, alpha=0.75, histtype="step", linewidth=1.6)
            for some, colour in zip(values, (FIRST, LIVING), strict=True):
                if len(some):
                    one.plot(np.median(some), 1, marker=7, color=colour, markersize=8,
                             transform=one.get_xaxis_transform(), clip_on=False)  # fmt: skip
        wanted_lines(one, aim, upright=True)
        one.locator_params(axis="y", nbins=5, integer=True)
        name_axes(one, folded(worded(aim), 40), "individuals")
    lost = [int(np.count_nonzero(~told.feasible[rows])) for rows in living]
    names = [
        f"{name}, generation {n}" + (f", {gone} that break a constraint left out" if gone else "")
        for name, n, gone in zip(("first", "last"), (0, told.last), lost, strict=True)
    ]
    handles = [
        Patch(color=FIRST, alpha=0.45, label=names[0]),
        Patch(edgecolor=LIVING, facecolor="none", linewidth=1.6, label=names[1]),
        Line2D([], [], color=INKS, linestyle="", marker=7, label="median"),
    ]
    shared_key(axes, handles)
    return axes


def _span(values: np.ndarray) -> tuple[float, float]:
    """From the least to the largest of some finite ``values``; around them where all are alike."""
    low, high = float(values.min()), float(values.max())
    if high - low <= 1e-9 * max(abs(low), abs(high)):
        air = 0.05 * abs(low) or 0.5
        return low - air, high + air
    return low, high


def parallel(
    run: Run,
    of: object = None,
    measures: str | Sequence[str] | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Parallel coordinates: a line an individual, an upright axis a measure, whose better end is
    above where one is known. Those that keep the constraints are coloured by the first measure;
    those that break one are grey and dotted.

    of : a frame of births, ids or individuals; who lives unless it is given.
    measures : names; all that something was wanted of unless they are given.

    Raises `RunError` for a measure that the run does not log, and an id that is no birth's.
    """
    told = told_of(run)
    aims = aims_on(told, measures)
    rows = rows_of(told, of, told.ids[told.alive])
    width = min(10.0, max(5.0, 1.6 * len(aims)))
    ax = panel(ax, width, 4.2)
    spans = [_span_of(told, aim, rows) for aim in aims]
    heights = np.column_stack([
        _height(told.value(aim.name)[rows], span) for aim, span in zip(aims, spans, strict=True)
    ])  # fmt: skip
    lines = [np.column_stack([np.arange(len(aims)), one]) for one in heights]
    kept = told.feasible[rows]
    faint = float(np.clip(30 / max(1, len(rows)), 0.25, 0.85))
    for which, dotted in ((~kept, True), (kept, False)):
        some = [lines[n] for n in np.flatnonzero(which)]
        if not some:
            continue
        drawn = LineCollection(some, linewidth=1.1, alpha=faint, zorder=2 + (not dotted))
        if dotted:
            drawn.set(color=BROKEN, linestyle=":", label="breaks a constraint")
        else:
            drawn.set(array=np.nan_to_num(heights[which, 0], nan=0.0), cmap=_two_colours())
            drawn.set_clim(0, 1)
        ax.add_collection(drawn)
        # a value between two that are missing is no line
        alone = heights[which] if len(aims) == 1 else _alone(heights[which])
        y, x = alone[~np.isnan(alone)], np.nonzero(~np.isnan(alone))[1]
        ax.plot(x, y, linestyle="", marker="_", color=BROKEN if dotted else LIVING, markersize=5)
    if not len(rows):
        note(ax, "no individual")
    for place, (low, high) in enumerate(spans):
        ax.axvline(place, color=FAINTS, linewidth=0.8, zorder=1)
        ends = ((low, 0, -4, "top"), (high, 1, 4, "bottom"))
        for value, y, away, where in ends:
            ax.annotate(f"{value:.3g}", (place, y), (0, away), textcoords="offset points",
                        ha="center", va=where, fontsize=SMALL, color=INKS)  # fmt: skip
    ax.set_xlim(-0.3, len(aims) - 0.7)
    ax.set_ylim(-0.09, 1.09)
    ax.set_yticks([])
    ax.grid(False)
    ax.spines["left"].set_visible(False)
    ax.spines["bottom"].set_visible(False)
    size = PLAIN if len(aims) < 8 else SMALL
    letters = max(9, int((width - 0.8) / len(aims) * 72 / (0.68 * size)))
    names = [folded(worded(aim), letters) for aim in aims]
    ax.set_xticks(range(len(aims)), names, fontsize=size, color=INKS)
    ax.tick_params(axis="x", length=0, pad=2)
    kept_told = f"{np.count_nonzero(kept)} that keep the constraints"
    told_too = f", {np.count_nonzero(~kept)} that break one dotted" if not kept.all() else ""
    where = f", coloured by {aims[0].name}" if kept.any() else ""
    ax.set_title(plain(kept_told + told_too + where), fontsize=PLAIN, color=FAINTS, loc="left")
    return ax


def _two_colours():
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("blue to red", [FIRST, OTHERS, LIVING])


def _span_of(told: Told, aim: Aim, rows: np.ndarray) -> tuple[float, float]:
    """The values at the lower and at the upper end of a measure's axis: the better above."""
    values = told.value(aim.name)[rows]
    values = values[np.isfinite(values)]
    low, high = _span(values) if len(values) else (0.0, 1.0)
    less = aim.goal == "min" or (aim.goal == "bounds" and aim.low is None)
    return (high, low) if less and aim.target is None else (low, high)


def _height(values: np.ndarray, span: tuple[float, float]) -> np.ndarray:
    """Where ``values`` lie along an axis, 0 below and 1 above; NaN where there is none."""
    low, high = span
    share = (np.where(np.isfinite(values), values, np.nan) / 2 - low / 2) / (high / 2 - low / 2)
    return share


def _alone(heights: np.ndarray) -> np.ndarray:
    """Those ``heights`` ``(n, k)`` of which neither neighbour is known; the others NaN."""
    known = np.pad(~np.isnan(heights), ((0, 0), (1, 1)))
    return np.where(known[:, :-2] | known[:, 2:], np.nan, heights)


def credit(run: Run, ax: Axes | None = None) -> Axes:
    """Which operators paid: of each how many births there were, how many of these lived in a
    generation at least, and how many no birth before them dominated; its share of all from whom
    the living descend, in words.

    Raises `RunError` where the run does not tell what it wanted.
    """
    told = told_of(run)
    names, columns = credit_of(told, Pedigree(told))
    ax = panel(ax, 8.0, 1.3 + 0.42 * len(names))
    places = np.arange(len(names))
    births = columns["births"]
    ax.barh(places, births, 0.74, color=OTHERS, alpha=0.55, label="births")
    ax.barh(places, columns["survived"], 0.5, color=FIRST, label="lived on")
    ax.barh(places, columns["entered"], 0.26, color=LIVING, label="entered the archive")
    for place in places:
        told_of_it = [f"{columns['survived'][place] / births[place]:.0%} lived on"]
        told_of_it += [f"{columns['ancestors'][place]:.0%} of the ancestors of the living"]
        if columns["failed"][place]:
            told_of_it.append(f"{columns['failed'][place]} failed")
        ax.annotate(", ".join(told_of_it), (births[place], place), (5, 0), va="center",
                    textcoords="offset points", fontsize=SMALL, color=FAINTS)  # fmt: skip
    ax.set_yticks(places, [folded(name.replace("_", " ")) for name in names], fontsize=PLAIN)
    ax.invert_yaxis()
    ax.grid(False, axis="y")
    ax.set_xlim(0, births.max() * 1.7)
    ax.locator_params(axis="x", integer=True, nbins=6)
    name_axes(ax, "births")
    key(ax, ax.containers, columns=3, loc="lower left", bbox_to_anchor=(0, 1.02))
    return ax


__all__ = ["credit", "first_and_last", "parallel"]
