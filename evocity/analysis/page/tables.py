"""The tables of a page: births by status, operator and error, generations, islands, settings."""

import json
from collections import Counter
from collections.abc import Sequence
from typing import Any

from evocity.analysis.failed_births import shortened
from evocity.analysis.goals import overrides_of
from evocity.analysis.page.islands import tables_of_islands
from evocity.analysis.page.shortlist import plain
from evocity.store import STATUSES
from evocity.store.events import TURNS

# Generations in a table, errors, and starts and ends of the run, at most.
_MOST_GENERATIONS, _MOST_ERRORS, _MOST_TURNS = 400, 12, 12
_OPERATORS = (
    'The row "source" counts the encoded maps of the parent cities. The column "survived" counts '
    'the births that survived at least one generation. The column "archive" counts the births that '
    'entered the archive. The column "paid" divides two shares: the operator\'s share among the '
    "ancestors of living individuals, and the operator's share among all births. If the value in "
    'the column "paid" is above 1, the operator\'s births have more living descendants than an '
    "average birth."
)


def table(title: str, headings: Sequence[str], rows: Sequence[Sequence], note: str = "") -> dict:
    return {
        "title": title,
        "headings": list(headings),
        "rows": [[plain(c) if isinstance(c, float) else c for c in row] for row in rows],
        "note": note,
    }


def tables_of(run: Any) -> list[dict]:
    """Return the tables about births; each has ``title``, ``headings``, ``rows`` and ``note``."""
    births = run.columns
    counted = Counter(births.status.tolist())
    status = [(name, counted[name]) for name in STATUSES]
    errors = Counter(
        shortened(text) for text in births.read(["error"])["error"].to_pylist() if text
    )
    listed = [
        table("births by status", ("status", "births"), status),
        _by_operator(run),
        table("errors", ("error", "births"), errors.most_common(_MOST_ERRORS)),
        *(table(*parts) for parts in tables_of_islands(run)),
        _by_generation(births),
    ]
    return [one for one in listed if one["rows"] or one["note"]]


def _by_operator(run: Any) -> dict:
    """Count births by operator, and the births that survived."""
    births, title = run.columns, "births by operator"
    if not births.has_known_goals:
        failed, born = Counter(births.operator[~births.ok]), Counter(births.operator).most_common()
        rows = [(name, count, failed[name]) for name, count in born]
        return table(title, ("operator", "births", "failed"), rows)
    names, credit = run.operator_credit
    columns = [
        credit[one].tolist() for one in ("births", "failed", "copies", "survived", "entered")
    ]
    paid = [round(one, 2) for one in credit["paid"].tolist()]
    headings = ("operator", "births", "failed", "copies", "survived", "archive", "paid")
    return table(
        title, headings, list(zip(names.tolist(), *columns, paid, strict=True)), _OPERATORS
    )


def _by_generation(births: Any) -> dict:
    """List the summaries of the generations."""
    history = births.history
    stride = max(1, -(-len(history) // _MOST_GENERATIONS))
    keys = ("generation", "births", "failures", "hypervolume", "evaluations_per_second")
    rows = [
        [
            *(about.get(key) for key in keys),
            *(about.get("best", {}).get(aim.name) for aim in births.sought),
        ]
        for about in [*history[:-1:stride], *history[-1:]]
    ]
    headings = ("generation", "births", "failures", "hypervolume", "evaluations/s")
    best = [f"best {aim.title}" for aim in births.sought]
    return table("every generation", (*headings, *best), rows)


def settings_of(run: Any) -> list[dict]:
    """Return the tables about the recipe and the course of the run, the provenance last."""
    logged = [(aim.name, aim.unit, aim.wanted, aim.meaning) for aim in run.columns.logged]
    events = [event for event in run.events() if event.get("event") in TURNS]
    turns = [(e["event"], str(e.get("time"))[:19].replace("T", " ")) for e in events][-_MOST_TURNS:]
    replaced = [(key, _text(value)) for key, value in overrides_of(run).items()]
    kept = [(name, _text(value)) for name, value in run.provenance.items() if name != "header"]
    listed = [
        table("measures of this run", ("measure", "unit", "goal", "meaning"), logged),
        table("starts and ends", ("event", "when, UTC"), turns),
        table(
            "values that replaced the recipe's", ("replaced on the command line", "by"), replaced
        ),
        table("provenance", ("name", "value"), kept),
    ]
    return [one for one in listed if one["rows"]]


def _text(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key} {_text(item)}" for key, item in value.items())
    if isinstance(value, list):
        return " ".join(map(_text, value))
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
