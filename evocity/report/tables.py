"""The tables of the report: births by status and operator, generations, settings, every birth."""

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.analysis import Run
from evocity.analysis.births import Births, label
from evocity.analysis.goals import overrides_of
from evocity.report.failed_births import shortened
from evocity.report.islands import Islands
from evocity.report.shown_births import ShownBirths
from evocity.store import STATUSES
from evocity.store.events import TURNS
from evocity.templates import number

#: Births, and generations, whose numbers stand on the page, at most.
MOST_BIRTHS, _MOST_GENERATIONS = 2000, 400


@dataclass(frozen=True)
class Table:
    """``headings`` and ``rows`` of cells."""

    headings: Sequence[str]
    rows: Sequence[Sequence]


# -- births ---------------------------------------------------------------------------------


def by_status(births: Births) -> Table:
    counted = Counter(births.status.tolist())
    return Table(("status", "births"), [(status, counted[status]) for status in STATUSES])


def by_operator(shown: ShownBirths) -> Table:
    """Count births by operator, and what came of them."""
    births = shown.births
    if shown.archive is None:  # the goals are not known
        failed, born = Counter(births.operator[~births.ok]), Counter(births.operator).most_common()
        rows = [(name, count, failed[name]) for name, count in born]
        return Table(("operator", "births", "failed"), rows)
    names, credit = shown.run.operator_credit
    columns = [credit[one].tolist() for one in ("births", "failed", "survived", "entered")]
    paid = [f"{one:.2f}" for one in credit["paid"]]
    headings = ("operator", "births", "failed", "survived", "archive", "paid")
    return Table(headings, list(zip(names.tolist(), *columns, paid, strict=True)))


def by_error(births: Births) -> Table:
    """Count births by the text of their error."""
    texts = births.read(["error"])["error"].to_pylist()
    errors = Counter(shortened(text) for text in texts if text)
    return Table(("error", "births"), errors.most_common(12))


def by_generation(births: Births) -> Table:
    """The summaries of the generations."""
    history = births.history
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
            *(number(about.get("best", {}).get(aim.name), aim.unit) for aim in births.sought),
        )
        for about in chosen
    ]
    return Table((*headings, *(f"best {aim.name}" for aim in births.sought)), rows)


def every_birth(births: Births) -> Table:
    """The numbers of all births, or of the last `MOST_BIRTHS`."""
    start = max(0, len(births) - MOST_BIRTHS)
    marks = np.where(births.alive, "alive", "")
    marks = np.where(births.ok & ~births.feasible, "breaks a constraint", marks)
    marks = np.where(births.ok, marks, births.status)
    columns = [births.ids, births.generation, births.operator, marks]
    parts = (one[start:].tolist() for one in (*columns, births.values))
    rows = [
        (*own, *(number(value) for value in values)) for *own, values in zip(*parts, strict=True)
    ]
    names = [label(aim.name) + (f", {aim.unit}" if aim.unit else "") for aim in births.logged]
    return Table(("id", "generation", "operator", "state", *names), rows)


# -- settings -------------------------------------------------------------------------------


def measures(births: Births) -> Table:
    rows = [(aim.name, aim.unit, aim.wanted, aim.meaning) for aim in births.logged]
    return Table(("measure", "unit", "goal", "meaning"), rows)


def turns(run: Run) -> Table:
    """The last starts, resumes, stops and ends of the run, in order."""
    events = [event for event in run.events() if event.get("event") in TURNS]
    rows = [(e["event"], str(e.get("time"))[:19].replace("T", " ")) for e in events]
    return Table(("event", "when, UTC"), rows[-12:])


def replaced(run: Run) -> Table:
    """The values of the recipe that the command line replaced."""
    rows = [(key, _text(value)) for key, value in overrides_of(run).items()]
    return Table(("replaced on the command line", "by"), rows)


def provenance(run: Run) -> Table:
    kept = {k: v for k, v in run.provenance.items() if k != "header"}
    return Table(("", ""), [(name, _text(value)) for name, value in kept.items()])


def _text(value) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key} {_text(item)}" for key, item in value.items())
    if isinstance(value, list):
        return " ".join(map(_text, value))
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


# -- islands --------------------------------------------------------------------------------


def of_islands(islands: Islands) -> dict[str, Table]:
    """Settings, figures, homes and moves of the islands."""
    figures = ("hypervolume, by its goals", "born there", "living", "of them from elsewhere")
    born = (f"born on {name}" for name in islands.names)
    return {
        "settings": Table(("island", "algorithm", "operators", "goals"), islands.settings),
        "figures": Table(("island", *figures, "figures of the algorithm"), islands.figures),
        "homes": Table(("living on", *born), [(name, *counts) for name, counts in islands.homes]),
        "moves": Table(("from", "to", "sent", "survived there"), islands.moves),
    }
