"""Threads that share the work of a search; kernels release the interpreter's lock."""

import functools
import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor


class Crew:
    """``threads`` threads, None for one a core; with one, the caller's own. Use it in a ``with``:
    what is not begun at its end is left out."""

    def __init__(self, threads: int | None):
        self.threads = threads or available_cores()
        # threads start with their first work; beside a caller that works on, one less is enough
        self._beside, self._all = (
            [ThreadPoolExecutor(count) for count in (self.threads - 1, self.threads)]
            if self.threads > 1
            else [None, None]
        )

    def __enter__(self) -> "Crew":
        return self

    def __exit__(self, *_) -> None:
        for pool in (self._beside, self._all):
            if pool:
                pool.shutdown(wait=False, cancel_futures=True)

    def begin(self, work: Callable, *arguments) -> Callable:
        """Have another thread, if there is one, do ``work`` while the caller goes on; what is
        returned, called, waits for what it returns."""
        if self._beside:
            return self._beside.submit(work, *arguments).result
        return functools.partial(work, *arguments)

    def map(self, work: Callable, parts: Iterable) -> Iterator:
        """What ``work`` returns for each of ``parts``, in order; the caller waits."""
        return self._all.map(work, parts) if self._all else map(work, parts)


def available_cores() -> int:
    """Cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
