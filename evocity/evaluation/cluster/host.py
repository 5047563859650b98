"""Hosts: pools of evocity's own workers inside a process of a cluster, whatever its kind.

There as at home, only these pools judge deadlines, memory and deaths.
"""

import threading
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from evocity.errors import RunError
from evocity.evaluation.cluster.parcel import Parcel
from evocity.evaluation.compilation import compile_once
from evocity.evaluation.evaluator import Outcome
from evocity.evaluation.worker_pool import Workers

#: Seconds without work after which a worker process ends; the next work starts another one.
IDLE = 60.0
#: Seconds of work in the batch that a worker takes.
_BATCH = 0.1

_compiling = threading.Lock()


class HostClosed(Exception):
    """The host is closed, and its outcomes are not needed any more."""


@dataclass
class Answer:
    """The answer to a chunk: ``outcomes`` in order, ``seconds`` of work, ``notes`` on jobs done
    again, and why it ``failed``, or ""."""

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
    """Hosts ``seats`` worker processes for a ``parcel``, with limits as in `Workers`. They start
    with the first job, and end when idle."""

    def __init__(self, parcel: Parcel, seats: int, timeout: float, memory: int | None):
        self._parcel, self.seats = parcel, seats
        self._timeout, self._memory = timeout, memory
        self._changed = threading.Condition()
        self._waiting: deque[tuple[_Chunk, int]] = deque()
        self._pools: set[Workers] = set()
        self._sitting = 0
        self._seconds = 1.0  # of a job, roughly
        self._closed = False

    def run(self, method: str, jobs: Sequence[bytes]) -> Answer:
        """Run ``jobs``, each framed, in free seats; any thread may call it. Raises `HostClosed`."""
        chunk = _Chunk(method, jobs, Answer([None] * len(jobs)), len(jobs))
        with self._changed:
            if self._closed:
                raise HostClosed
            self._waiting.extend((chunk, at) for at in range(len(jobs)))
            while self._sitting < min(self.seats, len(self._waiting) + len(self._pools)):
                threading.Thread(target=self._sit, daemon=True).start()
                self._sitting += 1
            self._changed.notify_all()
        chunk.done.wait()
        if self._closed:
            raise HostClosed
        return chunk.answer

    def close(self) -> None:
        """End all workers at once, and the waiting `run`s. Safe to call twice, by any thread."""
        with self._changed:
            self._closed = True
            for chunk, _ in self._waiting:
                chunk.done.set()
            self._waiting.clear()
            for pool in self._pools:
                pool.wake()
            self._changed.notify_all()

    def _sit(self) -> None:
        """Run the thread of one worker process."""
        notes: list[str] = []
        try:
            with _compiling:
                compile_once(self._parcel.sides, self._parcel.parts, lambda text: None)
            pool = Workers(
                self._parcel, 1, self._timeout, notes.append, self._memory, self._clock, main=False
            )
        except Exception as error:  # for example, too many open files
            self._give_up_seat(repr(error))
            return
        with self._changed:
            self._pools.add(pool)
        try:
            while batch := self._next():
                self._work(pool, batch, notes)
        except HostClosed:
            pass
        finally:
            with self._changed:
                self._pools.discard(pool)
            pool.close()

    def _give_up_seat(self, failed: str) -> None:
        """Give up a seat whose pool cannot start. Without any seat, waiting jobs fail."""
        with self._changed:
            self._sitting -= 1
            while self._waiting and not self._sitting:
                chunk, _ = self._waiting.popleft()
                chunk.answer.failed = failed
                chunk.done.set()

    def _next(self) -> list[tuple[_Chunk, int]]:
        """Take a batch of jobs from one chunk; none if no work came for `IDLE` seconds."""
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
        except HostClosed:
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
            raise HostClosed  # so `Workers.run` ends its worker
        return time.monotonic()
