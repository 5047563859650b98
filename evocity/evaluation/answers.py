"""Messages from a worker to the main process: bytes of a known layout, which are never unpickled.

A measure may write anything into its worker's connection, so the main process checks each message,
and ends the worker at the first that does not suit.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from evocity.evaluation.array_frames import read_message, write_message
from evocity.evaluation.evaluator import Outcome
from evocity.evaluation.frames import LENGTH
from evocity.evaluation.genome_document import array_at, describe_genome, genome_of
from evocity.store import STATUSES


@dataclass(frozen=True)
class Ready:
    """A worker is set up: its ``resident`` bytes, and the digest and the ``seconds`` of its
    `evocity.evaluation.canary.Canary`, "" and 0 without one."""

    resident: int
    canary: str
    seconds: float


@dataclass(frozen=True)
class Answer:
    """The ``outcome`` of the job ``number``; whether the worker ``leaves``, and then the digest of
    its last canary."""

    number: int
    outcome: Outcome
    leaves: bool
    canary: str


@dataclass(frozen=True)
class Checked:
    """The digest of a canary that the main process asked for."""

    canary: str


def write_ready(ready: Ready) -> bytes:
    """Return the framed message."""
    return _framed("ready", vars(ready), [])


def write_checked(checked: Checked) -> bytes:
    """Return the framed message."""
    return _framed("checked", vars(checked), [])


def write_answer(answer: Answer) -> bytes:
    """Return the framed message. Raises TypeError or ValueError for an outcome of other types."""
    outcome = answer.outcome
    arrays: list[np.ndarray] = []
    about: dict[str, Any] = {
        "number": answer.number,
        "leaves": bool(answer.leaves),
        "canary": answer.canary,
        "status": outcome.status,
        "error": outcome.error,
        "seconds": float(outcome.seconds),
        "values": {name: float(value) for name, value in outcome.values.items()},
    }
    if outcome.genome is not None:
        about["genome"] = describe_genome(outcome.genome, arrays)
    if outcome.look is not None:
        about["look"] = len(arrays)
        arrays.append(outcome.look)
    if outcome.thumbnail is not None:
        about["thumbnail"] = len(arrays)
        arrays.append(np.frombuffer(outcome.thumbnail, np.uint8))
    return _framed("answer", about, arrays)


def _framed(what: str, about: Mapping, arrays: list[np.ndarray]) -> bytes:
    message = write_message({"what": what, **about}, arrays)
    return LENGTH.pack(len(message)) + message


def read_answer(message: bytes | memoryview) -> Ready | Answer | Checked:
    """Return the message of these bytes, given without their length. Raises ValueError for any
    other bytes."""
    about, arrays = read_message(message)
    what = about.pop("what", None)
    try:
        if what == "ready":
            resident, seconds = _of(int, about, "resident"), _of(float, about, "seconds")
            return Ready(resident, _of(str, about, "canary"), seconds)
        if what == "checked":
            return Checked(_of(str, about, "canary"))
        if what == "answer":
            number, leaves = _of(int, about, "number"), _of(bool, about, "leaves")
            return Answer(number, _outcome(about, arrays), leaves, _of(str, about, "canary"))
    except KeyError as error:
        raise ValueError(f"a message without {error}") from None
    raise ValueError(f"a message {what!r}")


def _outcome(about: Mapping, arrays: list[np.ndarray]) -> Outcome:
    status, error, values = about["status"], about["error"], about["values"]
    if status not in STATUSES or not (error is None or isinstance(error, str)):
        raise ValueError(f"an outcome {status!r}, {type(error).__name__}")
    if not isinstance(values, dict) or not all(type(one) is float for one in values.values()):
        raise ValueError("values that are not numbers")
    genome = genome_of(about["genome"], arrays) if "genome" in about else None
    look = array_at(arrays, about["look"], "u").copy() if "look" in about else None
    thumbnail = None
    if "thumbnail" in about:
        thumbnail = array_at(arrays, about["thumbnail"], "u").tobytes()
    seconds = _of(float, about, "seconds")
    return Outcome(status, error, seconds, values, genome, look, thumbnail)


def _of(kind: type, about: Mapping, name: str) -> Any:
    value = about[name]
    if type(value) is not kind:
        raise ValueError(f"{name} of the type {type(value).__name__}")
    return value
