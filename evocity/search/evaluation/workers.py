"""The pool of worker processes: it hands out jobs, and judges deadlines, memory and deaths."""

import contextlib
import math
import selectors
import signal
import socket
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence

from evocity.errors import RunError, told_bytes
from evocity.search.evaluation import processes
from evocity.search.evaluation.frames import framed
from evocity.search.evaluation.output import show
from evocity.search.evaluation.seats import Seat
from evocity.search.evaluation.starting import Broken, News, Nursed, Spawned, first_words
from evocity.search.evaluator import Outcome, Setup

#: What starts workers may break so often, without an answer in between, before a run gives up.
_REBUILDS = 3
#: Seconds that a worker may take to be set up, to be started by a nursery that answers, to be gone.
_SETUP, _ANSWER = 600.0, 20.0
#: Seconds between two looks at the workers' memory; at those that print without end; at whether
#: workers ended, where nothing tells.
_LOOK, _FLOODED, _ASK = 0.5, 0.02, 0.05
#: Seconds from which on this process is told to have stood still, and those at most between two
#: looks at the clock while a job has its deadline.
_LATE, _BEAT = 0.2, 0.1
# Seconds of a job so short that waiting for the next would tell.
_SHORT = 0.05
# So many jobs a worker are drawn and wait: the next of each, and as many from which it comes.
_DRAWN = 3
_END = object()
# Ends that a measure hardly has by itself: such a birth is done again, once.
_FROM_OUTSIDE = tuple(
    -getattr(signal, name) for name in ("SIGKILL", "SIGTERM") if hasattr(signal, name)
)


