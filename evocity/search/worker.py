"""What happens inside a worker process: breeding and evaluating one individual at a time.

Installed once a worker by `install`; after that, genomes come in and outcomes go out.
"""

import importlib
import math
import multiprocessing
import os
import threading
import time
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from multiprocessing import connection

import numpy as np

from evocity import fitness
from evocity.coding import decode
from evocity.condensation import Condensation
from evocity.errors import EvocityError, FitnessError
from evocity.fitness import registry
from evocity.fitness.shipping import Shipment
from evocity.genome import Genome
from evocity.store import Header

#: An error's text in the log is no longer.
MOST_LETTERS = 2000


@dataclass(frozen=True)
class Setup:
    """What a worker must know. ``measures``: (name, file or None) in the recipe's order;
    ``condensation``: what is locked in every genome, or None; ``shipped``: measures of the user's
    session, which another process does not know by name."""

    header: Header
    measures: tuple[tuple[str, str | None], ...]
    condensation: Condensation | None = None
    shipped: tuple[Shipment, ...] = ()


@dataclass(frozen=True)
class Outcome:
    """How breeding or evaluating one individual ended; ``status`` as in `evocity.store`.

    ``error`` becomes one line of at most `MOST_LETTERS`, whatever a measure raised.
    """

    status: str
    error: str | None = None
    seconds: float = 0.0
    values: Mapping[str, float] = field(default_factory=dict)
    genome: Genome | None = None

    def __post_init__(self):
        if self.error is not None:
            line = " ".join(self.error.split()).encode(errors="replace").decode()
            line = line if len(line) <= MOST_LETTERS else line[: MOST_LETTERS - 1] + "…"
            object.__setattr__(self, "error", line)


class Evaluator:
    """Breeds and evaluates; never raises for what an operator or a measure does."""

    def __init__(self, setup: Setup):
        self.header, self.condensation = setup.header, setup.condensation
        files = {file for _, file in setup.measures if file is not None}
        loaded = {file: {m.name: m for m in fitness.load_file(file)} for file in sorted(files)}
        loaded[None] = {m.name: m for one in setup.shipped for m in registry.unpacked(one)}
        self.measures = {
            name: loaded[file][name] if file or name in loaded[None] else fitness.get(name)
            for name, file in setup.measures
        }

    def breed(self, operator, parents: Sequence[Genome], rng: np.random.Generator) -> Outcome:
        """The child's genome in ``.genome``, in the terms of the run's header."""
        start = time.perf_counter()
        try:
            genome = self.header.adopt(operator(parents, rng), self.condensation)
        except KeyboardInterrupt:  # the user's own, when everything runs in one process
            raise
        except BaseException as error:
            return Outcome("error", _told(error), time.perf_counter() - start)
        return Outcome("ok", None, time.perf_counter() - start, genome=genome)

    def evaluate(self, genome: Genome, parents: Sequence[Genome] = ()) -> Outcome:
        """Decode, then every measure; the first that raises ends it, values until then kept.

        ``parents``: the genomes it was bred from, for measures that ask for them; none for one
        that was not bred, which is its own parent.
        """
        start = time.perf_counter()
        parents = parents or (genome,)
        values: dict[str, float] = {}
        undefined: list[str] = []

        def ended(status: str, error: str | None = None) -> Outcome:
            return Outcome(status, error, time.perf_counter() - start, values)

        try:
            decoding = decode(genome)
        except EvocityError as error:
            return ended("invalid", _told(error))
        if not decoding.converged:
            return ended("invalid", f"decoding did not converge: still {decoding.change:.3g} m")
        for name, measure in self.measures.items():
            try:
                value = measure(decoding.city, genome=genome, parents=parents)
            except FitnessError as error:
                # a measure that raised has a cause; one that returned no number has none
                return ended("error" if error.__cause__ else "invalid", _told(error))
            except KeyboardInterrupt:
                raise
            except BaseException as error:
                return ended("error", f"{name}: {_told(error)}")
            values[name] = float(value)
            if not math.isfinite(value):
                undefined.append(
                    f"{name} is {values[name]}: {getattr(value, 'reason', 'no reason given')}"
                )
        return ended("invalid", "; ".join(undefined)) if undefined else ended("ok")


_evaluator: Evaluator | Exception | None = None


def install(setup: Setup) -> None:
    """Make this process a worker: quiet standard output, and an end when the main process ends."""
    global _evaluator
    # What a measure prints must not get into the main process's standard output.
    os.dup2(2, 1)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    # what the fork server warmed already is not done again
    importlib.import_module("evocity.search.warm").warm_up(setup.header.block)
    try:
        _evaluator = Evaluator(setup)
    except Exception as error:  # told by each call, so that the pool does not restart for ever
        _evaluator = error


def call(method: str, *arguments) -> Outcome:
    """Run a method of the installed `Evaluator`."""
    if isinstance(_evaluator, Exception):
        return Outcome("error", f"the worker could not be set up: {_told(_evaluator)}")
    return getattr(_evaluator, method)(*arguments)


def _end_with_parent() -> None:
    # A worker that hangs in a measure would outlive a main process ended by SIGKILL. This
    # thread runs whenever the interpreter lock is let go; code that holds it for ever defeats it.
    connection.wait([multiprocessing.parent_process().sentinel])
    os._exit(1)


def _told(error: BaseException) -> str:
    """One line: type, message, and where in the user's code."""
    if isinstance(error, EvocityError):
        text = f"{error.found} (expected: {error.expected})"
    else:
        frames = traceback.extract_tb(error.__traceback__)
        place = f" ({frames[-1].filename}:{frames[-1].lineno})" if frames else ""
        text = f"{type(error).__name__}: {error}{place}"
    line = " ".join(text.split())
    # a lone surrogate, as in the name of a strange file, cannot be written down
    return line.encode(errors="replace").decode()[:MOST_LETTERS]
