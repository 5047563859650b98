"""A child process that parses Parquet files without a seal, within limits of memory and time.

Damaged or hostile bytes can end a process inside Arrow. Only the child ends then: the caller gets
an error. The child ends with the process that starts it, and after some seconds without work.
"""

import atexit
import contextlib
import json
import os
import subprocess
import sys
import threading
from collections.abc import Sequence
from typing import BinaryIO, cast

from evocity.child_process import python_command
from evocity.errors import EvocityError, reason_of

#: Memory that the child may write, bytes, and the time that it has for a file, seconds.
MEMORY, SECONDS = 3 << 29, 60.0
#: Bytes of a file and of an answer, at most.
MOST_BYTES = 1 << 29
# Values of a column, and bytes of a column's page data, that a trial reads.
_TRIED_VALUES, _TRIED_BYTES = 1 << 22, 1 << 26
# Seconds without a request, after which the child ends; bytes of the first line of an answer.
_IDLE, _LINE = 5.0, 1 << 16


class UnreadableParquetError(ValueError):
    """A file that the child cannot read, or that ends the child."""


class ChildStartError(EvocityError):
    """The child cannot start; this says nothing about the file."""


class _Child:
    """The child of this process, which starts with the first request."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: subprocess.Popen | None = None

    def request(self, job: dict, content: bytes, more: float = 0.0) -> bytes:
        """Return the answer of the child for the ``content`` of a file, within `SECONDS` and
        ``more`` seconds. Raises `UnreadableParquetError`."""
        seconds = SECONDS + more
        with self._lock:
            for _ in range(2):  # the child may have ended for another reason
                process, late = self._started(), threading.Event()
                limit = threading.Timer(seconds, _end_late, (process, late))
                limit.daemon = True
                limit.start()
                answer = None
                try:
                    answer = _ask(process, job, content)
                finally:
                    limit.cancel()
                    if answer is None:
                        self._end()
                if late.is_set():
                    raise UnreadableParquetError(f"reading takes more than {seconds:.0f} seconds")
                if answer is not None:
                    error, result = answer
                    if error is not None:
                        raise UnreadableParquetError(error)
                    return result
        raise UnreadableParquetError("the process that reads the file ended")

    def end(self) -> None:
        """End the child, if it is alive."""
        with self._lock:
            self._end()

    def _started(self) -> subprocess.Popen:
        if self._process is not None and self._process.poll() is not None:
            self._end()
        if self._process is None:
            try:
                self._process = subprocess.Popen(
                    python_command("from evocity.parquet_child import main; main()", tied=True),
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.DEVNULL,
                    start_new_session=True,
                    env=os.environ | {"ARROW_DEFAULT_MEMORY_POOL": "system"},
                )
            except OSError as error:
                raise ChildStartError(
                    f"evocity cannot start the child process that reads an untrusted file: "
                    f"{reason_of(error)}",
                    "limits on memory, open files and processes that allow a child process",
                    "close other programs, or raise the limits (ulimit -n, ulimit -u)",
                ) from error
        return self._process

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            with contextlib.suppress(OSError):
                process.kill()
            process.wait()
            for pipe in (process.stdin, process.stdout):
                with contextlib.suppress(OSError):
                    cast(BinaryIO, pipe).close()


def _end_late(process: subprocess.Popen, late: threading.Event) -> None:
    late.set()
    with contextlib.suppress(OSError):
        process.kill()


def _ask(process: subprocess.Popen, job: dict, content: bytes) -> tuple[str | None, bytes] | None:
    """Return the error of a ``process``, if any, and its result; None if the process ends, or sends
    anything else."""
    requests, answers = cast(BinaryIO, process.stdin), cast(BinaryIO, process.stdout)
    with contextlib.suppress(OSError, ValueError, TypeError, LookupError):
        requests.write(json.dumps(job | {"size": len(content)}).encode() + b"\n")
        requests.write(content)
        requests.flush()
        about = json.loads(answers.readline(_LINE))
        if "error" in about:
            return str(about["error"]), b""
        size = int(about["size"])
        result = answers.read(size) if 0 <= size <= MOST_BYTES else b""
        return (None, result) if len(result) == size else None
    return None


_child = _Child()


def _forget() -> None:
    """Leave the child to the process that forked this one."""
    global _child
    _child = _Child()


atexit.register(lambda: _child.end())
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)


def rewrite(content: bytes, keys: Sequence[bytes], most: int) -> bytes:
    """Return a new Parquet file with the table and the metadata of a file with this ``content``.

    A file whose metadata has none of the ``keys`` becomes a table without columns. Raises
    `UnreadableParquetError` for a file that Arrow cannot read, or with more than ``most`` rows, or
    twice as many values in a column.
    """
    return _request({"keys": [key.decode() for key in keys], "most": most}, content)


def try_to_read(content: bytes) -> None:
    """Raise `UnreadableParquetError` if reading Parquet with this ``content`` ends a process, or
    takes too long. Other damage raises nothing here, nor does a child that cannot start."""
    with contextlib.suppress(ChildStartError):
        _request({}, content)


def describe_rows(path: str | os.PathLike) -> dict:
    """Return what `evocity.parquet_rows.describe` tells of a file. Raises
    `UnreadableParquetError`."""
    return json.loads(_child.request({"describe": os.path.abspath(path)}, b""))


def select_rows(path: str | os.PathLike, more: float = 0.0, **which) -> bytes:
    """Return rows of a file as `evocity.parquet_rows.select` does, within `SECONDS` and ``more``
    seconds. Raises `UnreadableParquetError`."""
    return _child.request({"select": {"path": os.path.abspath(path)} | which}, b"", more)


def _request(job: dict, content: bytes) -> bytes:
    if len(content) > MOST_BYTES:
        raise UnreadableParquetError(f"a file without a seal of more than {MOST_BYTES >> 20} MiB")
    return _child.request(job, content)


# -- the child --------------------------------------------------------------------------------


def main() -> None:
    """Answer the requests of standard input, one a line, on standard output."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    _limit()
    while line := _next_line():
        job = json.loads(line)
        _answer(job, sys.stdin.buffer.read(job["size"]), answers)
        answers.flush()


