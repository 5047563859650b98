"""Where breeding and evaluation run: in worker processes with a deadline each, or right here."""

import contextlib
import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import context, forkserver, resource_tracker

from pebble import ProcessExpired, ProcessPool

from evocity.errors import RunError
from evocity.search import worker
from evocity.search.evaluator import Evaluator, Outcome, Setup
from evocity.search.warm import VARIABLE, sides_told

#: Workers are single-threaded: their number, not BLAS, decides how many cores work.
_ONE_THREAD = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
)

#: A pool that breaks (not a worker: the pool) is built anew this often for one batch.
_REBUILDS = 3


class Here:
    """Runs everything in the calling process: for notebooks and debuggers. No deadline."""

    def __init__(self, setup: Setup):
        self._evaluator = Evaluator(setup)

    def run(self, method: str, jobs: Sequence[tuple]) -> list[Outcome]:
        """Outcomes of ``Evaluator.method(*job)``, in the order of ``jobs``."""
        with contextlib.redirect_stdout(sys.stderr):
            return [getattr(self._evaluator, method)(*job) for job in jobs]

    def close(self) -> None:
        pass


class Workers:
    """Runs jobs in ``count`` worker processes; each job has ``timeout`` seconds.

    A job that fails, hangs or ends its worker costs that job alone. Order and bits of the
    outcomes do not depend on ``count``. ``retried`` is called with a text when the pool itself
    broke and is built anew.
    """

    def __init__(
        self, setup: Setup, count: int, timeout: float, retried: Callable[[str], None] | None = None
    ):
        self._setup, self._count, self._timeout = setup, count, timeout
        self._retried = retried or (lambda text: None)
        self._pool: ProcessPool | None = None
        self._environment = contextlib.ExitStack()
        self._environment.enter_context(_single_threaded())

    def run(self, method: str, jobs: Sequence[tuple]) -> list[Outcome]:
        """Outcomes of ``Evaluator.method(*job)``, in the order of ``jobs``."""
        outcomes: list[Outcome | None] = [None] * len(jobs)
        for _ in range(_REBUILDS):
            left = [index for index, outcome in enumerate(outcomes) if outcome is None]
            if not left:
                break
            try:
                self._collect(method, jobs, left, outcomes)
            except (BrokenProcessPool, RuntimeError, CancelledError) as error:
                self._stop()
                self._retried(f"{type(error).__name__}: {error}")
        if None in outcomes:
            raise RunError(
                "the worker processes end before they take up work",
                "workers that start",
                "a script must start a search under `if __name__ == '__main__':`; "
                "else try workers=0, which shows what fails",
            )
        return outcomes

    def close(self) -> None:
        self._stop()
        self._environment.close()

    def _collect(self, method, jobs, left, outcomes) -> None:
        pool = self._started()
        futures = {
            i: pool.schedule(worker.call, args=(method, *jobs[i]), timeout=self._timeout)
            for i in left
        }
        for index, future in futures.items():
            try:
                outcomes[index] = future.result()
            except BrokenProcessPool:
                raise
            except TimeoutError:
                text = f"no result after {self._timeout:g} s"
                outcomes[index] = Outcome("timeout", text, float(self._timeout))
            except ProcessExpired as error:
                code = 0 if error.exitcode == _ENDED_BY_ITSELF else error.exitcode
                outcomes[index] = Outcome("died", f"the worker ended with exit code {code}")
            except (RuntimeError, CancelledError):
                raise
            except Exception as error:
                outcomes[index] = Outcome("error", f"{type(error).__name__}: {error}")

    def _started(self) -> ProcessPool:
        if self._pool is None:
            self._pool = ProcessPool(
                max_workers=self._count,
                initializer=worker.install,
                initargs=(self._setup,),
                context=_context(self._setup),
            )
        return self._pool

    def _stop(self) -> None:
        if self._pool is not None:
            self._pool.stop()
            self._pool.join()
            self._pool = None


#: Told in place of exit code 0, and no exit code of any system.
_ENDED_BY_ITSELF = 1 << 40


class _Worker:
    """A worker ends only because a job ended it, so exit code 0 is a death like any other.

    pebble would take it for a regular end and let the job run into its deadline.
    """

    @property
    def exitcode(self) -> int | None:
        code = super().exitcode
        return _ENDED_BY_ITSELF if code == 0 else code


class _SpawnedWorker(_Worker, context.SpawnProcess):
    def start(self) -> None:
        with _deaf_to_ctrl_c():
            super().start()


class _SpawnContext(context.SpawnContext):
    Process = _SpawnedWorker


if "forkserver" in multiprocessing.get_all_start_methods():

    class _ForkedWorker(_Worker, context.ForkServerProcess):
        pass

    class _ForkServerContext(context.ForkServerContext):
        Process = _ForkedWorker


def _context(setup: Setup) -> context.BaseContext:
    """A fork server with everything imported on Linux, so that a replaced worker starts at once.

    Returns when it has: an interrupt until then finds no pool half started.
    """
    if not sys.platform.startswith("linux"):
        return _SpawnContext()
    chosen = _ForkServerContext()
    chosen.set_forkserver_preload(["evocity.search.warm"])
    os.environ[VARIABLE] = ",".join([sides_told(setup.sides), *setup.parts])
    with _deaf_to_ctrl_c():
        forkserver.ensure_running()
    del os.environ[VARIABLE]
    first = chosen.Process(target=_nothing, daemon=True)
    first.start()
    first.join()
    return chosen


def _nothing() -> None:
    pass


@contextlib.contextmanager
def _deaf_to_ctrl_c() -> Iterator[None]:
    """What is started within never gets the terminal's SIGINT: the main process stops it.

    Workers and their fork server would else tell, from the first moment on, where in their
    imports they were. On Windows there is nothing to inherit.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # it would let the signal in again when it starts
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def _single_threaded() -> Iterator[None]:
    """Environment that worker processes start in, the later ones too."""
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
