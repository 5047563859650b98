"""The pool of worker processes: hands out jobs, ends those past their deadline or memory limit."""

import contextlib
import math
import selectors
import signal
import socket
import time
from collections.abc import Callable, Iterator

from evocity.errors import RunError, format_bytes
from evocity.evaluation import linux_processes
from evocity.evaluation.answers import Answer, Checked, Ready
from evocity.evaluation.engine import Engine, Jobs
from evocity.evaluation.evaluator import Outcome, Setup
from evocity.evaluation.frames import CHECK, write_frame
from evocity.evaluation.job_table import JobTable
from evocity.evaluation.kept_genomes import GenomeTokens
from evocity.evaluation.output import show
from evocity.evaluation.process_state import require_open_files
from evocity.evaluation.worker_seat import Seat, SeatSelector
from evocity.evaluation.worker_start import (
    News,
    NurseryStarter,
    SpawnStarter,
    StarterFailure,
    first_messages,
)

_REBUILDS = 3  # the most failures of the starter, without an answer of a worker in between
#: The most seconds for a worker to be set up; for an answering nursery to start or end a worker.
_SETUP, _ANSWER = 600.0, 20.0
#: Seconds between two checks of the workers' memory; of flooded output; of ended workers, where no
#: message reports their end.
_LOOK, _FLOODED, _ASK = 0.5, 0.02, 0.05
#: The least seconds without processor time that count as a standstill of this process; the most
#: seconds between two checks of the clock while a job has its deadline.
_LATE, _BEAT = 0.2, 0.1
# Seconds of a job so short that waiting for the next one would matter: this process takes some
# milliseconds for an answer and the next job.
_SHORT = 0.25
# Exit codes that a measure hardly causes by itself: such a birth is done again, once.
_FROM_OUTSIDE = tuple(
    -getattr(signal, name) for name in ("SIGKILL", "SIGTERM") if hasattr(signal, name)
)


class Cancelled(Exception):
    """Another thread called `Workers.cancel`."""


