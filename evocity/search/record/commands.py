"""Commands to a run in progress: to stop, to breed from picks, to change weights.

A command is a line in the run's `commands.jsonl`, which any process may add (`send`). The search
carries it out between two generations and logs that in `events.jsonl`, with the generation from
which on it counts. A resumed run replays these events (`StandingOrders.of`).
"""

import contextlib
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, ClassVar, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from evocity.errors import RunError, add_near_miss, reason_of, spell
from evocity.search.record.complete_run import CompleteRun
from evocity.selection.algorithms import algorithms
from evocity.store import Birth, RunLog, append_command, read_commands
from evocity.store.lock import is_held

#: The most picks of a run at a time.
MOST_PICKS = 10_000
#: The events of a command that was carried out, or refused.
DONE, REFUSED = "command", "command refused"
#: The event of another recipe that a run goes on by; it ends the weights set before.
REVISED = "recipe"
#: The event of a file of commands that was too long; the next line is the first of another file.
ASIDE = "commands set aside"
#: The events that `StandingOrders.of` reads.
STEERING = (DONE, REFUSED, REVISED, ASIDE)

_Id = Annotated[int, Field(ge=0, lt=2**63)]
_Weight = Annotated[float, Field(ge=0, le=1e6, allow_inf_nan=False)]


class Command(BaseModel):
    """A command to a run."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    #: Whether a resumed run ignores it.
    passing: ClassVar[bool] = False

    @property
    def words(self) -> str:
        """The command in a few words."""
        raise NotImplementedError


class Stop(Command):
    """End after the generation that is being bred, as if it had been the last."""

    command: Literal["stop"] = "stop"
    passing: ClassVar[bool] = True

    @property
    def words(self) -> str:
        return "stop"


class Pick(Command):
    """Breed from the individuals ``ids`` besides those that the algorithm chooses: a ``share`` of
    all births has one of them as first parent; None keeps the share in force. Earlier picks stay,
    all until `Unpick`."""

    command: Literal["pick"] = "pick"
    ids: Annotated[tuple[_Id, ...], Field(min_length=1, max_length=MOST_PICKS)]
    share: float | None = Field(None, gt=0, le=1)

    @property
    def words(self) -> str:
        share = (
            ""
            if self.share is None
            else f", first parents of {100 * self.share:.0f} % of the births"
        )
        return f"picked: {' '.join(map(str, self.ids))}{share}"


class Unpick(Command):
    """Breed no longer from ``ids``; without any, from no pick."""

    command: Literal["unpick"] = "unpick"
    ids: Annotated[tuple[_Id, ...], Field(max_length=MOST_PICKS)] = ()

    @property
    def words(self) -> str:
        return f"no longer picked: {' '.join(map(str, self.ids)) or 'all'}"


class Reweight(Command):
    """Set ``weights`` by name: of operators of the recipe's mixture, or of measures in a sum."""

    command: Literal["reweight"] = "reweight"
    weights: Annotated[dict[str, _Weight], Field(min_length=1, max_length=1000)]

    @property
    def words(self) -> str:
        return "weights: " + ", ".join(f"{name} {w:g}" for name, w in self.weights.items())


_ANY = TypeAdapter(Annotated[Stop | Pick | Unpick | Reweight, Field(discriminator="command")])


def command_of(document: Mapping | None) -> Command:
    """Return the command in a line of the file. Raises ValueError for anything else."""
    if document is None:
        raise ValueError("no JSON object")
    try:
        return _ANY.validate_python(document)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(map(str, first["loc"]))
        raise ValueError(f"{place or 'command'}: {first['msg']}") from None


@dataclass(frozen=True)
class StandingOrders:
    """The orders of all commands so far: ``picks`` in the order they were picked; the ``share`` of
    births bred from them, None for the recipe's; ``weights`` by name; whether to ``stop`` now.
    ``read``: how many lines of the file were carried out or refused."""

    picks: tuple[int, ...] = ()
    share: float | None = None
    weights: Mapping[str, float] = field(default_factory=dict)
    stop: bool = False
    read: int = 0

    def after(self, command: Command) -> "StandingOrders":
        """Return the orders once the ``command`` is carried out."""
        match command:
            case Stop():
                return replace(self, stop=True)
            case Pick(ids=ids, share=share):
                share = self.share if share is None else share
                return replace(self, picks=tuple(dict.fromkeys(self.picks + ids)), share=share)
            case Unpick(ids=ids):
                left = tuple(pick for pick in self.picks if ids and pick not in ids)
                return replace(self, picks=left, share=self.share if left else None)
            case Reweight(weights=weights):
                return replace(self, weights={**self.weights, **weights})
        raise TypeError(f"not a command: {command!r}")

    @classmethod
    def of(cls, events: Iterable[Mapping], generation: int) -> "StandingOrders":
        """Return the orders after those ``events`` of a run that count from the ``generation`` on,
        or from before, without a stop. The lines of all events are read. Raises ValueError for an
        event without a command."""
        orders = cls()
        for event in steering_events(events):
            if event["generation"] > generation:
                continue
            if event["event"] == REVISED:
                orders = replace(orders, weights={})
            if event["event"] == DONE:
                command = command_of(event)
                orders = orders if command.passing else orders.after(command)
        return replace(orders, read=lines_read(events))


