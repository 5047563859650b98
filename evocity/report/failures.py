"""What came of a run's births that a user should know: failures and repetitions, in few words."""

from collections import Counter
from dataclasses import dataclass

from evocity.search.evaluator import UNRECORDED
from evocity.store import STATUSES, Run

#: Fewer different genomes than this share of the births are worth a word.
_DIFFERENT = 0.25


@dataclass(frozen=True)
class Failure:
    """``count`` births that ended with one ``status``; ``error``: what the first of them told."""

    status: str
    count: int
    error: str

    def __str__(self) -> str:
        return f"{self.count} {self.status}" + (f", such as: {self.error}" if self.error else "")


def failures(run: Run) -> list[Failure]:
    """One a status but ``ok`` that occurs, in the order of `STATUSES`.

    Raises `RunError` if the run has no whole generation yet, or is damaged.
    """
    births = run.births(columns=["status", "error"])
    status, errors = births["status"].to_pylist(), births["error"].to_pylist()
    counted = Counter(status)
    first: dict[str, str] = {}
    for kind, error in zip(status, errors, strict=True):
        first.setdefault(kind, shortened(error or ""))
    return [Failure(s, counted[s], first[s]) for s in STATUSES if s != "ok" and counted[s]]


def unrecorded(run: Run) -> str:
    """In words, how many births of ``run`` that are ok lack a value: of a measure that is recorded
    besides, or of a constraint, which they break; "" if none does. Raises as `failures`."""
    births = run.births(columns=["status", "error"]).to_pylist()
    lacking = [one["error"] for one in births if one["status"] == "ok" and one["error"]]
    if not lacking:
        return ""
    first = shortened(lacking[0].removeprefix(UNRECORDED))
    return f"{len(lacking)} of {len(births)} births, such as: {first}"


def repeated(run: Run) -> str:
    """In words, that most births of ``run`` have a genome that another has; "" if a quarter of
    them or more differ. Raises as `failures`."""
    genomes = [one for one in run.births(columns=["genome"])["genome"].to_pylist() if one]
    different = len(set(genomes))
    if different >= _DIFFERENT * len(genomes):
        return ""
    return f"{len(genomes)} births, {different} different genomes"


def shortened(text: str, most: int = 160) -> str:
    """``text`` on one line of at most ``most`` letters."""
    line = " ".join(text.split())
    return line if len(line) <= most else line[: most - 1] + "…"


__all__ = ["Failure", "failures", "repeated", "shortened", "unrecorded"]
