"""What of a recipe's [stop] ends a run, when, and how it goes on; births do not depend on it."""

import json
from datetime import UTC, datetime, timedelta, timezone
from math import isnan, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_search_recipe import faults
from test_search_run import rows, run

from evocity.errors import RecipeError, RunError
from evocity.fitness import Aims, get
from evocity.fitness.composition import Wanted
from evocity.fitness.goals import Objective
from evocity.recipe.stop_and_notify import StopSection, moment_of
from evocity.search import Generation, Observer, Search, archive, read_recipe
from evocity.search.steering.stop_rules import Stagnation, Stopping, progress_of, size_of
from evocity.selection.individual import Individual
from evocity.store import RunLog

EVENING = datetime(2026, 11, 24, 22, 0).astimezone()


class Stepped:
    """A clock that a test steps, so much with each generation."""

    def __init__(self, at: datetime = EVENING, step: timedelta = timedelta()):
        self.at, self._step = at, step

    def __call__(self) -> datetime:
        return self.at

    def stepping(self) -> Observer:
        clock = self

        class Steps(Observer):
            def generation(self, *_):
                clock.at += clock._step

        return Steps()


def stop_of(path) -> dict:
    """The last event of a run, which is a stop, but for its time."""
    event = RunLog(path).events()[-1]
    assert event.pop("event") == "stop"
    del event["time"]
    return event


# -- until ---------------------------------------------------------------------------------------


def test_a_time_of_the_day_is_the_next_such():
    assert moment_of("22:01", EVENING) == EVENING + timedelta(minutes=1)
    assert moment_of("22:00", EVENING) == EVENING + timedelta(days=1)
    assert moment_of("7:00", EVENING) == EVENING + timedelta(hours=9)
    assert moment_of("07:00:30", EVENING) == EVENING + timedelta(hours=9, seconds=30)
    assert moment_of("2026-11-25T07:00", EVENING) == EVENING + timedelta(hours=9)
    assert moment_of("2026-11-25 06:00+00:00", EVENING) == datetime(2026, 11, 25, 6, tzinfo=UTC)
    assert moment_of("none", EVENING) is None
    for wrong in ("25:00", "07:60", "7", "2026-11-25", "soon", "", "07.00"):
        with pytest.raises(ValueError):
            moment_of(wrong, EVENING)


@given(
    st.datetimes(datetime(2020, 1, 2), datetime(2030, 1, 1)),
    st.times(),
    st.integers(-12, 14),
)
def test_the_next_such_is_within_a_day_whatever_the_clocks_zone(at, wanted, hours):
    now = at.replace(tzinfo=timezone(timedelta(hours=hours)))
    found = moment_of(wanted.strftime("%H:%M:%S"), now)
    # an hour more on the day on which summer time ends
    assert timedelta() < found - now <= timedelta(hours=25)
    local = found.astimezone()
    assert (local.hour, local.minute, local.second) == (wanted.hour, wanted.minute, wanted.second)


def test_a_run_ends_at_its_time_and_goes_on_until_the_next(toy, tmp_path):
    recipe = toy(recipe='[stop]\nuntil = "07:00"\n')
    run(toy(), tmp_path / "whole", workers=0, generations=5)
    recipe = toy(recipe='[stop]\nuntil = "07:00"\n')
    out = tmp_path / "run"
    clock = Stepped(step=timedelta(hours=3))
    with Search(
        read_recipe(recipe, generations=5),
        out=out,
        workers=0,
        observers=[clock.stepping()],
        clock=clock,
    ) as search:
        assert [one.number for one in search] == [0, 1, 2]
        assert (search.finished, search.stopped_by.by) == (False, "until")
    assert stop_of(out) == {
        "generation": 2,
        "reason": "it is past 2026-11-25 07:00",
        "by": "until",
    }
    assert RunLog(out).status()["stopped"] == "it is past 2026-11-25 07:00"
    with Search.resume(out, workers=0, clock=clock) as search:  # it is morning, and never later
        assert [one.number for one in search] == [3, 4, 5]
        assert search.stopped_by is None
    assert rows(out) == rows(tmp_path / "whole")
    assert RunLog(out).status()["stopped"] is None