def steering_events(events: Iterable[Mapping]) -> list[Mapping]:
    """Return those of the ``events`` that steer a run, by the generation from which on they count:
    a run whose last generations were set aside has logged events of later ones before."""
    known = [
        event
        for event in events
        if event.get("event") in STEERING and isinstance(event.get("generation"), int)
    ]
    return sorted(known, key=lambda event: event["generation"])


def later_commands(events: Iterable[Mapping], generation: int) -> list[tuple[int, Command]]:
    """Return the commands that counted from a generation after this ``generation`` on, which were
    logged before later generations were set aside. Raises ValueError for an event without one."""
    return [
        (event["generation"], command_of(event))
        for event in steering_events(events)
        if event["event"] == DONE and event["generation"] > generation
    ]


def lines_read(events: Iterable[Mapping]) -> int:
    """Return how many lines of the present file of commands were carried out or refused."""
    count = 0
    for event in events:
        if event.get("event") == ASIDE:
            count = 0
        elif event.get("event") in STEERING and isinstance(line := event.get("line"), int):
            count = max(count, line + 1)
    return count


@dataclass(frozen=True)
class CommandState:
    """The commands to a run: the ``orders`` once all that are ``pending`` are carried out, and
    those ``refused``, (generation, reason) each."""

    orders: StandingOrders
    pending: tuple[Command, ...]
    refused: tuple[tuple[int, str], ...]


def command_state(run: RunLog) -> CommandState:
    """Read the commands to a ``run`` so far, without lines that hold no command.

    Raises `RunError` if a file cannot be read, ValueError for an event without a command."""
    events = run.events()
    orders = StandingOrders.of(events, 2**63)
    refused = tuple(
        (event.get("generation", 0), str(event.get("reason", "")))
        for event in events
        if event.get("event") == REFUSED
    )
    pending = []
    for _, line in read_commands(run.path / "commands.jsonl", orders.read):
        with contextlib.suppress(ValueError):
            pending.append(command_of(line))
    for command in pending:
        orders = orders if command.passing else orders.after(command)
    return CommandState(orders, tuple(pending), refused)


def command_document(command: Command) -> dict:
    """Return a ``command`` as a line of the file, or an event, has it."""
    return command.model_dump(mode="json", exclude_none=True)


def send(path: str | os.PathLike, command: Command) -> bool:
    """Send a ``command`` to the run in ``path``; return whether the run goes on now.

    The search carries it out between two generations; a run that has stopped, when it is resumed.
    Raises `RunError` if the run cannot carry the command out.
    """
    run = CompleteRun(path)
    going = is_held(run.path / "lock")
    if isinstance(command, Stop) and not going:
        raise RunError(
            f"{run.path}: this run is not in progress: it has ended, or was stopped",
            "a run that is still running",
            f"check the state of the run: evocity status {run.path}",
        )
    if isinstance(command, Pick):
        refuse_picks(str(run.provenance.get("recipe", {}).get("search", {}).get("algorithm")))
        refuse_unborn(run, command.ids)
    if isinstance(command, Unpick):
        _refuse_unpicked(run, command.ids)
    if isinstance(command, Reweight):
        refuse_weights(command, _orders(run), *weights_of_run(run), str(run.path))
    try:
        append_command(run.path / "commands.jsonl", command_document(command))
    except OSError as error:
        raise RunError(
            f"{run.path} cannot be written: {reason_of(error)}",
            "a run folder that this user may write to",
            "check the owner of the folder, and the free space",
        ) from error
    return going


def pick(path: str | os.PathLike, ids: Sequence[int], share: float | None = None) -> bool:
    """Use the individuals with these ``ids`` as additional parents of the run in ``path``, from the
    next generation on, and even after a resume.

    The argument ``share`` (0…1) is the share of births whose first parent is a picked individual.
    By default, the key ``picks`` of the recipe's section ``[search]`` gives the value of ``share``.
    Individuals that were picked earlier stay picked.

    Returns whether the run is in progress now. Raises `RunError` if one of the individuals was
    never born, if its birth failed, or if the algorithm of the run accepts no picks.
    """
    try:
        command = Pick(ids=tuple(ids), share=share)
    except (ValidationError, TypeError) as error:
        raise RunError(
            f"the picked births {_list_ids(ids)} with the share {spell(share)} are not valid",
            "one or more ids of births, and a share above 0 and at most 1",
            "take ids from `evocity status`, from the report, or from the births' column `id`",
        ) from error
    return send(path, command)


