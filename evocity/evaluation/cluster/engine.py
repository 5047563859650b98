"""The engine for many machines: it hands chunks of jobs to the workers of a Dask cluster.

Each Dask worker hosts evocity's own worker processes, its seats. A chunk is about a tenth of a
second of work, and less at the end, so that all seats finish together. Each seat has two chunks,
one to follow at once. Jobs that are lost with a worker, or with the scheduler, are done again:
births do not depend on the machine.
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
from evocity.evaluation.cluster.dask_link import (
    CONNECT,
    Link,
    SchedulerLost,
    make_install,
    make_leave,
    make_versions,
)
from evocity.evaluation.cluster.parcel import Parcel
from evocity.evaluation.engine import Engine, Jobs
from evocity.evaluation.evaluator import Outcome
from evocity.evaluation.frames import write_frame
from evocity.recipe.values import describe_reach

#: Seconds of work in a chunk; the least seconds in the last chunks; the most bytes in a chunk.
_CHUNK, _LEAST, _HEAVY = 0.1, 0.03, 1 << 23
#: Chunks of a seat, of which one is at work.
_DEPTH = 2
#: The most seconds to wait for a lost scheduler, or for workers.
PATIENCE = 600.0
#: Seconds between two checks of the workers, and between two tries to connect.
_LOOK, _TRY = 1.0, 1.0
_END = object()


@dataclass
class _Job:
    number: int
    frame: bytes


@dataclass
class _Site:
    """A Dask worker: the number of its seats, and of its chunks."""

    seats: int
    chunks: int = 0


@dataclass
class _Chunk:
    jobs: list[_Job]
    site: str


class Cluster(Engine):
    """Runs jobs on the Dask cluster at ``address``: "tcp://…", "tls://…", or "local:N", N embedded
    workers. Each hosts ``seats`` worker processes, None for as many as it has threads; ``timeout``
    and ``memory`` as in `Workers`. ``tell`` gets a text when it waits before the first job,
    ``retried`` when it waits or does jobs again later.

    Raises `RunError` if the cluster cannot be reached, or would breed births of other bits.
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
        self.notes = describe_reach(address)
        self._timeout, self._memory, self._retried = timeout, memory, retried
        self._name = f"{parcel.digest}-{uuid.uuid4().hex[:8]}"  # another search may do the same
        self._sites: dict[str, _Site] = {}
        self._left_out: dict[str, str] = {}
        self._number = 0
        self._seconds = 1.0  # of a job, roughly
        self._looked = 0.0
        self._reset()
        self._link: Link | None = None
        try:
            self._link = Link(address)
            self._wait_for_sites(tell, strictly=True)
        except BaseException as error:
            connected = self._link is not None
            self.close()
            if not isinstance(error, SchedulerLost):
                raise
            how = "any more, before a worker came" if connected else f"within {CONNECT:g} s"
            raise RunError(
                f"no Dask scheduler answers at {address} {how} ({error})",
                "the address of a running scheduler that this machine can reach",
                "start a scheduler with: dask scheduler; or search on this machine with --cluster "
                "none",
            ) from None

    @property
    def size(self) -> int:
        return sum(site.seats for site in self._sites.values())

    @property
    def described(self) -> Mapping[str, Any]:
        sizes = {"dask_workers": len(self._sites), "workers": self.size}
        return {"engine": "dask", "cluster": self._address} | sizes

    def stream(self, method: str, jobs: Jobs) -> Iterator[tuple[int, Outcome]]:
        """As `Engine.stream`. Raises `RunError` if the cluster does not come back in time."""
        if self._link is None:
            raise ValueError("the engine is closed")
        self._reset()
        self._feed = jobs
        try:
            while True:
                yield from self._fetch()
                if not self._flying and not self._waiting and not self._suspects:
                    if self._feed is None:
                        return
                    raise RuntimeError("no job is given while no job is at work")
                outcomes: list[tuple[int, Outcome]] = []
                try:
                    self._hand_out(method)
                    self._hear(outcomes)
                    self._look()
                except SchedulerLost as error:
                    self._reconnect(error)
                yield from outcomes  # also those that came before the scheduler was lost
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

    def _reset(self) -> None:
        self._feed: Iterator | None = None
        self._waiting: deque[_Job] = deque()
        # these run one at a time, because one of them may end its Dask worker
        self._suspects: deque[_Job] = deque()
        self._struck: set[int] = set()  # numbers of all suspects so far
        self._flying: dict[int, _Chunk] = {}
        self._heard: SimpleQueue = SimpleQueue()
        self._drawn = 0

    def _fetch(self) -> Iterator[tuple[int, Outcome]]:
        """Draw the next jobs for all seats; yields outcomes of jobs that pickle cannot write."""
        enough = _DEPTH * max(1, self.size) * self._most
        while self._feed is not None and len(self._waiting) < enough:
            job = next(self._feed, _END)
            if job is _END:
                self._feed = None
            elif job is None:
                return
            else:
                number, self._drawn = self._drawn, self._drawn + 1
                try:
                    self._waiting.append(_Job(number, bytes(write_frame(job))))
                except Exception as error:
                    yield number, Outcome("error", f"{type(error).__name__}: {error}")

    @property
    def _most(self) -> int:
        """The most jobs in a chunk."""
        return max(1, int(_CHUNK / self._seconds))

    def _hand_out(self, method: str) -> None:
        while self._suspects or self._waiting:
            if self._suspects and self._flying:
                return
            free = [
                (site.chunks / site.seats, address)
                for address, site in self._sites.items()
                if site.chunks < _DEPTH * site.seats
            ]
            if not free:
                return
            address = min(free)[1]
            if self._suspects:
                jobs = [self._suspects.popleft()]
            else:
                fair = max(
                    -(-len(self._waiting) // (_DEPTH * self.size)), int(_LEAST / self._seconds)
                )
                jobs, weight = [self._waiting.popleft()], 0
                while self._waiting and len(jobs) < min(fair, self._most) and weight < _HEAVY:
                    jobs.append(self._waiting.popleft())
                    weight += len(jobs[-1].frame)
            self._number += 1
            self._flying[self._number] = _Chunk(jobs, address)
            self._sites[address].chunks += 1
            frames = [job.frame for job in jobs]
            self._link.send(self._number, address, self._heard, self._name, method, frames)

    def _hear(self, outcomes: list[tuple[int, Outcome]]) -> None:
        """Wait a while for chunks, and add their ``outcomes``. Raises `SchedulerLost`."""
        with contextlib.suppress(Empty):
            message = self._heard.get(timeout=_LOOK)
            while True:
                outcomes += self._take(*message)
                message = self._heard.get_nowait()

    def _take(self, number: int, ending: str, result: Any) -> list[tuple[int, Outcome]]:
        """Take the ``result`` of a chunk, as `Link.send` describes it; returns its outcomes."""
        chunk = self._flying.get(number)
        if chunk is None:
            return []
        if ending == "lost":
            raise SchedulerLost(result)
        del self._flying[number]
        if site := self._sites.get(chunk.site):
            site.chunks -= 1
        if ending == "killed":
            return self._suspect(chunk)
        failed = result if ending == "failed" else result and result.failed
        if failed:
            self._leave_out(chunk.site, failed)
        if failed or result is None:
            self._waiting.extendleft(reversed(chunk.jobs))
            if result is None:  # the Dask worker started again, or another one took the chunk
                self._install(list(self._link.sites()), strictly=False)
            return []
        for note in result.notes:
            self._retried(f"{note} (at {chunk.site})")
        self._seconds += (result.seconds / len(chunk.jobs) - self._seconds) / 3
        return [(job.number, one) for job, one in zip(chunk.jobs, result.outcomes, strict=True)]

    def _suspect(self, chunk: _Chunk) -> list[tuple[int, Outcome]]:
        """Suspect the jobs of a chunk, while which several Dask workers ended."""
        if len(chunk.jobs) == 1 and chunk.jobs[0].number in self._struck:
            text = "the Dask workers that had it ended, one after the other"
            return [(chunk.jobs[0].number, Outcome("died", text))]
        self._struck |= {job.number for job in chunk.jobs}
        self._suspects.extend(chunk.jobs)
        self._retried(
            "Dask workers ended, one after the other; their births are done again, one at a time"
        )
        return []

    def _requeue(self) -> None:
        """Put back all jobs that were sent."""
        for chunk in reversed(self._flying.values()):
            self._waiting.extendleft(reversed(chunk.jobs))
        self._flying.clear()
        self._heard = SimpleQueue()
        for site in self._sites.values():
            site.chunks = 0

    def _drop(self) -> None:
        """Drop all jobs, and end the hosts."""
        if self._link is not None and self._sites:
            with contextlib.suppress(Exception):
                self._link.ask(make_leave(), list(self._sites), self._name, seconds=CONNECT / 2)
        self._sites.clear()
        self._reset()

    # -- sites ---------------------------------------------------------------------------

    def _look(self) -> None:
        """Check, now and then, which workers came and went."""
        if time.monotonic() - self._looked < _LOOK and self._sites:
            return
        self._looked = time.monotonic()
        there = self._link.sites()
        for address in [one for one in self._sites if one not in there]:
            del self._sites[address]  # another worker may have done its chunks again already
            self._retried(
                f"the Dask worker at {address} is gone; births that it had are done again elsewhere"
            )
        new = [one for one in there if one not in self._sites and one not in self._left_out]
        if new:
            self._install(new, strictly=False)
        if not self._sites:
            self._wait_for_sites(self._retried)

    def _wait_for_sites(self, tell: Callable[[str], None], strictly: bool = False) -> None:
        """Wait until there is a worker. ``strictly``: raise `RunError` if one does not fit."""
        until, reported = time.monotonic() + PATIENCE, False
        while True:
            there = [one for one in self._link.sites() if one not in self._left_out]
            self._install(there, strictly)
            if self._sites:
                return
            if self._left_out and not there:
                raise self._unfit_error()
            if time.monotonic() > until:
                raise RunError(
                    f"no worker came to the Dask scheduler at {self._address} within {PATIENCE:g} "
                    "s",
                    "a Dask cluster with at least one worker",
                    f"start workers with: dask worker {self._address}; then run: evocity resume "
                    "RUN",
                )
            if not reported:
                reported = True
                tell(
                    f"waiting for workers of the Dask cluster at {self._address}, "
                    f"at most {PATIENCE:g} s"
                )
            time.sleep(_TRY / 2)

    def _install(self, addresses: Sequence[str], strictly: bool) -> None:
        """Install the host in the workers at ``addresses`` that fit; leave out the others."""
        if not addresses:
            return
        here = make_versions()()
        for address, there in self._link.ask(make_versions(), addresses).items():
            if reason := _describe_difference(here, there):
                self._leave_out(address, reason, quietly=strictly)
        if strictly and self._left_out:
            raise self._unfit_error()
        fit = [one for one in addresses if one not in self._left_out]
        parcel = self._parcel.setup, self._parcel.files, self._parcel.sides, self._parcel.parts
        given = self._name, parcel, self._seats, self._timeout, self._memory
        for address, seats in (self._link.ask(make_install(), fit, *given) if fit else {}).items():
            if isinstance(seats, int):
                self._sites.setdefault(address, _Site(seats))
            elif not isinstance(seats, OSError):  # an OSError means that the worker is gone
                self._leave_out(address, f"{type(seats).__name__}: {seats}", quietly=strictly)
        if strictly and self._left_out:
            raise self._unfit_error()

    def _leave_out(self, address: str, reason: str, quietly: bool = False) -> None:
        self._left_out[address] = reason
        self._sites.pop(address, None)
        if not quietly:
            self._retried(f"the Dask worker at {address} is left out: {reason}")

    def _unfit_error(self) -> RunError:
        address, reason = next(iter(self._left_out.items()))
        more = f", and {len(self._left_out) - 1} more" if len(self._left_out) > 1 else ""
        return RunError(
            f"the Dask worker at {address} cannot be used{more}: {reason}",
            "workers with the same versions of evocity, Python and libraries as on this machine",
            "install the same versions on the workers' machines, and start the workers again",
        )

    def _reconnect(self, error: SchedulerLost) -> None:
        """Connect again to a lost scheduler, and do all jobs again that were sent."""
        self._requeue()
        self._sites.clear()
        self._left_out.clear()
        self._retried(
            f"the Dask scheduler at {self._address} is gone ({error}): waiting for it, "
            f"at most {PATIENCE:g} s"
        )
        until = time.monotonic() + PATIENCE
        while True:
            with contextlib.suppress(Exception):
                self._link.close()
            try:
                self._link = Link(self._address)
                self._wait_for_sites(self._retried)
            except SchedulerLost as last:
                if time.monotonic() > until:
                    raise RunError(
                        f"the Dask scheduler at {self._address} did not answer again within "
                        f"{PATIENCE:g} s ({last})",
                        "a running scheduler",
                        "start the scheduler and its workers again; then run: evocity resume RUN",
                    ) from None
                time.sleep(_TRY)
            else:
                self._retried(f"the Dask scheduler at {self._address} is back: births go on")
                return


def _describe_difference(here: Mapping[str, str | None], there: Any) -> str:
    """Describe the versions ``there`` that would change the bits of births; "" if none would."""
    if isinstance(there, OSError):  # the worker is gone
        return ""
    if not isinstance(there, Mapping):
        return f"its versions are unknown ({there})"
    if there["evocity"] is None:
        return "evocity is not installed there"
    differ = [name for name in here if here[name] != there[name]]
    if "evocity" in differ or set(differ) != {"evocity's source"}:
        differ = [name for name in differ if name != "evocity's source"]
    return ", ".join(f"{name} {there[name]} there, {here[name]} here" for name in differ)
