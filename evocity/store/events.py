"""`events.jsonl`: starts, stops, resumes, retries, warnings, one JSON document a line."""

import json
import os
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

from pydantic_core import from_json

from evocity.errors import RunError
from evocity.store.parts import open_to_append, read_bytes

#: Lines of a file of events, or of commands, at most.
MOST_LINES = 200_000
#: Events of a run's beginnings and ends.
TURNS = ("start", "resume", "stop", "finish")
#: Why a run ended whose last turn is a beginning.
UNTOLD = "killed, or the machine went down"


def append_event(path: Path, event: str, **details) -> None:
    """Add what happened, see `append_line`."""
    append_line(path, {"event": event, **details})


def append_line(path: Path, document: dict) -> None:
    """Add a line with the ``document`` and the time, and flush it. A line cut short by a crash is
    closed off first. Raises OSError."""
    now = datetime.now(UTC).isoformat(timespec="milliseconds")
    line = json.dumps({"time": now, **document}, ensure_ascii=False)
    with open_to_append(path) as file:
        if file.seek(0, os.SEEK_END):
            file.seek(-1, os.SEEK_END)
            if file.read(1) != b"\n":
                file.write(b"\n")
        file.write(line.encode() + b"\n")
        file.flush()
        os.fsync(file.fileno())


def ended_untold(events: Sequence[Mapping]) -> bool:
    """Whether a run that nobody is at ended without a word, by its ``events``."""
    last = next((one["event"] for one in reversed(events) if one.get("event") in TURNS), None)
    return last in ("start", "resume")


def lines_of(content: bytes, path: Path) -> list[bytes]:
    """The lines of ``content``, read at ``path``, what follows the last end of a line too. Raises
    `RunError` for more than `MOST_LINES`."""
    count = content.count(b"\n")
    if count > MOST_LINES:
        raise RunError(
            f"{path} has {count} lines",
            f"at most {MOST_LINES}: one for each start, stop, resume, warning or command",
            "bring the file back from a copy",
        )
    return content.split(b"\n")


def read_events(path: Path) -> list[dict]:
    """All whole lines, oldest first; what was cut short is left out. Raises OSError, `RunError`."""
    events = []
    for line in lines_of(read_bytes(path), path):
        try:
            event = from_json(line)
        except ValueError:
            continue
        if isinstance(event, dict):
            events.append(event)
    return events
