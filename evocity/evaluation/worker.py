"""The main loop of a worker process: one job after the other.

The worker receives its setup once, then jobs, and sends outcomes. After each birth it undoes what a
measure did to the process, see `evocity.evaluation.process_state`; when asked, it evaluates its
canary, see `evocity.evaluation.canary`.
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

from evocity.errors import format_bytes
from evocity.evaluation import linux_processes
from evocity.evaluation.answers import (
    Answer,
    Checked,
    Ready,
    write_answer,
    write_checked,
    write_ready,
)
from evocity.evaluation.canary import Canary
from evocity.evaluation.evaluator import Evaluator, Outcome, Setup, describe_failure
from evocity.evaluation.frames import CHECK, receive
from evocity.evaluation.kept_genomes import KeptGenomes
from evocity.evaluation.kernel_warmup import warm_up
from evocity.evaluation.output import Budget, stream
from evocity.evaluation.process_state import ProcessState, move_descriptor


def run_forked(connection: int, output: int) -> None:
    """Run a worker that the nursery forked, with the descriptors of connection and output."""
    served = socket.socket(fileno=move_descriptor(connection))
    for low in (1, 2):
        os.dup2(output, low)
    os.close(output)
    _serve(served)


def run_spawned(served: socket.socket) -> None:
    """Run a worker that multiprocessing started, until its process ends."""
    os.dup2(2, 1)  # standard output is for the main process's results
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(os, "setsid"):
        os.setsid()
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _serve(served)


def _end_with_parent() -> None:
    # this thread needs the interpreter lock; code that never releases it blocks this thread
    connection.wait([multiprocessing.parent_process().sentinel])
    os._exit(1)


def _serve(served: socket.socket) -> None:
    me = os.getpid()
    with contextlib.suppress(EOFError, OSError):  # the main process ended, or closed the connection
        _prepare(*receive(served))
        budget = Budget()
        sys.stdout, sys.stderr = stream(1, budget), stream(2, budget)
        setup, memory = receive(served)
        linux_processes.keep_freed_memory(None if memory is None else memory // 8)
        evaluator = _make_evaluator(setup)
        if os.getpid() != me:
            os._exit(0)
        canary = _make_canary(evaluator, setup)
        state, limit = ProcessState(), Limit(memory)
        found = (canary.expected, canary.seconds) if canary else ("", 0.0)
        served.sendall(write_ready(Ready(linux_processes.resident_memory(me), *found)))
        genomes = KeptGenomes()
        while True:
            number, method, arguments, new, gone = receive(served)
            if method == CHECK:
                served.sendall(write_checked(Checked(canary.digest() if canary else "")))
                continue
            budget.renew()
            genomes.keep(new)
            outcome = _carry_out(evaluator, limit, method, arguments, genomes)
            genomes.drop(gone)
            outcome = _restore_folders(outcome, setup.moved)
            if os.getpid() != me:  # a copy that a measure forked must not answer
                os._exit(0)
            leaves = not state.restore() or outcome.status == "memory" or limit.is_half_used()
            last = canary.digest() if canary and leaves else ""
            served.sendall(_write_outcome(number, outcome, leaves, last))
            if leaves:
                break
    os._exit(0)


def _write_outcome(number: int, outcome: Outcome, leaves: bool, canary: str) -> bytes:
    try:
        return write_answer(Answer(number, outcome, leaves, canary))
    except BaseException as error:
        failed = Outcome("error", describe_failure(error))
        return write_answer(Answer(number, failed, leaves, canary))


def _prepare(preparation: dict | None, environment: dict | None) -> None:
    """Take over the main process's state; None for what the worker has already."""
    if environment is not None:
        own = {name: os.environ[name] for name in ("TMPDIR",) if name in os.environ}
        os.environ.clear()
        os.environ.update(environment | own)
    if preparation is not None:
        current = multiprocessing.process.current_process()
        current._inheriting = True  # so a main module that starts workers raises an error
        try:
            spawn.prepare(preparation)
        finally:
            del current._inheriting
    if sys.platform != "win32":
        import resource

        with contextlib.suppress(ValueError, OSError):  # a worker that crashes leaves no core file
            hard = resource.getrlimit(resource.RLIMIT_CORE)[1]
            resource.setrlimit(resource.RLIMIT_CORE, (0, hard))


def _make_evaluator(setup: Setup) -> Evaluator | Outcome:
    """Make the evaluator; if that fails, make the outcome that every job then has."""
    warm_up(setup.sides, setup.parts)  # parts that the nursery has loaded cost nothing
    try:
        return Evaluator(setup)
    except BaseException as error:  # as an outcome, so that the pool does not start workers forever
        return Outcome("error", f"the worker could not be set up: {describe_failure(error)}")


def _make_canary(evaluator: Evaluator | Outcome, setup: Setup) -> Canary | None:
    """Make the canary; None without an evaluator, or for a setup that allows none."""
    if isinstance(evaluator, Outcome):
        return None
    try:
        return Canary(evaluator, setup.sides)
    except Exception:
        return None


def _carry_out(
    evaluator: Evaluator | Outcome,
    limit: "Limit",
    method: str,
    arguments: bytes,
    genomes: KeptGenomes,
) -> Outcome:
    if isinstance(evaluator, Outcome):
        return evaluator
    try:
        with limit:
            outcome = getattr(evaluator, method)(*genomes.unpickle(arguments))
    except BaseException as error:
        status = "memory" if isinstance(error, MemoryError) else "error"
        outcome = Outcome(status, describe_failure(error))
    if outcome.status == "memory" and limit.allowed is not None:
        text = f"{outcome.error}; allowed: {format_bytes(limit.allowed)}"
        outcome = replace(outcome, error=text)
    return outcome


def _restore_folders(outcome: Outcome, moved: Mapping[str, str]) -> Outcome:
    """Name in an ``outcome``'s error the folders of the searching machine, instead of copies."""
    if outcome.error is None or not moved:
        return outcome
    text = outcome.error
    for copy, original in moved.items():
        text = text.replace(copy, original)
    return replace(outcome, error=text)


class Limit:
    """The bytes that a birth may add to the memory that the worker has now; None without limit.
    Linux's limit of data counts writable memory; that of addresses also counts unused memory."""

    def __init__(self, allowed: int | None):
        self.allowed = allowed if linux_processes.LINUX else None
        self._before = linux_processes.writable_memory()
        self._births = self._highest = 0
        if self.allowed is not None:
            import resource

            self._resource = resource
            self._old = resource.getrlimit(resource.RLIMIT_DATA)

    def __enter__(self) -> None:
        if self.allowed is not None:
            self._set(self._before + self.allowed)

    def __exit__(self, *_) -> None:
        if self.allowed is not None:  # describing an error needs memory
            self._set(self._old[0])

    def is_half_used(self) -> bool:
        """Whether the worker keeps half of it after a birth, which the next birth would lack."""
        if self.allowed is None:
            return False
        highest = self._resource.getrusage(self._resource.RUSAGE_SELF).ru_maxrss
        self._births += 1
        if highest == self._highest and self._births % 16:  # it seems that nothing new is kept
            return False
        self._highest = highest
        return linux_processes.writable_memory() - self._before > self.allowed / 2

    def _set(self, soft: int) -> None:
        hard = self._resource.getrlimit(self._resource.RLIMIT_DATA)[1]
        if hard != self._resource.RLIM_INFINITY and not 0 <= soft <= hard:
            soft = hard
        with contextlib.suppress(ValueError, OSError):
            self._resource.setrlimit(self._resource.RLIMIT_DATA, (soft, hard))
