"""The connection to a Dask cluster: the one file that knows Dask.

What goes over its wire is Dask's own, pickles too, between processes of one user: a cluster is for
networks that are trusted. Addresses of ``tls://`` take certificates from Dask's configuration.
"""

import asyncio
import contextlib
import logging
import os
import re
import shutil
import tempfile
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError
from concurrent.futures import TimeoutError as NotInTime
from queue import SimpleQueue
from typing import Any

try:
    import dask
    from distributed import Client, LocalCluster, Security, get_worker, secede
    from distributed.comm import CommClosedError
    from distributed.scheduler import KilledWorker
except ImportError as error:
    MISSING = str(error)
else:
    MISSING = ""

from evocity.errors import RunError
from evocity.search.evaluation import processes
from evocity.search.evaluation.hosting import Answer, Closed, Host
from evocity.search.evaluation.parcels import Parcel
from evocity.search.evaluation.starting import deaf_to_ctrl_c

#: Seconds in which a scheduler must answer when a search begins; and in which workers must.
CONNECT, ANSWER = 10.0, 120.0
#: Seconds that leaving may take.
_LEAVE = 3.0
#: Of the address of an embedded cluster.
EMBEDDED = re.compile(r"local:(\d+)")
#: An embedded cluster serves nothing but the search, and its processes may begin others.
_EMBEDDED = {
    "distributed.worker.daemon": False,
    "distributed.worker.profile.enabled": False,
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
}
# So long no line of Dask's own log reaches the user: what matters is told by the search.
_SILENT = logging.CRITICAL + 1


class Lost(Exception):
    """The scheduler does not answer any more."""


class Link:
    """A client of the scheduler at ``address``, or of an embedded cluster, "local:N".

    Raises `RunError` if the extra ``cluster`` is not installed; `Lost` if nobody answers.
    """

    def __init__(self, address: str):
        if MISSING:
            raise RunError(
                f"Dask is not installed ({MISSING})",
                "evocity with its extra `cluster`",
                "pip install 'evocity[cluster]', here and on all machines of the cluster",
            )
        self._undone = contextlib.ExitStack()
        try:
            self._undone.enter_context(_silence())
            target = (
                self._embedded(int(EMBEDDED.fullmatch(address)[1]))
                if (EMBEDDED.fullmatch(address))
                else address
            )
            with warnings.catch_warnings(), deaf_to_ctrl_c():
                warnings.simplefilter("ignore")  # of versions: those that matter are compared
                self._client = Client(target, timeout=CONNECT, set_as_default=False, name="evocity")
        except (OSError, NotInTime) as error:
            self._undone.close()
            raise Lost(_told(error)) from error
        except BaseException:
            self._undone.close()
            raise
        self._loop = self._client.loop.asyncio_loop
        self._mark = self._client.id.rpartition("-")[2]

    def _embedded(self, count: int) -> "LocalCluster":
        """A cluster of so many workers on this machine, which nobody else can reach or read."""
        room = tempfile.mkdtemp(prefix="evocity-dask-")  # Dask would leave its own behind
        self._undone.callback(shutil.rmtree, room, ignore_errors=True)
        self._undone.enter_context(dask.config.set(_EMBEDDED | {"temporary-directory": room}))
        with warnings.catch_warnings(), deaf_to_ctrl_c():
            warnings.simplefilter("ignore")
            cluster = LocalCluster(
                n_workers=count,
                threads_per_worker=1,
                host="127.0.0.1",
                dashboard_address=None,
                scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
                memory_limit=0,
                security=Security.temporary(),
                silence_logs=_SILENT,
            )
        self._undone.callback(_end, cluster)
        return cluster

    def sites(self) -> dict[str, int]:
        """Addresses of the workers there are now -> their threads. Raises `Lost`."""
        return self._asked(lambda: self._client.nthreads(), ANSWER)

    def ask(
        self, function: Callable, sites: Sequence[str], *args, seconds: float = ANSWER
    ) -> dict[str, Any]:
        """What a ``function`` returns in each of the ``sites``, or the exception it raised; it is
        called in the worker's own thread, and must not take long. Raises `Lost`."""
        return self._asked(
            lambda: self._client.run(function, *args, workers=list(sites), on_error="return"),
            seconds,
        )

    def _asked(self, question: Callable, seconds: float):
        async def answer():
            return await asyncio.wait_for(question(), seconds)

        told = answer()
        try:
            return asyncio.run_coroutine_threadsafe(told, self._loop).result(seconds + CONNECT)
        except (OSError, RuntimeError, CancelledError, NotInTime, TimeoutError) as error:
            told.close()
            raise Lost(_told(error)) from error

    def send(self, number: int, site: str, heard: SimpleQueue, *work) -> None:
        """Have `hosted` do its ``work`` at a ``site``, or elsewhere if that is lost. ``heard`` gets
        (``number``, how it ended, what came of it): "done" and what it returned, "killed" and
        "failed" and why, "lost" with the scheduler."""
        try:
            future = self._client.submit(
                _task(),
                *work,
                key=f"evocity-{self._mark}-{number}",
                pure=False,
                workers=[site],
                allow_other_workers=True,
            )
            asyncio.run_coroutine_threadsafe(_bring(number, future, heard), self._loop)
        except (OSError, RuntimeError, CancelledError) as error:
            raise Lost(_told(error)) from error

    def close(self) -> None:
        """Leave the cluster; end the embedded one. Safe to call twice."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with contextlib.suppress(Exception):
                self._client.close(timeout=_LEAVE)
            with contextlib.suppress(Exception):
                self._undone.close()


def _end(cluster: "LocalCluster") -> None:
    """Close an embedded cluster; its workers are gone afterwards, whatever Dask does."""
    pids = [nanny.pid for nanny in cluster.workers.values()]
    with contextlib.suppress(Exception):
        cluster.close(timeout=_LEAVE)
    with contextlib.suppress(Exception):
        cluster.scheduler.stop()  # it lets go of its folder, though closing took too long
    for pid in set(pids).intersection(processes.children(os.getpid())):
        processes.kill(pid)


async def _bring(number: int, future, heard: SimpleQueue) -> None:
    try:
        heard.put((number, "done", await future))
    except KilledWorker as error:
        heard.put((number, "killed", _told(error)))
    except (CancelledError, asyncio.CancelledError, CommClosedError) as error:
        heard.put((number, "lost", _told(error)))
    except Exception as error:
        heard.put((number, "failed", _told(error)))


# -- on the workers ----------------------------------------------------------------------
#
# What is sent is sent by its code, and imports evocity where it is called: the scheduler, which
# unpacks it too, need not have evocity, and a worker answers while it imports.


def _task() -> Callable:
    home = __name__

    def evocity(*work):
        from importlib import import_module

        return import_module(home).hosted(*work)

    return evocity


def installing() -> Callable:
    """Function that calls `install` in a worker."""
    home = __name__

    async def install(*given, dask_worker=None):
        import asyncio
        from importlib import import_module

        link = await asyncio.to_thread(import_module, home)
        return link.install(*given, dask_worker=dask_worker)

    return install


def leaving() -> Callable:
    """Function that calls `leave` in a worker, if it ever called another."""
    home = __name__

    def leave(name, dask_worker=None):
        import sys

        if link := sys.modules.get(home):
            link.leave(name, dask_worker=dask_worker)

    return leave


def hosted(name: str, method: str, jobs: Sequence[bytes]) -> Answer | None:
    """A task: ``jobs`` for the host called ``name``; None if there is no such here."""
    host = _hosts(get_worker()).get(name)
    if host is None:
        return None
    secede()  # how much is done at once, the host decides
    try:
        return host.run(method, jobs)
    except Closed:
        return None


def install(
    name: str,
    parcel: tuple,
    seats: int | None,
    timeout: float,
    memory: int | None,
    dask_worker=None,
) -> int:
    """Make the host ``name``, for what is in the fields of a `Parcel`; a seat for each thread of
    Dask's unless told. How many seats it has."""
    import multiprocessing

    if multiprocessing.current_process().daemon and not processes.LINUX:
        raise RuntimeError(
            "it is daemonic, and may begin no processes: start it with "
            "DASK_DISTRIBUTED__WORKER__DAEMON=False"
        )
    hosts = _hosts(dask_worker)
    if name not in hosts:
        seats = seats or dask_worker.state.nthreads
        hosts[name] = Host(Parcel(*parcel), seats, timeout, memory)
    return hosts[name].seats


