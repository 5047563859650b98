"""Trial of a measure on maps, artificial ones too: faults, values, time and memory."""

import contextlib
import math
import statistics
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from evocity import isometries
from evocity.citymap import CityMap
from evocity.coding.encode import encode
from evocity.errors import FitnessError
from evocity.fitness.check import faults
from evocity.fitness.check.faults import Change, Finding, Report, Trial
from evocity.fitness.check.observed_call import (
    Call,
    Case,
    list_changes,
    list_writable,
    observe,
    same_value,
)
from evocity.fitness.measure import Measure

#: Time above which a measure runs twice only on the first map, seconds.
_QUICK = 0.25
#: Number of given maps whose views are compared after the call, besides the artificial maps.
_COMPARED = 4


def check(
    measure: Measure,
    maps: Sequence[CityMap | Case],
    *,
    timeout: float = 10.0,
    progress: Callable[[int, int], None] | None = None,
) -> Report:
    """Try a ``measure`` on ``maps``, and on an empty, a full, an odd and a tiny map.

    Parameters
    ----------
    maps : at least one. The first, a typical one, is also turned, mirrored, and halved in
        resolution. It is the reference of measures that need one. A `Case` holds genome, parents
        or sources for measures that need these.
    timeout : the time limit of a call, seconds; the first call above it ends the check.
    progress : called with the number of finished maps, and of all maps.

    The check measures each map twice, as two maps of the same heights, which must give the same
    bits; for slow measures only the first map. The measure must leave each map and its views
    unchanged. The function raises nothing for errors of the measure, and its output does not reach
    standard output.

    >>> from evocity.fitness import gsi
    >>> heights = np.zeros((16, 16))
    >>> heights[4:12, 4:12] = 9
    >>> report = check(gsi, [CityMap(heights, 2.0, name="block")])
    >>> report.usable, report.trials[0].value
    (True, 0.25)
    """
    given = [city if isinstance(city, Case) else Case(city) for city in maps]
    if not given:
        raise FitnessError(
            f"the list of maps for the trial of {measure.name} is empty",
            "at least one map",
            'pass a list of maps, for example [evocity.read_map("lyon-1er")]',
        )
    if "reference" in measure.needs:
        measure = measure.bound(given[0].city)
    cases = [*given, *_artificial(given[0].city, coded=bool(measure.needs))]
    run = _TrialRun(measure, timeout, given)
    with contextlib.suppress(TimeoutError):
        for number, case in enumerate(cases, 1):
            run.measure(case, views=number <= _COMPARED or number > len(given))
            if progress:
                progress(number, len(cases))
        run.measure_changed(cases)
    return run.conclude()