def _next_line() -> bytes:
    """Return the next request; end the process if none comes in time."""
    idle = threading.Timer(_IDLE, os._exit, (0,))
    idle.daemon = True
    idle.start()
    try:
        return sys.stdin.buffer.readline()
    finally:
        idle.cancel()


def _answer(job: dict, content: bytes, answers: BinaryIO) -> None:
    try:
        if "describe" in job or "select" in job:
            from evocity import parquet_rows

            if "select" in job:
                result = parquet_rows.select(**job["select"])
            else:
                result = parquet_rows.describe(job["describe"])
        elif "keys" in job:
            result = _rewritten(content, job["keys"], job["most"])
        else:
            _try(content)
            result = b""
    except Exception as error:  # of Arrow, of memory, of the file system
        text = (str(error) or type(error).__name__)[:300]
        answers.write(json.dumps({"error": text}).encode() + b"\n")
        return
    answers.write(json.dumps({"size": len(result)}).encode() + b"\n")
    answers.write(result)


def _limit() -> None:
    """Bound the memory that this process may write, and let it leave no dump."""
    try:
        import resource
    except ImportError:  # Windows
        return
    with contextlib.suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        _, hard = resource.getrlimit(resource.RLIMIT_DATA)
        most = MEMORY if hard == resource.RLIM_INFINITY else min(MEMORY, hard)
        resource.setrlimit(resource.RLIMIT_DATA, (most, most))


def _rewritten(content: bytes, keys: Sequence[str], most: int) -> bytes:
    import pyarrow as pa
    import pyarrow.parquet as pq

    source = pa.BufferReader(content)
    with pq.ParquetFile(source, page_checksum_verification=True) as file:
        about, schema = file.metadata, file.schema_arrow
        metadata = schema.metadata or {}
        if not any(key.encode() in metadata for key in keys):
            table = pa.schema([], metadata).empty_table()
        else:
            groups = [about.row_group(k) for k in range(about.num_row_groups)]
            values = sum(
                max((g.column(k).num_values for k in range(g.num_columns)), default=0)
                for g in groups
            )
            if about.num_rows > most or values > 2 * most:
                raise ValueError(f"{about.num_rows} rows, {values} values in a column")
            table = file.read(use_threads=False)
    target = pa.BufferOutputStream()
    pq.write_table(table, target, compression="zstd")
    return target.getvalue().to_pybytes()


def _try(content: bytes) -> None:
    """Read a file's description, and its columns of moderate size; damage is not reported."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    source = pa.BufferReader(content)
    with (
        contextlib.suppress(Exception),
        pq.ParquetFile(source, page_checksum_verification=True) as file,
    ):
        about, names = file.metadata, file.schema_arrow.names
        for group in range(about.num_row_groups):
            columns = map(about.row_group(group).column, range(about.num_columns))
            large = {
                column.path_in_schema.partition(".")[0]
                for column in columns
                if column.num_values > _TRIED_VALUES
                or column.total_uncompressed_size > _TRIED_BYTES
            }
            for name in names:
                if name not in large:
                    with contextlib.suppress(Exception):
                        file.read_row_group(group, columns=[name], use_threads=False)


if __name__ == "__main__":
    main()