def refuse_picks(algorithm: str) -> None:
    """Raise `RunError` if the ``algorithm`` breeds by its own operator, without chosen parents."""
    kind = algorithms().get(algorithm)
    if kind is not None and kind.breeds_by is not None:
        raise RunError(
            f"the algorithm {algorithm} chooses all parents, so users cannot pick parents",
            "a run with another algorithm, which lets users pick parents",
            "start another run with the picked births as [[parents]] (keys 'run' and 'id')",
        )


def refuse_unborn(run: RunLog, ids: Sequence[int]) -> None:
    """Raise `RunError` unless all ``ids`` are births of the ``run`` that did not fail."""
    refuse_failed(run, run.individuals(ids, rebred=False))


def refuse_failed(run: RunLog, births: Sequence[Birth]) -> None:
    """Raise `RunError` if one of the ``births`` of a ``run`` failed."""
    for birth in births:
        if not birth.ok:
            raise RunError(
                f"{run.path}: individual {birth.id} failed ({birth.error})",
                "individuals that were bred and measured",
                f"choose individuals that `evocity status {run.path}` lists",
            )


def _list_ids(ids) -> str:
    """``ids`` as the user typed them, if they can be listed."""
    try:
        return " ".join(map(str, ids)) or "nobody"
    except TypeError:
        return spell(ids)


def _orders(run: RunLog) -> StandingOrders:
    """The orders with all pending commands; none if the log is damaged, which a resume reports."""
    with contextlib.suppress(ValueError):
        return command_state(run).orders
    return StandingOrders()


def _refuse_unpicked(run: RunLog, ids: Sequence[int]) -> None:
    picks = _orders(run).picks
    unpicked = [identifier for identifier in ids if identifier not in picks]
    if unpicked or not picks:
        verb = "are not" if len(unpicked) > 1 else "is not" if unpicked else "is"
        raise RunError(
            f"{run.path}: {' '.join(map(str, unpicked)) or 'nobody'} {verb} picked",
            f"some of {' '.join(map(str, picks))}" if picks else "a run that breeds from picks",
            f"list the picked individuals: evocity status {run.path}",
        )


def weights_of_run(run: RunLog) -> tuple[list[dict[str, float]], list[str]]:
    """Read what a ``run`` weighs: the operators of each mixture, to the weights of its recipe, and
    the measures in sums. An algorithm that breeds by its own operator weighs no operators."""
    try:
        recipe = run.provenance["recipe"]
        kind = algorithms().get(str(recipe.get("search", {}).get("algorithm")))
        sums = [one["name"] for one in run.provenance["fitness"] if one.get("objective")]
        if kind is not None and kind.breeds_by is not None:
            return [], sums
        every = [island["operators"] for island in recipe.get("islands", [])]
        return [
            {
                name: float(entry.get("weight", 1) if isinstance(entry, Mapping) else entry)
                for name, entry in entries.items()
            }
            for entries in every or [recipe.get("operators", {})]
        ], sums
    except (LookupError, TypeError, AttributeError, ValueError):
        return [], []


def refuse_weights(
    command: Reweight,
    orders: StandingOrders,
    mixtures: Sequence[Mapping[str, float]],
    sums: Sequence[str],
    where: str,
) -> None:
    """Raise `RunError` for weights of anything but operators of the ``mixtures`` and measures in
    ``sums``, for a measure's weight of 0, and if no operator of a mixture keeps a weight."""
    mixture = list(dict.fromkeys(name for weights in mixtures for name in weights))
    for name, weight in command.weights.items():
        if name not in (*mixture, *sums):
            known = [f"the operators {', '.join(mixture)}"] if mixture else []
            known += [f"the measures {', '.join(sums)}"] if sums else []
            raise RunError(
                add_near_miss(f"{where} has no weight {spell(name)}", name, [*mixture, *sums]),
                ", and ".join(known) or "a run that records its weights",
                "name one of them; only measures in a sum have weights, and the algorithm `cma` "
                "has no weights of operators",
            )
        if name in sums and weight == 0:
            raise RunError(
                f"{where}: the new weight of the measure {name} is 0",
                "a weight above 0 for each measure in a weighted sum",
                "give the measure a small weight instead, such as 0.001",
            )
    weights = {**orders.weights, **command.weights}
    for mixture in mixtures:
        if mixture and not any(weights.get(name, weight) for name, weight in mixture.items()):
            of_one = f" of an island ({', '.join(mixture)})" if len(mixtures) > 1 else ""
            raise RunError(
                f"{where}: all operators{of_one} would have the weight 0",
                "at least one operator with a weight above 0",
                "leave the weight of one operator as it is, or give another operator a weight",
            )
