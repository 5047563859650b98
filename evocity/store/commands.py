"""`commands.jsonl`: what other processes ask of a run, one JSON document a line, oldest first.

Whoever asks adds a line; whoever breeds the run reads them between two generations. What is done
about a line, `events.jsonl` tells by its number.
"""

import os
from pathlib import Path

from pydantic_core import from_json

from evocity.store.events import append_line, lines_of
from evocity.store.parts import read_bytes

#: A line is no longer than that, bytes; what is longer is not read.
LONGEST = 1 << 20


def append_command(path: Path, command: dict) -> None:
    """Add a line to the file at ``path``, which need not exist, and flush it. Raises OSError."""
    append_line(path, command)


def read_commands(path: Path, first: int = 0) -> list[tuple[int, dict | None]]:
    """Whole lines from number ``first`` on, with their numbers; None for what is no JSON object.
    Nothing without a file. Raises OSError, `RunError`."""
    if not os.path.lexists(path):
        return []
    *lines, _ = lines_of(read_bytes(path), path)  # what follows the last is not whole
    return [(number, _document(line)) for number, line in enumerate(lines) if number >= first]


def _document(line: bytes) -> dict | None:
    try:
        found = from_json(line) if len(line) <= LONGEST else None
    except ValueError:
        return None
    return found if isinstance(found, dict) else None
