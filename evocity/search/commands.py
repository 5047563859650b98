"""What may be asked of a run while it goes on: to stop, to breed from picks, to weigh anew.

A command is a line in the run's `commands.jsonl`, which any process may add (`send`). The search
carries it out between two generations and says so in `events.jsonl`, with the generation from
which on it counts. What such events tell is what a resumed run replays (`Standing.of`).
"""

import contextlib
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, ClassVar, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from evocity.errors import RunError, shown, with_near_miss
from evocity.search.algorithms import algorithms
from evocity.search.opening import open_run
from evocity.store import Run, append_command, read_commands
from evocity.store.lock import is_held

#: Picks that a run breeds from at a time, at most.
MOST_PICKS = 10_000
#: The events that tell what was done about a command.
DONE, REFUSED = "command", "command refused"
#: The event of another recipe that a run goes on by; weights that were set before are over.
REVISED = "recipe"
#: The events by which `Standing.of` goes.
STEERING = (DONE, REFUSED, REVISED)

_Id = Annotated[int, Field(ge=0, lt=2**63)]
_Weight = Annotated[float, Field(ge=0, le=1e6, allow_inf_nan=False)]


class Command(BaseModel):
    """Something asked of a run."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    #: Whether a run that is taken up again has done with it.
    passing: ClassVar[bool] = False

    @property
    def words(self) -> str:
        """What is asked for, in a few words."""
        raise NotImplementedError


class Stop(Command):
    """End after the generation that is being bred, as if it had been the last."""

    command: Literal["stop"] = "stop"
    passing: ClassVar[bool] = True

    @property
    def words(self) -> str:
        return "stop"


class Pick(Command):
    """Breed from the individuals ``ids`` besides those that the algorithm chooses: of all births
    the ``share`` has one of them for its first parent. Earlier picks stay; a ``share`` of None
    leaves the one that is set. It counts until `Unpick`."""

    command: Literal["pick"] = "pick"
    ids: Annotated[tuple[_Id, ...], Field(min_length=1, max_length=MOST_PICKS)]
    share: float | None = Field(None, gt=0, le=1)

    @property
    def words(self) -> str:
        share = "" if self.share is None else f", first parents of {self.share:.0%} of the births"
        return f"picked: {' '.join(map(str, self.ids))}{share}"


class Unpick(Command):
    """Breed no longer from ``ids``; from no pick at all where there are none."""

    command: Literal["unpick"] = "unpick"
    ids: Annotated[tuple[_Id, ...], Field(max_length=MOST_PICKS)] = ()

    @property
    def words(self) -> str:
        return f"no longer picked: {' '.join(map(str, self.ids)) or 'all'}"


class Reweight(Command):
    """Weigh anew: names of operators of the recipe's mixture, or of measures that count in a sum,
    to their weights."""

    command: Literal["reweight"] = "reweight"
    weights: Annotated[dict[str, _Weight], Field(min_length=1, max_length=1000)]

    @property
    def words(self) -> str:
        return "weights: " + ", ".join(f"{name} {one:g}" for name, one in self.weights.items())


_ANY = TypeAdapter(
    Annotated[Stop | Pick | Unpick | Reweight, Field(discriminator="command")],
)


def command_of(told: Mapping | None) -> Command:
    """The command in a line of the file; ValueError, in words, for anything else."""
    if told is None:
        raise ValueError("no JSON object")
    try:
        return _ANY.validate_python(told)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(map(str, first["loc"]))
        raise ValueError(f"{place or 'command'}: {first['msg']}") from None


@dataclass(frozen=True)
class Standing:
    """What commands have changed so far: ``picks``, ids in the order they were picked; the
    ``share`` of births bred from them, None for the recipe's; new ``weights`` by name; whether to
    ``stop`` now. ``read``: how many lines of the file are done with."""

    picks: tuple[int, ...] = ()
    share: float | None = None
    weights: Mapping[str, float] = field(default_factory=dict)
    stop: bool = False
    read: int = 0

    def after(self, command: Command) -> "Standing":
        """What stands once the ``command`` is carried out."""
        match command:
            case Stop():
                return replace(self, stop=True)
            case Pick(ids=ids, share=share):
                share = self.share if share is None else share
                return replace(self, picks=tuple(dict.fromkeys(self.picks + ids)), share=share)
            case Unpick(ids=ids):
                left = tuple(one for one in self.picks if ids and one not in ids)
                return replace(self, picks=left, share=self.share if left else None)
            case Reweight(weights=weights):
                return replace(self, weights={**self.weights, **weights})
        raise TypeError(f"no command: {command!r}")

    def having_read(self, lines: int) -> "Standing":
        """The same, once so many ``lines`` of the file are done with."""
        return replace(self, read=lines)

    @classmethod
    def of(cls, events: Iterable[Mapping], generation: int) -> "Standing":
        """What stands after those ``events`` of a run that count from the ``generation`` on, or
        from before; but a stop, which is over once the run goes on.

        Raises ValueError for an event that tells no command."""
        found = cls()
        for event in events:
            since = event.get("generation")
            if event.get("event") not in STEERING or not isinstance(since, int):
                continue
            if since > generation:
                continue
            if event["event"] == REVISED:
                found = replace(found, weights={})
            line = event.get("line")
            if isinstance(line, int):
                found = replace(found, read=max(found.read, line + 1))
            if event["event"] == DONE:
                command = command_of(event)
                found = found if command.passing else found.after(command)
        return found


@dataclass(frozen=True)
class Asked:
    """What was asked of a run: what ``stands`` once all is carried out that ``waits``, and what was
    ``refused``, (generation, reason) of each."""

    stands: Standing
    waits: tuple[Command, ...]
    refused: tuple[tuple[int, str], ...]


def asked_of(run: Run) -> Asked:
    """What was asked of a ``run`` until now. Lines that hold no command do not count.

    Raises `RunError` if a file cannot be read, ValueError for an event that tells no command."""
    events = run.events()
    stands = Standing.of(events, 2**63)
    refused = tuple(
        (one.get("generation", 0), str(one.get("reason", "")))
        for one in events
        if one.get("event") == REFUSED
    )
    waits = []
    for _, line in read_commands(run.path / "commands.jsonl", stands.read):
        with contextlib.suppress(ValueError):
            waits.append(command_of(line))
    for command in waits:
        stands = stands if command.passing else stands.after(command)
    return Asked(stands, tuple(waits), refused)


def told(command: Command) -> dict:
    """A ``command`` as a line of the file, or an event, has it."""
    return command.model_dump(mode="json", exclude_none=True)


def send(path: str | os.PathLike, command: Command) -> bool:
    """Ask the run in ``path`` for a ``command``; whether the run goes on now.

    It is carried out between two generations. A run that does not go on takes it up when it is
    resumed.

    Raises `RunError` if the command cannot be carried out: an individual that was never born or
    failed, or is not picked, a weight of nothing that the run weighs, a stop of a run that does not
    go on.
    """
    run = open_run(path)
    going = is_held(run.path / "lock")
    if isinstance(command, Stop) and not going:
        raise RunError(
            f"{run.path}: no process is at this run: it has ended, or was stopped",
            "a run that goes on",
            f"see where it is: evocity status {run.path}",
        )
    if isinstance(command, Pick):
        refuse_own_breeding(
            str(run.provenance.get("recipe", {}).get("search", {}).get("algorithm"))
        )
        refuse_unborn(run, command.ids)
    if isinstance(command, Unpick):
        _refuse_unpicked(run, command.ids)
    if isinstance(command, Reweight):
        mixtures, sums = weighed_of(run)
        refuse_weights(command.weights, mixtures, sums, str(run.path))
        refuse_idle({**_stands(run).weights, **command.weights}, mixtures, str(run.path))
    try:
        append_command(run.path / "commands.jsonl", told(command))
    except OSError as error:
        raise RunError(
            f"{run.path} cannot be written: {error.strerror or error}",
            "a run folder that this user may write to",
            "check its owner, and the space left",
        ) from error
    return going


def pick(path: str | os.PathLike, ids: Sequence[int], share: float | None = None) -> bool:
    """Have the run in ``path`` breed from its individuals ``ids`` too, from the next generation
    on, and when it is resumed: of all births the ``share`` (0…1; the recipe's ``[search] picks``
    unless told) has one of them for its first parent. Earlier picks stay.

    Returns whether the run goes on now. Raises `RunError` as `send`.
    """
    try:
        asked = Pick(ids=tuple(ids), share=share)
    except (ValidationError, TypeError) as error:
        raise RunError(
            f"picks of {_listed(ids)} with a share of {shown(share)}",
            "ids of births, one or more, and a share above 0 up to 1",
            "take ids from `evocity status`, the report, or the births' `id` column",
        ) from error
    return send(path, asked)


def refuse_own_breeding(algorithm: str) -> None:
    """Raise `RunError` for picks where the ``algorithm`` breeds by itself."""
    kind = algorithms().get(algorithm)
    if kind is not None and kind.breeds_by is not None:
        raise RunError(
            f"picks for {algorithm}, which breeds by itself",
            "a run whose parents are chosen",
            "start another run from them: [[parents]] with run and id",
        )


def refuse_unborn(run: Run, ids: Sequence[int]) -> None:
    """Raise `RunError` unless all ``ids`` are births of the ``run`` that did not fail."""
    for birth in run.individuals(ids, rebred=False):
        if not birth.ok:
            raise RunError(
                f"{run.path}: individual {birth.id} failed ({birth.error})",
                "individuals that were bred and measured",
                "pick others, such as `evocity status` lists",
            )


def _listed(ids) -> str:
    """Ids as they were typed, as far as they are some."""
    try:
        return " ".join(map(str, ids)) or "nobody"
    except TypeError:
        return shown(ids)


def _stands(run: Run) -> Standing:
    """What stands of a ``run``; a log that tells no commands is told of where it is resumed."""
    with contextlib.suppress(ValueError):
        return asked_of(run).stands
    return Standing()


def _refuse_unpicked(run: Run, ids: Sequence[int]) -> None:
    """Raise `RunError` unless all ``ids``, or anybody where there are none, are picked."""
    picks = _stands(run).picks
    strange = [one for one in ids if one not in picks]
    if strange or not picks:
        some = f"{run.path}: {' '.join(map(str, strange)) or 'nobody'} {{}} picked"
        raise RunError(
            some.format("is not" if len(strange) == 1 else "are not" if strange else "is"),
            f"some of {' '.join(map(str, picks))}" if picks else "a run that breeds from picks",
            f"see who is picked: evocity status {run.path}",
        )


def weighed_of(run: Run) -> tuple[list[dict[str, float]], list[str]]:
    """What a ``run`` weighs: the operators of its mixture, or of each island's, to the weights of
    its recipe, and the measures that count in sums. An algorithm that breeds by itself weighs no
    operators."""
    try:
        recipe = run.provenance["recipe"]
        kind = algorithms().get(str(recipe.get("search", {}).get("algorithm")))
        sums = [one["name"] for one in run.provenance["fitness"] if one.get("objective")]
        if kind is not None and kind.breeds_by is not None:
            return [], sums
        every = [island["operators"] for island in recipe.get("islands", [])]
        return [
            {
                name: float(one.get("weight", 1) if isinstance(one, Mapping) else one)
                for name, one in entries.items()
            }
            for entries in every or [recipe.get("operators", {})]
        ], sums
    except (LookupError, TypeError, AttributeError, ValueError):
        return [], []


def refuse_weights(
    weights: Mapping[str, float],
    mixtures: Sequence[Mapping[str, float]],
    sums: Sequence[str],
    where: str,
) -> None:
    """Raise `RunError` for ``weights`` of anything but operators of the ``mixtures`` and measures
    in ``sums``, which are above 0."""
    mixture = list(dict.fromkeys(name for one in mixtures for name in one))
    for name, weight in weights.items():
        if name not in (*mixture, *sums):
            known = [f"the operators {', '.join(mixture)}"] if mixture else []
            known += [f"the measures {', '.join(sums)}"] if sums else []
            raise RunError(
                with_near_miss(f"{where} weighs no {shown(name)}", name, [*mixture, *sums]),
                ", and ".join(known) or "a run that notes what it weighs",
                "name one of them; a measure is weighed where it is part of a sum, and one with a "
                "goal of its own competes by itself; `cma` breeds without operators",
            )
        if name in sums and weight == 0:
            raise RunError(
                f"{where}: a weight of 0 for {name}", "a weight above 0", "write a small one"
            )


def refuse_idle(
    weights: Mapping[str, float], mixtures: Sequence[Mapping[str, float]], where: str
) -> None:
    """Raise `RunError` if no operator of one of the ``mixtures`` has a weight, with ``weights`` in
    place of their own."""
    for mixture in mixtures:
        own = [weights.get(name, weight) for name, weight in mixture.items()]
        if own and not any(own):
            of_one = f" of an island ({', '.join(mixture)})" if len(mixtures) > 1 else ""
            raise RunError(
                f"{where}: all operators{of_one} would have the weight 0",
                "at least one weight above 0",
                "leave one of them, or raise another",
            )


__all__ = [
    "DONE",
    "REFUSED",
    "REVISED",
    "STEERING",
    "Asked",
    "Command",
    "Pick",
    "Reweight",
    "Standing",
    "Stop",
    "Unpick",
    "asked_of",
    "command_of",
    "pick",
    "send",
    "told",
]
