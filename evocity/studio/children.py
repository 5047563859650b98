"""Children of picked births, bred in broods; they are not in the log, and a user may keep them.

One brood is bred at a time; each child shows its picture first. Each child has its own generator of
random numbers, so the same picks, operators and seed give the same genomes.
"""

import contextlib
import inspect
import itertools
import json
import threading
from collections.abc import Iterable, Iterator, Mapping, Sequence
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
from evocity.evaluation import Workers
from evocity.evaluation.evaluator import Outcome
from evocity.fitness import Part
from evocity.genome import Genome
from evocity.operators import Operator
from evocity.studio.child_evaluation import workers_of
from evocity.studio.drawing_board import Drawing, hatched, lock_layer, measured_part
from evocity.studio.request_fields import Body, Id
from evocity.studio.run_watcher import Moment
from evocity.viewer.sheet import Sheet

#: Children of a brood, parents, operators that take turns; at most.
MOST_CHILDREN, MOST_PARENTS, MOST_OPERATORS = 24, 16, 12
_FILLS = (0.1, 0.9)
# Pictures of smaller maps are enlarged to about so many px.
_CLEAR = 320
# Seconds to wait for cancelled children.
_PATIENCE = 0.5


class Brood(Body):
    """A request for ``count`` children of ``parents``, by ``operators`` in turn. ``parameters`` go
    with a single operator. ``vary`` draws the share of the second parent for each child. A
    ``drawing`` locks pixels and marks where to measure. Broods of the ``board`` are separate."""

    operators: Annotated[tuple[str, ...], Field(min_length=1, max_length=MOST_OPERATORS)]
    parameters: Annotated[dict[str, JsonValue], Field(max_length=50)] = {}  # noqa: RUF012
    parents: Annotated[tuple[Id, ...], Field(min_length=1, max_length=MOST_PARENTS)]
    count: Annotated[int, Field(ge=1, le=MOST_CHILDREN)] = 12
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    vary: bool = False
    board: bool = False
    drawing: Drawing | None = None


class ReadyRequest(Body):
    """A request to prepare workers and ``parents``, for the ``board`` or for a brood."""

    parents: Annotated[tuple[Id, ...], Field(max_length=MOST_PARENTS)] = ()
    board: bool = False


@dataclass
class Child:
    """One child: ``stage`` is "waiting", "bred", "measured" or "failed"."""

    number: int
    operator: Operator
    parents: tuple[int, ...]
    parameters: Mapping[str, JsonValue] = field(default_factory=dict)
    stage: str = "waiting"
    error: str | None = None
    #: Why the child equals its first parent, if it does.
    unchanged: str | None = None
    values: Mapping[str, float] = field(default_factory=dict)
    genome: Genome | None = None
    city: CityMap | None = None

    @property
    def state(self) -> dict:
        return {
            "number": self.number,
            "operator": self.operator.name,
            "parents": list(self.parents),
            "stage": self.stage,
            "error": self.error,
            "unchanged": self.unchanged,
            "values": _finite(self.values),
        }


def _finite(values: Mapping[str, float]) -> dict[str, float]:
    return {name: float(value) for name, value in values.items() if np.isfinite(value)}


def plan_children(brood: Brood) -> list[Child]:
    """Return the children of a ``brood``, not yet bred. Raises `OperatorError`."""
    if brood.parameters and len(brood.operators) > 1:
        raise OperatorError(
            f"the request gives parameters but names {len(brood.operators)} operators",
            "a single operator for the given parameters",
            "choose one operator, or leave the parameters out",
        )
    parents, children = list(dict.fromkeys(brood.parents)), []
    for number in range(brood.count):
        name = brood.operators[number % len(brood.operators)]
        turn = number // len(brood.operators)
        parameters, most_of = dict(brood.parameters), len(parents)
        if brood.vary and not {"fill", "void"} & set(parameters) and _takes_share(name):
            drawn = _generator(brood.seed, number, 1).uniform(*_FILLS)
            parameters["fill"] = round(float(drawn), 3)
            most_of = 2
        operator = operators.make(name, **parameters)
        fewest, most = operator.parents
        if len(parents) < fewest:
            raise OperatorError(
                f"{len(parents)} parents are too few for the operator {name}",
                f"{fewest} or more parents",
                "pick more births, or choose another operator",
            )
        count = min(len(parents), most_of, most or most_of)
        taken = tuple(parents[(turn + k) % len(parents)] for k in range(count))
        if hasattr(operator, "check_count"):
            operator.check_count(count)
        children.append(Child(number, operator, taken, parameters))
    return children


def _takes_share(name: str) -> bool:
    kind = operators.operators().get(name)
    return kind is not None and "fill" in inspect.signature(kind).parameters


def _are_equal(child: CityMap, parent: CityMap | None) -> bool:
    return parent is not None and np.array_equal(child.heights, parent.heights, equal_nan=True)


def _generator(seed: int, number: int, use: int) -> np.random.Generator:
    sequence = np.random.SeedSequence(seed, spawn_key=(number, use))
    return np.random.Generator(np.random.PCG64(sequence))