def leave(name: str, dask_worker=None) -> None:
    """End the host ``name``."""
    if host := _hosts(dask_worker).pop(name, None):
        host.close()


def _hosts(worker) -> dict[str, Host]:
    """What a Dask worker hosts: kept with it, and gone with it."""
    return worker.__dict__.setdefault("_evocity_hosts", {})


def versions_of() -> Callable[[], dict[str, str | None]]:
    """Function that tells what decides the bits of births where it is called: by no name of
    evocity's, which need not be there."""

    def versions() -> dict:
        import hashlib
        import importlib.metadata
        import importlib.util
        import pathlib
        import sys

        found = {"python": "{}.{}".format(*sys.version_info)}
        for name in ("numpy", "scipy", "numba", "distributed"):
            try:
                found[name] = importlib.metadata.version(name)
            except importlib.metadata.PackageNotFoundError:
                found[name] = None
        spec = importlib.util.find_spec("evocity")
        found["evocity"] = found["evocity's source"] = None
        if spec is not None and spec.origin:
            found["evocity"] = importlib.import_module("evocity").__version__
            state, folder = hashlib.blake2b(digest_size=8), pathlib.Path(spec.origin).parent
            for path in sorted(folder.rglob("*.py")):
                name = path.relative_to(folder).as_posix()
                state.update(f"{name}\n".encode() + path.read_bytes().replace(b"\r\n", b"\n"))
            found["evocity's source"] = state.hexdigest()
        return found

    return versions


@contextlib.contextmanager
def _silence():
    """Dask's loggers, as good as mute; as they were, afterwards."""
    names = [name for name in logging.root.manager.loggerDict if name.startswith("distributed")]
    loggers = [logging.getLogger(name) for name in {"distributed", *names}]
    before = [one.level for one in loggers]
    for one in loggers:
        one.setLevel(_SILENT)
    try:
        yield
    finally:
        for one, level in zip(loggers, before, strict=True):
            one.setLevel(level)


def _told(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__


__all__ = ["CONNECT", "EMBEDDED", "Link", "Lost", "installing", "leaving", "versions_of"]