def test_a_moment_that_has_passed_is_told(toy, tmp_path):
    recipe = read_recipe(toy(recipe="[stop]\nuntil = 2026-11-24T21:00:00\n"))
    with (
        pytest.raises(RecipeError, match=r"stop\.until: '2026-11-24T21:00:00' has passed"),
        Search(recipe, out=tmp_path / "run", workers=0, clock=Stepped()) as search,
    ):
        next(iter(search))
    assert not (tmp_path / "run").exists()


def test_an_option_replaces_the_time_and_stays(toy, tmp_path):
    out = tmp_path / "run"
    clock = Stepped(step=timedelta(hours=1))
    recipe = read_recipe(toy(), generations=4, until="2026-11-24T23:00")
    with Search(recipe, out, 0, observers=[clock.stepping()], clock=clock) as search:
        assert len(list(search)) == 1
    with Search.resume(out, workers=0, clock=clock) as search:
        assert "past 2026-11-24 23:00 still" in search.notes[-1]
        assert "--until none" in search.notes[-1]
        assert list(search) == []
    with Search.resume(out, workers=0, clock=clock, until="none") as search:
        assert len(list(search)) == 4
    with pytest.raises(RecipeError, match=r"stop\.until: 'soon'"):
        Search.resume(out, workers=0, until="soon")


# -- target --------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_target_that_one_individual_reaches_ends_the_run(toy, tmp_path):
    run(toy(), tmp_path / "whole", workers=0, generations=6)
    births = RunLog(tmp_path / "whole").births().to_pylist()
    first = [one for one in births if one["generation"] == 0]
    # both at once, by somebody who is born after generation 0
    best = max(one["fitness.spread"] for one in first)
    reaching = [
        one
        for one in births
        if one["fitness.spread"] > best
        and one["fitness.roof"] <= max(o["fitness.roof"] for o in first)
    ]
    assert reaching
    one = reaching[0]
    target = f"spread = {one['fitness.spread']!r}\nroof = {one['fitness.roof']!r}\n"
    recipe = toy(recipe=f"[stop.target]\n{target}")
    out = tmp_path / "run"
    generations = run(recipe, out, workers=0, generations=6)
    assert len(generations) == one["generation"] + 1
    assert stop_of(out) == {
        "generation": one["generation"],
        "reason": f"target reached by {one['id']}",
        "by": "target",
    }
    # it holds still, unless more is asked for; then for good
    with Search.resume(out, workers=0) as search:
        assert search.notes == [
            f"target reached by {one['id']} still; to go on, ask for more generations "
            "(--generations), or another [stop] (--recipe)"
        ]
        assert list(search) == []
    assert stop_of(out)["by"] == "target"
    with Search.resume(out, workers=0, generations=6) as search:
        next(iter(search))
    with Search.resume(out, workers=0) as search:
        assert [one.number for one in search][-1] == 6
    assert rows(out) == rows(tmp_path / "whole")


def after(number, hypervolume, living=()) -> Generation:
    return Generation(number, 0, 0, hypervolume, {}, 0.0, 0.0, list(living))


def individual(identifier, violation=0.0, **values) -> Individual:
    return Individual(identifier, None, values, (), violation)


def test_a_target_goes_by_each_measures_own_direction():
    wanted = Aims(
        (
            Wanted(get("alignment"), Objective(get("alignment"))),
            Wanted(get("crumbs"), Objective(get("crumbs"))),
            Wanted(get("gsi"), Objective(get("gsi"), target=0.35)),
        )
    )
    assert [one.objective.goal for one in wanted.wanted] == ["max", "min", "target"]
    section = StopSection(target={"alignment": 0.5, "crumbs": 2.0, "gsi": 0.01})

    def reason(*living):
        stopping = Stopping(section, wanted)
        stopping.check(after(0, 1.0, living))
        return stopping.reason and stopping.reason.words

    good = individual(7, alignment=0.5, crumbs=2.0, gsi=0.355)
    assert reason(good) == "target reached by 7"
    assert reason(individual(9, alignment=1.0, crumbs=0.0, gsi=0.35), good) == "target reached by 7"
    for name, value in (("alignment", 0.49), ("crumbs", 2.1), ("gsi", 0.37), ("gsi", 0.33)):
        assert reason(individual(7, **{**good.values, name: value})) is None
    assert reason(individual(7, violation=0.1, **good.values)) is None
    apart = (
        individual(1, alignment=1, crumbs=9, gsi=0.35),
        individual(2, alignment=0, crumbs=0, gsi=0.35),
    )
    assert reason(*apart) is None  # one of them must reach all


