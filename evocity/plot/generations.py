"""Curves over the generations: measures, hypervolume, diversity."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import PercentFormatter

from evocity.analysis import Aim, Run
from evocity.analysis.births import Births
from evocity.analysis.likeness import Likeness
from evocity.analysis.series import diversity_of, series_of
from evocity.errors import RunError
from evocity.genome import VOID, Genome
from evocity.genome.nucleotides import unpacked
from evocity.plot import style
from evocity.plot.births import aims_on, axis_label, births_of
from evocity.plot.style import Panels
from evocity.selection.fronts import Hypervolume, not_dominated, volume_is_quick

#: Quantiles of the living between which bands are drawn.
QUANTILES = (0.0, 0.25, 0.5, 0.75, 1.0)
# Generations that are computed where each takes long, at most.
_COMPUTED = 25
# Points of those that break a constraint, at most.
_MOST_POINTS = 3000


def objectives(run: Run, measures: str | Sequence[str] | None = None, ax: object = None) -> Panels:
    """Draw the values of each measure over the generations, with one panel per measure. A panel
    shows the range, the middle half, the median and the best value of the living individuals. Each
    panel considers only individuals that keep the constraints; crosses mark individuals that break
    a constraint. Dashed lines show the target and the bounds of the measure. A dotted line shows
    the median of the first population.

    measures : names of the measures to draw; by default the measures with a goal or bounds.
    ax : axes of matplotlib, one for each measure; by default the function makes new axes.

    Raises `RunError` if the run does not log a measure.
    """
    births = births_of(run)
    aims = aims_on(births, measures)
    axes = style.panels(len(aims), ax)
    for one, aim in zip(axes, aims, strict=True):
        _objective(one, births, aim)
    handles = [
        Patch(color=style.OTHERS, alpha=0.35, label="the living that keep the constraints"),
        Patch(color=style.OTHERS, alpha=0.8, label="the middle half of them"),
        Line2D([], [], color=style.INKS, label="median"),
        Line2D([], [], color=style.LIVING, label="best"),
        Line2D([], [], color=style.FIRST, linestyle=":", label="median of the first"),
    ]
    if not births.feasible[births.lives[1]].all():
        handles.append(_crosses([], []))
    style.shared_key(axes, handles)
    return axes


def _objective(ax: Axes, births: Births, aim: Aim) -> None:
    born, rows = births.lives
    values = births.value(aim.name)[rows]
    kept = births.feasible[rows] & np.isfinite(values)
    bands = quantiles(born[kept], values[kept], births.last + 1)
    spans = np.arange(births.last + 1.0)
    if not births.last:  # a single generation has a width of its own
        spans, bands = np.array([-0.4, 0.4]), bands.repeat(2, axis=1)
    ax.fill_between(spans, bands[0], bands[4], color=style.OTHERS, alpha=0.35, linewidth=0)
    ax.fill_between(spans, bands[1], bands[3], color=style.OTHERS, alpha=0.8, linewidth=0)
    ax.plot(spans, bands[2], color=style.INKS, linewidth=1.3)
    if (best := _best(aim, born[kept], values[kept], births.last + 1)) is not None:
        ax.plot(spans, best if births.last else best.repeat(2), color=style.LIVING, linewidth=1.6)
    if np.isfinite(bands[2, 0]):
        ax.axhline(bands[2, 0], color=style.FIRST, linestyle=":", linewidth=1)
    lost = np.flatnonzero(~births.feasible[rows] & np.isfinite(values))
    lost = lost[:: max(1, -(-len(lost) // _MOST_POINTS))]
    if len(lost):
        ax.add_line(_crosses(born[lost], values[lost]))
    if not (kept.any() or len(lost)):
        style.note(ax, "none of the living has a value")
    wanted_lines(ax, aim)
    style.whole_numbers(ax)
    ax.margins(x=0.02)
    ax.autoscale_view()
    style.name_axes(ax, "generation", style.fold(axis_label(aim)))


def _crosses(x, y) -> Line2D:
    return Line2D(x, y, color=style.BROKEN, linestyle="", marker="x", markersize=3, alpha=0.6,
                  markeredgewidth=0.7, label="breaks a constraint")  # fmt: skip


def wanted_lines(ax: Axes, aim: Aim, upright: bool = False) -> None:
    """Draw target and bounds of a measure, dashed, across the y axis, or x if ``upright``."""
    for value in (aim.target, aim.low, aim.high):
        if value is not None and abs(value) < 1e300:
            draw = ax.axvline if upright else ax.axhline
            draw(value, color=style.INKS, linestyle=(0, (4, 3)), linewidth=0.9)


def quantiles(born: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """Return `QUANTILES` of the ``values`` of each generation, float64 ``(len(QUANTILES),
    count)``."""
    values_at = np.full((len(QUANTILES), count), np.nan)
    order = np.argsort(born, kind="stable")
    parts = np.split(values[order], np.searchsorted(born[order], np.arange(1, count)))
    for generation, part in enumerate(parts):
        if len(part):
            values_at[:, generation] = np.quantile(part, QUANTILES)
    return values_at


def _best(aim: Aim, born: np.ndarray, values: np.ndarray, count: int) -> np.ndarray | None:
    """The best value of each generation, None for a measure without a known goal."""
    if aim.target is None and aim.goal not in ("max", "min"):
        return None
    losses = np.abs(values - aim.target) if aim.target is not None else values
    losses = -losses if aim.target is None and aim.goal == "max" else losses
    best = np.full(count, np.nan)
    order = np.lexsort((losses, born))
    which, first = np.unique(born[order], return_index=True)
    best[which] = values[order][first]
    return best


def convergence(run: Run, ax: Axes | None = None) -> Axes:
    """Draw the hypervolume over the generations, in units of the ranges of the first population.
    The first curve shows the hypervolume of the living individuals. The second curve shows the
    hypervolume of the archive of all births so far.

    The function leaves out the curve of the archive if computing its exact volumes would take
    minutes.
    """
    births = births_of(run)
    ax = style.panel(ax)
    series = series_of(births)
    marker = "o" if len(series["generation"]) < 2 else ""
    ax.plot(series["generation"], series["hypervolume"], color=style.LIVING, marker=marker,
            label="the living")  # fmt: skip
    try:
        at, volumes = _archive_volumes(births)
        ax.plot(at, volumes, color=style.INKS, linestyle="--", marker=marker and "s", markersize=4,
                label="the archive: all births until then")  # fmt: skip
    except RunError:  # the run does not record its goals
        pass
    if not any(np.isfinite(line.get_ydata()).any() for line in ax.lines):
        style.note(ax, "no birth keeps the constraints yet")
    style.whole_numbers(ax)
    style.name_axes(ax, "generation", "hypervolume, in ranges of the first population")
    style.key(ax, ax.lines, loc="lower right")
    return ax


def _archive_volumes(births: Births) -> tuple[np.ndarray, np.ndarray]:
    """Some generations, and the hypervolume of the archive in each."""
    losses, kept, born = births.losses, births.feasible, births.generation
    first = losses[births.ok & (born == 0)]
    if not len(first):
        return np.zeros(0), np.zeros(0)
    volume, front, volumes = Hypervolume(first), np.empty((0, losses.shape[1])), []
    most = 4 * _COMPUTED if losses.shape[1] < 5 else _COMPUTED // 4  # each may take a second
    at = np.unique(np.linspace(0, births.last, most).round().astype(int))
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
    """Draw the diversity of the living individuals over the generations. The first curve is the
    share of the map on which the heights of two individuals differ by more than a storey. The first
    curve is a mean over all pairs of living individuals. The second curve is the share of the map
    whose fabric lies at the same place as in the source city. For a long run, the plot shows only
    some generations, evenly spaced."""
    births = births_of(run)
    ax = style.panel(ax)
    at, apart = diversity_of(births, Likeness(births), "looks", _COMPUTED)
    marker = "o" if len(at) < 2 else ""
    ax.plot(at, apart, color=style.LIVING, marker=marker, label="two of the living differ")
    ax.plot(at, _placed(births, at), color=style.FIRST, linestyle="--", marker=marker and "s",
            label="stones in their place")  # fmt: skip
    ax.set_ylim(0, 1)
    style.whole_numbers(ax)
    ax.yaxis.set_major_formatter(PercentFormatter(1, 0))
    style.name_axes(ax, "generation", "share of the map, mean of the living")
    style.key(ax, ax.lines, loc="lower left", bbox_to_anchor=(0, 1.02), columns=2)
    return ax


def _placed(births: Births, at: np.ndarray) -> np.ndarray:
    """The mean share of stones in their place, of the living of some generations."""
    born, rows = births.lives
    seen = np.isin(born, at)
    born, rows = born[seen], rows[seen]
    known, where = np.unique(rows, return_inverse=True)
    ids, shares = births.ids[known].tolist(), np.full(len(known), np.nan)
    for start in range(0, len(ids), 64):
        for n, birth in enumerate(births.run.individuals(ids[start : start + 64]), start):
            fabric = birth.genome and births.run.header.chromosome.fabric(birth.genome)
            shares[n] = np.nan if fabric is None else in_place(fabric)
    parts = [shares[where[born == generation]] for generation in at]
    return np.array([part[~np.isnan(part)].mean() if len(part) else np.nan for part in parts])


def in_place(genome: Genome) -> float:
    """Return the share of the map whose stones lie where they lie in their city, not turned."""
    top, left = genome.pavement.corners
    row, column = unpacked(genome.source)
    own = (row == top) & (column == left) & (genome.turn == 0)
    own &= np.array([city != VOID for city in genome.cities])[genome.parent]
    area = genome.pavement.area
    return float((own * genome.part * area).sum() / area.sum())
