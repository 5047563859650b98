"""Checksums of `events.jsonl`: each line ends with one of itself and of all lines before it.

A line is a JSON document whose last key, ``chain``, has the checksum. The first line with one seals
the lines of older releases before it, which have none. Each generation's membership keeps the
checksum of the last event before it, so that missing lines are found too.
"""

import hashlib
import json
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import BinaryIO

from evocity.errors import RunError
from evocity.store.run_directory import RunDirectory

_DIGITS = 32
_KEY, _CLOSE = b', "chain": "', b'"}'
_LENGTH = len(_KEY) + _DIGITS + len(_CLOSE)
_INSIDE = re.compile(_KEY + rb"[0-9a-f]{32}" + _CLOSE)


@dataclass(frozen=True)
class Chain:
    """The checksums of a file. ``last``: of the last line, or of a file without; ``known``: all of
    them; ``whole``: the bytes before a line that a crash cut short; ``chained``: whether there is a
    line with a checksum."""

    last: str
    known: frozenset[str]
    whole: int
    chained: bool


def line_of(document: Mapping) -> bytes:
    """Return the line of a ``document`` with the time, without an end of line."""
    now = datetime.now(UTC).isoformat(timespec="milliseconds")
    return json.dumps({"time": now, **document}, ensure_ascii=False).encode()


def append_whole(file: BinaryIO, line: bytes) -> None:
    """Append a ``line`` to a ``file`` and flush it; close a line that a crash cut short first."""
    if file.seek(0, os.SEEK_END):
        file.seek(-1, os.SEEK_END)
        if file.read(1) != b"\n":
            file.write(b"\n")
    file.write(line + b"\n")
    file.flush()
    os.fsync(file.fileno())


class EventLog:
    """Appends events to the file ``part`` of a run, with their checksums. All methods raise
    OSError, and `RunError` if a line was changed."""

    def __init__(self, directory: RunDirectory, part: str):
        self._directory, self._part = directory, part
        self._end: tuple[int, str] | None = None

    @property
    def chain(self) -> str:
        """The checksum of the last event."""
        if self._end is None:
            known = self._read()
            self._end = known.whole, known.last
        return self._end[1]

    def append(self, document: Mapping) -> None:
        """Append the ``document`` with the time, and flush it."""
        with self._directory.append(self._part) as file:
            size = file.seek(0, os.SEEK_END)
            if self._end is None or self._end[0] != size:
                self._end = self._close(file, size)
            last = self._end[1]
            line = line_of(document).removesuffix(b"}")
            last = _digest(last.encode() + line)
            append_whole(file, line + _KEY + last.encode() + _CLOSE)
            self._end = file.seek(0, os.SEEK_END), last

    def _close(self, file: BinaryIO, size: int) -> tuple[int, str]:
        """Drop a line that a crash cut short; one of an older release stays, with an end. Return
        the new end of the file, and the checksum there."""
        known = self._read()
        if known.whole < size and known.chained:
            file.truncate(known.whole)
        elif known.whole < size:
            file.write(b"\n")
            file.flush()
            known = self._read()
        return known.whole, known.last

    def _read(self) -> Chain:
        """The checksums of the file, which has the last event that was written here."""
        content = self._directory.read(self._part)
        sealed = None if self._end is None else self._end[1]
        return check_chain(content, self._directory.root / self._part, sealed)


def check_chain(content: bytes, path: Path, sealed: str | None = None) -> Chain:
    """Return the checksums of events in ``content``, read at ``path``. Raises `RunError` for a line
    that was changed, and if no event has the checksum ``sealed``."""
    *lines, tail = content.split(b"\n")
    start, last, known = 0, None, set()
    if _INSIDE.search(tail):  # whole but for its end
        lines, tail = [*lines, tail], b""
    for number, line in enumerate(lines, 1):
        if last is None and _checksum(line) is not None:
            last = _digest(content[:start])
            known.add(last)
        if last is not None:
            last = _digest(last.encode() + line[:-_LENGTH])
            if _checksum(line) != last.encode():
                raise RunError(
                    f"{path}: line {number} has changed, or a line before line {number} is missing",
                    "all events of the run, unchanged and in the order in which they were written",
                    "restore the file from a backup",
                )
            known.add(last)
        start += len(line) + 1
    chained = last is not None
    if last is None:
        last = _digest(content)
        known.add(last)
    if sealed is not None and sealed not in known:
        raise RunError(
            f"{path} lacks lines that it had when the last generation was written",
            "all events of the run, in the order in which they were written",
            "restore the file from a backup",
        )
    return Chain(last, frozenset(known), min(start, len(content)) if chained else start, chained)


def _checksum(line: bytes) -> bytes | None:
    """The checksum at the end of a ``line``; None for a line without one."""
    stated = line[-_LENGTH:]
    if stated.startswith(_KEY) and stated.endswith(_CLOSE):
        return stated[len(_KEY) : -len(_CLOSE)]
    return None


def _digest(content: bytes) -> str:
    return hashlib.blake2b(content, digest_size=_DIGITS // 2).hexdigest()
