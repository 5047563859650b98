"""Trying a measure: what a call gave, every fault with its line, and what measures cost."""

import functools
import linecache
import math
import re
import sys
import textwrap
import threading
import time
import tracemalloc

import numpy as np
import pytest
from towns import draw_town

import evocity.fitness
from evocity import isometries
from evocity.citymap import CityMap
from evocity.coding import encode
from evocity.errors import FitnessError
from evocity.fitness import load_file, registry
from evocity.fitness.check import Case, check
from evocity.fitness.check.cost import cost, cost_together
from evocity.fitness.check.observed_call import observe

TOWNS = [draw_town(1), draw_town(2)]

HEADER = """\
import evocity.fitness
import numpy as np


@evocity.fitness({options})
def tried(city{extras}):
"""
FIRST = 7  # the line in which the body begins


@pytest.fixture(autouse=True)
def table_as_it_was(monkeypatch):
    monkeypatch.setattr(registry, "_table", dict(registry._table))
    monkeypatch.setattr(registry, "_from_files", dict(registry._from_files))


@pytest.fixture
def measure(tmp_path):
    """Makes a measure of the lines of a function's body; the first is line 8 of its file."""

    def write(body, options='goal="max"', extras="", doc='"What it says."'):
        text = HEADER.format(options=options, extras=extras)
        text += textwrap.indent(f"{doc}\n{textwrap.dedent(body).strip()}\n", "    ")
        path = tmp_path / f"tried_{len(list(tmp_path.iterdir()))}.py"
        path.write_text(text, encoding="utf-8")
        return load_file(path)[0]

    return write


def found(report, about):
    """The one finding about something."""
    (one,) = [finding for finding in report.findings if finding.about == about]
    return one


# -- what is right ---------------------------------------------------------------------------


def test_a_sound_measure_has_no_findings_and_its_own_values(measure):
    sound = measure("return city.heights.mean()")
    report = check(sound, TOWNS)
    assert report.usable
    assert report.findings == []
    assert [trial.map for trial in report.trials] == [
        "town-1",
        "town-2",
        "empty map",
        "map built all over",
        "61 × 38 px of 0.5 m",
        "one pixel",
    ]
    for trial, city in zip(report.trials, TOWNS, strict=False):
        assert trial.value == float(city.heights.mean())
    assert report.trials[2].value == 0
    assert report.trials[5].value == 9
    assert report.pixels == TOWNS[0].heights.size
    assert 0 < report.median < 1


@pytest.mark.parametrize("name", ["gsi", "salingaros", "alignment", "elongation"])
def test_measures_of_the_package_can_be_used(name):
    report = check(evocity.fitness.get(name), [draw_town(7, side=128, buildings=150)])
    assert report.findings == []


def test_no_map_is_refused_and_progress_is_told(measure):
    sound = measure("return city.heights.mean()")
    with pytest.raises(FitnessError, match="list of maps for the trial of tried is empty"):
        check(sound, [])
    told = []
    check(sound, TOWNS, progress=lambda done, total: told.append((done, total)))
    assert told == [(number, 6) for number in range(1, 7)]


def test_turning_and_halving_tell_the_furthest_value(measure):
    corner = measure("return city.heights[: city.shape[0] // 4].mean()")
    city = TOWNS[0]
    report = check(corner, [city])
    values = [corner(city.replace(isometries.apply(k, city.heights))) for k in range(8)]
    assert report.turned.before == values[0]
    furthest = max(abs(value - values[0]) for value in values)
    assert abs(report.turned.after - values[0]) == furthest > 0
    pixel = measure("return city.metres_per_pixel * city.shape[0] + city.heights.max()")
    means = city.heights.reshape(32, 2, 32, 2).mean((1, 3))
    halved = check(pixel, [city]).halved
    assert halved.after == pixel(CityMap(means, 4.0))
    assert halved.before == pixel(city)


def test_undefined_when_turned_is_told(measure):
    leaning = measure("""
        if city.heights[0].sum() < city.heights[-1].sum():
            return evocity.fitness.Undefined("leans")
        return 1.0 + city.heights.mean()
    """)
    heights = np.zeros((16, 16))
    heights[0] = 9
    report = check(leaning, [CityMap(heights, 2.0)])
    assert math.isnan(report.turned.after)
    assert report.usable


def test_memory_is_what_a_call_holds(measure):
    hungry = measure("return np.ones(1 << 20).sum() + city.heights.max()")
    assert check(hungry, TOWNS).memory == pytest.approx(8 << 20, rel=0.1)
    assert not tracemalloc.is_tracing()


