"""What happened from generation to generation: measures, hypervolume, diversity."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import PercentFormatter

from evocity.analysis import Aim, Run
from evocity.analysis.births import Told
from evocity.analysis.likeness import Likeness
from evocity.analysis.series import series_of
from evocity.analysis.spread import diversity_of
from evocity.errors import RunError
from evocity.genome import VOID, Genome
from evocity.genome.nucleotides import unpacked
from evocity.plot.chosen import aims_on, told_of, worded
from evocity.plot.style import (
    BROKEN,
    FIRST,
    INKS,
    LIVING,
    OTHERS,
    Panels,
    folded,
    key,
    name_axes,
    note,
    panel,
    panels,
    shared_key,
    whole_numbers,
)
from evocity.search.fronts import Hypervolume, not_dominated, volume_is_quick

#: Shares of the living between whose values bands are drawn.
QUANTILES = (0.0, 0.25, 0.5, 0.75, 1.0)
# Generations that are looked at where each takes its time, at most.
_LOOKED_AT = 25
# Points of those that break a constraint, at most.
_MOST_POINTS = 3000


def objectives(run: Run, measures: str | Sequence[str] | None = None, ax: object = None) -> Panels:
    """Each measure over the generations, a panel each: of the living that keep the constraints the
    range, the middle half, the median and the best; those that break one as crosses; target and
    bounds as dashed lines, the median of the first population as a dotted one.

    measures : names; all that something was wanted of unless they are given.
    ax : as many of matplotlib's axes.

    Raises `RunError` for a measure that the run does not log.
    """
    told = told_of(run)
    aims = aims_on(told, measures)
    axes = panels(len(aims), ax)
    for one, aim in zip(axes, aims, strict=True):
        _objective(one, told, aim)
    handles = [
        Patch(color=OTHERS, alpha=0.35, label="the living that keep the constraints"),
        Patch(color=OTHERS, alpha=0.8, label="the middle half of them"),
        Line2D([], [], color=INKS, label="median"),
        Line2D([], [], color=LIVING, label="best"),
        Line2D([], [], color=FIRST, linestyle=":", label="median of the first"),
    ]
    if not told.feasible[told.lives[1]].all():
        handles.append(_crosses([], []))
    shared_key(axes, handles)
    return axes


def _objective(ax: Axes, told: Told, aim: Aim) -> None:
    born, rows = told.lives
    values = told.value(aim.name)[rows]
    kept = told.feasible[rows] & np.isfinite(values)
    bands = quantiles(born[kept], values[kept], told.last + 1)
    spans = np.arange(told.last + 1.0)
    if not told.last:  # one generation is as wide as one
        spans, bands = np.array([-0.4, 0.4]), bands.repeat(2, axis=1)
    ax.fill_between(spans, bands[0], bands[4], color=OTHERS, alpha=0.35, linewidth=0)
    ax.fill_between(spans, bands[1], bands[3], color=OTHERS, alpha=0.8, linewidth=0)
    ax.plot(spans, bands[2], color=INKS, linewidth=1.3)
    if (best := _best(aim, born[kept], values[kept], told.last + 1)) is not None:
        ax.plot(spans, best if told.last else best.repeat(2), color=LIVING, linewidth=1.6)
    if np.isfinite(bands[2, 0]):
        ax.axhline(bands[2, 0], color=FIRST, linestyle=":", linewidth=1)
    lost = np.flatnonzero(~told.feasible[rows] & np.isfinite(values))
    lost = lost[:: max(1, -(-len(lost) // _MOST_POINTS))]
    if len(lost):
        ax.add_line(_crosses(born[lost], values[lost]))
    if not (kept.any() or len(lost)):
        note(ax, "none of the living has a value")
    wanted_lines(ax, aim)
    whole_numbers(ax)
    ax.margins(x=0.02)
    ax.autoscale_view()
    name_axes(ax, "generation", folded(worded(aim)))


def _crosses(x, y) -> Line2D:
    return Line2D(x, y, color=BROKEN, linestyle="", marker="x", markersize=3, alpha=0.6,
                  markeredgewidth=0.7, label="breaks a constraint")  # fmt: skip


def wanted_lines(ax: Axes, aim: Aim, upright: bool = False) -> None:
    """The target and the bounds of a measure, dashed, across axes whose y it is, or whose x."""
    for value in (aim.target, aim.low, aim.high):
        if value is not None and abs(value) < 1e300:
            draw = ax.axvline if upright else ax.axhline
            draw(value, color=INKS, linestyle=(0, (4, 3)), linewidth=0.9)


def quantiles(born: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """Float64 ``(len(QUANTILES), count)``: of the finite ``values`` of those that lived in each
    generation; NaN where there is none."""
    found = np.full((len(QUANTILES), count), np.nan)
    order = np.argsort(born, kind="stable")
    parts = np.split(values[order], np.searchsorted(born[order], np.arange(1, count)))
    for generation, part in enumerate(parts):
        if len(part):
            found[:, generation] = np.quantile(part, QUANTILES)
    return found


def _best(aim: Aim, born: np.ndarray, values: np.ndarray, count: int) -> np.ndarray | None:
    """The best value of each generation, None where nobody knows what is better."""
    if aim.target is None and aim.goal not in ("max", "min"):
        return None
    losses = np.abs(values - aim.target) if aim.target is not None else values
    losses = -losses if aim.target is None and aim.goal == "max" else losses
    found = np.full(count, np.nan)
    order = np.lexsort((losses, born))
    which, first = np.unique(born[order], return_index=True)
    found[which] = values[order][first]
    return found


def convergence(run: Run, ax: Axes | None = None) -> Axes:
    """The hypervolume over the generations, in units of the first population's ranges: of the
    living, and of the archive, of all births until then those that no other dominates.

    Where exact volumes of so many births and goals would take minutes, the archive's are left out.
    """
    told = told_of(run)
    ax = panel(ax)
    series = series_of(told)
    marker = "o" if len(series["generation"]) < 2 else ""
    ax.plot(series["generation"], series["hypervolume"], color=LIVING, marker=marker,
            label="the living")  # fmt: skip
    try:
        at, volumes = _archive_volumes(told)
        ax.plot(at, volumes, color=INKS, linestyle="--", marker=marker and "s", markersize=4,
                label="the archive: all births until then")  # fmt: skip
    except RunError:  # it does not tell what it wanted
        pass
    if not any(np.isfinite(line.get_ydata()).any() for line in ax.lines):
        note(ax, "no birth keeps the constraints yet")
    whole_numbers(ax)
    name_axes(ax, "generation", "hypervolume, in ranges of the first population")
    key(ax, ax.lines, loc="lower right")
    return ax


def _archive_volumes(told: Told) -> tuple[np.ndarray, np.ndarray]:
    """Some generations, and the hypervolume of the archive in each."""
    losses, kept, born = told.losses, told.feasible, told.generation
    first = losses[told.ok & (born == 0)]
    if not len(first):
        return np.zeros(0), np.zeros(0)
    volume, front, volumes = Hypervolume(first), np.empty((0, losses.shape[1])), []
    looked = 4 * _LOOKED_AT if losses.shape[1] < 5 else _LOOKED_AT // 4  # each may take a second
    at = np.unique(np.linspace(0, told.last, looked).round().astype(int))
    before = -1
    for generation in at:
        new = losses[kept & (before < born) & (born <= generation)]
        front = np.vstack([front, new])
        front = front[not_dominated(front)]
        quick = volume_is_quick(*front.shape)
        volumes.append((volume(front) if len(front) else 0.0) if quick else np.nan)
        before = generation
    return at, np.array(volumes)


def diversity(run: Run, ax: Axes | None = None) -> Axes:
    """How much the living differ, over the generations: the share of the map in which two of them
    differ by more than a storey, in the mean of all pairs; and the share of their stones that lie
    where they lie in their city. Of a long run some generations, evenly."""
    told = told_of(run)
    ax = panel(ax)
    at, apart = diversity_of(told, Likeness(told), "looks", _LOOKED_AT)
    marker = "o" if len(at) < 2 else ""
    ax.plot(at, apart, color=LIVING, marker=marker, label="two of the living differ")
    ax.plot(at, _placed(told, at), color=FIRST, linestyle="--", marker=marker and "s",
            label="stones in their place")  # fmt: skip
    ax.set_ylim(0, 1)
    whole_numbers(ax)
    ax.yaxis.set_major_formatter(PercentFormatter(1, 0))
    name_axes(ax, "generation", "share of the map, mean of the living")
    key(ax, ax.lines, loc="lower left", bbox_to_anchor=(0, 1.02), columns=2)
    return ax


def _placed(told: Told, at: np.ndarray) -> np.ndarray:
    """Of some generations the mean share of stones of the living that lie in their place."""
    born, rows = told.lives
    seen = np.isin(born, at)
    born, rows = born[seen], rows[seen]
    known, where = np.unique(rows, return_inverse=True)
    ids, shares = told.ids[known].tolist(), np.full(len(known), np.nan)
    for start in range(0, len(ids), 64):
        for n, birth in enumerate(told.run.individuals(ids[start : start + 64]), start):
            fabric = birth.genome and told.run.header.chromosome.fabric(birth.genome)
            shares[n] = np.nan if fabric is None else in_place(fabric)
    parts = [shares[where[born == generation]] for generation in at]
    return np.array([part[~np.isnan(part)].mean() if len(part) else np.nan for part in parts])


def in_place(genome: Genome) -> float:
    """The share of the map whose stones lie where they lie in their city, not turned."""
    top, left = genome.pavement.corners
    row, column = unpacked(genome.source)
    own = (row == top) & (column == left) & (genome.turn == 0)
    own &= np.array([city != VOID for city in genome.cities])[genome.parent]
    area = genome.pavement.area
    return float((own * genome.part * area).sum() / area.sum())


__all__ = ["QUANTILES", "convergence", "diversity", "in_place", "objectives", "quantiles"]
