"""How each fault of a measure is told: what it did, where in the user's file, what to do."""

import linecache
import math
import re
from collections.abc import Iterator, Sequence

from evocity.authoring.findings import Finding, Trial
from evocity.authoring.watching import Call, Case
from evocity.errors import EvocityError, FitnessError, told
from evocity.fitness.measure import Measure

#: A call that takes longer, seconds, is told of.
SLOW = 1.0
#: Undefined on a larger share of cities, it is told of.
UNDEFINED = 0.25
#: Of at least so many cities most must differ by this share of the measure's range, if it has
#: bounds; else of the largest value.
FEWEST, NEAR = 5, 0.01
#: A code whose value differs from its map's by this share of the maps' spread is told of.
APART = 0.5


def of_call(measure: Measure, call: Call, name: str, *, first: bool) -> Iterator[Finding]:
    """What one ``call`` on the map ``name`` shows; a ``first`` call may take its time."""
    if isinstance(call.error, TimeoutError):
        yield _finding(
            measure,
            "error",
            "time",
            call.line,
            f"{measure.name} was at this line after {call.seconds:g} s on {name}, and given up",
            "a few milliseconds: a search calls it once a birth",
            "work on whole arrays, not pixel by pixel, or give it more time: timeout=, --timeout",
        )
    elif call.error:
        yield _raised(measure, call, name)
    elif call.seconds > SLOW and not first:
        yield _finding(
            measure,
            "warning",
            "time",
            None,
            f"{measure.name} took {call.seconds:.1f} s on {name}",
            "some milliseconds: a search calls it once a birth",
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
            "a number returned, and nothing said: a run calls it thousands of times",
            "take the print out",
        )
    if call.warned:
        line, text = call.warned
        yield _finding(
            measure,
            "warning",
            "arithmetic",
            line,
            f"{measure.name} makes numpy warn on {name}: {text}",
            "arithmetic that every map bears",
            'before that line, return evocity.fitness.Undefined("why") where it has no meaning',
        )


def _raised(measure: Measure, call: Call, name: str) -> Finding:
    error = call.error
    about = "exception" if error.__cause__ else "result"
    if not isinstance(error, EvocityError):  # it would have ended the program
        about = "exception"
        error = FitnessError(
            f"{measure.name} raised {told(error)} on {name}",
            "a number returned, whatever the map",
            'return evocity.fitness.Undefined("why") where the measure has no meaning',
        )
    place = rf" \({re.escape(measure.file)}, line \d+\)"  # a finding has it apart
    found = re.sub(place, "", error.found)
    return _finding(measure, "error", about, call.line, found, error.expected, error.remedy)


def of_change(
    measure: Measure, writable: Sequence[str], changed: Sequence[str], name: str
) -> Finding:
    """That it made views of the map ``name`` ``writable``, or ``changed`` some and locked them."""
    # beside views left open, what else is changed mostly comes from them
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
        "a map left as it was: it and its views are shared by all measures, so read-only",
        "change a copy, heights = city.heights.copy()",
    )


def of_difference(measure: Measure, first: float, second: float | None, name: str) -> Finding:
    """That the map ``name`` gave another value the ``second`` time, or none."""
    again = "no number" if second is None else repr(float(second))
    return _finding(
        measure,
        "error",
        "random",
        _line_with(measure, r"\brandom\b|\bdefault_rng\b|\btime\b|\bglobal\b"),
        f"{measure.name} of {name} is {float(first)!r}, and of the same map again {again}: "
        "it draws random numbers, or keeps something between calls",
        "the same bits for the same map, else no run can be repeated",
        "draw from np.random.default_rng(0), made anew within the function, or do not draw; "
        "keep nothing between calls",
    )