def test_genome_and_parents_are_given_to_those_who_ask(measure):
    asking = measure("return len(genome) / len(parents)", extras=", genome, parents")
    genome = encode(TOWNS[0], block=4, fit=False, settle=False).genome
    case = Case(TOWNS[0], genome, (genome, genome))
    report = check(asking, [TOWNS[1], case])
    plain, coded, *awkward = report.trials
    assert (plain.value, plain.reason) == (None, "not measured: the map has no genome and parents")
    assert coded.value == len(genome) / 2
    assert [trial.value for trial in awkward] == [len(genome), len(genome)]
    assert report.turned is report.halved is None
    assert report.memory is not None


def test_a_number_of_several_is_tried_like_any_other(measure):
    spread = measure(
        'return {"low": city.heights.min(), "high": city.heights.max()}',
        options='goal="max", numbers=("low", "high")',
    )
    report = check(spread, TOWNS)
    assert report.measure.name == "tried.low"
    assert report.usable


VIEWS = [
    name
    for name, held in vars(CityMap).items()
    if isinstance(held, property | functools.cached_property) and not name.startswith("_")
]


@pytest.mark.parametrize("view", VIEWS)
def test_who_reads_a_view_has_not_changed_it(measure, view):
    tried = measure(
        f"one = city.{view}\n"
        "for name in dir(one) if not isinstance(one, tuple | np.ndarray) else ():\n"
        "    if not name.startswith('_'): getattr(one, name)\n"
        "return city.heights.mean()"
    )
    report = check(tried, TOWNS, timeout=200.0)  # the first view may compile kernels
    assert [one.found for one in report.findings] == []


def test_of_a_measure_that_fails_it_is_not_told_that_it_is_undefined(measure):
    body = "if not city.built.any(): return evocity.fitness.Undefined('empty')\nreturn 1 / 0"
    report = check(measure(body), TOWNS)
    assert [one.about for one in report.findings if one.kind == "error"] == ["exception"]


# -- a map that is changed -------------------------------------------------------------------

