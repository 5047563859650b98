"""`BackgroundWriter`: writes a run folder in a thread while the next generation is bred."""

import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

from evocity.store.membership import Member
from evocity.store.schema import Birth, Header
from evocity.store.writer import RunWriter


class BackgroundWriter:
    """A `RunWriter` in a thread, at most one generation behind: tables, compression, files,
    merging.

    The next call raises an error of the thread; writes after the error are dropped, so that the
    folder ends with a whole generation. The thread lives while there is work. Where the system has
    no thread left, the caller writes. An event is written at once while the thread is idle.
    """

    def __init__(self, writer: RunWriter):
        self._writer = writer
        self._changed = threading.Condition()
        self._waiting: deque[Callable[[], None]] = deque()
        self._thread: threading.Thread | None = None
        self._error: BaseException | None = None
        self._closing = self._closed = False

    @property
    def path(self) -> Path:
        return self._writer.path

    @property
    def header(self) -> Header:
        return self._writer.header

    def write_generation(
        self, generation: int, births: Sequence[Birth], members: Sequence[Member], summary: Mapping
    ) -> None:
        """See `RunWriter.write_generation`; waits for all earlier writes, and raises their
        errors."""
        self.flush()
        births, members = list(births), list(members)
        self._begin(lambda: self._writer.write_generation(generation, births, members, summary))

    def event(self, event: str, **details) -> None:
        """See `RunWriter.event`; raises errors of earlier writes."""
        with self._changed:
            behind = self._thread is not None and self._error is None
        if behind:
            time = datetime.now(UTC).isoformat(timespec="milliseconds")
            self._begin(lambda: self._writer.event(event, time=time, **details))
        else:
            self.flush()
            self._writer.event(event, **details)

    def commands(self, first: int) -> tuple[list[tuple[int, dict | None]], bool]:
        """See `RunWriter.commands`."""
        return self._writer.commands(first)

    def count_commands(self) -> int:
        """See `RunWriter.count_commands`."""
        return self._writer.count_commands()

    def set_commands_aside(self) -> str:
        """See `RunWriter.set_commands_aside`."""
        return self._writer.set_commands_aside()

    def wait(self) -> None:
        """Wait until nothing is being written."""
        with self._changed:
            self._changed.wait_for(lambda: self._thread is None)

    def flush(self) -> None:
        """Wait until all is written; raise errors."""
        self.wait()
        with self._changed:
            error, self._error = self._error, None
        if error is not None:
            raise error

    def close(self) -> None:
        """Write what is left, then release the run; safe to call twice. Raises errors. If it is
        interrupted, the thread releases the run."""
        with self._changed:
            self._closing = True
            if self._thread is None:
                self._release()
        self.flush()

    def _release(self) -> None:
        if not self._closed:
            self._closed = True
            self._writer.close()

    def _begin(self, work: Callable[[], None]) -> None:
        with self._changed:
            self._waiting.append(work)
            if self._thread is not None:
                return
            self._thread = threading.Thread(target=self._work, name="evocity log")
            try:
                self._thread.start()
            except RuntimeError:  # the system has no thread left
                self._work()

    def _work(self) -> None:
        while True:
            with self._changed:
                if not self._waiting or self._error is not None:
                    self._waiting.clear()
                    if self._closing:
                        self._release()
                    self._thread = None
                    self._changed.notify_all()
                    return
                work = self._waiting.popleft()
            try:
                work()
            except BaseException as error:
                with self._changed:
                    self._error = error
