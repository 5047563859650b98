"""`events.jsonl` and `commands.jsonl`: what happened to a run, and what other processes request of
it, one JSON document per line, oldest first.

A process appends a command; the run reads it between two generations, and an event states by the
number of the line what was done.
"""

import json
import os
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

from pydantic_core import from_json

from evocity.errors import RunError
from evocity.store.safe_open import open_to_append, read_bytes

#: Lines of a file of events, or of commands, at most.
MOST_LINES = 200_000
#: Bytes of a command, at most.
LONGEST = 1 << 20
#: Events of starts and ends.
TURNS = ("start", "resume", "stop", "finish")
#: Why a run ended whose last turn is a start.
KILLED = "killed, or the machine went down"


def append_event(path: Path, event: str, **details) -> None:
    """Append an event, see `append_line`."""
    append_line(path, {"event": event, **details})


def append_line(path: Path, document: dict) -> None:
    """Append a line with the ``document`` and the time, and flush it. A line that a crash cut short
    is closed first. Raises OSError."""
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


def was_killed(events: Sequence[Mapping]) -> bool:
    """Return whether a run that no process holds ended without an event."""
    last = next((one["event"] for one in reversed(events) if one.get("event") in TURNS), None)
    return last in ("start", "resume")


def lines_of(content: bytes, path: Path) -> list[bytes]:
    """Return the lines of ``content``, read at ``path``, with the text after the last end of line.
    Raises `RunError` for more than `MOST_LINES`."""
    count = content.count(b"\n")
    if count > MOST_LINES:
        raise RunError(
            f"{path} has {count} lines",
            f"at most {MOST_LINES}: one for each start, stop, resume, warning or command",
            "bring the file back from a copy",
        )
    return content.split(b"\n")


def read_events(path: Path) -> list[dict]:
    """Return all whole events, oldest first. Raises OSError, `RunError`."""
    lines = lines_of(read_bytes(path), path)
    return [event for event in map(_document, lines) if event is not None]


def append_command(path: Path, command: dict) -> None:
    """Append a command to the file at ``path``, which may be missing, and flush it. Raises
    OSError."""
    append_line(path, command)


def read_commands(path: Path, first: int = 0) -> list[tuple[int, dict | None]]:
    """Return whole lines from number ``first`` on, with their numbers; None for a line that is not
    a JSON object. Nothing without a file. Raises OSError, `RunError`."""
    if not os.path.lexists(path):
        return []
    *lines, _ = lines_of(read_bytes(path), path)  # what follows the last is not whole
    return [
        (number, _document(line) if len(line) <= LONGEST else None)
        for number, line in enumerate(lines)
        if number >= first
    ]


def _document(line: bytes) -> dict | None:
    try:
        document = from_json(line)
    except ValueError:
        return None
    return document if isinstance(document, dict) else None