LOCKED = """\
a = a if a.base is None else a.base; a.setflags(write=True)
a[:] = 0
a.setflags(write=False)
"""
CHANGES = {
    # what the measure does, what is found in the second line
    "left open": (
        "a = city.buildings.area\na.setflags(write=True)\na[:] = 0",
        "made city.buildings.area writable on town-1",
    ),
    "heights": (f"a = city.heights\n{LOCKED}", "changed city.heights on town-1"),
    "view": (f"a = city.labels\n{LOCKED}", "changed city.labels on town-1"),
    "table": (f"a = city.buildings.area\n{LOCKED}", "changed city.buildings.area on town-1"),
    "lazy column": (
        f"a = city.buildings.courtyards\n{LOCKED.replace('= 0', '= 1')}",
        "changed city.buildings.courtyards on town-1",
    ),
    "lazy shape": (f"a = city.buildings.circle\n{LOCKED}", "changed city.buildings on town-1"),
    "pair": (f"a = city.gradients[1]\n{LOCKED}", "changed city.gradients on town-1"),
    "streets": (f"a = city.streets.widths\n{LOCKED}", "changed city.streets.widths on town-1"),
    "open space": (f"a = city.open_space.area\n{LOCKED}", "changed city.open_space.area"),
    "other number": (
        "a = city.streets\nvars(a)['length'] = 0.0",
        "changed city.streets.length on town-1",
    ),
    "other view": (
        "a = city.areas\nvars(city)['labels'] = a",
        "changed city.labels on town-1",
    ),
    "other pixel": (
        "a = 1\nvars(city)['metres_per_pixel'] = 1.0",
        "changed city.metres_per_pixel on town-1",
    ),
    "taken away": ("a = 1\ndel vars(city)['heights']", "changed city.heights on town-1"),
    "put there": ("a = 1\nvars(city)['mine'] = a", "changed city.mine on town-1"),
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_changed_map_is_an_error_with_its_line(measure, name):
    body, says = CHANGES[name]
    tried = measure(f"{body.strip()}\nreturn 3.0")
    one = found(check(tried, TOWNS), "change")
    assert (one.kind, one.file, one.line) == ("error", tried.file, FIRST + 2)
    assert says in one.found
    assert "an unchanged map" in one.expected
    assert "change a copy" in one.remedy


def test_the_view_of_one_map_among_many_is_found(measure):
    body = f"if city.built.any():\n    return 3.0\na = city.streets.width\n{LOCKED}return 2.0"
    body = body.replace("= 0", "= 1")
    assert (
        "changed city.streets.width on empty map"
        in found(check(measure(body), TOWNS), "change").found
    )


def test_no_view_that_is_only_looked_at_is_told(measure):
    looks = measure("""
        views = (city.areas, city.outline, city.gradients, city.structure, city.open_space)
        views += (city.distance_to_built, city.streets)
        columns = city.buildings.as_dict()
        return len(views) + len(columns) + city.heights.mean()
    """)
    assert check(looks, TOWNS).findings == []


# -- what is wrong ---------------------------------------------------------------------------

FAULTS = {
    # body, about, line after the first, what is found
    "text": ('x = 1\nreturn "much"', "result", 1, "returned str 'much' for town-1"),
    "early": ("if city.built.any():\n    return [1]\nreturn 0", "result", 1, "returned list [1]"),
    "array": ("return city.heights", "result", 0, "ndarray of shape (64, 64)"),
    "none": ("x = 1", "result", 0, "for town-1"),
    "complex": ("return 1j", "result", 0, "returned complex 1j"),
    "infinite": ("return np.inf", "result", 0, "returned float inf"),
    "raising": ("y = 0\nreturn 1 / y", "exception", 1, "ZeroDivisionError"),
    "empty": ("return city.heights[city.built].min()", "exception", 0, "on empty map"),
    "missing": ("return float(open('weights.txt').read())", "exception", 0, "weights.txt"),
    "exit": ("raise SystemExit(3)", "exception", 0, "raised SystemExit: 3"),
    "ends": ("import os\nos._exit(3)", "exception", 1, "os._exit(3), which ends the process"),
    "writes": ("h = city.heights\nh[0] = 1\nreturn 1", "exception", 1, "read-only"),
    "sets": ("city.name = 'x'\nreturn 1", "exception", 0, "is immutable"),
    "unlocks": (
        "city.heights.setflags(write=True)\ncity.heights[:] += 1\nreturn city.heights.max()",
        "change",
        0,
        "made city.heights writable on town-1",
    ),
    "view": (
        "built = city.built\nbuilt.flags.writeable = True\nreturn city.heights.max()",
        "change",
        1,
        "made city.built writable",
    ),
    "draws": (
        "x = city.heights.max()\nreturn x + np.random.default_rng().random()",
        "random",
        1,
        "draws random numbers, or keeps state",
    ),
    "counts": ("seen.append(1)\nreturn len(seen)", "random", None, "is 1.0, and of the same map"),
    "nowhere": ("return float('nan')", "undefined", None, "is undefined on every map: NaN"),
    "range": ("return 2 + city.heights.mean()", "range", None, "of town-1 is"),
}
REMEDIES = {
    "text": "return float(...)",
    "array": "return float(np.mean(...))",
    "missing": "the measure's own folder",
    "writes": "city.heights.copy()",
    "sets": "city.heights.copy()",
    "unlocks": "city.heights.copy()",
    "draws": "np.random.default_rng(0)",
    "range": "range=(lowest, highest)",
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_an_error_with_its_line(measure, name):
    body, about, line, says = FAULTS[name]
    extras = ", seen=[]" if name == "counts" else ""
    tried = measure(body, options='goal="max", range=(-1, 1000)', extras=extras)
    if name == "range":
        tried = measure(body, options='goal="max", range=(0, 1)')
    report = check(tried, TOWNS)
    one = found(report, about)
    assert not report.usable
    assert one.kind == "error"
    assert one.file == tried.file
    assert one.line == (tried.line if line is None else FIRST + 1 + line)
    assert says in one.found
    assert tried.file not in one.found
    assert REMEDIES.get(name, "") in one.remedy


def test_what_is_kept_for_a_map_is_found_by_another_of_the_same_heights(measure):
    kept = measure("return known.setdefault(city, float(len(known)))", extras=", known={}")
    assert "is 0.0, and of the same map again 1.0" in found(check(kept, TOWNS), "random").found


def test_what_several_maps_show_is_said_once(measure):
    report = check(measure("return 1j"), TOWNS)
    assert found(report, "result").found == (
        "tried returned complex 1j for town-1; likewise on 5 more maps"
    )
    assert all(trial.reason == "failed" for trial in report.trials)


WARNINGS = {
    "print": ("x = 1\nprint('a', x)\nreturn city.heights.max()", 1, "prints 'a 1' on town-1"),
    "arithmetic": (
        "roofs = city.heights[city.built]\nmean = roofs.mean()\n"
        "return evocity.fitness.Undefined('flat') if np.isnan(mean) else mean",
        1,
        "makes numpy warn on empty map: RuntimeWarning: Mean of empty slice",
    ),
    "reason": (
        "if not city.built.any():\n    return np.nan\nreturn city.heights.max()",
        1,
        "NaN without a reason on empty map",
    ),
    "constant": ("return 3.0", None, "is 3 on all 6 maps"),
}


@pytest.mark.parametrize("about", WARNINGS)
def test_what_is_seldom_meant_is_a_warning(measure, about, capsys):
    body, line, says = WARNINGS[about]
    tried = measure(body)
    report = check(tried, TOWNS)
    one = found(report, about)
    assert report.usable
    assert [finding.kind for finding in report.findings] == ["warning"]
    assert one.line == (tried.line if line is None else FIRST + 1 + line)
    assert says in one.found
    assert capsys.readouterr() == ("", "")


def test_a_measure_undefined_on_many_cities_is_warned_of(measure):
    towns = [draw_town(seed) for seed in range(8)]
    level = sorted(city.heights.mean() for city in towns)
    body = "if city.heights.mean() > {}:\n    return evocity.fitness.Undefined('high')\nreturn {}"
    tried = measure(body.format(level[4] + 1e-6, "city.heights.mean()"))
    report = check(tried, towns)
    assert report.usable
    one = found(report, "often undefined")
    count = sum(top > level[4] for top in level)
    assert count > 2
    assert f"undefined on {count} of 8 cities" in one.found
    assert one.found.endswith(": high")
    # on two of eight it is told in the table alone; awkward maps do not count
    seldom = measure(body.format(level[-3] + 1e-6, "city.heights.mean()"))
    assert check(seldom, towns).findings == []
    awkward = measure(
        "if not 0.1 < city.built.mean() < 0.9:\n    return evocity.fitness.Undefined('odd')\n"
        "return city.heights.mean()"
    )
    assert check(awkward, towns[:2]).findings == []


@pytest.mark.parametrize(
    ("options", "formula", "told"),
    [
        ("range=(0, 1)", "0.5 + 0.004 * city.built.mean()", "its range"),
        ("range=(0.4, 0.6)", "0.5 + 0.1 * city.built.mean()", ""),
        ("", "1000 + city.built.mean()", "its size"),
        ("", "city.built.mean()", ""),
        ("", "float(city.heights.mean() > {top})", "its size"),
    ],
)
def test_a_measure_that_hardly_differs_is_warned_of(measure, options, formula, told):
    towns = [draw_town(seed) for seed in range(12)]
    top = sorted(city.heights.mean() for city in towns)[-2] + 1e-6  # one town is above
    report = check(measure(f"return {formula}".format(top=top), options=options), towns)
    assert report.usable
    assert [one.found.endswith(told) for one in report.findings] == [True] * bool(told)
    assert {one.about for one in report.findings} <= {"near-constant"}


def test_a_measure_that_sees_the_code_more_than_the_city_is_warned_of(measure):
    towns = [draw_town(seed) for seed in range(4)]
    coded = encode(towns[0], block=4, reach=4, fit=False, settle=False).genome
    city = evocity.coding.decode(coded).city
    cases = [*towns, Case(city.replace(city.heights, name="decoded"), coded, (coded,), "town-0")]
    assert towns[0].name == "town-0"
    crumbs = "np.unique(city.heights[city.built]).size"  # a code's roofs are not flat
    one = found(check(measure(f"return {crumbs}"), cases), "code and map")
    values = [len(np.unique(t.heights[t.built])) for t in (*towns, city)]
    assert f"of town-0 is {values[0]}, and of its code {values[4]}" in one.found
    undefined = measure(f"if {crumbs} > 50:\n    return evocity.fitness.Undefined('rough')\n"
                        "return city.heights.mean()")  # fmt: skip
    one = found(check(undefined, cases), "code and map")
    assert one.found.endswith("and of its code undefined: rough")
    assert check(measure("return city.heights.mean()"), cases).findings == []


def test_a_missing_docstring_is_a_warning(measure):
    one = found(check(measure("return city.heights.max()", doc=""), TOWNS), "documentation")
    assert (one.kind, one.found) == ("warning", "tried has no docstring")


def test_helpers_are_followed_to_the_line_of_the_measure(measure):
    tried = measure("x = 0\nreturn np.linalg.inv(city.heights[:2, :1])[0, 0]")
    assert found(check(tried, TOWNS), "exception").line == FIRST + 2


@pytest.mark.parametrize(
    "body",
    ["import time\ntime.sleep(30)\nreturn 1.0", "n = 0\nwhile True: n += 1\nreturn n"],
    ids=["waits", "loops"],
)
def test_a_call_that_does_not_end_is_given_up_at_its_line(measure, body):
    tried = measure(body)
    report = check(tried, TOWNS, timeout=0.2)
    one = found(report, "time")
    assert not report.usable
    assert report.given_up
    assert one.line == FIRST + 2
    assert "was at this line after 0.2 s on town-1" in one.found
    assert [(trial.map, trial.reason) for trial in report.trials] == [("town-1", "timed out")]


@pytest.mark.skipif(not hasattr(time, "pthread_getcpuclockid"), reason="a clock of each thread")
def test_a_loop_given_up_is_ended(measure):
    before = set(threading.enumerate())
    call = observe(measure("n = 0\nwhile True: n += 1"), Case(TOWNS[0]), 0.2)
    assert isinstance(call.error, TimeoutError)
    for left in set(threading.enumerate()) - before:  # a loaded machine may not get to it at once
        left.join(60.0)
    assert set(threading.enumerate()) <= before


def test_what_is_given_up_waiting_does_not_stop_the_next(measure):
    observe(measure("import time\ntime.sleep(30)"), Case(TOWNS[0]), 0.05)
    call = observe(measure("return 1j"), Case(TOWNS[0]), 60.0)
    assert call.seconds < 20
    assert call.line == FIRST + 1


def test_only_the_second_call_hangs(measure):
    tried = measure(
        "import time\nseen.append(1)\ntime.sleep(30 * (len(seen) == 2))\nreturn 1.0",
        extras=", seen=[]",
    )
    report = check(tried, TOWNS, timeout=1.0)  # the first call takes as good as nothing
    assert report.given_up
    assert found(report, "time").line == FIRST + 3
    assert [trial.value for trial in report.trials] == [1.0]


def test_a_slow_call_is_a_warning(measure, monkeypatch):
    monkeypatch.setattr("evocity.fitness.check.faults.SLOW", 0.02)
    monkeypatch.setattr("evocity.fitness.check.trial._QUICK", 0.02)
    tried = measure("import time\ntime.sleep(0.03)\nreturn city.heights.max()")
    report = check(tried, TOWNS)
    one = found(report, "time")
    assert report.usable
    assert not report.given_up
    assert one.kind == "warning"
    assert re.search(r"took \d+\.\d s on town-", one.found)


def test_trying_leaves_the_process_as_it_was(measure):
    out, profile, shown = sys.stdout, sys.getprofile(), linecache.getlines
    check(measure("print(1)\nreturn np.log(0.0 * city.heights.max())"), TOWNS)
    assert sys.stdout is out
    assert sys.getprofile() is profile
    assert linecache.getlines is shown


# -- one call --------------------------------------------------------------------------------


def test_a_call_tells_value_and_time(measure):
    tried = measure("import time\ntime.sleep(0.02)\nreturn city.heights.max()")
    call = observe(tried, Case(TOWNS[0]), 60.0)
    assert call.value == tried(TOWNS[0])
    assert 0.02 <= call.seconds < 60
    assert call.error is call.line is call.printed is call.warned is call.peak is None


def test_only_the_first_line_printed_is_kept(measure):
    tried = measure("print()\nprint('one', end=' ')\nprint('two')\nprint('three')\nreturn 1.0")
    assert observe(tried, Case(TOWNS[0]), 60.0).printed == (FIRST + 2, "one two")


# -- cost ------------------------------------------------------------------------------------


def test_shared_views_are_not_paid_twice(measure):
    viewing = measure("return float(city.labels.max())")
    plain = measure("import time\ntime.sleep(0.01)\nreturn 1.0")
    city = draw_town(7, side=256, buildings=300)
    found = cost(viewing, Case(city), repeats=5)
    assert 0 < found.shared.least <= found.shared.median
    assert found.shared.least < found.alone.least / 3
    assert cost(plain, Case(city), repeats=3).shared.least >= 0.01


def test_a_function_of_several_numbers_is_timed_each_time(measure):
    several = measure(
        'import time\ncalls.append(1)\ntime.sleep(0.01)\nreturn {"low": 1.0, "high": 2.0}',
        options='numbers=("low", "high")',
        extras=", calls=[]",
    )
    (calls,) = several.function.__wrapped__.__defaults__
    found = cost(several, Case(TOWNS[0]), repeats=3)
    assert min(found.alone.least, found.shared.least) >= 0.01
    both = [evocity.fitness.get(f"tried.{number}") for number in ("low", "high")]
    calls.clear()
    together = cost_together(both, Case(TOWNS[0]), repeats=3)
    assert together.least >= 0.01
    assert len(calls) == 4  # one for both numbers, a time, and one that does not count


def test_costs_stand_on_the_measures_errors(measure):
    with pytest.raises(FitnessError, match="returned complex"):
        cost(measure("return 1j"), Case(TOWNS[0]))
