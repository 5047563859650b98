"""Threads that share the work of a search; kernels release the interpreter lock."""

import functools
import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor


class Crew:
    """A crew of ``threads`` threads, None for one per core; a single one is the caller's thread.
    The end of its ``with`` block cancels work that has not begun."""

    def __init__(self, threads: int | None):
        self.threads = threads or available_cores()
        # threads start with their first work; a caller that works too replaces one
        self._helpers, self._all = (
            [ThreadPoolExecutor(count) for count in (self.threads - 1, self.threads)]
            if self.threads > 1
            else [None, None]
        )

    def __enter__(self) -> "Crew":
        return self

    def __exit__(self, *_) -> None:
        for pool in (self._helpers, self._all):
            if pool:
                pool.shutdown(wait=False, cancel_futures=True)

    def begin(self, work: Callable, *arguments) -> Callable:
        """Begin ``work`` in another thread, if there is one. Returns a function that waits for the
        result; without another thread it does the work."""
        if self._helpers:
            return self._helpers.submit(work, *arguments).result
        return functools.partial(work, *arguments)

    def map(self, work: Callable, parts: Iterable) -> Iterator:
        """Yield the results of ``work`` on each of ``parts``, in order; the caller waits."""
        return self._all.map(work, parts) if self._all else map(work, parts)


def available_cores() -> int:
    """Count the cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