def _artificial(typical: CityMap, coded: bool) -> Iterator[Case]:
    """Make maps that every measure must handle; ``coded`` adds the genomes they decode from."""
    pixel, block = typical.metres_per_pixel, 4
    side = max(2 * block, min(typical.shape) // block * block)
    for name, height in (("empty map", 0.0), ("map built all over", 12.0)):
        city = CityMap(np.full((side, side), height), pixel, name=name)
        genome = encode(city, block=block).genome if coded else None
        yield Case(city, genome, (genome,), sources=(city,)) if coded else Case(city)
    if not coded:
        odd = typical.heights[:61, :38]
        tall, wide = odd.shape
        yield Case(CityMap(odd, 0.5, name=f"{tall} × {wide} px of 0.5 m"))
        yield Case(CityMap(np.full((1, 1), 9.0), pixel, name="one pixel"))


class _TrialRun:
    """A measure, and the findings about it so far."""

    def __init__(self, measure: Measure, timeout: float, given: Sequence[Case]):
        self._measure, self._timeout = measure, timeout
        self._report = Report(measure)
        self._given = given  # their trials come first, those on artificial maps after
        self._times: list[tuple[int, float]] = []  # pixels, seconds
        self._findings: dict[tuple[str, int], tuple[Finding, set[str]]] = {}  # with its maps

    def measure(self, case: Case, *, views: bool) -> None:
        """Measure one map, twice if that is quick, and compare its heights, and with ``views`` its
        views too, with the originals. Raises TimeoutError at the time limit."""
        name, first, measure = case.city.name, not self._times, self._measure
        trials = self._report.trials
        if not case.serves(measure):
            needs = " and ".join(measure.needs)
            trials.append(Trial(name, None, f"not measured: the map has no {needs}"))
            return
        fresh = case.fresh()
        call = self._call(fresh)
        timed_out = isinstance(call.error, TimeoutError)
        failed = "timed out" if timed_out else "failed" if call.error else ""
        reason = failed or getattr(call.value, "reason", "")
        trials.append(Trial(name, call.value, reason, call.seconds))
        self._note(name, *faults.of_call(measure, call, name, first=first))
        if timed_out:
            raise call.error
        twice = first or call.seconds < _QUICK
        writable = list_writable(fresh.city)
        changed = list_changes(fresh.city, case.fresh().city, views=views and twice)
        if writable or changed:
            self._note(name, faults.of_change(measure, writable, changed, name))
        if call.value is None:
            return
        self._note(name, *faults.of_value(measure, call.value, name))
        if call.line:
            self._note(name, faults.of_nan(measure, call.line, name))
        if twice:
            second = self._call(case.fresh())
            if isinstance(second.error, TimeoutError):
                self._note(name, *faults.of_call(measure, second, name, first=False))
                raise second.error
            if second.value is None or not same_value(call.value, second.value):
                self._note(name, faults.of_difference(measure, call.value, second.value, name))

    def measure_changed(self, cases: Sequence[Case]) -> None:
        """Measure the first map that has a value again: memory, other positions, half
        resolution."""
        report, measure = self._report, self._measure
        known = [
            (case, trial.value)
            for case, trial in zip(cases, report.trials, strict=True)
            if trial.value is not None and not math.isnan(trial.value)
        ]
        if not known:
            return
        case, before = known[0]
        # the count of bytes takes time
        call = observe(measure, case.fresh(), 4 * self._timeout, memory=True)
        report.memory = None if call.error else call.peak
        if measure.needs:
            return  # the code does not decode to a turned map
        city = case.city
        turned = [city.replace(isometries.apply(k, city.heights)) for k in range(1, 8)]
        report.turned = self._largest_change(before, turned)
        tall, wide = (side // 2 for side in city.shape)
        if tall and wide:
            fours = city.heights[: 2 * tall, : 2 * wide].reshape(tall, 2, wide, 2)
            means = fours.mean(axis=(1, 3))
            halved = city.replace(means, metres_per_pixel=2 * city.metres_per_pixel)
            report.halved = self._largest_change(before, [halved])

    def conclude(self) -> Report:
        """Complete the report, with one finding for the same fault on several maps."""
        report = self._report
        self._note("", *faults.of_all(self._measure, report.trials))
        tried = list(zip(self._given, report.trials, strict=False))
        self._note("", *faults.of_maps(self._measure, [trial for _, trial in tried]))
        self._note("", *faults.of_codes(self._measure, tried))
        for finding, maps in self._findings.values():
            if others := len(maps) - 1:
                more = f"; likewise on {others} more map{'s' * (others > 1)}"
                finding = replace(finding, found=finding.found + more)
            report.findings.append(finding)
        report.findings.sort(key=lambda finding: finding.kind != "error")
        if self._times:
            report.first = self._times[0][1]
            report.pixels = max(pixels for pixels, _ in self._times)
            later = [taken for pixels, taken in self._times[1:] if pixels == report.pixels]
            report.median = statistics.median(later) if later else None
        return report

    def _call(self, case: Case) -> Call:
        pixels = case.city.heights.size
        call = observe(self._measure, case, self._timeout)
        self._times.append((pixels, call.seconds))
        return call

    def _largest_change(self, before: float, cities: Sequence[CityMap]) -> Change | None:
        """Find the value of ``cities`` that differs most; undefined counts as infinitely far."""
        calls = [observe(self._measure, Case(city), self._timeout) for city in cities]
        values = [call.value for call in calls if call.value is not None]
        differ = [math.inf if math.isnan(v) else abs(v - before) for v in values]
        return Change(before, values[differ.index(max(differ))]) if values else None

    def _note(self, name: str, *findings: Finding) -> None:
        for finding in findings:
            key = finding.about, finding.line
            self._findings.setdefault(key, (finding, set()))[1].add(name)
