"""`events.jsonl` and `commands.jsonl`: what happened to a run, and what other processes request of
it, one JSON document per line, oldest first.

A process appends a command; the run reads it between two generations, and an event states by the
number of the line what was done. Each event ends with a checksum, see `evocity.store.event_chain`.
Commands have none: other programs write them, and only the event counts.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

from pydantic_core import from_json

from evocity.errors import RunError
from evocity.store.event_chain import append_whole, check_chain, line_of
from evocity.store.run_directory import MOST_BYTES, RunDirectory

#: The names of the two files.
EVENTS, COMMANDS = "events.jsonl", "commands.jsonl"
#: Lines of a file of events, or of commands, at most.
MOST_LINES = 200_000
#: Bytes of a command, at most.
LONGEST = 1 << 20
#: Commands that are read at a time, at most.
MOST_AT_ONCE = 1000
#: Events of starts and ends.
TURNS = ("start", "resume", "stop", "finish")
#: Why a run ended whose last turn is a start.
KILLED = "killed, or the machine went down"


def was_killed(events: Sequence[Mapping]) -> bool:
    """Return whether a run that no process holds ended without an event."""
    last = next((one["event"] for one in reversed(events) if one.get("event") in TURNS), None)
    return last in ("start", "resume")


def read_events(directory: RunDirectory, sealed: str | None = None) -> list[dict]:
    """Return all whole events, oldest first, without their checksums. Raises OSError, `RunError`;
    also for a changed line, and where no event has the checksum ``sealed``."""
    content, path = directory.read(EVENTS), directory.root / EVENTS
    if (count := content.count(b"\n")) > MOST_LINES:
        raise RunError(
            f"{path} has {count} lines",
            f"at most {MOST_LINES} lines, one for each event of the run",
            "restore the file from a backup",
        )
    check_chain(content, path, sealed)
    events = [event for event in map(_document, content.split(b"\n")) if event is not None]
    for event in events:
        event.pop("chain", None)
    return events


def append_command(path: Path, command: dict) -> None:
    """Append a command to the file at ``path``, which may be missing, and flush it. A line that a
    crash cut short is closed first. Raises OSError, `RunError`."""
    with RunDirectory(path.parent).append(path.name) as file:
        append_whole(file, line_of(command))


def read_commands(path: Path, first: int = 0) -> list[tuple[int, dict | None]]:
    """Return the commands in the file at ``path``, which may be missing, see `commands_of`."""
    return commands_of(RunDirectory(path.parent), first, path.name)[0]


def commands_of(
    directory: RunDirectory, first: int = 0, part: str = COMMANDS
) -> tuple[list[tuple[int, dict | None]], bool]:
    """Return whole lines of commands from number ``first`` on, with their numbers; None for a line
    that is not a JSON object. Nothing without a file.

    At most `MOST_AT_ONCE` commands are read, of at most `MOST_LINES` lines in `MOST_BYTES`. The
    second value is whether the file has more. Raises OSError, `RunError`.
    """
    commands: list[tuple[int, dict | None]] = []
    number = size = 0
    if not directory.exists(part):
        return commands, False
    with directory.open(part) as file:
        while line := file.readline(LONGEST + 1):
            if len(commands) == MOST_AT_ONCE or number == MOST_LINES:
                return commands, True
            size, end = size + len(line), line
            while not end.endswith(b"\n") and (end := file.readline(LONGEST + 1)):
                size += len(end)
                if size > MOST_BYTES:
                    return commands, True
            if size > MOST_BYTES:
                return commands, True
            if not end.endswith(b"\n"):  # what follows the last end of line is not whole
                break
            if number >= first:
                commands.append((number, _document(line) if line.endswith(b"\n") else None))
            number += 1
    return commands, False


def count_commands(directory: RunDirectory) -> int:
    """Return the number of whole lines of commands, up to `MOST_BYTES`. Raises OSError,
    `RunError`."""
    count = 0
    if directory.exists(COMMANDS):
        with directory.open(COMMANDS) as file:
            for _ in range(MOST_BYTES // LONGEST):
                count += file.read(LONGEST).count(b"\n")
    return count


def _document(line: bytes) -> dict | None:
    try:
        document = from_json(line)
    except ValueError:
        return None
    return document if isinstance(document, dict) else None
