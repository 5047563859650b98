"""The births over their measures, and how good the living were in each generation: drawings."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from markupsafe import Markup

from evocity.analysis.wanted import Aim
from evocity.pages import number
from evocity.report.facts import Facts
from evocity.report.islands import Islands
from evocity.report.plots import Axis, Dots, curve, scatter

#: Of later births, no more dots than this in a plot; and no more plots of pairs than this.
_MOST_DOTS, _MOST_PAIRS = 2000, 6


@dataclass(frozen=True)
class Front:
    """Values for the section of the front."""

    facts: Facts

    @property
    def pairs(self) -> int:
        """How many pairs of measures there are."""
        count = len(self.facts.told.aims)
        return count * (count - 1) // 2

    @property
    def plots(self) -> list[Markup]:
        """One a pair that is shown; of a single measure one over the generations."""
        facts = self.facts
        pairs = pairs_to_show(facts) if len(facts.told.aims) > 1 else [(None, 0)]
        return [_plot(facts, x, y) for x, y in pairs]

    @property
    def breaks(self) -> bool:
        """Whether a dot stands for one that breaks a constraint."""
        return bool((self.facts.told.ok & ~self.facts.told.feasible).any())


def pairs_to_show(facts: Facts) -> list[tuple[int, int]]:
    """Pairs of measures (indices): all of up to four; of more, those of goals before those with a
    bound alone, and then those most in conflict.

    Conflict of two measures is the negative correlation of their losses over the last
    generation, or over all births where that one is too small.
    """
    every = list(combinations(range(len(facts.told.aims)), 2))
    if len(every) <= _MOST_PAIRS:
        return every
    told = facts.told
    where = np.isin(told.ids, [row["id"] for row in facts.members]) & told.ok
    if where.sum() < 3:
        where = told.ok
    losses = np.array([aim.losses(told.value(aim.name)[where]) for aim in told.aims])
    losses /= np.maximum(np.abs(losses).max(axis=1, keepdims=True), 1e-300)  # no sum overflows
    centred = losses - losses.mean(axis=1, keepdims=True)
    length = np.maximum(np.sqrt((centred**2).sum(axis=1)), 1e-300)
    correlation = (centred / length[:, None]) @ (centred / length[:, None]).T
    bounds = {i for i, aim in enumerate(facts.told.aims) if not aim.sought}
    every.sort(key=lambda pair: (bool(bounds.intersection(pair)), correlation[pair]))
    return sorted(every[:_MOST_PAIRS])


def _plot(facts: Facts, x: int | None, y: int) -> Markup:
    """Measure ``y`` over measure ``x``; over the generation of birth where ``x`` is None. Those
    that break a constraint are crosses, beneath all others."""
    ids, born, measured = facts.told.ids, facts.told.generation, facts.told.values
    across = born if x is None else measured[:, x]
    shown = {one.birth.id for one in facts.shown}

    def dots(where, kind, radius, titles=True, links=False):
        told = [_title(facts, ids[i], measured[i]) for i in where] if titles else ()
        links = [f"#i{one}" for one in ids[where]] if links and shown.issuperset(ids[where]) else ()
        points = across[where].astype(float), measured[where, y]
        return Dots(*points, kind, radius, told, links)

    layers = []
    for end, kept in ((" broken", ~facts.told.feasible), ("", facts.told.feasible)):
        here = facts.told.ok & kept
        front = here & np.isin(ids, facts.front)
        later = np.flatnonzero(here & (born > 0) & ~front)
        later = later[:: max(1, -(-len(later) // _MOST_DOTS))]
        layers += [
            dots(later, f"later{end}", 1.8, False),
            dots(np.flatnonzero(here & (born == 0)), f"first{end}", 3),
            dots(np.flatnonzero(front), f"front{end}", 4, links=True),
        ]
    horizontal = Axis("generation") if x is None else _axis(facts.told.aims[x])
    return scatter(layers, horizontal, _axis(facts.told.aims[y]))


def _title(facts: Facts, identifier: int, values: np.ndarray) -> str:
    told = (f"{a.name} {number(v, a.unit)}" for a, v in zip(facts.told.aims, values, strict=False))
    return f"{identifier}: {', '.join(told)}"


def _axis(aim: Aim) -> Axis:
    return Axis(aim.name + (f", {aim.unit}" if aim.unit else ""), aim.wanted, aim.target)


def curves(facts: Facts) -> Iterator[Markup]:
    """Hypervolume, what the algorithm tells, and the best of each goal, by generation; none of a
    first population alone."""
    history = facts.told.history
    if len(history) < 2:
        return
    yield curve([about.get("hypervolume") for about in history], Axis("hypervolume"))
    for name in facts.run.header.figures:
        values = [about.get("algorithm", {}).get(name) for about in history]
        yield curve(values, Axis(name.replace("_", " ")))
    for aim in facts.sought:
        best = [about.get("best", {}).get(aim.name) for about in history]
        axis = Axis(f"best {aim.name}" + (f", {aim.unit}" if aim.unit else ""), "", aim.target)
        yield curve(best, axis)


def curves_of(islands: Islands) -> list[Markup]:
    """The hypervolume of each island; none of a first population alone."""
    if len(islands.facts.told.history) < 2:
        return []
    return [curve(values, Axis(f"hypervolume of {name}")) for name, values in islands.volumes]


__all__ = ["Front", "curves", "curves_of", "pairs_to_show"]
