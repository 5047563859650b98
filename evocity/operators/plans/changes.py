"""Changes of plans: alleys, closed streets, wider and narrower streets, seams of two plans."""

import json
from collections import OrderedDict
from collections.abc import Iterable, Mapping
from threading import Lock
from typing import Any

import numpy as np

from evocity.errors import MapError, spell
from evocity.operators.plans.changed import Draft, faces_of
from evocity.operators.plans.plan import Plan
from evocity.operators.plans.seams import draw_seam, join
from evocity.operators.plans.street_changes import (
    close_street,
    cut_alley,
    draw_alley,
    draw_closing,
    draw_width,
    move_outline,
)

#: The kinds of changes, by the names in their dicts.
CHANGE_KINDS = ("alley", "closing", "width", "seam")
#: The cache holds so many changed plans, and so many pixels of them, but always two.
_MOST_PLANS, _MOST_PIXELS = 64, 1 << 22
# Attempts to draw a change; a seam tries many exits each time.
_TRIES = {"alley": 12, "closing": 12, "width": 12, "seam": 3}

_DRAWERS = {"alley": draw_alley, "closing": draw_closing, "width": draw_width}
_MAKERS = {"alley": cut_alley, "closing": close_street, "width": move_outline}

# Most levels of seams within seams; children have fewer changes.
_DEEPEST = 64

_cache: OrderedDict[tuple, Plan] = OrderedDict()
_lock = Lock()


def apply_changes(
    plan: Plan, changes: Iterable[Mapping[str, Any]], plans: Mapping[str, Plan] | None = None
) -> Plan:
    """Apply ``changes`` to a plan, one after another.

    A change is a dict with its ``"kind"`` and the parameters of this kind:

    - ``alley``: ``face``, its number; ``row`` and ``column``, a place on the alley, px; ``angle``,
      its direction, radians from east towards south; ``width``, 3 to 6 m. The alley cuts the face
      from street to street.
    - ``closing``: ``faces``, the numbers of two neighbours. The street between them is closed, at
      most 12 m wide from lot to lot.
    - ``width``: ``faces``, one number or two; ``metres``, −4 to −2 or 2 to 4. The lot of the first
      face moves back from its streets by so many metres, or forward if the number is negative. If
      a second face is named, the lot moves only along the street between the two.
    - ``seam``: ``city``, the name of the second plan in ``plans``; ``faces``, the numbers of the
      faces that the second plan replaces. The street along these faces, from frame to frame,
      becomes the seam. ``changes``, if present, are applied to the second plan before.

    Numbers of faces are those of the plan before the change. A face whose pixels and lot stay the
    same keeps its own numbers; `renumbering` finds it in the new plan. The coverage, front and
    frame of another face come from the faces from which it was made, averaged by their lots.
    Buildings in ``heights`` are cut at the outlines of changed lots.

    plans : plans by the names of their cities, for seams. The same arguments give the same plan.
    Raises `MapError` for an unknown kind, a face that is not in the plan, a city without a plan,
    plans of different sizes or pixels, and a change that leaves a dead end or cuts the streets in
    two. A cache keeps recent plans.

    Source: our own.
    """
    for change in changes:
        plan = _apply(plan, change, plans or {}, 0)
    return plan


def renumbering(old: Plan, new: Plan) -> dict[int, int]:
    """Find the faces of a plan that a changed plan keeps: their old and new numbers.

    A face is kept if it has the same pixels and the same lot. About 1 ms at 256².
    """
    if old.labels.shape != new.labels.shape:
        return {}
    many = len(new) + 1
    both = []
    for first, second in ((old.labels, new.labels), (old.lots, new.lots)):
        pairs = first.ravel().astype(np.int64) * many + second.ravel()
        both.append(np.bincount(pairs, minlength=(len(old) + 1) * many).reshape(-1, many))
    labels, lots = both
    row, column = np.nonzero(labels[1:, 1:])
    row, column = row + 1, column + 1
    same = labels[row, column] == labels[row].sum(axis=1)
    same &= labels[row, column] == labels[:, column].sum(axis=0)
    same &= lots[row, column] == lots[row].sum(axis=1)
    same &= lots[row, column] == lots[:, column].sum(axis=0)
    return dict(zip(row[same].tolist(), column[same].tolist(), strict=True))


