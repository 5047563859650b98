"""What happens inside a worker process: one job after the other.

Installed once a worker by `install`; after that, genomes come in and outcomes go out.
"""

import multiprocessing
import os
import threading
from multiprocessing import connection

from evocity.search.evaluator import Evaluator, Outcome, Setup, told
from evocity.search.warm import warm_up

_evaluator: Evaluator | Exception | None = None


def install(setup: Setup) -> None:
    """Make this process a worker: quiet standard output, and an end when the main process ends."""
    global _evaluator
    # What a measure prints must not get into the main process's standard output.
    os.dup2(2, 1)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    # what the fork server warmed already is not done again
    warm_up(setup.sides, setup.parts)
    try:
        _evaluator = Evaluator(setup)
    except Exception as error:  # told by each call, so that the pool does not restart for ever
        _evaluator = error


def call(method: str, *arguments) -> Outcome:
    """Run a method of the installed `Evaluator`."""
    if isinstance(_evaluator, Exception):
        return Outcome("error", f"the worker could not be set up: {told(_evaluator)}")
    return getattr(_evaluator, method)(*arguments)


def _end_with_parent() -> None:
    # A worker that hangs in a measure would outlive a main process ended by SIGKILL. This
    # thread runs whenever the interpreter lock is let go; code that holds it for ever defeats it.
    connection.wait([multiprocessing.parent_process().sentinel])
    os._exit(1)
