"""Children of births that a user picked: one by one, picture first, not logged until they are kept.

A brood is bred at a time. Each child has a generator of its own, so that the same picks, operators
and seed give the same genomes, whatever else is bred and however many workers there are.
"""

import contextlib
import inspect
import json
import threading
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from PIL import Image
from pydantic import Field, JsonValue

from evocity import operators
from evocity.analysis.thumbnails import thumbnail
from evocity.citymap import CityMap
from evocity.condensation import Condensation
from evocity.errors import EvocityError, OperatorError, RunError
from evocity.fitness import Part
from evocity.genome import Genome
from evocity.operators import Operator
from evocity.search.evaluation import Workers
from evocity.search.evaluator import Outcome
from evocity.studio.asked import Body
from evocity.studio.drawing import Drawing, locked_by, measured_by
from evocity.studio.measuring import workers_of
from evocity.studio.picks import Id
from evocity.studio.watched import Moment
from evocity.viewer.sheet import Sheet

#: Children of a brood, parents, operators that take turns; at most.
MOST_CHILDREN, MOST_PARENTS, MOST_OPERATORS = 24, 16, 12
_FILLS = (0.1, 0.9)


class Brood(Body):
    """What is asked for: so many children of these ``parents``, by ``operators`` in turn. Of one
    operator alone ``parameters`` may be told; ``vary`` draws how much of each child is the second
    parent's, of two, where an operator lets that be told and nobody does. A ``drawing`` locks
    pixels in all of them, and tells what they are measured of; those of the ``board`` are beside
    the others."""

    operators: Annotated[tuple[str, ...], Field(min_length=1, max_length=MOST_OPERATORS)]
    parameters: Annotated[dict[str, JsonValue], Field(max_length=50)] = {}  # noqa: RUF012
    parents: Annotated[tuple[Id, ...], Field(min_length=1, max_length=MOST_PARENTS)]
    count: Annotated[int, Field(ge=1, le=MOST_CHILDREN)] = 12
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    vary: bool = False
    board: bool = False
    drawing: Drawing | None = None


class Ready(Body):
    """Who may soon be bred from; on the ``board``, or as a brood."""

    parents: Annotated[tuple[Id, ...], Field(max_length=MOST_PARENTS)] = ()
    board: bool = False


@dataclass
class Child:
    """One child: ``stage`` is "waiting", "bred", "measured" or "failed"; ``parameters`` are those
    that its operator was told."""

    number: int
    operator: Operator
    parents: tuple[int, ...]
    parameters: Mapping[str, JsonValue] = field(default_factory=dict)
    stage: str = "waiting"
    error: str | None = None
    values: Mapping[str, float] = field(default_factory=dict)
    genome: Genome | None = None
    city: CityMap | None = None

    @property
    def told(self) -> dict:
        return {
            "number": self.number,
            "operator": self.operator.name,
            "parents": list(self.parents),
            "stage": self.stage,
            "error": self.error,
            "values": _finite(self.values),
        }


def _finite(values: Mapping[str, float]) -> dict[str, float]:
    return {name: float(one) for name, one in values.items() if np.isfinite(one)}


def planned(brood: Brood) -> list[Child]:
    """The children of a ``brood``, not yet bred. Raises `OperatorError` for operators, parameters
    and numbers of parents that do not go together."""
    if brood.parameters and len(brood.operators) > 1:
        raise OperatorError(
            f"parameters of {len(brood.operators)} operators", "of one", "choose one operator"
        )
    parents, found = list(dict.fromkeys(brood.parents)), []
    for number in range(brood.count):
        name = brood.operators[number % len(brood.operators)]
        turn = number // len(brood.operators)
        parameters, most_of = dict(brood.parameters), len(parents)
        if brood.vary and not {"fill", "void"} & set(parameters) and _shares(name):
            drawn = _generator(brood.seed, number, 1).uniform(*_FILLS)
            parameters["fill"] = round(float(drawn), 3)
            most_of = 2
        operator = operators.make(name, **parameters)
        fewest, most = operator.parents
        if len(parents) < fewest:
            raise OperatorError(
                f"{name} of {len(parents)} parent{'s' * (len(parents) > 1)}",
                f"{fewest} or more",
                "pick more births, or choose another operator",
            )
        taken = min(len(parents), most_of, most or most_of)
        own = tuple(parents[(turn + k) % len(parents)] for k in range(taken))
        if hasattr(operator, "check_count"):
            operator.check_count(taken)
        found.append(Child(number, operator, own, parameters))
    return found


