"""Faults of a measure as findings: what it did, the line in the user's file, and a remedy."""

import linecache
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from evocity.errors import EvocityError, FitnessError, describe_error
from evocity.fitness.check.observed_call import Call, Case
from evocity.fitness.measure import Measure

#: Time of a call above which a warning follows, seconds.
SLOW = 1.0
#: Share of cities on which a measure may be undefined without a warning.
UNDEFINED = 0.25
#: Least number of cities, and least spread of most of their values: a share of the measure's range,
#: or of the largest value if the range has no bounds.
FEWEST, NEAR = 5, 0.01
#: Difference of a code's value from its map's that gives a warning, as a share of the maps' spread.
APART = 0.5


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


def of_call(measure: Measure, call: Call, name: str, *, first: bool) -> Iterator[Finding]:
    """Find the faults of one ``call`` on the map ``name``; a ``first`` call may be slow."""
    if isinstance(call.error, TimeoutError):
        yield _finding(
            measure,
            "error",
            "time",
            call.line,
            f"{measure.name} was at this line after {call.seconds:g} s on {name}, and was stopped",
            "a few milliseconds: a search calls it once for each birth",
            "work on whole arrays, not pixel by pixel; or raise the limit: timeout=, --timeout",
        )
    elif call.error:
        yield _exception_finding(measure, call, name)
    elif call.seconds > SLOW and not first:
        yield _finding(
            measure,
            "warning",
            "time",
            None,
            f"{measure.name} took {call.seconds:.1f} s on {name}",
            "a few milliseconds: a search calls it once for each birth",
            "work on whole arrays, and use the city's views, which all measures share",
        )
    if call.printed:
        line, text = call.printed
        yield _finding(
            measure,
            "warning",
            "print",
            line,
            f"{measure.name} prints {text.strip()!r} on {name}",
            "no output: a run calls the measure thousands of times",
            "remove the print",
        )
    if call.warned:
        line, text = call.warned
        yield _finding(
            measure,
            "warning",
            "arithmetic",
            line,
            f"{measure.name} makes numpy warn on {name}: {text}",
            "arithmetic without warnings on every map",
            'before that line, return evocity.fitness.Undefined("why") where it has no meaning',
        )


def _exception_finding(measure: Measure, call: Call, name: str) -> Finding:
    error = call.error
    about = "exception" if error.__cause__ else "result"
    if not isinstance(error, EvocityError):  # such as SystemExit
        about = "exception"
        error = FitnessError(
            f"the measure {measure.name} raised {describe_error(error)} on the map {name}",
            "a function that returns a number for every map",
            'return evocity.fitness.Undefined("why") where the measure has no meaning',
        )
    place = rf" \({re.escape(measure.file)}, line \d+\)"  # a finding has its own place
    fault = re.sub(place, "", error.found)
    return _finding(measure, "error", about, call.line, fault, error.expected, error.remedy)


def of_change(
    measure: Measure, writable: Sequence[str], changed: Sequence[str], name: str
) -> Finding:
    """Report that the measure made views of the map ``name`` ``writable``, or ``changed`` them."""
    # most other changes come from writable views
    if writable:
        what = f"made {' and '.join(writable)} writable"
    else:
        what = f"changed {' and '.join(changed)}"
    return _finding(
        measure,
        "error",
        "change",
        _line_with(measure, r"setflags|writeable|__dict__|__setattr__|\bvars\("),
        f"{measure.name} {what} on {name}",
        "an unchanged map: all measures share it and its views",
        "change a copy, heights = city.heights.copy()",
    )


def of_difference(measure: Measure, first: float, second: float | None, name: str) -> Finding:
    """Report that the map ``name`` had another value, or none, the ``second`` time."""
    other = "no number" if second is None else repr(float(second))
    return _finding(
        measure,
        "error",
        "random",
        _line_with(measure, r"\brandom\b|\bdefault_rng\b|\btime\b|\bglobal\b"),
        f"{measure.name} of {name} is {float(first)!r}, and of the same map again {other}: "
        "it draws random numbers, or keeps state between calls",
        "the same bits for the same map, or no run can be repeated",
        "draw no random numbers, or draw from np.random.default_rng(0) made in the function; "
        "keep no state between calls",
    )


def of_value(measure: Measure, value: float, name: str) -> Iterator[Finding]:
    """Report a ``value`` of the map ``name`` beyond the declared range."""
    low, high = measure.range
    if not (low <= value <= high or math.isnan(value)):
        yield _finding(
            measure,
            "error",
            "range",
            None,
            f"{measure.name} of {name} is {value!r}",
            f"a value from {low:g} to {high:g}, its declared range",
            "correct the formula, or range=(lowest, highest)",
        )


def of_nan(measure: Measure, line: int, name: str) -> Finding:
    """Report NaN on the map ``name``, returned in ``line`` without a reason."""
    return _finding(
        measure,
        "warning",
        "reason",
        line,
        f"{measure.name} is NaN without a reason on {name}",
        "a reason, which tables and logs show",
        'return evocity.fitness.Undefined("why") instead of NaN',
    )