# -- stagnation ----------------------------------------------------------------------------------


@given(st.lists(st.floats(0, 10) | st.just(nan)), st.integers(0, 5))
def test_stagnation_is_told_as_by_counting(values, since):
    """Where nothing was measured (NaN) nobody can tell whether it got better."""
    found = Stagnation(since=since)
    for number, value in enumerate(values):
        found.add(number, value)
        seen = values[: number + 1]
        best = max((one for one in seen if one > 0), default=None)
        after = [] if best is None else range(max(since, seen.index(best)) + 1, number + 1)
        assert found.count == sum(not isnan(values[one]) for one in after)


def test_progress_is_the_qd_score_where_there_is_one():
    assert progress_of(0.5, {}) == 0.5
    assert progress_of(0.5, {"coverage": 1.0, "qd_score": 3.0}) == 3.0
    assert progress_of(None, {}) == float("inf")


def test_a_run_of_so_many_goals_that_nobody_takes_their_hypervolume_goes_on(toy, tmp_path):
    measures = "".join(
        f"@evocity.fitness(goal='max')\ndef of_{k}(city):\n    return number(city) % (7 + {k})\n"
        for k in range(10)
    )
    settings = {"population": 26, "workers": 1}
    path = toy(measures, "[stop]\nstagnation = 1\n", **settings)
    run(path, tmp_path / "whole", workers=0, generations=3)
    run(path, tmp_path / "parts", workers=0, generations=1)
    with Search.resume(tmp_path / "parts", workers=0, generations=3) as search:
        assert len(list(search)) == 2
    whole, parts = (RunLog(tmp_path / name) for name in ("whole", "parts"))
    assert len(whole.generations) == len(parts.generations) == 4
    assert whole.status()["hypervolume"] is None
    genomes = [one.births(columns=["id", "genome"]) for one in (whole, parts)]
    assert genomes[0].equals(genomes[1])
    assert isnan(archive(whole).hypervolume_alive)


@pytest.mark.slow
def test_a_run_that_gets_no_better_ends_and_counts_on_when_it_is_resumed(toy, tmp_path):
    run(toy(), tmp_path / "whole", workers=0, generations=24)
    history = [one["hypervolume"] for one in RunLog(tmp_path / "whole").history()]
    limit, last = next(
        (limit, number)
        for limit in (2, 1)
        for number in range(24)
        if number - history.index(max(history[: number + 1])) == limit
    )
    best = history.index(max(history[: last + 1]))
    recipe = toy(recipe=f"[stop]\nstagnation = {limit}\n")
    out = tmp_path / "run"
    # taken up in between: what was before counts
    search = Search(read_recipe(recipe, generations=24), out=out, workers=0)
    with search:
        for generation in search:
            if generation.number == last - 1:
                break
    with Search.resume(out, workers=0) as search:
        assert [one.number for one in search] == [last]
    assert stop_of(out) == {
        "generation": last,
        "reason": f"{limit} generations without progress, the best is of generation {best}",
        "by": "stagnation",
    }
    with Search.resume(out, workers=0) as search:
        assert "without progress" in search.notes[-1]
        assert list(search) == []
    with Search.resume(out, workers=0, generations=24) as search:
        numbers = [one.number for one in search]
    assert len(numbers) >= limit  # it counts anew
    assert rows(out) == rows(tmp_path / "whole")[: 8 * (numbers[-1] + 1)] + [
        one
        for one in rows(tmp_path / "whole")
        if "slot" in one and one["generation"] <= numbers[-1]
    ]