class Workers(Engine):
    """Runs jobs in ``count`` worker processes.

    Each job has ``timeout`` seconds of ``clock`` and may add ``memory`` bytes; None sets no limit.
    A job that fails, hangs or ends its worker costs only that job. The outcomes of a worker wait
    for its next good canary; after a bad one, other workers do these jobs again. ``retried`` gets a
    text when jobs are done again. ``setup``: the `Setup`, or an object that unpickles as one.
    ``main``: whether workers also load the main module.
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
        require_open_files()
        self._setup, self._count, self._timeout = setup, count, timeout
        self._memory, self._clock, self._main = memory, clock, main
        self._retried = retried or (lambda text: None)
        self._cancelled = False
        self._starter: NurseryStarter | SpawnStarter | None = None
        self._seats: dict[int, Seat] = {}
        self._started = self._failed_starts = self._breaks = 0
        self._looked = 0.0
        self._seconds = 1.0  # of a job, roughly
        self._canary = ""  # the digest of the first worker's
        self._selector = SeatSelector()
        self._bell, self._heard = socket.socketpair()
        self._bell.setblocking(False)
        self._selector.register(self._heard, selectors.EVENT_READ)
        self._genomes = GenomeTokens()
        self._jobs = JobTable("", iter(()))

    @property
    def size(self) -> int:
        return self._count

    @property
    def described(self) -> dict:
        return {"engine": "workers", "workers": self._count}

    def stream(self, method: str, jobs: Jobs) -> Iterator[tuple[int, Outcome]]:
        """As `Engine.stream`. A stream that is closed before its end ends its workers. Raises
        `Cancelled` after `cancel`."""
        self._jobs = JobTable(method, jobs, self._genomes)
        self._stepped = time.monotonic(), time.thread_time()
        try:
            while self._jobs.draw(self._count):
                if self._cancelled:
                    raise Cancelled
                try:
                    self._step()
                except StarterFailure as error:
                    self._rebuild(str(error))
                done, self._jobs.outcomes = self._jobs.outcomes, {}
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

    def cancel(self) -> None:
        """Make `stream` end its workers and raise `Cancelled`, at once; another thread calls it."""
        self._cancelled = True
        self.wake()

    def __del__(self):
        with contextlib.suppress(Exception):
            self.close()

    # -- jobs ----------------------------------------------------------------------------

    def _step(self) -> None:
        self._fill_seats()
        self._hand_out()
        if self._jobs.outcomes:  # of jobs that cannot be sent: no worker will answer them
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
        jobs = self._jobs
        busy = any(seat.state in ("busy", "checking") for seat in self._seats.values())
        for seat in self._seats.values():
            if seat.state != "idle":
                continue
            waiting = jobs.suspects or jobs.waiting
            stays = not waiting or (jobs.suspects and busy)
            due = stays or self.is_prompt or seat.needs_check or jobs.isolates(seat, waiting[0])
            if seat.held and due:
                busy = True
                self._check(seat)
            elif not stays and self._send(seat, number := waiting.popleft()):
                busy, seat.job = True, number
                seat.enter("busy", self._clock())
        if self._seconds > _SHORT or jobs.suspects or self.is_prompt:
            return
        # a worker gets its next short job in advance
        for seat in self._seats.values():
            if len(jobs.waiting) <= len(self._seats):
                return
            ready = seat.state == "busy" and seat.next is None and not seat.needs_check
            if ready and not jobs.isolates(seat, jobs.waiting[0]):
                number = jobs.waiting.popleft()
                seat.next = number if self._send(seat, number) else None

    def _check(self, seat: Seat) -> None:
        """Ask a worker for its canary."""
        seat.send(write_frame((-1, CHECK, b"", (), ())))
        seat.enter("checking", self._clock())
        self._selector.watch(seat)

    def _send(self, seat: Seat, number: int) -> bool:
        """Send a job to a worker. Returns whether it could be pickled."""
        try:
            message = self._jobs.write(number, seat)
        except Exception as error:
            self._jobs.settle(number, Outcome("error", f"{type(error).__name__}: {error}"))
            return False
        seat.send(message)
        self._selector.watch(seat)
        return True

    def _listen(self, seat: Seat) -> None:
        try:
            for message in seat.messages():
                self._hear(seat, message)
        except (ValueError, TypeError) as error:
            self._end(seat, Outcome("died", f"the worker sent an invalid answer: {error}"))
        if seat.hung_up and seat.closed is None:
            seat.closed = self._clock()
        if seat.drain is not None:
            seat.drain.drain()
        self._selector.watch(seat)

    def _hear(self, seat: Seat, message: Ready | Answer | Checked) -> None:
        """Take a message of a worker: it is ready, answers a job, or evaluated its canary."""
        show(seat.text())
        if isinstance(message, Ready) and seat.state == "starting":
            self._take_ready(seat, message)
        elif isinstance(message, Checked) and seat.state == "checking":
            if self._judge_canary(seat, message.canary):
                seat.enter("idle", self._clock())
        elif isinstance(message, Answer) and seat.state == "busy" and message.number == seat.job:
            self._take_answer(seat, message)
        elif seat.state != "ending":
            raise ValueError(f"{type(message).__name__}, though the worker is {seat.state}")

    def _take_ready(self, seat: Seat, ready: Ready) -> None:
        seat.set_up(ready)
        self._canary = self._canary or ready.canary
        if ready.canary not in ("", self._canary):
            self._failed_starts += 1
            self._retried("a new worker computes other values than the first: it is replaced")
            self._end(seat)
            return
        seat.enter("idle", self._clock())
        self._failed_starts = 0

    def _take_answer(self, seat: Seat, answer: Answer) -> None:
        now, self._breaks = self._clock(), 0
        seconds, seat.job = now - seat.since, None
        self._seconds += (seconds - self._seconds) / 10
        seat.hold(answer.number, answer.outcome, seconds)
        judged = answer.leaves or not seat.canary
        if judged and not self._judge_canary(seat, answer.canary):
            return
        if seat.next is not None and not answer.leaves:
            seat.job, seat.next = seat.next, None
        seat.enter("ending" if answer.leaves else "idle" if seat.job is None else "busy", now)

    def _judge_canary(self, seat: Seat, digest: str) -> bool:
        """Settle what a worker held if its canary is good, else end it. Returns whether it is."""
        if digest != seat.canary:
            self._end(seat, Outcome("died", "the worker computes other values"), failed=True)
            return False
        for number, outcome in seat.take_held():
            self._jobs.settle(number, outcome)
        return True

    def _end(self, seat: Seat, outcome: Outcome | None = None, failed: bool = False) -> None:
        """End a worker, and its job with this ``outcome``; without one, the job waits again, as do
        those whose outcomes it held. ``failed``: whether its check failed."""
        if failed or (seat.state == "checking" and outcome is not None):
            self._retried(self._jobs.fail(seat.take_held()))
        self._release(seat, outcome)
        if seat.state != "ending":
            seat.enter("ending", self._clock())
            self._starter.end(seat.token)

    def _release(self, seat: Seat, outcome: Outcome | None = None) -> None:
        """Take the jobs from a worker that ends: its job has this ``outcome``, or waits again."""
        again = [number for number, _ in seat.held]
        if seat.job is not None and outcome is not None:
            self._jobs.settle_ended(seat, outcome)
        elif seat.job is not None:
            again.append(seat.job)
        if seat.next is not None:  # a job that the worker has not begun
            again.append(seat.next)
        seat.job = seat.next = None
        seat.take_held()
        self._jobs.requeue(again)

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
            self._started += 1
            seat = Seat(self._started, self._clock(), prints=not self._starter.inherits)
            self._seats[seat.token] = seat
            self._starter.start(seat.token, seat.theirs, seat.output)
            seat.close_worker_ends()
            seat.send(self._first)
            self._selector.watch(seat)

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
            self._jobs.strikes[number] += 1
            code = linux_processes.describe_exit_code(news.code)
            if news.code in _FROM_OUTSIDE and self._jobs.strikes[number] < 2:
                self._release(seat)
                self._retried(f"a worker was killed ({code}); its birth is done again")
            else:
                text = f"the worker ended with exit code {code}"
                self._release(seat, Outcome("died", text, self._clock() - seat.since))
        elif seat.state == "checking":
            self._retried(self._jobs.fail(seat.take_held()))
        elif seat.state == "starting":
            self._failed_starts += 1
        self._remove(seat)
        if self._failed_starts > self._count + 1:
            raise RunError(
                "the worker processes end before they start work",
                "worker processes that start and wait for work",
                "in a script, start the search under `if __name__ == '__main__':`; or set "
                "workers=0 to see the error",
            )

    def _remove(self, seat: Seat) -> None:
        self._release(seat)
        self._selector.unwatch(seat)
        seat.close()
        del self._seats[seat.token]

    def _judge(self) -> None:
        """End the workers that are past a deadline or a limit."""
        now = self._clock()
        for seat in list(self._seats.values()):
            spent = now - seat.since
            if seat.state in ("busy", "checking") and spent > self._timeout:
                strikes, number = self._jobs.strikes, seat.first
                if not strikes[number] and linux_processes.is_stopped(seat.pid):
                    strikes[number] += 1  # a stopped worker cannot answer
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
        """Take a standstill of this process, longer than ``patience``, from the workers' times."""
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
        """End all workers after a failure of the starter, and do their jobs again, one at a time. A
        job that fails it twice, the second time as the only one, is to blame."""
        lost = [seat.job for seat in self._seats.values() if seat.job is not None]
        jobs = self._jobs
        jobs.strikes.update(lost)
        for seat in self._seats.values():
            seat.job = None
        self._stop(abandon=True)
        if len(lost) == 1 and jobs.strikes[lost[0]] > 1:
            text = "it ended the process that starts the workers"
            jobs.settle(lost[0], Outcome("died", text))
        else:
            jobs.suspects.extend(one for one in lost if one not in jobs.suspects)
            self._breaks += 1
        if self._breaks > _REBUILDS:
            raise RunError(
                f"the worker processes cannot be started: {reason}",
                "an operating system that allows evocity to start and end processes",
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
            if seat.state in ("busy", "checking"):
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