def of_all(measure: Measure, trials: Sequence[Trial]) -> Iterator[Finding]:
    """Find the faults that all ``trials`` together show, and missing documentation."""
    known = [t.value for t in trials if t.value is not None and not math.isnan(t.value)]
    undefined = [t for t in trials if t.value is not None and math.isnan(t.value)]
    if undefined and len(undefined) == len(trials):  # failures of calls come first
        yield _finding(
            measure,
            "error",
            "undefined",
            None,
            f"{measure.name} is undefined on every map: {undefined[0].reason or 'NaN'}",
            "a number for real cities: a search rejects births without one",
            "return NaN only where the formula has no meaning, as on an empty map",
        )
    if len(known) > 2 and len(set(known)) == 1:
        yield _finding(
            measure,
            "warning",
            "constant",
            None,
            f"{measure.name} is {known[0]:g} on all {len(known)} maps",
            "different numbers for different maps",
            "correct the formula: a search needs differences",
        )
    if not measure.doc.strip():
        yield _finding(
            measure,
            "warning",
            "documentation",
            None,
            f"{measure.name.partition('.')[0]} has no docstring",
            "a docstring with the meaning, formula, unit, range and source",
            'write """What it measures.""" below its def',
        )


def of_maps(measure: Measure, trials: Sequence[Trial]) -> Iterator[Finding]:
    """Report a measure that is undefined on many cities, or nearly equal on most of them.

    The ``trials`` are those of the given cities, without the artificial maps.
    """
    values = [trial.value for trial in trials if trial.value is not None]
    known = [value for value in values if not math.isnan(value)]
    lacking = [t for t in trials if t.value is not None and math.isnan(t.value)]
    if known and len(lacking) > UNDEFINED * len(values):
        yield _finding(
            measure,
            "warning",
            "often undefined",
            None,
            f"{measure.name} is undefined on {len(lacking)} of {len(values)} cities, as on "
            f"{lacking[0].map}: {lacking[0].reason or 'NaN'}",
            "a number for nearly every city: a search rejects births without one",
            "define a value there too, or expect a search to lose as many of its births",
        )
    low, high = measure.range
    scale = high - low if math.isfinite(high - low) else max(map(abs, known), default=0.0)
    if len(known) >= FEWEST and len(set(known)) > 1:
        tenth, ninth = (sorted(known)[round(q * (len(known) - 1))] for q in (0.1, 0.9))
        if ninth - tenth <= NEAR * scale:
            yield _finding(
                measure,
                "warning",
                "near-constant",
                None,
                f"{measure.name} lies from {tenth:.4g} to {ninth:.4g} on most of {len(known)} "
                f"cities, less than {100 * NEAR:.0f} % of "
                + ("its range" if math.isfinite(high - low) else "its size"),
                "clearly different numbers for different cities",
                "correct the formula, or narrow range=: a search needs differences",
            )


def of_codes(measure: Measure, tried: Sequence[tuple[Case, Trial]]) -> Iterator[Finding]:
    """Report a code whose value is far from its map's, compared with the spread of cities."""
    maps = {
        case.city.name: trial.value
        for case, trial in tried
        if case.genome is None and trial.value is not None and not math.isnan(trial.value)
    }
    spread = max(maps.values(), default=0.0) - min(maps.values(), default=0.0)
    for case, trial in tried:
        if case.code_of not in maps or trial.value is None:
            continue
        before = maps[case.code_of]
        if math.isnan(trial.value):
            values = f"{before:.4g}, and of its code undefined: {trial.reason or 'NaN'}"
        elif len(maps) > 1 and abs(trial.value - before) > APART * spread:
            values = (
                f"{before:.4g}, and of its code {trial.value:.4g}; all {len(maps)} maps lie within "
                f"{spread:.4g}"
            )
        else:
            continue
        yield _finding(
            measure,
            "warning",
            "code and map",
            None,
            f"{measure.name} of {case.code_of} is {values}",
            "nearly the same value for a code and its map: a search breeds codes",
            "take targets and bounds from values of codes: evocity encode, then evocity score",
        )


def _finding(measure: Measure, kind: str, about: str, line: int | None, *parts: str) -> Finding:
    return Finding(kind, about, measure.file, line or measure.line, *parts)


def _line_with(measure: Measure, pattern: str) -> int | None:
    """Find the first line of the function, else of its file, that matches the ``pattern``."""
    lines = linecache.getlines(measure.file)
    within = {line for *_, line in measure.function.__code__.co_lines() if line}
    for number in (*sorted(within), *range(1, len(lines) + 1)):
        code = lines[number - 1].partition("#")[0] if number <= len(lines) else ""
        if re.search(pattern, code) and not code.startswith(("import ", "from ")):
            return number
    return None