def test_new_weights_count_anew(toy, tmp_path):
    stopping = Stopping(StopSection(stagnation=2), Aims(()))
    for generation, progress in enumerate((1.0, 1.0)):
        stopping.check(after(generation, progress))
    stopping.reset_progress()
    stopping.check(after(2, 0.5))
    assert stopping.reason is None
    stopping.check(after(3, 0.5))
    stopping.check(after(4, 0.5))
    assert stopping.reason.words == "2 generations without progress, the best is of generation 2"


# -- disk ----------------------------------------------------------------------------------------


def test_a_run_ends_before_its_folder_is_larger_than_allowed(toy, tmp_path):
    run(toy(), tmp_path / "whole", workers=0, generations=6)
    size = size_of(tmp_path / "whole")
    assert size == sum(p.stat().st_size for p in (tmp_path / "whole").rglob("*") if p.is_file())
    allowed = size * 3 // 4
    recipe = toy(recipe=f'[stop]\ndisk = "{allowed / 1000:.3f} kB"\n')
    out = tmp_path / "run"
    done = run(recipe, out, workers=0, generations=6)
    assert 1 < len(done) < 7
    assert stop_of(out)["by"] == "disk"
    assert "of the" in stop_of(out)["reason"]
    assert size_of(out) <= allowed + 1000  # its last events
    with Search.resume(out, workers=0) as search:
        numbers = [one.number for one in search]
    assert len(numbers) <= 1  # a resumed run does not know how much the next one takes
    assert size_of(tmp_path / "nowhere") == 0


# -- ask and tell, faults ------------------------------------------------------------------------


def test_ask_and_tell_are_told_of_a_stop(toy):
    recipe = read_recipe(toy(recipe="[stop]\nstagnation = 1\n"), generations=9)
    with Search(recipe, workers=0) as search:
        for _ in range(9):
            genomes = search.ask()
            search.tell([{"spread": 1.0, "roof": 1.0} for _ in genomes])
            if search.stopped_by is not None:
                break
        assert search.stopped_by.by == "stagnation"
        with pytest.raises(RunError, match="has stopped: 1 generations without progress"):
            search.ask()


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        ('until = "25:00"', "stop.until: '25:00'; allowed: \"07:00\""),
        ("until = 7", "stop.until: 7; allowed: text in quotes"),
        ("until = 2026-11-25", "stop.until"),
        ("stagnation = 0", "stop.stagnation: 0; allowed: 1 or more"),
        ('disk = "10"', "stop.disk: '10'; allowed: a size"),
        ("hours = 3", "stop.hours: unknown key"),
        (
            "target = { spred = 3 }",
            "stop.target.spred: 'spred', which is not a goal, did",
        ),
        ("target = { spread = nan }", "stop.target.spread: nan; allowed: a finite number"),
        ('target = { spread = "much" }', "stop.target.spread: 'much'; allowed: a number"),
    ],
)
def test_faults_are_told_with_the_others(toy, lines, says):
    (line,) = faults(toy(recipe=f"[stop]\n{lines}\n"))
    assert line.startswith(says), line


@pytest.mark.parametrize(
    ("entry", "target", "says"),
    [
        ('name = "alignment"', "alignment = 1.5", "1.5; allowed: within its range, 0…1"),
        ('name = "alignment"\ngoal = "min"', "alignment = -1", "-1; allowed: within its range"),
        (
            'name = "gsi"\ntarget = 0.3',
            "gsi = -0.1",
            "-0.1; allowed: the distance from the entry's target",
        ),
        ('name = "gsi"\nmin = 0.3', "gsi = 0.4", "'gsi', which is not a goal"),
    ],
)
def test_a_target_that_none_can_reach_is_a_fault(toy, entry, target, says):
    (line,) = faults(toy(recipe=f"[[fitness]]\n{entry}\n[stop.target]\n{target}\n"))
    assert line.startswith(f"stop.target.{target.split()[0]}: {says}"), line


def test_times_of_toml_and_sums_may_be_named(toy):
    recipe = read_recipe(
        toy(
            recipe='[[fitness]]\nname = "gsi"\ntarget = 0.3\nweight = 2\n'
            "[stop]\nuntil = 07:00:00\ntarget = { gsi = 0.02 }\n"
        )
    )
    assert recipe.stop.until == "07:00:00"
    json.dumps(recipe.stop.model_dump())
