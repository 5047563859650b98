"""What is wrong with a measure, and how it behaves: it is tried on maps, awkward ones too."""

import contextlib
import math
import statistics
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from evocity import isometries
from evocity.authoring.faults import (
    of_all,
    of_call,
    of_change,
    of_codes,
    of_difference,
    of_maps,
    of_nan,
    of_value,
)
from evocity.authoring.findings import Change, Finding, Report, Trial
from evocity.authoring.touched import altered, unlocked
from evocity.authoring.watching import Call, Case, same, watched
from evocity.citymap import CityMap
from evocity.coding.encode import encode
from evocity.errors import FitnessError
from evocity.fitness.measure import Measure

#: Of measures slower than this, seconds, only the first map is measured twice.
_QUICK = 0.25
#: The views of so many maps given, and of the awkward ones, are compared after the call.
_COMPARED = 4


def check(
    measure: Measure,
    maps: Sequence[CityMap | Case],
    *,
    timeout: float = 10.0,
    progress: Callable[[int, int], None] | None = None,
) -> Report:
    """Try a ``measure`` on ``maps``, and on an empty, a full, an odd and a tiny one besides.

    Parameters
    ----------
    maps : at least one; the first, a typical one, is also turned, mirrored, and halved in
        resolution, and is the reference of measures that ask for one. For measures that ask for
        genome, parents or sources, a `Case` has these.
    timeout : a call that takes longer, seconds, is given up, and all the rest left out.
    progress : called with how many maps are done, and of how many.

    Each map is measured twice, as two maps of the same heights, which must give the same bits
    (of slow measures the first map alone), and must be left as it was, its views too. Nothing
    that the measure does is raised; what it prints is kept from standard output.

    >>> from evocity.fitness import gsi
    >>> heights = np.zeros((16, 16))
    >>> heights[4:12, 4:12] = 9
    >>> report = check(gsi, [CityMap(heights, 2.0, name="block")])
    >>> report.usable, report.trials[0].value
    (True, 0.25)
    """
    given = [one if isinstance(one, Case) else Case(one) for one in maps]
    if not given:
        raise FitnessError(
            f"no map to try {measure.name} on",
            "at least one",
            'for example [evocity.read_map("lyon-1er")]',
        )
    if "reference" in measure.needs:
        measure = measure.bound(given[0].city)
    cases = [*given, *_awkward(given[0].city, coded=bool(measure.needs))]
    trying = _Trying(measure, timeout, given)
    with contextlib.suppress(TimeoutError):
        for number, case in enumerate(cases, 1):
            trying.on(case, views=number <= _COMPARED or number > len(given))
            if progress:
                progress(number, len(cases))
        trying.changed(cases)
    return trying.concluded()


def _awkward(typical: CityMap, coded: bool) -> Iterator[Case]:
    """Maps that every measure must cope with; ``coded``: with the genomes they decode from."""
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


class _Trying:
    """A measure, and what was found of it so far."""

    def __init__(self, measure: Measure, timeout: float, given: Sequence[Case]):
        self._measure, self._timeout = measure, timeout
        self._report = Report(measure)
        self._given = given  # their trials come first, those on awkward maps after
        self._times: list[tuple[int, float]] = []  # pixels, seconds
        self._found: dict[tuple[str, int], tuple[Finding, set[str]]] = {}  # with its maps

    def on(self, case: Case, *, views: bool) -> None:
        """Measure one map, twice unless that takes long, and compare its heights, and its
        ``views`` too, with what they were. TimeoutError if a call is given up."""
        name, first, measure = case.city.name, not self._times, self._measure
        trials = self._report.trials
        if not case.serves(measure):
            needs = " and ".join(measure.needs)
            trials.append(Trial(name, None, f"not asked: a map without {needs}"))
            return
        fresh = case.fresh()
        call = self._call(fresh)
        given_up = isinstance(call.error, TimeoutError)
        failed = "given up" if given_up else "failed" if call.error else ""
        reason = failed or getattr(call.value, "reason", "")
        trials.append(Trial(name, call.value, reason, call.seconds))
        self._note(name, *of_call(measure, call, name, first=first))
        if given_up:
            raise call.error
        twice = first or call.seconds < _QUICK
        writable = unlocked(fresh.city)
        changed = altered(fresh.city, case.fresh().city, views=views and twice)
        if writable or changed:
            self._note(name, of_change(measure, writable, changed, name))
        if call.value is None:
            return
        self._note(name, *of_value(measure, call.value, name))
        if call.line:
            self._note(name, of_nan(measure, call.line, name))
        if twice:
            again = self._call(case.fresh())
            if isinstance(again.error, TimeoutError):
                self._note(name, *of_call(measure, again, name, first=False))
                raise again.error
            if again.value is None or not same(call.value, again.value):
                self._note(name, of_difference(measure, call.value, again.value, name))

    def changed(self, cases: Sequence[Case]) -> None:
        """The first map that has a value, once more: memory, other positions, half resolution."""
        report, measure = self._report, self._measure
        known = [
            (case, trial.value)
            for case, trial in zip(cases, report.trials, strict=True)
            if trial.value is not None and not math.isnan(trial.value)
        ]
        if not known:
            return
        case, before = known[0]
        # counting bytes takes time
        call = watched(measure, case.fresh(), 4 * self._timeout, memory=True)
        report.memory = None if call.error else call.peak
        if measure.needs:
            return  # a turned map is not what its code decodes to
        city = case.city
        turned = [city.replace(isometries.apply(k, city.heights)) for k in range(1, 8)]
        report.turned = self._furthest(before, turned)
        tall, wide = (side // 2 for side in city.shape)
        if tall and wide:
            fours = city.heights[: 2 * tall, : 2 * wide].reshape(tall, 2, wide, 2)
            means = fours.mean(axis=(1, 3))
            halved = city.replace(means, metres_per_pixel=2 * city.metres_per_pixel)
            report.halved = self._furthest(before, [halved])

    def concluded(self) -> Report:
        """The report; what was found on several maps is said once."""
        report = self._report
        self._note("", *of_all(self._measure, report.trials))
        tried = list(zip(self._given, report.trials, strict=False))
        self._note("", *of_maps(self._measure, [trial for _, trial in tried]))
        self._note("", *of_codes(self._measure, tried))
        for finding, maps in self._found.values():
            if others := len(maps) - 1:
                more = f"; likewise on {others} more map{'s' * (others > 1)}"
                finding = replace(finding, found=finding.found + more)
            report.findings.append(finding)
        report.findings.sort(key=lambda one: one.kind != "error")
        if self._times:
            report.first = self._times[0][1]
            report.pixels = max(pixels for pixels, _ in self._times)
            later = [taken for pixels, taken in self._times[1:] if pixels == report.pixels]
            report.median = statistics.median(later) if later else None
        return report

    def _call(self, case: Case) -> Call:
        pixels = case.city.heights.size
        call = watched(self._measure, case, self._timeout)
        self._times.append((pixels, call.seconds))
        return call

    def _furthest(self, before: float, cities: Sequence[CityMap]) -> Change | None:
        """The value of ``cities`` that differs most; being undefined differs more than any."""
        calls = [watched(self._measure, Case(city), self._timeout) for city in cities]
        values = [call.value for call in calls if call.value is not None]
        differ = [math.inf if math.isnan(v) else abs(v - before) for v in values]
        return Change(before, values[differ.index(max(differ))]) if values else None

    def _note(self, name: str, *findings: Finding) -> None:
        for one in findings:
            _, maps = self._found.setdefault((one.about, one.line), (one, set()))
            maps.add(name)


__all__ = ["check"]
