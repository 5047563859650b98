"""A long job of studio in a thread, with progress, and results that are kept by key."""

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any

from evocity.errors import EvocityError, RunError, describe_error


class Cache:
    """The last ``most`` results by key. One result is computed at a time."""

    def __init__(self, most: int):
        self._most, self._lock = most, threading.Lock()
        self._kept: OrderedDict[Hashable, Any] = OrderedDict()

    def get(self, key: Hashable, make: Callable[[], Any]) -> Any:
        """Return the result of a ``key``; ``make`` computes it if it is missing."""
        with self._lock:
            if key not in self._kept:
                self._kept[key] = make()
                while len(self._kept) > self._most:
                    self._kept.popitem(last=False)
            self._kept.move_to_end(key)
            return self._kept[key]


class JobStopped(Exception):
    """The user stopped the job, or a newer job replaced it."""


class BackgroundJob:
    """A job with a ``key``. Its ``work`` gets the job, and calls `progress` from time to time."""

    def __init__(self, key: Hashable, work: Callable[["BackgroundJob"], Any]):
        self.key, self._work = key, work
        self.done = self.total = 0
        #: The result; None until the job is ready.
        self.result: Any = None
        self.error, self.stopped = "", False
        #: Functions that a stop calls, for example to end a process.
        self.at_stop: list[Callable[[], None]] = []
        self._thread = threading.Thread(target=self._run, daemon=True, name="background job")
        self._thread.start()

    def progress(self, done: int, total: int) -> None:
        """Note the progress. Raises `JobStopped` after a stop."""
        self.done, self.total = done, total
        if self.stopped:
            raise JobStopped

    def stop(self) -> None:
        self.stopped = True
        for act in self.at_stop:
            act()

    def join(self, seconds: float) -> None:
        self._thread.join(seconds)

    @property
    def state(self) -> dict:
        """Plain values for the page. A job is ``at`` work, ``ready``, stopped, or has an
        ``error``."""
        at, ready = self._thread.is_alive(), self.result is not None
        facts = {"at": at and not (ready or self.stopped), "ready": ready, "error": self.error}
        return facts | {"done": int(self.done), "total": int(self.total)}

    def _run(self) -> None:
        try:
            result = self._work(self)
            if not self.stopped:
                self.result = result
        except JobStopped:
            pass
        except EvocityError as error:
            self.error = str(error)
        except Exception as error:  # the page shows it, whatever it is
            self.error = describe_error(error)


class JobSlot:
    """A place for one job: a job with another key replaces the job before."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.job: BackgroundJob | None = None

    def begin(self, key: Hashable, work: Callable[[BackgroundJob], Any]) -> dict:
        """Begin a job, unless a job with this ``key`` works or has ended; return its state. An
        error is returned once, so that the next call tries again."""
        with self._lock:
            if self.job is None or self.job.key != key:
                self._stop()
                self.job = BackgroundJob(key, work)
            state = self.job.state
            if not (state["at"] or state["ready"]):
                self.job = None
            return state

    def result(self, key: Hashable, what: str) -> Any:
        """Return the result of the job with a ``key``. Raises `RunError` if it is not ready."""
        job = self.job
        if job is None or job.key != key or job.result is None:
            raise RunError(
                f"{what} of these births are not ready",
                "a search or a growth that has ended",
                "wait until it ends, or begin it again",
            )
        return job.result

    def stop(self) -> dict:
        with self._lock:
            self._stop()
            self.job = None
        return {}

    def _stop(self) -> None:
        if self.job is not None and not self.job.state["ready"]:
            self.job.stop()