def of_value(measure: Measure, value: float, name: str) -> Iterator[Finding]:
    """What the ``value`` of the map ``name`` shows."""
    low, high = measure.range
    if not (low <= value <= high or math.isnan(value)):
        yield _finding(
            measure,
            "error",
            "range",
            None,
            f"{measure.name} of {name} is {value!r}",
            f"from {low:g} to {high:g}, as the range above it tells",
            "correct the formula, or range=(lowest, highest)",
        )


def of_nan(measure: Measure, line: int, name: str) -> Finding:
    """That the map ``name`` gave NaN, returned in ``line``, without a reason."""
    return _finding(
        measure,
        "warning",
        "reason",
        line,
        f"{measure.name} is NaN without a reason on {name}",
        "a reason, which tables and logs then tell",
        'return evocity.fitness.Undefined("why") in place of NaN',
    )


def of_all(measure: Measure, trials: Sequence[Trial]) -> Iterator[Finding]:
    """What only all ``trials`` together show, and what the measure does not say of itself."""
    known = [t.value for t in trials if t.value is not None and not math.isnan(t.value)]
    undefined = [t for t in trials if t.value is not None and math.isnan(t.value)]
    if undefined and len(undefined) == len(trials):  # where others failed, that comes first
        yield _finding(
            measure,
            "error",
            "undefined",
            None,
            f"{measure.name} is undefined on every map: {undefined[0].reason or 'NaN'}",
            "a number of a city: what cannot be measured does not live",
            "return NaN only where the formula has no meaning, as on an empty map",
        )
    if len(known) > 2 and len(set(known)) == 1:
        yield _finding(
            measure,
            "warning",
            "constant",
            None,
            f"{measure.name} is {known[0]:g} on all {len(known)} maps",
            "a number that tells maps apart",
            "look at its formula: nothing can be bred by it",
        )
    if not measure.doc.strip():
        yield _finding(
            measure,
            "warning",
            "documentation",
            None,
            f"{measure.name.partition('.')[0]} has no docstring",
            "what it measures, its formula, unit, range and source",
            'write """What it measures.""" below its def',
        )


def of_maps(measure: Measure, trials: Sequence[Trial]) -> Iterator[Finding]:
    """What the ``trials`` of cities, none of them awkward, show together: that it is undefined on
    many, or hardly tells them apart."""
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
            "a number of nearly every city: a birth that has none does not live",
            "give it a meaning there too, or expect a search to lose as many of its births",
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
                f"cities, less than {NEAR:.0%} of "
                + ("its range" if math.isfinite(high - low) else "its size"),
                "a number that tells cities apart",
                "look at its formula, or narrow range=: there is little to breed by",
            )


def of_codes(measure: Measure, tried: Sequence[tuple[Case, Trial]]) -> Iterator[Finding]:
    """That the value of a map's code lies far from the map's, for how far cities lie apart."""
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
            found = f"{before:.4g}, and of its code undefined: {trial.reason or 'NaN'}"
        elif len(maps) > 1 and abs(trial.value - before) > APART * spread:
            found = (
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
            f"{measure.name} of {case.code_of} is {found}",
            "a code that measures about as its map: a search breeds codes",
            "set targets and bounds by values of codes: evocity encode, then evocity score",
        )


def _finding(measure: Measure, kind: str, about: str, line: int | None, *parts: str) -> Finding:
    return Finding(kind, about, measure.file, line or measure.line, *parts)


def _line_with(measure: Measure, pattern: str) -> int | None:
    """The first line of the function, else of its file, in which the ``pattern`` occurs."""
    lines = linecache.getlines(measure.file)
    within = {line for *_, line in measure.function.__code__.co_lines() if line}
    for number in (*sorted(within), *range(1, len(lines) + 1)):
        code = lines[number - 1].partition("#")[0] if number <= len(lines) else ""
        if re.search(pattern, code) and not code.startswith(("import ", "from ")):
            return number
    return None


__all__ = [
    "SLOW",
    "of_all",
    "of_call",
    "of_change",
    "of_codes",
    "of_difference",
    "of_maps",
    "of_nan",
    "of_value",
]
