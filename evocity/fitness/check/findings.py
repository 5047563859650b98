"""The report of a measure's trials: values, findings, changes, cost."""

from dataclasses import dataclass, field

from evocity.fitness.measure import Measure


@dataclass(frozen=True)
class Trial:
    """The result of a measure on one map.

    value : the number; NaN where it is undefined; None where the call failed or did not happen.
    reason : why there is no number.
    seconds : the time of the call, with the views of the map; None without a call.
    """

    map: str
    value: float | None
    reason: str = ""
    seconds: float | None = None


@dataclass(frozen=True)
class Finding:
    """A fault of the measure, with its place and remedy.

    kind : "error", a search cannot use the measure; "warning", it can, but the fault is likely.
    about : the subject: result, exception, time, change, random, range, undefined; print,
        arithmetic, constant, near-constant, often undefined, code and map, reason, documentation.
    file, line : the place in the user's code.
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
    """The value of a map, and the value of its changed map that differs most."""

    before: float
    after: float


@dataclass
class Report:
    """The report of a measure's trials; unknown fields are None.

    trials : one for each map, in order.
    findings : the faults, errors first.
    first : seconds of the first call, one-time preparation included.
    median : seconds of the other calls on maps of ``pixels``, with their views.
    pixels : number of pixels of the largest maps.
    memory : most bytes that a call on the first map held, with its views.
    turned : the first map, and its seven other positions.
    halved : the first map, and the same at half its resolution (means of 2 × 2 px).
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
        """Whether a search can use the measure: no finding is an error."""
        return all(finding.kind != "error" for finding in self.findings)

    @property
    def given_up(self) -> bool:
        """Whether a call took too long, so that `check` stopped."""
        return any((f.kind, f.about) == ("error", "time") for f in self.findings)