def _shares(name: str) -> bool:
    kind = operators.operators().get(name)
    return kind is not None and "fill" in inspect.signature(kind).parameters


def _generator(seed: int, number: int, use: int) -> np.random.Generator:
    sequence = np.random.SeedSequence(seed, spawn_key=(number, use))
    return np.random.Generator(np.random.PCG64(sequence))


def operators_told() -> list[dict]:
    """The operators there are, plain values: name, fewest and most parents, a sentence, and each
    parameter with its default as JSON."""
    return [
        {
            "name": name,
            "fewest": kind.parents[0],
            "most": kind.parents[1],
            "told": (inspect.getdoc(kind) or "").partition("\n\n")[0].replace("\n", " "),
            "parameters": [
                {"name": one.name, "default": _as_json(one.default)}
                for one in inspect.signature(kind).parameters.values()
            ],
        }
        for name, kind in operators.operators().items()
    ]


def _as_json(value: object) -> str:
    try:
        return "" if value is inspect.Parameter.empty else json.dumps(value)
    except (TypeError, ValueError):  # of another package's
        return str(value)


class Breeding:
    """Broods of one run, each in place of the one before."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._stopped = False
        self._workers: Workers | None = None
        self._of: str | None = None
        self._parents: dict[int, Genome] = {}
        self._parents_of: str | None = None
        self._highest = 10.0
        self.left: dict[str, str] = {}
        self.number = 0
        self.brood: Brood | None = None
        self.children: list[Child] = []
        #: What a drawing locks in them besides what the run does, and that.
        self.locked: Condensation | None = None
        #: What a drawing has them measured of, and values of their parents there, by id.
        self.part: Part | None = None
        self.marked: dict[int, Mapping[str, float]] = {}
        self.error: str | None = None

    @property
    def busy(self) -> bool:
        return self._thread is not None and self._thread.is_alive()

    def told(self) -> dict:
        """Plain values for the page."""
        return {
            "brood": self.number,
            "busy": self.busy,
            "error": self.error,
            "left": self.left,
            "children": [one.told for one in self.children],
            "marked": None
            if self.part is None
            else {one: _finite(values) for one, values in dict(self.marked).items()},
        }

    def ready(self, moment: Moment, parents: Sequence[int]) -> None:
        """Have workers at hand, which takes a second or two, and the genomes of ``parents``.
        Raises `RunError` for those that have none."""
        self._begin(moment, None, [])
        self._genomes(moment, parents)

    def _genomes(self, moment: Moment, parents: Sequence[int]) -> dict[int, Genome]:
        """Of ``parents``, each read once."""
        known = self._parents if self._parents_of == moment.called else {}
        found = {one: known.get(one) or moment.run.genome(one) for one in parents}
        self._parents, self._parents_of = found, moment.called
        return found

    def begin(self, brood: Brood, moment: Moment) -> None:
        """Breed a ``brood`` of births of the ``moment``. Raises `RunError` while another is bred
        and for parents that have no genome; `OperatorError` as `planned`."""
        children = planned(brood)
        parents = births = self._genomes(moment, brood.parents)
        locked = part = None
        if brood.drawing is not None:
            drawn_over = [births[one] for one in brood.parents]
            part = measured_by(brood.drawing, drawn_over)
            locked = locked_by(brood.drawing, drawn_over)
            parents = {n: one.replace(condensation=locked) for n, one in parents.items()}
        jobs = [
            (one.operator, tuple(parents[n] for n in one.parents), _generator(brood.seed, k, 0))
            for k, one in enumerate(children)
        ]
        self._begin(moment, brood, children, jobs, locked, part, births)

    def stop(self) -> None:
        """Begin no more children; who is being bred ends, at its deadline at last."""
        self._stopped = True

    def rest(self) -> None:
        """Let workers go that nobody breeds by; the next brood has new ones."""
        with self._lock:
            if self._workers is not None and not self.busy:
                self._workers.close()
                self._workers = None

    def close(self) -> None:
        self.stop()
        thread, workers = self._thread, self._workers
        if thread is not None:
            thread.join(2.0)
        if workers is not None and not self.busy:  # else they end with this process
            workers.close()

    def sheet(self, brood: int, numbers: list[int], side: int) -> Sheet:
        """Small pictures of children."""
        found = {}
        for one in self._of_brood(brood):
            if one.number in numbers and one.city is not None:
                found[one.number] = np.asarray(thumbnail(one.city, self._highest, side))
        return Sheet.of(found, {})

    def picture(self, brood: int, number: int) -> Image.Image:
        """A picture of one child. Raises `RunError` where it has none."""
        from evocity.pictures import render

        return render(self.child(brood, number).city)

    def child(self, brood: int, number: int) -> Child:
        """One that was bred. Raises `RunError` for another."""
        for one in self._of_brood(brood):
            if one.number == number and one.city is not None:
                return one
        raise RunError(f"no child {number}", "one of this brood that was bred", "choose another")

    def _of_brood(self, brood: int) -> list[Child]:
        if brood != self.number:
            raise RunError(f"brood {brood} is over", f"brood {self.number}", "look at that one")
        return self.children

    # -- in a thread -----------------------------------------------------------------------------

    def _begin(
        self,
        moment: Moment,
        brood: Brood | None,
        children: list[Child],
        jobs=(),
        locked: Condensation | None = None,
        part: Part | None = None,
        births: Mapping[int, Genome] | None = None,
    ) -> None:
        with self._lock:
            if self.busy:
                if brood is None:
                    return
                raise RunError("a brood is being bred", "one at a time", "wait for it, or stop it")
            self._stopped, self.error = False, None
            if brood is not None:
                self.number, self.brood, self.children = self.number + 1, brood, children
                self.locked, self.part, self.marked = locked, part, {}
            self._thread = threading.Thread(
                target=self._breed,
                args=(moment, list(jobs), births or {}),
                daemon=True,
                name="breeding",
            )
            self._thread.start()

    def _breed(self, moment: Moment, jobs: list[tuple], births: Mapping[int, Genome]) -> None:
        try:
            workers, part = self._ready(moment), self.part
            own = list(zip(self.children, jobs, strict=False))  # without jobs none is bred
            self._stream(workers, "breed", iter(own), self._bred)
            bred = [(one, job[1]) for one, job in own if one.stage == "bred"]
            if part is None:
                whole = ((one, (one.genome, parents)) for one, parents in bred)
                self._stream(workers, "evaluate", whole, self._measured)
            else:
                within = ((one, (one.genome, part)) for one, _ in bred)
                self._stream(workers, "evaluate_within", within, self._measured)
                within = ((number, (genome, part)) for number, genome in births.items())
                self._stream(workers, "evaluate_within", within, self._compared)
        except EvocityError as error:
            self.error = str(error)
        except Exception as error:  # told on the page; the next brood has new workers
            self.error, self._of = f"{type(error).__name__}: {error}", None

    def _ready(self, moment: Moment) -> Workers:
        if self._workers is None or self._of != moment.called:
            if self._workers is not None:
                self._workers.close()
            self._workers, self.left = workers_of(moment.run)
            self._highest, self._of = moment.thumbnails.highest, moment.called
            self._express = moment.run.header.chromosome.express
            source = moment.run.sources()[0].genome  # so that they have all at hand
            self._workers.run("evaluate", [(source,)] * self._workers.size)
        return self._workers

    def _stream(self, workers: Workers, method: str, jobs: Iterator[tuple], done) -> None:
        """``jobs``: whose each is, and what a worker is given; ``done`` is told whose, and how it
        ended."""
        at: list = []

        def drawn() -> Iterator[tuple]:
            for whose, job in jobs:
                if self._stopped:
                    return
                at.append(whose)
                yield job

        with contextlib.closing(workers.stream(method, drawn())) as outcomes:
            for place, outcome in outcomes:
                done(at[place], outcome)

    def _bred(self, child: Child, outcome: Outcome) -> None:
        child.genome, child.error = outcome.genome, outcome.error
        if child.genome is not None:
            if self.locked is not None:  # workers tell it in the run's terms, which lock less
                child.genome = child.genome.replace(condensation=self.locked)
            expressed = self._express(child.genome)
            child.city, child.error = expressed.city, expressed.problem
        child.stage = "failed" if child.city is None else "bred"

    def _measured(self, child: Child, outcome: Outcome) -> None:
        child.values, child.error = dict(outcome.values), outcome.error
        child.stage = "measured"

    def _compared(self, parent: int, outcome: Outcome) -> None:
        self.marked[parent] = dict(outcome.values)


__all__ = ["MOST_CHILDREN", "Breeding", "Brood", "Child", "Ready", "operators_told", "planned"]