def draw_change(
    kind: str,
    plan: Plan,
    rng: np.random.Generator,
    plans: Mapping[str, Plan] | None = None,
) -> dict[str, Any] | None:
    """Draw a change of a ``kind`` that suits the plan; None if some attempts find no change.

    ``plans`` holds the second plans for a seam, which draws one of them. Raises `MapError` for an
    unknown kind.
    """
    _check_kind(kind)
    for _ in range(_TRIES[kind]):
        change = draw_seam(plan, rng, plans or {}) if kind == "seam" else _DRAWERS[kind](plan, rng)
        if change is None:
            continue
        try:
            apply_changes(plan, [change], plans)
        except MapError:
            continue
        return change
    return None


def _check_kind(kind: Any) -> str:
    if not isinstance(kind, str) or kind not in CHANGE_KINDS:
        raise MapError(
            f"the change has the kind {spell(kind)}",
            f"one of the kinds {', '.join(CHANGE_KINDS)}",
            "correct the kind",
        )
    return kind


def _apply(plan: Plan, change: Mapping[str, Any], plans: Mapping[str, Plan], depth: int) -> Plan:
    if not isinstance(change, Mapping):
        raise MapError(
            f"a change is {spell(change)}", 'a dict with a "kind"', "correct the list of changes"
        )
    kind = _check_kind(change.get("kind"))
    other = _other_plan(plan, change, plans, depth) if kind == "seam" else None
    key = plan, json.dumps(change, sort_keys=True, default=str), other
    with _lock:
        if key in _cache:
            _cache.move_to_end(key)
            return _cache[key]
    draft = Draft.of(plan)
    try:
        if other is not None:
            join(draft, plan, other, faces_of(plan, change, 1, len(plan)))
        else:
            _MAKERS[kind](draft, plan, change)
    except (KeyError, TypeError, ValueError) as error:
        raise MapError(
            f"the {kind} is {spell(dict(change))}: {error}",
            "the parameters of this kind, as `apply_changes` lists them",
            "correct the change",
        ) from error
    changed = draft.finish(plan, change)
    most = min(_MOST_PLANS, max(2, _MOST_PIXELS // changed.labels.size))
    with _lock:
        _cache[key] = changed
        while len(_cache) > most:
            _cache.popitem(last=False)
    return changed


def _other_plan(plan: Plan, change, plans: Mapping[str, Plan], depth: int) -> Plan:
    """Find the second plan of a seam, with its own changes."""
    city = change.get("city")
    if city not in plans:
        raise MapError(
            f"the seam names the city {spell(city)}",
            f"one of the cities {', '.join(plans) or '(none are given)'}",
            "pass the plan of this city, too",
        )
    other = plans[city]
    for form, first, second in (
        ("metres a pixel", plan.metres_per_pixel, other.metres_per_pixel),
        ("pixels", plan.labels.shape, other.labels.shape),
    ):
        if first != second:
            raise MapError(
                f"the plan of {plan.name} has {spell(first)} {form}, that of {city} has "
                f"{spell(second)}",
                "two plans with equal pixels and equal sides",
                "read both maps at the same pixel size and side",
            )
    if depth > _DEEPEST:
        raise MapError(
            f"the seam has changes with seams in more than {_DEEPEST} levels",
            f"{_DEEPEST} levels at most",
            "join plans with fewer seams",
        )
    for step in change.get("changes", ()):
        other = _apply(other, step, plans, depth + 1)
    return other


__all__ = ["CHANGE_KINDS", "apply_changes", "draw_change", "renumbering"]
