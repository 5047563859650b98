"""Evocity's own workers on another machine: in a process of a cluster, which hosts them.

They are the one judge of deadlines, memory and deaths there as they are at home. Nothing here
knows what kind of cluster it is.
"""

import threading
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from evocity.errors import RunError
from evocity.search.compiling import compile_once
from evocity.search.evaluation.parcels import Parcel
from evocity.search.evaluation.workers import Workers
from evocity.search.evaluator import Outcome

#: Seconds without work after which a worker process is ended; another starts with the next work.
IDLE = 60.0
#: Seconds of work that a worker takes at once.
_BATCH = 0.02

_compiling = threading.Lock()


class Closed(Exception):
    """The host is closed: nobody wants its outcomes."""


@dataclass
class Answer:
    """What became of a chunk of jobs: their ``outcomes``, in order; the ``seconds`` that workers
    had them; ``notes``, on jobs that were done again; ``failed``: why no workers can be had, ""
    if they could."""

    outcomes: list[Outcome | None]
    seconds: float = 0.0
    notes: list[str] = field(default_factory=list)
    failed: str = ""


@dataclass
class _Chunk:
    method: str
    jobs: Sequence[bytes]
    answer: Answer
    left: int
    done: threading.Event = field(default_factory=threading.Event)


class Host:
    """``seats`` worker processes for what is in a ``parcel``; each job has ``timeout`` seconds and
    ``memory`` bytes, as in `Workers`. They start with the first job, and end when idle."""

    def __init__(self, parcel: Parcel, seats: int, timeout: float, memory: int | None):
        self._parcel, self.seats = parcel, seats
        self._timeout, self._memory = timeout, memory
        self._changed = threading.Condition()
        self._waiting: deque[tuple[_Chunk, int]] = deque()
        self._pools: set[Workers] = set()
        self._sitting = 0
        self._seconds = 1.0  # that a job takes, roughly
        self._closed = False

    def run(self, method: str, jobs: Sequence[bytes]) -> Answer:
        """What becomes of ``jobs``, each framed, in seats that are free; called by any thread.
        Raises `Closed`."""
        chunk = _Chunk(method, jobs, Answer([None] * len(jobs)), len(jobs))
        with self._changed:
            if self._closed:
                raise Closed
            self._waiting.extend((chunk, at) for at in range(len(jobs)))
            while self._sitting < min(self.seats, len(self._waiting) + len(self._pools)):
                threading.Thread(target=self._sit, daemon=True).start()
                self._sitting += 1
            self._changed.notify_all()
        chunk.done.wait()
        if self._closed:
            raise Closed
        return chunk.answer

    def close(self) -> None:
        """End all workers at once; what waits is told. Safe to call twice, by any thread."""
        with self._changed:
            self._closed = True
            for chunk, _ in self._waiting:
                chunk.done.set()
            self._waiting.clear()
            for pool in self._pools:
                pool.wake()
            self._changed.notify_all()

    def _sit(self) -> None:
        """The thread of one worker process."""
        notes: list[str] = []
        try:
            with _compiling:
                compile_once(self._parcel.sides, self._parcel.parts, lambda text: None)
            pool = Workers(
                self._parcel, 1, self._timeout, notes.append, self._memory, self._clock, main=False
            )
        except Exception as error:  # no files are left, for one
            self._stand_up(repr(error))
            return
        with self._changed:
            self._pools.add(pool)
        try:
            while batch := self._next():
                self._work(pool, batch, notes)
        except Closed:
            pass
        finally:
            with self._changed:
                self._pools.discard(pool)
            pool.close()

    def _stand_up(self, failed: str) -> None:
        """A seat cannot be had. If it was the last one, what waits has ``failed``: nobody comes."""
        with self._changed:
            self._sitting -= 1
            while self._waiting and not self._sitting:
                chunk, _ = self._waiting.popleft()
                chunk.answer.failed = failed
                chunk.done.set()

    def _next(self) -> list[tuple[_Chunk, int]]:
        """Jobs of one chunk, as many as take a moment; none if there is nothing more to do."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting or self._closed, IDLE)
            if self._closed or not self._waiting:
                self._sitting -= 1
                return []
            fair = -(-len(self._waiting) // self.seats)
            most = max(1, min(fair, int(_BATCH / self._seconds)))
            batch = [self._waiting.popleft()]
            while len(batch) < most and self._waiting and self._waiting[0][0] is batch[0][0]:
                batch.append(self._waiting.popleft())
            return batch

    def _work(self, pool: Workers, batch: list[tuple[_Chunk, int]], notes: list[str]) -> None:
        chunk, answer = batch[0][0], batch[0][0].answer
        began = time.monotonic()
        failed, outcomes = "", [None] * len(batch)
        try:
            outcomes = pool.run(chunk.method, [chunk.jobs[at] for _, at in batch])
        except Closed:
            chunk.done.set()
            raise
        except Exception as error:
            failed = error.found if isinstance(error, RunError) else repr(error)
        spent = time.monotonic() - began
        with self._changed:
            self._seconds += (spent / len(batch) - self._seconds) / 4
            for (_, at), outcome in zip(batch, outcomes, strict=True):
                answer.outcomes[at] = outcome
            answer.seconds += spent
            answer.failed = answer.failed or failed
            answer.notes += notes
            notes.clear()
            chunk.left -= len(batch)
            if not chunk.left:
                chunk.done.set()

    def _clock(self) -> float:
        if self._closed:
            raise Closed  # so `Workers.run` ends its worker
        return time.monotonic()


__all__ = ["Answer", "Closed", "Host"]
