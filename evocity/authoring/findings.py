"""What trying a measure has shown: `Report`, and what it is made of."""

from dataclasses import dataclass, field

from evocity.fitness.measure import Measure


@dataclass(frozen=True)
class Trial:
    """What the measure said of one map.

    value : the number; NaN where it is undefined; None where it failed or was not asked.
    reason : why it is no number.
    seconds : the call took, the views of the map included; None if there was none.
    """

    map: str
    value: float | None
    reason: str = ""
    seconds: float | None = None


@dataclass(frozen=True)
class Finding:
    """Something to know of the measure.

    kind : "error", it cannot be used as it is; "warning", it can, but is seldom meant so.
    about : in a word, what: result, exception, time, change, random, range, undefined; print,
        arithmetic, constant, near-constant, often undefined, code and map, reason, documentation.
    file, line : where in the user's code.
    found, expected, remedy : as in an `EvocityError`.
    """

    kind: str
    about: str
    file: str
    line: int
    found: str
    expected: str
    remedy: str


@dataclass(frozen=True)
class Change:
    """The value of a map, and that of the map changed which differs most from it."""

    before: float
    after: float


@dataclass
class Report:
    """What trying a measure has shown; what could not be found out is None.

    trials : one a map, in order.
    findings : what is wrong with it, errors first.
    first : seconds of the very first call, all that is prepared once included.
    median : seconds of the other calls on maps of ``pixels``, their views included.
    pixels : how many the largest maps have.
    memory : bytes that a call on the first map held at most, its views included.
    turned : the first map, and in its seven other positions.
    halved : the first map, and at half its resolution (means of 2 × 2 px).
    """

    measure: Measure
    trials: list[Trial] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    first: float | None = None
    median: float | None = None
    pixels: int = 0
    memory: int | None = None
    turned: Change | None = None
    halved: Change | None = None

    @property
    def usable(self) -> bool:
        """Whether a search can use it: no finding is an error."""
        return all(one.kind != "error" for one in self.findings)

    @property
    def given_up(self) -> bool:
        """Whether a call took too long, and all that was to follow was left out."""
        return any((one.kind, one.about) == ("error", "time") for one in self.findings)


__all__ = ["Change", "Finding", "Report", "Trial"]
