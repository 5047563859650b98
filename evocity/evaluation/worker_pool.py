"""The pool of worker processes: hands out jobs, ends those past their deadline or memory limit."""

import contextlib
import math
import selectors
import signal
import socket
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator

from evocity.errors import RunError, format_bytes
from evocity.evaluation import linux_processes
from evocity.evaluation.engine import Engine, Jobs
from evocity.evaluation.evaluator import Outcome, Setup
from evocity.evaluation.frames import write_frame
from evocity.evaluation.output import show
from evocity.evaluation.worker_seat import Seat
from evocity.evaluation.worker_start import (
    News,
    NurseryStarter,
    SpawnStarter,
    StarterFailure,
    first_messages,
)

#: The most failures of the starter, without an answer of a worker in between.
_REBUILDS = 3
#: The most seconds for a worker to be set up; for an answering nursery to start or end a worker.
_SETUP, _ANSWER = 600.0, 20.0
#: Seconds between two checks of the workers' memory; of flooded output; of ended workers, where no
#: message reports their end.
_LOOK, _FLOODED, _ASK = 0.5, 0.02, 0.05
#: The least seconds without processor time that count as a standstill of this process; the most
#: seconds between two checks of the clock while a job has its deadline.
_LATE, _BEAT = 0.2, 0.1
# Seconds of a job so short that waiting for the next one would matter.
_SHORT = 0.05
# Jobs that wait for each worker: its next one, and some to choose from.
_DRAWN = 3
_END = object()
# Exit codes that a measure hardly causes by itself: such a birth is done again, once.
_FROM_OUTSIDE = tuple(
    -getattr(signal, name) for name in ("SIGKILL", "SIGTERM") if hasattr(signal, name)
)


