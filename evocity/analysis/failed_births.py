"""Failed births, repeated genomes, and births that differ when replayed, in few words."""

from collections import Counter
from dataclasses import dataclass

from evocity.search.record.complete_run import DIFFERS, describe_differences
from evocity.store import STATUSES, RunLog

# A smaller share of different genomes is worth a word.
_DIFFERENT = 0.25


@dataclass(frozen=True)
class Failure:
    """``count`` births that ended with one ``status``, and the ``error`` of the first of them."""

    status: str
    count: int
    error: str

    def __str__(self) -> str:
        return f"{self.count} {self.status}" + (f", such as: {self.error}" if self.error else "")


def failures(run: RunLog) -> list[Failure]:
    """Count the failed births by status, in the order of `STATUSES`.

    Raises `RunError` if the run has no complete generation yet, or is damaged.
    """
    births = run.births(columns=["status", "error"])
    status, errors = births["status"].to_pylist(), births["error"].to_pylist()
    counted = Counter(status)
    first: dict[str, str] = {}
    for kind, error in zip(status, errors, strict=True):
        first.setdefault(kind, shortened(error or ""))
    return [Failure(s, counted[s], first[s]) for s in STATUSES if s != "ok" and counted[s]]


def unrecorded(run: RunLog) -> str:
    """Describe in words how many births with the status "ok" lack a value of a recorded measure or
    of a constraint. Return "" if no birth lacks a value. Raises `RunError` for the same reasons as
    `failures`."""
    births = run.births(columns=["status", "error"]).to_pylist()
    lacking = [one["error"] for one in births if one["status"] == "ok" and one["error"]]
    if not lacking:
        return ""
    from evocity.evaluation.evaluator import UNRECORDED  # it loads all that measures

    first = shortened(lacking[0].removeprefix(UNRECORDED))
    return f"{len(lacking)} of {len(births)} births, such as: {first}"


def repeated(run: RunLog) -> str:
    """Describe in words that most births of the ``run`` have the same genome as another birth.
    Return "" if at least a quarter of the births have different genomes. Raises `RunError` for the
    same reasons as `failures`."""
    genomes = [one for one in run.births(columns=["genome"])["genome"].to_pylist() if one]
    different = len(set(genomes))
    if different >= _DIFFERENT * len(genomes):
        return ""
    return f"{len(genomes)} births, {different} different genomes"


def differing(run: RunLog) -> list[dict]:
    """Return the births for which a check by replaying the ``run`` gave a different result, oldest
    first. Each entry is a mapping with the keys ``generation``, ``id`` and ``differs``, see
    `evocity.search.resume.replay.Replayed`."""
    keys = ("generation", "id", "differs")
    listed = [{key: one.get(key) for key in keys} for one in run.events() if _is_whole(one)]
    return list({one["id"]: one for one in reversed(listed)}.values())[::-1]


def differing_told(run: RunLog) -> str:
    """Describe in words which births gave a different result when they were replayed. Return "" if
    all replayed births gave equal results."""
    births = differing(run)
    if not births:
        return ""
    many = "1 birth differs" if len(births) == 1 else f"{len(births)} births differ"
    first = shortened(describe_differences(births[0]["differs"]))
    return f"{many} when replayed, such as {births[0]['id']}: {first}"


def _is_whole(event: dict) -> bool:
    """Whether an event tells of a birth that differed, with all its values."""
    differs = event.get("differs")
    whole = all(isinstance(event.get(key), int) for key in ("generation", "id"))
    return (
        event.get("event") == DIFFERS
        and whole
        and isinstance(differs, dict)
        and all(isinstance(one, dict) and {"then", "now"} <= set(one) for one in differs.values())
    )


def shortened(text: str, most: int = 160) -> str:
    """Return ``text`` on one line of at most ``most`` letters."""
    line = " ".join(text.split())
    return line if len(line) <= most else line[: most - 1] + "…"
