"""An engine of many machines: chunks of jobs go to the workers of a Dask cluster, each of which
hosts workers of evocity's own.

A chunk is about a tenth of a second of work, and less at the end, so that none waits for the last.
Each seat has two of them, one to follow at once. What is lost with a worker, or with the
scheduler, is done again: births do not depend on where they are bred.
"""

import contextlib
import time
import uuid
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import Any

from evocity.errors import RunError
from evocity.search.evaluation.frames import framed
from evocity.search.evaluation.link import (
    CONNECT,
    EMBEDDED,
    Link,
    Lost,
    installing,
    leaving,
    versions_of,
)
from evocity.search.evaluation.parcels import Parcel
from evocity.search.evaluator import Outcome

#: Seconds of work in a chunk, in the last ones at least; bytes in one at most.
_CHUNK, _LEAST, _HEAVY = 0.1, 0.03, 1 << 23
#: Chunks that a seat has, one at work.
_DEPTH = 2
#: Seconds for a scheduler that was lost, or for workers, to come (back).
PATIENCE = 600.0
#: Seconds between two looks at which workers there are, between two tries to connect.
_LOOK, _TRY = 1.0, 1.0
_END = object()


@dataclass
class _Job:
    number: int
    told: bytes


@dataclass
class _Site:
    """A Dask worker: the worker processes that it hosts, and the chunks it was given."""

    seats: int
    chunks: int = 0


@dataclass
class _Chunk:
    jobs: list[_Job]
    site: str


