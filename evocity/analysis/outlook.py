"""The outlook of a run: the time left, what more births would bring, and targets and bounds that no
birth has reached, with the help that would reach them."""

from collections.abc import Sequence

import numpy as np

from evocity.analysis.goals import Aim, planned_generations
from evocity.analysis.run import Run
from evocity.analysis.slope import more_births
from evocity.store import RunLog

#: Generations whose pace gives the time left.
_PACE = 8
#: A time left above this, thirty years, comes from a damaged log.
_MOST_SECONDS = 1e9
#: Values reach a target within this share of it, or of the span of all values.
_NEAR = 0.01
#: Measures of how a child mixes its parents: they describe no parent.
_OF_MIXTURES = ("smallest_share",)


def seconds_left(run: RunLog) -> float | None:
    """Estimate the time left of a ``run`` by the pace of its last generations; None without a
    pace."""
    planned, history = planned_generations(run), run.history()
    # the first generation also waited for the workers
    entries = history[1:][-_PACE:] or history
    paces = [float(entry.get("evaluations_per_second") or 0) for entry in entries]
    if planned is None or not paces or not all(paces):
        return None
    population: int = run.header.population
    seconds = sum(population / pace for pace in paces) / len(paces)
    left = max(0, planned - history[-1]["generation"]) * seconds
    return left if left < _MOST_SECONDS else None


def unreachable(run: Run) -> list[str]:
    """List the targets and bounds that no child of a ``run`` has reached, each with the values of
    the parents and with the changes that would help. The list is empty until the run has bred as
    many children as its population has."""
    births = run.columns
    children = ~np.isin(births.ids, births.founders) & births.ok
    if np.count_nonzero(children) < run.header.population:
        return []
    parents = births.rows(births.founders)
    within = {aim.name: aim.within(births.value(aim.name)) for aim in births.aims if aim.bounds}
    texts: list[str] = []
    for aim in births.aims:
        values = births.value(aim.name)
        near = _NEAR * max(abs(aim.target or 0.0), np.ptp(values[births.ok]))
        limits = [(aim.high, True), (aim.low, False)]
        if aim.target is not None:
            limits += [(aim.target + near, True), (aim.target - near, False)]
        missed = [
            _describe_miss(aim, limit, is_upper, values[children], values[parents], bool(within))
            for limit, is_upper in limits
            if limit is not None
        ]
        if aim.target is not None and not any(missed):
            close = children & (np.abs(values - aim.target) <= near)
            missed.append(_describe_guard(f"{_name(aim)} {_goal(aim)}", "near it", within, close))
        texts += filter(None, missed)
    return texts or list(filter(None, [_describe_guard("", "", within, children)]))


def _describe_miss(
    aim: Aim,
    limit: float,
    is_upper: bool,
    children: np.ndarray,
    parents: np.ndarray,
    has_bounds: bool,
) -> str:
    """Say that no child reaches a ``limit`` of an ``aim``; an empty text if one does."""
    sign = 1.0 if is_upper else -1.0
    children, parents = (sign * values[~np.isnan(values)] for values in (children, parents))
    if not children.size or children.min() <= sign * limit:
        return ""
    side, more = ("below", "less") if is_upper else ("above", "more")
    text = f"{_name(aim)} {_goal(aim)} was never {side} {_format(aim, sign * children.min())}."
    helpful = f"another parent with {more} {_name(aim)}"
    if aim.name in _OF_MIXTURES:
        helpful = "more generations"
    elif parents.size and parents.min() > sign * limit:
        text += f" No parent has {more} than {_format(aim, sign * parents.min())}."
    elif parents.size:
        text += f" A parent has {_format(aim, sign * parents.min())}."
        helpful = "more generations"
    more = ", or wider bounds" if has_bounds else ""
    return f"{text} {helpful[0].upper()}{helpful[1:]} would help{more}."


def _describe_guard(
    what: str, where: str, within: dict[str, np.ndarray], births: np.ndarray
) -> str:
    """Name the bound that most of the ``births`` break, if each of them breaks a bound; an empty
    text if one of them keeps all bounds."""
    count = int(np.count_nonzero(births))
    if not within or not count or (np.all(list(within.values()), axis=0) & births).any():
        return ""
    broken = {name: int(np.count_nonzero(births & ~kept)) for name, kept in within.items()}
    name = max(broken, key=broken.__getitem__)
    who = f"each of {count} births {where}" if count > 1 else f"the only birth {where}"
    text = f"{what}: {who}".rstrip() if what else f"{who[0].upper()}{who[1:]}".rstrip()
    most = "All of them break" if broken[name] == count else f"{broken[name]} of them break"
    return (
        f"{text} breaks a bound. {most if count > 1 else 'It breaks'} the bound of "
        f"{name.replace('_', ' ')}. A wider bound there would help, or another parent."
    )


def _name(aim: Aim) -> str:
    return aim.name.replace("_", " ")


def _goal(aim: Aim) -> str:
    return f"({aim.bounds})" if aim.target is None else _format(aim, aim.target)


def _format(aim: Aim, value: float) -> str:
    return f"{value:.3g} {aim.unit}".rstrip()


def outlook(run: Run) -> dict[str, float | Sequence[str] | None]:
    """Return the outlook as plain values: ``seconds_left``, the sentences of `unreachable`, and
    ``more_births``."""
    return {
        "seconds_left": seconds_left(run),
        "unreachable": unreachable(run),
        "more_births": more_births(run),
    }