class Workers(Engine):
    """Runs jobs in ``count`` worker processes. Each job has ``timeout`` seconds, by ``clock``, and
    may add ``memory`` bytes to its worker's memory, None without limit.

    A job that fails, hangs or ends its worker costs only that job. The pool ends a worker with all
    its descendants. Order and bits of the outcomes do not depend on ``count``. ``retried`` is
    called with a text when jobs are done again: a worker was killed, or the starter failed.
    ``setup``: the `Setup`, or an object that unpickles as one. ``main``: whether workers also load
    the main module, as processes of multiprocessing do.
    """

    def __init__(
        self,
        setup: Setup,
        count: int,
        timeout: float,
        retried: Callable[[str], None] | None = None,
        memory: int | None = None,
        clock: Callable[[], float] = time.monotonic,
        main: bool = True,
    ):
        self._setup, self._count, self._timeout = setup, count, timeout
        self._memory, self._clock, self._main = memory, clock, main
        self._retried = retried or (lambda text: None)
        self._starter: NurseryStarter | SpawnStarter | None = None
        self._seats: dict[int, Seat] = {}
        self._tokens = self._failed_starts = self._breaks = 0
        self._looked = 0.0
        self._seconds = 1.0  # of a job, roughly
        self._selector = selectors.DefaultSelector()
        self._bell, self._heard = socket.socketpair()
        self._bell.setblocking(False)
        self._selector.register(self._heard, selectors.EVENT_READ)
        self._begin("", iter(()))

    @property
    def size(self) -> int:
        return self._count

    @property
    def described(self) -> dict:
        return {"engine": "workers", "workers": self._count}

    def stream(self, method: str, jobs: Jobs) -> Iterator[tuple[int, Outcome]]:
        """As `Engine.stream`. A stream that is closed before its end ends its workers. Raises
        `RunError` if workers cannot be started."""
        self._begin(method, jobs)
        try:
            while self._draw():
                try:
                    self._step()
                except StarterFailure as error:
                    self._rebuild(str(error))
                done, self._outcomes = self._outcomes, {}
                yield from done.items()
        except BaseException:
            self._stop()  # nobody wants their jobs any more
            raise

    def close(self) -> None:
        """End all workers and their descendants; safe to call twice."""
        self._stop()
        self._selector.close()
        self._bell.close()
        self._heard.close()

    def wake(self) -> None:
        """Make `stream` check the clock at once; another thread calls it."""
        with contextlib.suppress(OSError):  # a full connection wakes it anyway
            self._bell.send(b"!")

    def __del__(self):
        with contextlib.suppress(Exception):
            self.close()

    # -- jobs ----------------------------------------------------------------------------

    def _begin(self, method: str, jobs: Jobs) -> None:
        self._method, self._coming = method, jobs
        self._stepped = time.monotonic(), time.thread_time()
        self._drawn, self._ended = 0, False
        self._jobs: dict[int, tuple] = {}  # number -> job without an outcome
        self._outcomes: dict[int, Outcome] = {}  # to be yielded
        self._waiting: deque[int] = deque()
        # these run one at a time, because one of them may kill the starter
        self._suspects: deque[int] = deque()
        self._strikes: Counter[int] = Counter()

    def _draw(self) -> bool:
        """Draw jobs, enough for each worker's next one. Returns whether any job is to be done."""
        while not self._ended and len(self._waiting) < _DRAWN * self._count:
            job = next(self._coming, _END)
            self._ended = job is _END
            if job is None or self._ended:
                break
            self._jobs[self._drawn] = job
            self._waiting.append(self._drawn)
            self._drawn += 1
        if not self._jobs and not self._ended:
            raise RuntimeError("no job is given while no job is at work")
        return bool(self._jobs)

    def _settle(self, number: int, outcome: Outcome) -> None:
        """Take the ``outcome`` of a job."""
        del self._jobs[number]
        self._outcomes[number] = outcome

    def _step(self) -> None:
        self._fill_seats()
        self._hand_out()
        if self._outcomes:  # of jobs that cannot be sent: no worker will answer them
            return
        patience = self._patience()
        ready = self._selector.select(patience)
        self._forgive(patience)
        for key, events in ready:
            if isinstance(key.data, Seat):
                if events & selectors.EVENT_WRITE:
                    key.data.flush()
                self._listen(key.data)
            elif key.fileobj is self._heard:
                self._heard.recv(1 << 12)
        for news in self._starter.news():
            self._take(news)
        if self._answered is None and self._starter.answered:
            self._answered = self._clock()
        self._judge()

    def _hand_out(self) -> None:
        busy = any(seat.job is not None for seat in self._seats.values())
        for seat in self._seats.values():
            waiting = self._suspects or self._waiting
            if not waiting or (self._suspects and busy):
                return
            if seat.state == "idle" and self._send(seat, number := waiting.popleft()):
                busy, seat.job = True, number
                seat.enter("busy", self._clock())
        if self._seconds > _SHORT or self._suspects:
            return
        # a worker gets its next short job in advance
        for seat in self._seats.values():
            if len(self._waiting) <= len(self._seats):
                return
            if seat.state == "busy" and seat.next is None:
                number = self._waiting.popleft()
                seat.next = number if self._send(seat, number) else None

    def _send(self, seat: Seat, number: int) -> bool:
        """Send a job to a worker. Returns whether it could be pickled."""
        try:
            job = self._jobs[number]
            job = job if isinstance(job, bytes) else bytes(write_frame(job))
            message = write_frame((number, self._method, job))
        except Exception as error:
            self._settle(number, Outcome("error", f"{type(error).__name__}: {error}"))
            return False
        seat.send(message)
        self._watch(seat)
        return True

    def _listen(self, seat: Seat) -> None:
        try:
            for message in seat.messages():
                self._hear(seat, *message)
        except (ValueError, TypeError) as error:
            self._end(seat, Outcome("died", f"the worker sent an invalid answer: {error}"))
        if seat.hung_up and seat.closed is None:
            seat.closed = self._clock()
        if seat.drain is not None:
            seat.drain.drain()
        self._watch(seat)

    def _hear(self, seat: Seat, what: str, *details) -> None:
        """Take a message of a worker: it is ready, or answers a job."""
        show(seat.text())
        if what == "ready":
            (seat.resident,) = details
            seat.enter("idle", self._clock())
            self._failed_starts = 0
            return
        number, outcome, leaves = details
        if seat.state != "busy" or number != seat.job or not isinstance(outcome, Outcome):
            raise ValueError(f"job {number!r}")
        self._settle(number, outcome)
        now, self._breaks = self._clock(), 0
        self._seconds += (now - seat.since - self._seconds) / 10
        seat.job = None
        if seat.next is not None and not leaves:
            seat.job, seat.next = seat.next, None
        seat.enter("ending" if leaves else "idle" if seat.job is None else "busy", now)

    def _end(self, seat: Seat, outcome: Outcome | None = None) -> None:
        """End a worker, and its job with this ``outcome``; without one, the job waits again."""
        if seat.job is not None and outcome is not None:
            self._settle(seat.job, outcome)
        elif seat.job is not None:
            self._waiting.appendleft(seat.job)
        seat.job = None
        if seat.state != "ending":
            seat.enter("ending", self._clock())
            self._starter.end(seat.token)

    # -- workers -------------------------------------------------------------------------

    def _fill_seats(self) -> None:
        if self._starter is None:
            kind = NurseryStarter if linux_processes.LINUX else SpawnStarter
            self._starter = kind(self._setup)
            self._answered: float | None = None  # the time of the starter's first answer
            if self._starter.handle is not None:
                self._selector.register(self._starter.handle, selectors.EVENT_READ)
            inherits = self._starter.inherits
            self._first = first_messages(inherits, self._setup, self._memory, self._main)
        while len(self._seats) < self._count:
            self._tokens += 1
            seat = Seat(self._tokens, self._clock(), prints=not self._starter.inherits)
            self._seats[seat.token] = seat
            self._starter.start(seat.token, seat.theirs, seat.output)
            seat.close_worker_ends()
            seat.send(self._first)
            self._watch(seat)

    def _take(self, news: News) -> None:
        """Take the news that a worker started or ended."""
        seat = self._seats.get(news.token)
        if seat is None:
            return
        if news.event == "started":
            seat.pid = news.pid
            return
        self._listen(seat)  # it may have answered before it ended
        show(seat.text())
        number = seat.job
        if number is not None:
            seconds = self._clock() - seat.since
            self._strikes[number] += 1
            if news.code in _FROM_OUTSIDE and self._strikes[number] < 2:
                self._waiting.appendleft(number)
                code = linux_processes.describe_exit_code(news.code)
                self._retried(f"a worker was killed ({code}); its birth is done again")
            else:
                code = linux_processes.describe_exit_code(news.code)
                text = f"the worker ended with exit code {code}"
                self._settle(number, Outcome("died", text, seconds))
        elif seat.state == "starting":
            self._failed_starts += 1
        self._remove(seat)
        if self._failed_starts > self._count + 1:
            raise RunError(
                "the worker processes end before they start work",
                "worker processes that start",
                "in a script, start the search under `if __name__ == '__main__':`; "
                "otherwise try workers=0, which shows the error",
            )

    def _remove(self, seat: Seat) -> None:
        if seat.next is not None:  # a job that the worker has not begun
            self._waiting.appendleft(seat.next)
        self._unwatch(seat)
        seat.close()
        del self._seats[seat.token]

    def _judge(self) -> None:
        """End the workers that are past a deadline or a limit."""
        now = self._clock()
        for seat in list(self._seats.values()):
            spent = now - seat.since
            if seat.state == "busy" and spent > self._timeout:
                if not self._strikes[seat.job] and linux_processes.is_stopped(seat.pid):
                    self._strikes[seat.job] += 1  # a stopped worker cannot answer
                    self._end(seat)
                    self._retried("a worker was stopped past its deadline; its birth is done again")
                else:
                    text = f"no result after {self._timeout:g} s"
                    self._end(seat, Outcome("timeout", text, float(self._timeout)))
            elif seat.job is not None and seat.closed and now - seat.closed > _ANSWER:
                self._end(seat, Outcome("died", "the worker closed its connection", spent))
            elif seat.state == "ending" and spent > _ANSWER:
                raise StarterFailure("a worker that was ended is still there")
            elif seat.state == "starting" and spent > _SETUP:
                raise StarterFailure(f"a worker was not ready after {_SETUP:g} s")
            elif not seat.pid and self._unanswered(seat) > _ANSWER:
                raise StarterFailure("the process that starts the workers does not answer")
            elif seat.drain is not None and seat.drain.flooded:
                seat.drain.drain()
        if self._memory is not None and linux_processes.LINUX and now - self._looked > _LOOK:
            self._looked = now
            self._judge_memory()

    def _forgive(self, patience: float) -> None:
        """Take from the workers' times a standstill of this process: if it was stopped, they may
        have been stopped with it. It had neither processor time nor ``patience`` to wait."""
        before, worked = self._stepped
        self._stepped = time.monotonic(), time.thread_time()
        still = self._stepped[0] - before - (self._stepped[1] - worked) - patience
        if still > _LATE:
            for seat in self._seats.values():
                seat.since += still

    def _unanswered(self, seat: Seat) -> float:
        """Return the seconds for which an answering nursery has not started a worker."""
        since = math.inf if self._answered is None else max(self._answered, seat.since)
        return self._clock() - since

    def _judge_memory(self) -> None:
        for seat in self._seats.values():
            if seat.state == "busy" and seat.pid:
                added = linux_processes.added_memory(seat.pid, seat.resident, self._memory)
                if added > self._memory:
                    text = f"it takes {format_bytes(added)}; allowed: {format_bytes(self._memory)}"
                    self._end(seat, Outcome("memory", text, self._clock() - seat.since))

    def _rebuild(self, reason: str) -> None:
        """After a failure of the starter, end all workers and do their jobs again, one at a time.
        A job that fails it twice, the second time as the only one, is to blame."""
        lost = [seat.job for seat in self._seats.values() if seat.job is not None]
        self._strikes.update(lost)
        self._stop(abandon=True)
        if len(lost) == 1 and self._strikes[lost[0]] > 1:
            text = "it ended the process that starts the workers"
            self._settle(lost[0], Outcome("died", text))
        else:
            self._suspects.extend(one for one in lost if one not in self._suspects)
            self._breaks += 1
        if self._breaks > _REBUILDS:
            raise RunError(
                f"the worker processes cannot be started: {reason}",
                "a system that lets evocity start and end processes",
                "try fewer workers, or workers=0",
            )
        self._retried(reason)

    def _stop(self, abandon: bool = False) -> None:
        """End all workers; ``abandon``: kill them, as the starter failed."""
        starter, self._starter = self._starter, None
        pids = [seat.pid for seat in self._seats.values() if seat.pid]
        if starter is not None and starter.handle is not None:
            with contextlib.suppress(KeyError, ValueError):
                self._selector.unregister(starter.handle)
        for seat in list(self._seats.values()):
            show(seat.text())
            self._remove(seat)
        if starter is not None:
            starter.abandon(pids) if abandon else starter.close()

    # -- waiting -------------------------------------------------------------------------

    def _patience(self) -> float:
        """Return the seconds until the next check is due."""
        now, until = self._clock(), [_SETUP]
        for seat in self._seats.values():
            if seat.state == "busy":
                until += [seat.since + self._timeout - now, _BEAT]
            elif seat.state == "ending" or not seat.pid:
                until.append(seat.since + _ANSWER - now)
            if seat.job is not None and seat.closed:
                until.append(seat.closed + _ANSWER - now)
            if seat.drain is not None and seat.drain.flooded:
                until.append(_FLOODED)
        if self._starter.handle is None:
            until.append(_ASK)
        return max(0.0, min(until)) + 0.001

    def _watch(self, seat: Seat) -> None:
        """Select on a worker's messages, on its output unless flooded, and on room to send."""
        events = selectors.EVENT_READ | (selectors.EVENT_WRITE if seat.has_unsent else 0)
        self._register(seat.handle.fileno(), 0 if seat.hung_up else events, seat)
        if seat.drain is not None:
            calm = not seat.drain.flooded and not seat.drain.ended
            self._register(seat.drain.descriptor, selectors.EVENT_READ if calm else 0, seat)

    def _unwatch(self, seat: Seat) -> None:
        self._register(seat.handle.fileno(), 0, seat)
        if seat.drain is not None:
            self._register(seat.drain.descriptor, 0, seat)

    def _register(self, descriptor: int, events: int, seat: Seat) -> None:
        before = self._selector.get_map().get(descriptor)
        if before is None and events:
            self._selector.register(descriptor, events, seat)
        elif before is not None and not events:
            self._selector.unregister(descriptor)
        elif before is not None and events != before.events:
            self._selector.modify(descriptor, events, seat)
