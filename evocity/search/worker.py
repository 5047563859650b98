"""What happens inside a worker process: one job after the other.

The worker is told once what it must know; after that, genomes come in and outcomes go out. What a
measure does to the process is undone after each birth, see `evocity.search.evaluation.upkeep`.
"""

import contextlib
import multiprocessing
import os
import signal
import socket
import sys
import threading
from collections.abc import Mapping
from dataclasses import replace
from multiprocessing import connection, spawn

from evocity.errors import told_bytes
from evocity.search.evaluation import processes
from evocity.search.evaluation.frames import framed, read_of, receive
from evocity.search.evaluation.output import Budget, stream
from evocity.search.evaluation.upkeep import Upkeep, raised
from evocity.search.evaluator import Evaluator, Outcome, Setup, told
from evocity.search.warm import warm_up


def begin(connected: int, printed: int) -> None:
    """A worker that the nursery forked; ends with the process. ``connected``, ``printed``: files
    of its connection, and of the pipe that takes what it prints."""
    served = socket.socket(fileno=raised(connected))
    for low in (1, 2):
        os.dup2(printed, low)
    os.close(printed)
    _serve(served)


def begin_spawned(served: socket.socket) -> None:
    """A worker that multiprocessing started; ends with the process."""
    os.dup2(2, 1)  # standard output is for the main process's results
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(os, "setsid"):
        os.setsid()
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _serve(served)


def _end_with_parent() -> None:
    # This thread runs whenever the interpreter lock is let go; code that holds it defeats it.
    connection.wait([multiprocessing.parent_process().sentinel])
    os._exit(1)


def _serve(served: socket.socket) -> None:
    me = os.getpid()
    with contextlib.suppress(EOFError, OSError):  # the main process is gone, or ended this one
        _prepare(*receive(served))
        budget = Budget()
        sys.stdout, sys.stderr = stream(1, budget), stream(2, budget)
        setup, memory = receive(served)
        evaluator = _evaluator_of(setup)
        if os.getpid() != me:
            os._exit(0)
        upkeep, limit = Upkeep(), Limit(memory)
        served.sendall(framed(("ready", processes.resident(me))))
        while True:
            number, method, arguments = receive(served)
            budget.renew()
            outcome = _as_at_home(_done(evaluator, limit, method, arguments), setup.moved)
            if os.getpid() != me:  # a copy that a measure forked answers for nobody
                os._exit(0)
            leaves = not upkeep.restore() or outcome.status == "memory" or limit.half_used()
            served.sendall(framed(("answer", number, outcome, leaves)))
            if leaves:
                break
    os._exit(0)


def _prepare(preparation: dict | None, environment: dict | None) -> None:
    """Take on the main process's folder, path, main module and environment, unless they are here
    already."""
    if environment is not None:
        own = {name: os.environ[name] for name in ("TMPDIR",) if name in os.environ}
        os.environ.clear()
        os.environ.update(environment | own)
    if preparation is not None:
        current = multiprocessing.process.current_process()
        current._inheriting = True  # a main module that starts workers is told so
        try:
            spawn.prepare(preparation)
        finally:
            del current._inheriting
    if sys.platform != "win32":
        import resource

        with contextlib.suppress(ValueError, OSError):  # a worker that crashes leaves no file
            resource.setrlimit(
                resource.RLIMIT_CORE, (0, resource.getrlimit(resource.RLIMIT_CORE)[1])
            )


def _evaluator_of(setup: Setup) -> Evaluator | Outcome:
    """What evaluates; an outcome that each job has where it cannot be made."""
    # what the nursery warmed already is not done again
    warm_up(setup.sides, setup.parts)
    try:
        return Evaluator(setup)
    except BaseException as error:  # told by each job, so that no worker is started for ever
        return Outcome("error", f"the worker could not be set up: {told(error)}")


def _done(evaluator: Evaluator | Outcome, limit: "Limit", method: str, arguments: bytes) -> Outcome:
    if isinstance(evaluator, Outcome):
        return evaluator
    try:
        with limit:
            outcome = getattr(evaluator, method)(*read_of(memoryview(arguments)[8:]))
    except MemoryError as error:
        outcome = Outcome("memory", told(error))
    except BaseException as error:
        outcome = Outcome("error", told(error))
    if outcome.status == "memory" and limit.allowed is not None:
        text = f"{outcome.error}; allowed: {told_bytes(limit.allowed)}"
        outcome = replace(outcome, error=text)
    return outcome


def _as_at_home(outcome: Outcome, moved: Mapping[str, str]) -> Outcome:
    """An ``outcome`` whose error names folders as they are where the search is."""
    if outcome.error is None or not moved:
        return outcome
    text = outcome.error
    for here, there in moved.items():
        text = text.replace(here, there)
    return replace(outcome, error=text)


class Limit:
    """Bytes that a birth may take besides what the worker has now; None without limit.

    Of Linux's limits it is that of data: what can be written, and was asked for. The limit of
    addresses counts what libraries reserve and never use.
    """

    def __init__(self, allowed: int | None):
        self.allowed = allowed if processes.LINUX else None
        self._before = processes.own_data()
        self._births = self._highest = 0
        if self.allowed is not None:
            import resource

            self._resource = resource
            self._old = resource.getrlimit(resource.RLIMIT_DATA)

    def __enter__(self) -> None:
        if self.allowed is not None:
            self._set(self._before + self.allowed)

    def __exit__(self, *_) -> None:
        if self.allowed is not None:  # what is told of it must not lack memory
            self._set(self._old[0])

    def half_used(self) -> bool:
        """Whether the worker keeps half of it between two births: the next would lack it."""
        if self.allowed is None:
            return False
        highest = self._resource.getrusage(self._resource.RUSAGE_SELF).ru_maxrss
        self._births += 1
        if highest == self._highest and self._births % 16:  # nothing new is kept, it seems
            return False
        self._highest = highest
        return processes.own_data() - self._before > self.allowed / 2

    def _set(self, soft: int) -> None:
        hard = self._resource.getrlimit(self._resource.RLIMIT_DATA)[1]
        if hard != self._resource.RLIM_INFINITY and not 0 <= soft <= hard:
            soft = hard
        with contextlib.suppress(ValueError, OSError):
            self._resource.setrlimit(self._resource.RLIMIT_DATA, (soft, hard))
