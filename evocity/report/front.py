"""Plots of the front, of all births over their measures, and curves over the generations."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from markupsafe import Markup

from evocity.analysis import Run
from evocity.analysis.births import Births
from evocity.analysis.goals import Aim
from evocity.report.plots import Axis, Dots, curve, scatter
from evocity.report.shown_births import ShownBirths
from evocity.templates import number

#: Dots of later births in a plot, and plots of pairs of measures, at most.
_MOST_DOTS, _MOST_PAIRS = 2000, 6


@dataclass(frozen=True)
class Front:
    shown: ShownBirths

    @property
    def pairs(self) -> int:
        count = len(self.shown.births.aims)
        return count * (count - 1) // 2

    @property
    def plots(self) -> list[Markup]:
        """A plot of each pair that is shown; of a single measure one over the generations."""
        births = self.shown.births
        pairs = pairs_to_show(births) if len(births.aims) > 1 else [(None, 0)]
        return [_plot(self.shown, x, y) for x, y in pairs]

    @property
    def breaks(self) -> bool:
        """Whether a dot stands for a birth that breaks a constraint."""
        return bool((self.shown.births.ok & ~self.shown.births.feasible).any())


def pairs_to_show(births: Births) -> list[tuple[int, int]]:
    """Choose pairs of measures, by their indices: all of up to four measures; of more, first pairs
    of goals, then those with the lowest correlation of their losses over the last generation."""
    every = list(combinations(range(len(births.aims)), 2))
    if len(every) <= _MOST_PAIRS:
        return every
    where = births.alive & births.ok
    if where.sum() < 3:
        where = births.ok
    losses = np.array([aim.losses(births.value(aim.name)[where]) for aim in births.aims])
    losses /= np.maximum(np.abs(losses).max(axis=1, keepdims=True), 1e-300)  # no sum overflows
    centred = losses - losses.mean(axis=1, keepdims=True)
    length = np.maximum(np.sqrt((centred**2).sum(axis=1)), 1e-300)
    correlation = (centred / length[:, None]) @ (centred / length[:, None]).T
    bounds = {i for i, aim in enumerate(births.aims) if not aim.sought}
    every.sort(key=lambda pair: (bool(bounds.intersection(pair)), correlation[pair]))
    return sorted(every[:_MOST_PAIRS])


def _plot(shown: ShownBirths, x: int | None, y: int) -> Markup:
    """Measure ``y`` over measure ``x``, or over the generation of birth where ``x`` is None."""
    births = shown.births
    ids, born, measured = births.ids, births.generation, births.values
    across = born if x is None else measured[:, x]
    cards = {one.birth.id for one in shown.shown}

    def dots(where, kind, radius, titles=True, links=False):
        texts = [_title(births, ids[i], measured[i]) for i in where] if titles else ()
        links = [f"#i{one}" for one in ids[where]] if links and cards.issuperset(ids[where]) else ()
        points = across[where].astype(float), measured[where, y]
        return Dots(*points, kind, radius, texts, links)

    layers = []
    for end, kept in ((" broken", ~births.feasible), ("", births.feasible)):
        here = births.ok & kept
        front = here & np.isin(ids, births.front)
        later = np.flatnonzero(here & (born > 0) & ~front)
        later = later[:: max(1, -(-len(later) // _MOST_DOTS))]
        layers += [
            dots(later, f"later{end}", 1.8, False),
            dots(np.flatnonzero(here & (born == 0)), f"first{end}", 3),
            dots(np.flatnonzero(front), f"front{end}", 4, links=True),
        ]
    horizontal = Axis("generation") if x is None else _axis(births.aims[x])
    return scatter(layers, horizontal, _axis(births.aims[y]))


def _title(births: Births, identifier: int, values: np.ndarray) -> str:
    pairs = zip(births.aims, values, strict=False)
    return f"{identifier}: {', '.join(f'{a.name} {number(v, a.unit)}' for a, v in pairs)}"


def _axis(aim: Aim) -> Axis:
    return Axis(aim.title, aim.wanted, aim.target)


def curves(run: Run) -> Iterator[Markup]:
    """Draw hypervolume, figures and the best of each goal, of several generations."""
    history = run.columns.history
    if len(history) < 2:
        return
    yield curve([about.get("hypervolume") for about in history], Axis("hypervolume"))
    for name in run.header.figures:
        values = [about.get("algorithm", {}).get(name) for about in history]
        yield curve(values, Axis(name.replace("_", " ")))
    for aim in run.columns.sought:
        best = [about.get("best", {}).get(aim.name) for about in history]
        yield curve(best, Axis(f"best {aim.title}", "", aim.target))
