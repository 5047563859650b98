"""What came of a run's births that a user should know, in few words: failures, repetitions, and
what was not the same once more."""

from collections import Counter
from dataclasses import dataclass

from evocity.search.differing import DIFFERS, in_words
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
    from evocity.search.evaluator import UNRECORDED  # it loads all that measures

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


def differing(run: Run) -> list[dict]:
    """Births that were another when the ``run`` replayed them by itself, oldest first: generation,
    id, and what ``differs``, as `evocity.search.repeating.Replayed` has it. Events that tell of
    none are left out."""
    keys = ("generation", "id", "differs")
    told = [{key: one.get(key) for key in keys} for one in run.events() if _is_told(one)]
    return list({one["id"]: one for one in reversed(told)}.values())[::-1]


def differing_told(run: Run) -> str:
    """The same in words; "" if all were the same."""
    found = differing(run)
    if not found:
        return ""
    many = "1 birth differs" if len(found) == 1 else f"{len(found)} births differ"
    first = shortened(in_words(found[0]["differs"]))
    return f"{many} when replayed, such as {found[0]['id']}: {first}"


def _is_told(event: dict) -> bool:
    differs = event.get("differs")
    whole = all(isinstance(event.get(key), int) for key in ("generation", "id"))
    return (
        event.get("event") == DIFFERS
        and whole
        and isinstance(differs, dict)
        and all(isinstance(one, dict) and {"then", "now"} <= set(one) for one in differs.values())
    )


def shortened(text: str, most: int = 160) -> str:
    """``text`` on one line of at most ``most`` letters."""
    line = " ".join(text.split())
    return line if len(line) <= most else line[: most - 1] + "…"


__all__ = [
    "Failure",
    "differing",
    "differing_told",
    "failures",
    "repeated",
    "shortened",
    "unrecorded",
]