class Workers:
    """Runs jobs in ``count`` worker processes; each job has ``timeout`` seconds, by ``clock``, and
    ``memory`` bytes besides what its worker has before, None without limit.

    A job that fails, hangs or ends its worker costs that job alone; a worker is ended with all
    processes that it began. Order and bits of the outcomes do not depend on ``count``. ``retried``
    is called with a text when jobs are done again: a worker was killed, or what starts them broke.
    ``setup`` is sent to the workers, and may be what becomes a setup there. ``main``: whether they
    load the main module too, as processes of multiprocessing do.
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
        self._starter: Nursed | Spawned | None = None
        self._seats: dict[int, Seat] = {}
        self._tokens = self._failed_starts = self._breaks = 0
        self._looked = 0.0
        self._seconds = 1.0  # that a job takes, roughly
        self._selector = selectors.DefaultSelector()
        self._watched: dict[int, int] = {}
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

    def run(self, method: str, jobs: Sequence[tuple | bytes]) -> list[Outcome]:
        """Outcomes of ``Evaluator.method(*job)``, in the order of ``jobs``; one may be framed
        already.

        Raises `RunError` if no workers can be had.
        """
        outcomes = dict(self.stream(method, iter(jobs)))
        return [outcomes[number] for number in range(len(jobs))]

    def stream(self, method: str, jobs: Iterator[tuple | None]) -> Iterator[tuple[int, Outcome]]:
        """As `Engine.stream`. One that is left before its end takes its workers with it.

        Raises `RunError` if no workers can be had.
        """
        self._begin(method, jobs)
        try:
            while self._draw():
                try:
                    self._step()
                except Broken as error:
                    self._rebuild(str(error))
                done, self._outcomes = self._outcomes, {}
                yield from done.items()
        except BaseException:
            self._stop()  # jobs of theirs are nobody's any more
            raise

    def close(self) -> None:
        """End all workers, and what they began; safe to call twice."""
        self._stop()
        self._selector.close()
        self._bell.close()
        self._heard.close()

    def wake(self) -> None:
        """Have `run` look at the clock at once; called by another thread."""
        with contextlib.suppress(OSError):  # it will anyway
            self._bell.send(b"!")

    def __del__(self):
        with contextlib.suppress(Exception):
            self.close()

    # -- jobs ----------------------------------------------------------------------------

    def _begin(self, method: str, jobs: Iterator[tuple | None]) -> None:
        self._method, self._coming = method, jobs
        self._stepped = time.monotonic(), time.thread_time()
        self._drawn, self._ended = 0, False
        self._jobs: dict[int, tuple] = {}  # by their numbers, those without an outcome
        self._outcomes: dict[int, Outcome] = {}  # those that nobody was told of
        self._waiting: deque[int] = deque()
        # of these one at a time, for one of them may break what starts workers
        self._alone: deque[int] = deque()
        self._strikes: Counter[int] = Counter()

    def _draw(self) -> bool:
        """Draw jobs, so many that each worker can have its next; whether any is to be done."""
        while not self._ended and len(self._waiting) < _DRAWN * self._count:
            job = next(self._coming, _END)
            self._ended = job is _END
            if job is None or self._ended:
                break
            self._jobs[self._drawn] = job
            self._waiting.append(self._drawn)
            self._drawn += 1
        if not self._jobs and not self._ended:
            raise RuntimeError("no job is given while none is at work: there is none to wait for")
        return bool(self._jobs)

    def _settle(self, number: int, outcome: Outcome) -> None:
        """A job is done."""
        del self._jobs[number]
        self._outcomes[number] = outcome

    def _step(self) -> None:
        self._fill_seats()
        self._hand_out()
        if self._outcomes:  # of jobs that cannot be sent: nothing will tell of them
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
            waiting = self._alone or self._waiting
            if not waiting or (self._alone and busy):
                return
            if seat.state == "idle" and self._sent(seat, number := waiting.popleft()):
                busy, seat.job = True, number
                seat.enter("busy", self._clock())
        if self._seconds > _SHORT or self._alone:
            return
        # of short jobs each worker has the next at hand
        for seat in self._seats.values():
            if len(self._waiting) <= len(self._seats):
                return
            if seat.state == "busy" and seat.next is None:
                number = self._waiting.popleft()
                seat.next = number if self._sent(seat, number) else None

    def _sent(self, seat: Seat, number: int) -> bool:
        try:
            job = self._jobs[number]
            job = job if isinstance(job, bytes) else bytes(framed(job))
            told = framed((number, self._method, job))
        except Exception as error:  # it cannot be sent to another process
            self._settle(number, Outcome("error", f"{type(error).__name__}: {error}"))
            return False
        seat.send(told)
        self._watch(seat)
        return True

    def _listen(self, seat: Seat) -> None:
        try:
            for message in seat.messages():
                self._hear(seat, *message)
        except (ValueError, TypeError) as error:
            self._lose(seat, Outcome("died", f"the worker sent what is no answer: {error}"))
        if seat.hung_up and seat.closed is None:
            seat.closed = self._clock()
        if seat.drain is not None:
            seat.drain.drain()
        self._watch(seat)

    def _hear(self, seat: Seat, what: str, *told) -> None:
        show(seat.text())
        if what == "ready":
            (seat.resident,) = told
            seat.enter("idle", self._clock())
            self._failed_starts = 0
            return
        number, outcome, leaves = told
        if seat.state != "busy" or number != seat.job or not isinstance(outcome, Outcome):
            raise ValueError(f"job {number!r}")
        self._settle(number, outcome)
        now, self._breaks = self._clock(), 0
        self._seconds += (now - seat.since - self._seconds) / 10
        seat.job = None
        if seat.next is not None and not leaves:
            seat.job, seat.next = seat.next, None
        seat.enter("ending" if leaves else "idle" if seat.job is None else "busy", now)

    def _lose(self, seat: Seat, outcome: Outcome) -> None:
        """End a worker, whose job ends so."""
        if seat.job is not None:
            self._settle(seat.job, outcome)
            seat.job = None
        if seat.state != "ending":
            seat.enter("ending", self._clock())
            self._starter.end(seat.token)

    # -- workers -------------------------------------------------------------------------

    def _fill_seats(self) -> None:
        if self._starter is None:
            self._starter = (Nursed if processes.LINUX else Spawned)(self._setup)
            self._answered: float | None = None  # when what starts workers was first heard of
            if self._starter.handle is not None:
                self._selector.register(self._starter.handle, selectors.EVENT_READ)
            inherits = self._starter.inherits
            self._first = first_words(inherits, self._setup, self._memory, self._main)
        while len(self._seats) < self._count:
            self._tokens += 1
            seat = Seat(self._tokens, self._clock(), prints=not self._starter.inherits)
            self._seats[seat.token] = seat
            self._starter.start(seat.token, seat.theirs, seat.printed)
            seat.given()
            seat.send(self._first)
            self._watch(seat)

    def _take(self, news: News) -> None:
        seat = self._seats.get(news.token)
        if seat is None:
            return
        if news.what == "started":
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
                self._retried(
                    f"a worker was killed ({processes.code_told(news.code)}): its birth again"
                )
            else:
                text = f"the worker ended with exit code {processes.code_told(news.code)}"
                self._settle(number, Outcome("died", text, seconds))
        elif seat.state == "starting":
            self._failed_starts += 1
        self._leave(seat)
        if self._failed_starts > self._count + 1:
            raise RunError(
                "the worker processes end before they take up work",
                "workers that start",
                "a script must start a search under `if __name__ == '__main__':`; "
                "else try workers=0, which shows what fails",
            )

    def _leave(self, seat: Seat) -> None:
        if seat.next is not None:  # not begun
            self._waiting.appendleft(seat.next)
        self._unwatch(seat)
        seat.close()
        del self._seats[seat.token]

    def _judge(self) -> None:
        now = self._clock()
        for seat in list(self._seats.values()):
            spent = now - seat.since
            if seat.state == "busy" and spent > self._timeout and self._again(seat):
                self._retried("a worker was stopped beyond its deadline: its birth again")
            elif seat.state == "busy" and spent > self._timeout:
                text = f"no result after {self._timeout:g} s"
                self._lose(seat, Outcome("timeout", text, float(self._timeout)))
            elif seat.job is not None and seat.closed and now - seat.closed > _ANSWER:
                self._lose(seat, Outcome("died", "the worker closed its connection", spent))
            elif seat.state == "ending" and spent > _ANSWER:
                raise Broken("a worker that was ended is still there")
            elif seat.state == "starting" and spent > _SETUP:
                raise Broken(f"a worker was not ready after {_SETUP:g} s")
            elif not seat.pid and self._unanswered(seat) > _ANSWER:
                raise Broken("the process that starts the workers does not answer")
            elif seat.drain is not None and seat.drain.flooded:
                seat.drain.drain()
        if self._memory is not None and processes.LINUX and now - self._looked > _LOOK:
            self._looked = now
            self._weigh()

    def _again(self, seat: Seat) -> bool:
        """Whether the worker's job is begun again, once: it stood still, so it could not answer."""
        if self._strikes[seat.job] or not processes.is_stopped(seat.pid):
            return False
        self._strikes[seat.job] += 1
        self._waiting.appendleft(seat.job)
        seat.job = None
        seat.enter("ending", self._clock())
        self._starter.end(seat.token)
        return True

    def _forgive(self, patience: float) -> None:
        """Time in which this process had no processor, though it did not ask to wait, is no
        worker's: it was stopped, and its workers maybe with it."""
        before, worked = self._stepped
        self._stepped = time.monotonic(), time.thread_time()
        still = self._stepped[0] - before - (self._stepped[1] - worked) - patience
        if still > _LATE:
            for seat in self._seats.values():
                seat.since += still

    def _unanswered(self, seat: Seat) -> float:
        """Seconds for which a nursery that answers has not started a worker."""
        since = math.inf if self._answered is None else max(self._answered, seat.since)
        return self._clock() - since

    def _weigh(self) -> None:
        for seat in self._seats.values():
            if seat.state == "busy" and seat.pid:
                found = processes.taken(seat.pid, seat.resident, self._memory)
                if found > self._memory:
                    text = f"it takes {told_bytes(found)}; allowed: {told_bytes(self._memory)}"
                    self._lose(seat, Outcome("memory", text, self._clock() - seat.since))

    def _rebuild(self, reason: str) -> None:
        """What starts workers broke: all are ended, and those jobs done again, one at a time; one
        that breaks it twice, the last time alone, is to blame."""
        lost = [seat.job for seat in self._seats.values() if seat.job is not None]
        self._strikes.update(lost)
        self._abandon()
        if len(lost) == 1 and self._strikes[lost[0]] > 1:
            text = "it ended the process that starts the workers"
            self._settle(lost[0], Outcome("died", text))
        else:
            self._alone.extend(one for one in lost if one not in self._alone)
            self._breaks += 1
        if self._breaks > _REBUILDS:
            raise RunError(
                f"the worker processes cannot be started: {reason}",
                "a system on which processes can be started and ended",
                "try fewer workers, or workers=0",
            )
        self._retried(reason)

    def _abandon(self) -> None:
        starter, self._starter = self._starter, None
        pids = [seat.pid for seat in self._seats.values() if seat.pid]
        self._unseat(starter)
        if starter is not None:
            starter.abandon(pids)

    def _stop(self) -> None:
        starter, self._starter = self._starter, None
        self._unseat(starter)
        if starter is not None:
            starter.close()

    def _unseat(self, starter: Nursed | Spawned | None) -> None:
        if starter is not None and starter.handle is not None:
            with contextlib.suppress(KeyError, ValueError):
                self._selector.unregister(starter.handle)
        for seat in list(self._seats.values()):
            show(seat.text())
            self._leave(seat)

    # -- waiting -------------------------------------------------------------------------

    def _patience(self) -> float:
        """Seconds until something is to be looked at."""
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
        """See what it sends, and prints unless that is too much, and when it takes more."""
        events = selectors.EVENT_READ | (selectors.EVENT_WRITE if seat.writing else 0)
        self._register(seat.handle.fileno(), 0 if seat.hung_up else events, seat)
        if seat.drain is not None:
            calm = not seat.drain.flooded and not seat.drain.ended
            self._register(seat.drain.descriptor, selectors.EVENT_READ if calm else 0, seat)

    def _unwatch(self, seat: Seat) -> None:
        self._register(seat.handle.fileno(), 0, seat)
        if seat.drain is not None:
            self._register(seat.drain.descriptor, 0, seat)

    def _register(self, descriptor: int, events: int, seat: Seat) -> None:
        before = self._watched.get(descriptor, 0)
        if events == before:
            return
        if not before:
            self._selector.register(descriptor, events, seat)
        elif events:
            self._selector.modify(descriptor, events, seat)
        else:
            self._selector.unregister(descriptor)
        self._watched[descriptor] = events
