"""The connection to a Dask cluster: only this file imports Dask.

Dask's own protocol, which contains pickles, connects processes of one user: a cluster is only for
trusted networks. Addresses of ``tls://`` take certificates from Dask's configuration.
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

from evocity.errors import RunError, describe_error
from evocity.evaluation import linux_processes
from evocity.evaluation.cluster.host import Answer, Host, HostClosed
from evocity.evaluation.cluster.parcel import Parcel
from evocity.evaluation.worker_start import block_ctrl_c

#: The most seconds for an answer of the scheduler when a search begins; and of workers.
CONNECT, _ANSWER = 10.0, 120.0
#: The most seconds to leave a cluster.
_LEAVE = 3.0
#: The address of an embedded cluster.
_EMBEDDED = re.compile(r"local:(\d+)")
#: Dask's settings for an embedded cluster: no web pages, and workers that may start processes.
_SETTINGS = {
    "distributed.worker.daemon": False,
    "distributed.worker.profile.enabled": False,
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
}
# A level above all lines of Dask's own log: the search itself reports what matters.
_SILENT = logging.CRITICAL + 1


class SchedulerLost(Exception):
    """The scheduler does not answer any more."""


class Link:
    """A client of the scheduler at ``address``, or of an embedded cluster, "local:N". Raises
    `RunError` without the extra ``cluster``; `SchedulerLost` if no scheduler answers."""

    def __init__(self, address: str):
        if MISSING:
            raise RunError(
                f"Dask is not installed ({MISSING})",
                "the package evocity, installed with the extra `cluster`",
                "run pip install 'evocity[cluster]' here and on all machines of the cluster",
            )
        self._cleanup = contextlib.ExitStack()
        try:
            self._cleanup.enter_context(_silence())
            embedded = _EMBEDDED.fullmatch(address)
            target = self._start_embedded(int(embedded[1])) if embedded else address
            with warnings.catch_warnings(), block_ctrl_c():
                warnings.simplefilter(
                    "ignore"
                )  # on versions; the engine compares those that matter
                self._client = Client(target, timeout=CONNECT, set_as_default=False, name="evocity")
        except OSError as error:
            self._cleanup.close()
            raise SchedulerLost(describe_error(error)) from error
        except BaseException:
            self._cleanup.close()
            raise
        self._loop = self._client.loop.asyncio_loop
        self._mark = self._client.id.rpartition("-")[2]

    def _start_embedded(self, count: int) -> "LocalCluster":
        """Start a cluster of ``count`` workers on this machine, which only this user can reach."""
        room = tempfile.mkdtemp(prefix="evocity-dask-")  # Dask would not remove its own folder
        self._cleanup.callback(shutil.rmtree, room, ignore_errors=True)
        self._cleanup.enter_context(dask.config.set(_SETTINGS | {"temporary-directory": room}))
        with warnings.catch_warnings(), block_ctrl_c():
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
        self._cleanup.callback(_end_embedded, cluster)
        return cluster

    def sites(self) -> dict[str, int]:
        """Map the addresses of the present workers to their threads. Raises `SchedulerLost`."""
        return self._await(lambda: self._client.nthreads(), _ANSWER)

    def ask(
        self, function: Callable, sites: Sequence[str], *args, seconds: float = _ANSWER
    ) -> dict[str, Any]:
        """Call a quick ``function`` at each of the ``sites``; returns its results or exceptions."""
        return self._await(
            lambda: self._client.run(function, *args, workers=list(sites), on_error="return"),
            seconds,
        )

    def _await(self, question: Callable, seconds: float):
        async def answer():
            return await asyncio.wait_for(question(), seconds)

        pending = answer()
        try:
            return asyncio.run_coroutine_threadsafe(pending, self._loop).result(seconds + CONNECT)
        except (OSError, RuntimeError, CancelledError) as error:
            pending.close()
            raise SchedulerLost(describe_error(error)) from error

    def send(self, number: int, site: str, heard: SimpleQueue, *work) -> None:
        """Send ``work`` to `run_hosted` at a ``site``, or elsewhere if that is lost. Later the
        queue ``heard`` gets (``number``, ending, result): "done" and the return value, "killed" or
        "failed" and the reason, or "lost" with the scheduler."""
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
            raise SchedulerLost(describe_error(error)) from error

    def close(self) -> None:
        """Leave the cluster; end the embedded one. Safe to call twice."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with contextlib.suppress(Exception):
                self._client.close(timeout=_LEAVE)
            with contextlib.suppress(Exception):
                self._cleanup.close()