class Cluster:
    """Runs jobs on the Dask cluster at ``address``: "tcp://…", "tls://…", or "local:N", N embedded
    workers. Each hosts ``seats`` worker processes, None for as many as it has threads; ``timeout``
    and ``memory`` as in `Workers`. ``tell`` and ``retried`` are told in words what is waited for
    before, and while jobs are done.

    Raises `RunError` if the cluster cannot be reached or serves no births of the same bits.
    """

    def __init__(
        self,
        parcel: Parcel,
        address: str,
        seats: int | None,
        timeout: float,
        memory: int | None,
        tell: Callable[[str], None],
        retried: Callable[[str], None],
    ):
        self._parcel, self._address, self._seats = parcel, address, seats
        self._timeout, self._memory, self._retried = timeout, memory, retried
        self._name = f"{parcel.digest}-{uuid.uuid4().hex[:8]}"  # nobody else's, who does the same
        self._sites: dict[str, _Site] = {}
        self._left_out: dict[str, str] = {}
        self._number = 0
        self._seconds = 1.0  # that a job takes, roughly
        self._looked = 0.0
        self._forget()
        self._link: Link | None = None
        try:
            self._link = Link(address)
            self._wait_for_sites(tell, strictly=True)
        except BaseException as error:
            came = self._link is not None
            self.close()
            if not isinstance(error, Lost):
                raise
            how = "any more, before a worker came" if came else f"within {CONNECT:g} s"
            raise RunError(
                f"no Dask scheduler answers at {address} {how} ({error})",
                "a scheduler that runs, at an address that can be reached from here",
                "start one: dask scheduler; or search on this machine, with --cluster none",
            ) from None

    @property
    def size(self) -> int:
        return sum(site.seats for site in self._sites.values())

    @property
    def described(self) -> Mapping[str, Any]:
        told = {"engine": "dask", "cluster": self._address}
        return told | {"dask_workers": len(self._sites), "workers": self.size}

    def run(self, method: str, jobs: Sequence[tuple]) -> list[Outcome]:
        """Outcomes of ``Evaluator.method(*job)``, in the order of ``jobs``. Raises `RunError` if
        the cluster is gone and does not come back in time."""
        found = dict(self.stream(method, iter(jobs)))
        return [found[number] for number in range(len(jobs))]

    def stream(self, method: str, jobs: Iterator[tuple | None]) -> Iterator[tuple[int, Outcome]]:
        """As `Engine.stream`. Raises `RunError` as `run` does."""
        if self._link is None:
            raise ValueError("the cluster was left")
        self._forget()
        self._feed = jobs
        try:
            while True:
                yield from self._fetch()
                if not self._flying and not self._waiting and not self._alone:
                    if self._feed is None:
                        return
                    raise RuntimeError("no job is given while none is at work")
                found: list[tuple[int, Outcome]] = []
                try:
                    self._hand_out(method)
                    self._hear(found)
                    self._look()
                except Lost as error:
                    self._connect_again(error)
                yield from found  # what came before the scheduler was lost too
        except BaseException:
            self._drop()
            raise

    def close(self) -> None:
        """Leave the cluster. Safe to call twice."""
        if self._link is not None:
            self._drop()
            self._link.close()
            self._link = None

    # -- jobs ----------------------------------------------------------------------------

    def _forget(self) -> None:
        self._feed: Iterator | None = None
        self._waiting: deque[_Job] = deque()
        # of these one at a time: one of them may end the Dask worker that it comes to
        self._alone: deque[_Job] = deque()
        self._suspects: set[int] = set()
        self._flying: dict[int, _Chunk] = {}
        self._heard: SimpleQueue = SimpleQueue()
        self._given = 0

    def _fetch(self) -> Iterator[tuple[int, Outcome]]:
        """Take the next jobs, enough for all seats; outcomes of those that cannot be sent."""
        wanted = _DEPTH * max(1, self.size) * self._most
        while self._feed is not None and len(self._waiting) < wanted:
            job = next(self._feed, _END)
            if job is _END:
                self._feed = None
            elif job is None:
                return
            else:
                number, self._given = self._given, self._given + 1
                try:
                    self._waiting.append(_Job(number, bytes(framed(job))))
                except Exception as error:
                    yield number, Outcome("error", f"{type(error).__name__}: {error}")

    @property
    def _most(self) -> int:
        return max(1, int(_CHUNK / self._seconds))

    def _hand_out(self, method: str) -> None:
        while self._alone or self._waiting:
            if self._alone and self._flying:
                return
            free = [
                (site.chunks / site.seats, address)
                for address, site in self._sites.items()
                if site.chunks < _DEPTH * site.seats
            ]
            if not free:
                return
            address = min(free)[1]
            if self._alone:
                jobs = [self._alone.popleft()]
            else:
                fair = max(
                    -(-len(self._waiting) // (_DEPTH * self.size)), int(_LEAST / self._seconds)
                )
                jobs, weight = [self._waiting.popleft()], 0
                while self._waiting and len(jobs) < min(fair, self._most) and weight < _HEAVY:
                    jobs.append(self._waiting.popleft())
                    weight += len(jobs[-1].told)
            self._number += 1
            self._flying[self._number] = _Chunk(jobs, address)
            self._sites[address].chunks += 1
            told = [job.told for job in jobs]
            self._link.send(self._number, address, self._heard, self._name, method, told)

    def _hear(self, found: list[tuple[int, Outcome]]) -> None:
        """Add to ``found`` what came of chunks, waited for a while. Raises `Lost`."""
        with contextlib.suppress(Empty):
            told = self._heard.get(timeout=_LOOK)
            while True:
                found += self._take(*told)
                told = self._heard.get_nowait()

    def _take(self, number: int, ended: str, what: Any) -> list[tuple[int, Outcome]]:
        chunk = self._flying.get(number)
        if chunk is None:
            return []
        if ended == "lost":
            raise Lost(what)
        del self._flying[number]
        if site := self._sites.get(chunk.site):
            site.chunks -= 1
        if ended == "killed":
            return self._suspect(chunk)
        if ended == "failed" or (what is not None and what.failed):
            self._leave_out(chunk.site, what if ended == "failed" else what.failed)
        if ended == "failed" or what is None or what.failed:
            self._waiting.extendleft(reversed(chunk.jobs))
            if ended == "done" and what is None:  # it began anew, or another took the chunk
                self._install(list(self._link.sites()), strictly=False)
            return []
        for note in what.notes:
            self._retried(f"{note} (at {chunk.site})")
        self._seconds += (what.seconds / len(chunk.jobs) - self._seconds) / 3
        return [(job.number, one) for job, one in zip(chunk.jobs, what.outcomes, strict=True)]

    def _suspect(self, chunk: _Chunk) -> list[tuple[int, Outcome]]:
        """Of a chunk with which several Dask workers ended."""
        if len(chunk.jobs) == 1 and chunk.jobs[0].number in self._suspects:
            text = "the Dask workers that had it ended, one after the other"
            return [(chunk.jobs[0].number, Outcome("died", text))]
        self._suspects |= {job.number for job in chunk.jobs}
        self._alone.extend(chunk.jobs)
        self._retried("Dask workers ended, one after the other: their births again, one at a time")
        return []

    def _requeue(self) -> None:
        """Have what was sent done again."""
        for chunk in reversed(self._flying.values()):
            self._waiting.extendleft(reversed(chunk.jobs))
        self._flying.clear()
        self._heard = SimpleQueue()
        for site in self._sites.values():
            site.chunks = 0

    def _drop(self) -> None:
        """Whatever is done there is nobody's any more."""
        if self._link is not None and self._sites:
            with contextlib.suppress(Exception):
                self._link.ask(leaving(), list(self._sites), self._name, seconds=CONNECT / 2)
        self._sites.clear()
        self._forget()

    # -- sites ---------------------------------------------------------------------------

    def _look(self) -> None:
        """See, now and then, which workers came and went."""
        if time.monotonic() - self._looked < _LOOK and self._sites:
            return
        self._looked = time.monotonic()
        there = self._link.sites()
        for address in [one for one in self._sites if one not in there]:
            lost = self._sites.pop(address)
            if lost.chunks:
                self._retried(f"the Dask worker at {address} is gone: its births again, elsewhere")
        new = [one for one in there if one not in self._sites and one not in self._left_out]
        if new:
            self._install(new, strictly=False)
        if not self._sites:
            self._wait_for_sites(self._retried)

    def _wait_for_sites(self, tell: Callable[[str], None], strictly: bool = False) -> None:
        """Wait until a worker is there. ``strictly``: refuse one that does not serve."""
        until, told = time.monotonic() + PATIENCE, False
        while True:
            there = [one for one in self._link.sites() if one not in self._left_out]
            self._install(there, strictly)
            if self._sites:
                return
            if self._left_out and not there:
                raise self._unfit()
            if time.monotonic() > until:
                raise RunError(
                    f"no worker came to the Dask scheduler at {self._address} in {PATIENCE:g} s",
                    "a cluster with workers",
                    f"start some: dask worker {self._address}; then: evocity resume RUN",
                )
            if not told:
                told = True
                tell(
                    f"waiting for workers of the Dask cluster at {self._address}, "
                    f"{PATIENCE:g} s at most"
                )
            time.sleep(_TRY / 2)

    def _install(self, addresses: Sequence[str], strictly: bool) -> None:
        """Send what workers must know to those that do not have it."""
        if not addresses:
            return
        here = versions_of()()
        for address, found in self._link.ask(versions_of(), addresses).items():
            if reason := _differing(here, found):
                self._leave_out(address, reason, quietly=strictly)
        if strictly and self._left_out:
            raise self._unfit()
        fit = [one for one in addresses if one not in self._left_out]
        parcel = self._parcel.told, self._parcel.files, self._parcel.sides, self._parcel.parts
        given = self._name, parcel, self._seats, self._timeout, self._memory
        for address, seats in (self._link.ask(installing(), fit, *given) if fit else {}).items():
            if isinstance(seats, int):
                self._sites.setdefault(address, _Site(seats))
            elif not isinstance(seats, OSError):  # it went meanwhile
                self._leave_out(address, f"{type(seats).__name__}: {seats}", quietly=strictly)
        if strictly and self._left_out:
            raise self._unfit()

    def _leave_out(self, address: str, reason: str, quietly: bool = False) -> None:
        self._left_out[address] = reason
        self._sites.pop(address, None)
        if not quietly:
            self._retried(f"the Dask worker at {address} is left out: {reason}")

    def _unfit(self) -> RunError:
        address, reason = next(iter(self._left_out.items()))
        more = f", and {len(self._left_out) - 1} more" if len(self._left_out) > 1 else ""
        return RunError(
            f"the Dask worker at {address} does not serve{more}: {reason}",
            "workers with the same evocity, Python and libraries as here, for the same births",
            "install the same versions there, and start the workers again",
        )

    def _connect_again(self, error: Lost) -> None:
        """After the scheduler was lost: connect to it anew, and have all done that was sent."""
        self._requeue()
        self._sites.clear()
        self._left_out.clear()
        self._retried(
            f"the Dask scheduler at {self._address} is gone ({error}): waiting for it, "
            f"{PATIENCE:g} s at most"
        )
        until = time.monotonic() + PATIENCE
        while True:
            with contextlib.suppress(Exception):
                self._link.close()
            try:
                self._link = Link(self._address)
                self._wait_for_sites(self._retried)
            except Lost as again:
                if time.monotonic() > until:
                    raise RunError(
                        f"the Dask scheduler at {self._address} did not come back in "
                        f"{PATIENCE:g} s ({again})",
                        "a scheduler that runs",
                        "start it again, and its workers; then: evocity resume RUN",
                    ) from None
                time.sleep(_TRY)
            else:
                self._retried(f"the Dask scheduler at {self._address} is back: births go on")
                return


def _differing(here: Mapping[str, str | None], there: Any) -> str:
    """In words, what differs there in what decides the bits of births; "" if nothing does."""
    if isinstance(there, OSError):  # it went meanwhile
        return ""
    if not isinstance(there, Mapping):
        return f"it does not tell its versions ({there})"
    if there["evocity"] is None:
        return "evocity is not installed there"
    differ = [name for name in here if here[name] != there[name]]
    if "evocity" in differ or set(differ) != {"evocity's source"}:
        differ = [name for name in differ if name != "evocity's source"]
    return ", ".join(f"{name} {there[name]} there, {here[name]} here" for name in differ)


__all__ = ["EMBEDDED", "PATIENCE", "Cluster"]
