"""The tables of the report: births by status and operator, generations, settings, every birth."""

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.analysis.births import label
from evocity.analysis.credit import credit_of
from evocity.analysis.pedigree import Pedigree
from evocity.analysis.wanted import Aim
from evocity.pages import number
from evocity.report.facts import Facts
from evocity.report.failing import shortened
from evocity.report.islands import Islands
from evocity.store import STATUSES

#: Births whose numbers stand on the page, and generations.
MOST_BIRTHS, _MOST_GENERATIONS = 2000, 400


@dataclass(frozen=True)
class Table:
    """``headings`` and ``rows`` of cells."""

    headings: Sequence[str]
    rows: Sequence[Sequence]


# -- births ---------------------------------------------------------------------------------


def by_status(facts: Facts) -> Table:
    counted = Counter(facts.told.status.tolist())
    return Table(("status", "births"), [(status, counted[status]) for status in STATUSES])


def by_operator(facts: Facts) -> Table:
    told = facts.told
    if facts.archive is None:  # nobody knows what it wanted
        failed, born = Counter(told.operator[~told.ok]), Counter(told.operator).most_common()
        return Table(
            ("operator", "births", "failed"), [(name, count, failed[name]) for name, count in born]
        )
    names, credit = credit_of(told, Pedigree(told))
    columns = [credit[one].tolist() for one in ("births", "failed", "survived", "entered")]
    paid = [f"{one:.2f}" for one in credit["paid"]]
    headings = ("operator", "births", "failed", "lived", "archive", "paid")
    return Table(headings, list(zip(names.tolist(), *columns, paid, strict=True)))


def by_error(facts: Facts) -> Table:
    told = facts.told.read(["error"])["error"].to_pylist()
    errors = Counter(shortened(text) for text in told if text)
    return Table(("error", "births"), errors.most_common(12))


def by_generation(facts: Facts) -> Table:
    history = facts.told.history
    stride = max(1, -(-len(history) // _MOST_GENERATIONS))
    chosen = [*history[:-1:stride], history[-1]]
    headings = ("generation", "births", "failures", "hypervolume", "evaluations/s")
    rows = [
        (
            about["generation"],
            about.get("births", "–"),
            about.get("failures", "–"),
            number(about.get("hypervolume")),
            number(about.get("evaluations_per_second")),
            *(number(about.get("best", {}).get(aim.name), aim.unit) for aim in facts.sought),
        )
        for about in chosen
    ]
    return Table((*headings, *(f"best {aim.name}" for aim in facts.sought)), rows)


def every_birth(facts: Facts) -> Table:
    """The numbers of all births, of more than `MOST_BIRTHS` of the last ones."""
    told, measures = facts.told, facts.told.logged
    start = max(0, len(told) - MOST_BIRTHS)
    alive = np.isin(told.ids, [row["id"] for row in facts.members])
    marks = np.where(alive, "lives", "")
    marks = np.where(told.ok & ~told.feasible, "breaks a constraint", marks)
    marks = np.where(told.ok, marks, told.status)
    columns = [told.ids, told.generation, told.operator, marks]
    parts = (one[start:].tolist() for one in (*columns, told.values))
    rows = [
        (*own, *(number(value) for value in values)) for *own, values in zip(*parts, strict=True)
    ]
    names = [label(aim.name) + (f", {aim.unit}" if aim.unit else "") for aim in measures]
    return Table(("id", "generation", "operator", "what became of it", *names), rows)


# -- settings -------------------------------------------------------------------------------


def measures(facts: Facts) -> Table:
    every: list[Aim] = facts.told.logged
    rows = [(aim.name, aim.unit, aim.wanted, aim.meaning) for aim in every]
    return Table(("measure", "unit", "what is wanted", "what it tells"), rows)


def turns(facts: Facts) -> Table:
    return Table(("event", "when, UTC"), facts.times[-12:])


def replaced(facts: Facts) -> Table:
    """What the command line put in place of the recipe's values."""
    rows = [(key, _plainly(value)) for key, value in facts.overrides.items()]
    return Table(("replaced on the command line", "by"), rows)


def provenance(facts: Facts) -> Table:
    kept = {k: v for k, v in facts.run.provenance.items() if k != "header"}
    return Table(("", ""), [(name, _plainly(value)) for name, value in kept.items()])


def _plainly(value) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key} {_plainly(item)}" for key, item in value.items())
    if isinstance(value, list):
        return " ".join(map(_plainly, value))
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


# -- islands --------------------------------------------------------------------------------


def of_islands(told: Islands) -> dict[str, Table]:
    """Settings, figures, homes and moves of the islands."""
    figures = ("hypervolume, by its goals", "born there", "living", "of them from elsewhere")
    born = (f"born on {name}" for name in told.names)
    return {
        "settings": Table(("island", "algorithm", "operators", "goals"), told.settings),
        "figures": Table(("island", *figures, "algorithm tells"), told.figures),
        "homes": Table(("living on", *born), [(name, *counts) for name, counts in told.homes]),
        "moves": Table(("from", "to", "sent", "lived there after"), told.moves),
    }