def _end_embedded(cluster: "LocalCluster") -> None:
    """Close an embedded cluster, and kill its workers if Dask does not end them."""
    pids = [nanny.pid for nanny in cluster.workers.values()]
    with contextlib.suppress(Exception):
        cluster.close(timeout=_LEAVE)
    with contextlib.suppress(Exception):
        cluster.scheduler.stop()  # it releases its folder, even if closing took too long
    for pid in set(pids).intersection(linux_processes.children(os.getpid())):
        linux_processes.kill(pid)


async def _bring(number: int, future, heard: SimpleQueue) -> None:
    try:
        heard.put((number, "done", await future))
    except KilledWorker as error:
        heard.put((number, "killed", describe_error(error)))
    except (CancelledError, asyncio.CancelledError, CommClosedError) as error:
        heard.put((number, "lost", describe_error(error)))
    except Exception as error:
        heard.put((number, "failed", describe_error(error)))


# -- on the workers ----------------------------------------------------------------------
#
# Nested functions are sent by their code, and import evocity where they are called. So the
# scheduler, which unpickles them too, needs no evocity, and a worker answers while it imports.


def _task() -> Callable:
    home = __name__

    def evocity(*work):
        from importlib import import_module

        return import_module(home).run_hosted(*work)

    return evocity


def make_install() -> Callable:
    """Make the function that calls `install` in a worker."""
    home = __name__

    async def install(*given, dask_worker=None):
        import asyncio
        from importlib import import_module

        link = await asyncio.to_thread(import_module, home)
        return link.install(*given, dask_worker=dask_worker)

    return install


def make_leave() -> Callable:
    """Make the function that calls `leave` in a worker, if the worker has imported this module."""
    home = __name__

    def leave(name, dask_worker=None):
        import sys

        if link := sys.modules.get(home):
            link.leave(name, dask_worker=dask_worker)

    return leave


def run_hosted(name: str, method: str, jobs: Sequence[bytes]) -> Answer | None:
    """Run ``jobs`` in the host ``name`` of this worker; None if it has no such host."""
    host = _hosts(get_worker()).get(name)
    if host is None:
        return None
    secede()  # the host, and not Dask, limits the jobs at work
    try:
        return host.run(method, jobs)
    except HostClosed:
        return None


def install(
    name: str,
    parcel: tuple,
    seats: int | None,
    timeout: float,
    memory: int | None,
    dask_worker=None,
) -> int:
    """Make the host ``name``, by default with a seat for each thread. Returns its seats."""
    import multiprocessing

    if multiprocessing.current_process().daemon and not linux_processes.LINUX:
        raise RuntimeError(
            "it is daemonic, so it cannot start processes: start it with "
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
    """Return the hosts of a Dask worker, which live as long as it does."""
    return worker.__dict__.setdefault("_evocity_hosts", {})


def make_versions() -> Callable[[], dict[str, str | None]]:
    """Make the function that returns the versions which decide the bits, without using evocity."""

    def versions() -> dict:
        import hashlib
        import importlib.metadata
        import importlib.util
        import pathlib
        import sys

        known = {"python": "{}.{}".format(*sys.version_info)}
        for name in ("numpy", "scipy", "numba", "distributed"):
            try:
                known[name] = importlib.metadata.version(name)
            except importlib.metadata.PackageNotFoundError:
                known[name] = None
        spec = importlib.util.find_spec("evocity")
        known["evocity"] = known["evocity's source"] = None
        if spec is not None and spec.origin:
            known["evocity"] = importlib.import_module("evocity").__version__
            state, folder = hashlib.blake2b(digest_size=8), pathlib.Path(spec.origin).parent
            for path in sorted(folder.rglob("*.py")):
                name = path.relative_to(folder).as_posix()
                state.update(f"{name}\n".encode() + path.read_bytes().replace(b"\r\n", b"\n"))
            known["evocity's source"] = state.hexdigest()
        return known

    return versions


@contextlib.contextmanager
def _silence():
    """Silence Dask's loggers, and restore their levels afterwards."""
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