def reasons_against(moment: Moment, parents: Iterable[Genome]) -> dict[str, str]:
    """Return for each operator the reason why it does not suit ``parents`` of a run, or ""."""
    chromosome = moment.run.header.chromosome
    fabrics = [chromosome.fabric(one) or one for one in parents]
    return {
        name: operators.reason_against(kind, chromosome.factors, fabrics)
        for name, kind in operators.operators().items()
    }


def list_operators(reasons: Mapping[str, str]) -> list[dict]:
    """Return the operators as plain values, with the default of each parameter as JSON, and with
    the ``reasons`` of `reasons_against`."""
    return [
        {
            "name": name,
            "of": operators.bred_by(kind),
            "reason": reasons[name],
            "turns": operators.takes_turns(kind),
            "told": (inspect.getdoc(kind) or "").partition("\n\n")[0].replace("\n", " "),
            "parameters": [
                {"name": parameter.name, "default": _as_json(parameter.default)}
                for parameter in inspect.signature(kind).parameters.values()
            ],
        }
        for name, kind in operators.operators().items()
    ]


def _as_json(value: object) -> str:
    try:
        return "" if value is inspect.Parameter.empty else json.dumps(value)
    except (TypeError, ValueError):  # the default of another package's operator
        return str(value)


class Breeding:
    """The broods of one run; each replaces the one before."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._stopped = self._closed = False
        self._workers: Workers | None = None
        self._workers_run: str | None = None
        self._parents: dict[int, Genome] = {}
        self._parents_run: str | None = None
        self._highest = 10.0
        self.left: dict[str, str] = {}
        self.number = 0
        self.brood: Brood | None = None
        self.children: list[Child] = []
        #: The lock of the run and of a drawing together.
        self.locked: Condensation | None = None
        self._hatched: Condensation | None = None
        #: The part of the map where a drawing measures; values of the parents there, by id.
        self.part: Part | None = None
        self.marked: dict[int, Mapping[str, float]] = {}
        self.error: str | None = None

    @property
    def busy(self) -> bool:
        """Whether a brood is being bred, or workers are being prepared."""
        return self._thread is not None and self._thread.is_alive()

    def state(self) -> dict:
        marked = None
        if self.part is not None:
            marked = {parent: _finite(values) for parent, values in dict(self.marked).items()}
        return {
            "brood": self.number,
            "busy": self.busy,
            "error": self.error,
            "left": self.left,
            "children": [child.state for child in self.children],
            "marked": marked,
        }

    def prepare(self, moment: Moment, parents: Sequence[int]) -> None:
        """Start workers, which takes a second or two, and read the genomes of ``parents``."""
        with self._lock:
            if not self.busy:
                self._start(moment, [], {})
        self.genomes(moment, parents)

    def genomes(self, moment: Moment, parents: Sequence[int]) -> dict[int, Genome]:
        """Return the genomes of ``parents``, which stay in memory, by id."""
        known = self._parents if self._parents_run == moment.fingerprint else {}
        genomes = {n: known.get(n) or moment.run.genome(n) for n in parents}
        self._parents, self._parents_run = genomes, moment.fingerprint
        return genomes

    def begin(self, brood: Brood, moment: Moment) -> None:
        """Breed a ``brood`` of births of the ``moment``. Raises `RunError` while another is
        bred."""
        children = plan_children(brood)
        parents = births = self.genomes(moment, brood.parents)
        reasons = reasons_against(moment, births.values())
        for name in dict.fromkeys(child.operator.name for child in children):
            if reasons[name]:
                raise OperatorError(
                    f"the operator {name} does not suit these parents: {reasons[name]}",
                    "an operator that suits the parents",
                    "choose another operator, or other parents",
                )
        locked = part = None
        if brood.drawing is not None:
            drawn_over = [births[n] for n in brood.parents]
            part = measured_part(brood.drawing, drawn_over)
            locked = lock_layer(brood.drawing, drawn_over)
            parents = {n: genome.replace(condensation=locked) for n, genome in parents.items()}
        jobs = [
            (child.operator, tuple(parents[n] for n in child.parents), _generator(brood.seed, k, 0))
            for k, child in enumerate(children)
        ]
        with self._lock:
            if self.busy:
                raise RunError(
                    "studio is already breeding children",
                    "one group of children at a time",
                    "wait for the present children, or stop them",
                )
            self.number, self.brood, self.children = self.number + 1, brood, children
            self.locked, self.part, self.marked = locked, part, {}
            self._hatched = locked or moment.run.condensation
            self._start(moment, jobs, births)

    def stop(self) -> None:
        """Begin no more children; children that are being bred go on until their deadline."""
        self._stopped = True

    def release_workers(self) -> None:
        """End idle workers; the next brood starts new ones."""
        with self._lock:
            if self._workers is not None and not self.busy:
                self._workers.close()
                self._workers = None

    def cancel(self) -> None:
        """End the children that are being bred, and begin no more, ever; it waits for nothing."""
        self._stopped = self._closed = True
        if (workers := self._workers) is not None:
            workers.cancel()

    def close(self) -> None:
        self.cancel()
        if self._thread is not None:
            self._thread.join(_PATIENCE)
        if self._workers is not None and not self.busy:  # busy workers end with this process
            self._workers.close()

    def sheet(self, brood: int, numbers: list[int], side: int) -> Sheet:
        pictures = {
            child.number: np.asarray(thumbnail(child.city, self._highest, side))
            for child in self._children_of(brood)
            if child.number in numbers and child.city is not None
        }
        return Sheet.of(pictures, {})

    def picture(self, brood: int, number: int) -> Image.Image:
        """Return a picture of one child, with its lock hatched. Raises `RunError` where it has
        none."""
        from evocity.pictures import render
        from evocity.pictures.colours import scale_end
        from evocity.pictures.legend import draw_with_scale

        city, layer = self.child(brood, number).city, self._hatched
        end = scale_end(city)
        zoom = max(1, _CLEAR // max(city.shape))
        fabric = render(city, highest=end, legend=False, zoom=zoom)
        if layer is not None:
            hatch = hatched(layer.mask.repeat(zoom, 0).repeat(zoom, 1))
            fabric.paste(hatch, mask=hatch)
        return draw_with_scale(city, fabric, city.name, end, zoom)

    def child(self, brood: int, number: int) -> Child:
        """Return a child that was bred. Raises `RunError` for another number."""
        for child in self._children_of(brood):
            if child.number == number and child.city is not None:
                return child
        raise RunError(
            f"this group of children has no bred child {number}",
            "the number of a bred child",
            "choose another child",
        )

    def _children_of(self, brood: int) -> list[Child]:
        if brood != self.number:
            raise RunError(
                f"newer children have replaced the children of group {brood}",
                f"the number of the present group of children, {self.number}",
                "choose from the newest children",
            )
        return self.children

    # -- in a thread -----------------------------------------------------------------------------

    def _start(self, moment: Moment, jobs: list[tuple], births: Mapping[int, Genome]) -> None:
        self._stopped, self.error = False, None
        self._thread = threading.Thread(
            target=self._breed, args=(moment, jobs, births), daemon=True, name="breeding"
        )
        self._thread.start()

    def _breed(self, moment: Moment, jobs: list[tuple], births: Mapping[int, Genome]) -> None:
        try:
            workers, part = self._ready_workers(moment), self.part
            pairs = list(zip(self.children, jobs, strict=False))  # without jobs nothing is bred
            for child, outcome in self._outcomes(workers, "breed", pairs):
                self._note_genome(child, outcome, jobs[child.number])
            method = "evaluate" if part is None else "evaluate_within"
            bred = [
                (child, (child.genome, job[1] if part is None else part))
                for child, job in pairs
                if child.stage == "bred"
            ]
            for child, outcome in self._outcomes(workers, method, bred):
                child.values, child.error = dict(outcome.values), outcome.error
                child.stage = "measured"
            if part is not None:
                parents = [(n, (genome, part)) for n, genome in births.items()]
                for parent, outcome in self._outcomes(workers, method, parents):
                    self.marked[parent] = dict(outcome.values)
        except EvocityError as error:
            self.error = str(error)
        except Exception as error:  # the page shows it; the next brood has new workers
            self.error, self._workers_run = f"{type(error).__name__}: {error}", None

    def _ready_workers(self, moment: Moment) -> Workers:
        if self._workers is None or self._workers_run != moment.fingerprint:
            if self._workers is not None:
                self._workers.close()
            self._workers, self.left = workers_of(moment.run)
            if self._closed:  # meanwhile
                self._workers.cancel()
            self._highest, self._workers_run = moment.thumbnails.highest, moment.fingerprint
            self._express = moment.run.header.chromosome.express
            source = moment.run.sources()[0].genome  # each worker loads its modules by this
            self._workers.run("evaluate", [(source,)] * self._workers.size)
        return self._workers

    def _outcomes(self, workers: Workers, method: str, jobs: Sequence[tuple]) -> Iterator[tuple]:
        """Send ``jobs``, pairs of a key and arguments, to ``workers``; return the key and outcome
        of each."""
        arguments = (job for _, job in itertools.takewhile(lambda _: not self._stopped, jobs))
        with contextlib.closing(workers.stream(method, arguments)) as outcomes:
            for place, outcome in outcomes:
                yield jobs[place][0], outcome

    def _note_genome(self, child: Child, outcome: Outcome, job: tuple) -> None:
        child.genome, child.error = outcome.genome, outcome.error
        if child.genome is not None:
            if self.locked is not None:  # workers return the lock of the run, which is smaller
                child.genome = child.genome.replace(condensation=self.locked)
            expressed = self._express(child.genome)
            child.city, child.error = expressed.city, expressed.problem
        child.stage = "failed" if child.city is None else "bred"
        operator, (first, *_), _ = job
        if child.city is not None and _are_equal(child.city, self._express(first).city):
            find = getattr(operator, "reason_unchanged", lambda parents: "")
            child.unchanged = find(job[1]) or "the operator found nothing to change"
