"""Canaries: what a birth changes in its worker changes no other birth, and the run says so."""

import ctypes
import time
from functools import cached_property
from types import SimpleNamespace

import numpy as np
import pytest
from codes import uniformly
from faults_kinds import SOURCE
from towns import draw_town
from toy_runs import write_toy

import evocity
from evocity import fitness
from evocity.citymap import CityMap
from evocity.coding import decoding_cache
from evocity.evaluation import Here, Workers, job_table, linux_processes
from evocity.evaluation.canary import Canary, _count_writeable
from evocity.evaluation.evaluator import Evaluator, Outcome, Setup
from evocity.evaluation.floating_point import FloatingPoint
from evocity.evaluation.job_table import JobTable
from evocity.evaluation.process_state import ProcessState
from evocity.kinds import KINDS
from evocity.search import Search, read_recipe

NAMES = ("gsi", "crumbs", "alignment", "integrity")
linux = pytest.mark.skipif(not linux_processes.LINUX, reason="the kinds are those of Linux")


def setup_of(kind="fabric", names=NAMES, file=None) -> Setup:
    names = [name for name in names if fitness.get(name).of in KINDS[kind].subjects]
    own = [] if file is None else [("bad", str(file))]
    measured = tuple(name for name, _ in own) + tuple(names)
    header = SimpleNamespace(chromosome=KINDS[kind], measures=measured, recorded=())
    return Setup(header, (*own, *((name, None) for name in names)), sides=4)


@pytest.fixture
def canary():
    return Canary(Evaluator(setup_of()), 4)


def test_a_canary_repeats_itself(canary):
    assert len(canary.expected) == 32
    assert canary.digest() == canary.expected == Canary(Evaluator(setup_of()), 4).expected


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_chromosome_has_a_canary(kind):
    one = Canary(Evaluator(setup_of(kind)), (2, 16))
    assert one.digest() == one.expected
    assert len(one.expected) == 32


PATCHES = {
    "the evaluation": (Evaluator, "evaluate", lambda *_, **__: Outcome("ok")),
    "a helper": (Evaluator, "_record", lambda *_, **__: []),
    "a measure": (fitness.get("gsi"), "function", lambda city: 0.5),
    "the decoder": (decoding_cache, "decode", None),
    "a view": (CityMap, "built", property(lambda city: city.heights > 5)),
    "numpy": (np, "rint", lambda array: array),
}


@pytest.mark.parametrize("patch", PATCHES)
def test_a_canary_notices_changed_code(canary, patch):
    place, name, value = PATCHES[patch]
    before = vars(place)[name]
    write = object.__setattr__ if isinstance(place, fitness.Measure) else setattr
    write(place, name, value)
    try:
        assert canary.digest() != canary.expected
    finally:
        write(place, name, before)
    assert canary.digest() == canary.expected


def test_all_views_of_maps_are_read_only_for_the_canary_to_count(town):
    """Else a measure that uses such a view would look like one that changes maps."""
    city = decoding_cache.decode(uniformly(town).genome).city
    views = [name for name in dir(CityMap) if not name.startswith("__")]
    for part in [getattr(city, name) for name in views]:
        for name in dir(type(part)) if hasattr(part, "__dict__") else []:
            if isinstance(getattr(type(part), name), (property, cached_property)):
                getattr(part, name)
    assert _count_writeable(city) == 0
    vars(city)["own"] = np.zeros(3)  # of the measure's author
    assert _count_writeable(city) == 0
    city.heights.setflags(write=True)
    city.built.setflags(write=True)
    assert _count_writeable(city) == 2


@linux
def test_the_rounding_mode_and_built_in_functions_are_restored(monkeypatch):
    state, libm = ProcessState(), ctypes.CDLL("libm.so.6")
    libm.fesetround(0x800)
    monkeypatch.setattr("builtins.sum", lambda *_: 0)
    monkeypatch.setattr("builtins.all", None)
    assert state.restore()
    assert libm.fegetround() == 0
    assert sum([1, 2]) == 3
    assert all([True])


def test_a_floating_point_environment_costs_little():
    state = FloatingPoint()
    start = time.thread_time()
    for _ in range(1000):
        state.restore()
    assert time.thread_time() - start < 0.5


BAD = ["replaces_evaluate", "rounds_up", "replaces_sum", "ends_the_next", "sends_a_pickle"]


@pytest.fixture(scope="module")
def genomes():
    return [uniformly(draw_town(seed)).genome for seed in (1, 2, 3)]


def jobs_of(genomes, bad=None):
    named = [(genomes[at % 3], bad if bad and at == 4 else f"calm-{at}") for at in range(9)]
    return [(genome.replace(cities=(name,)),) for genome, name in named]


@linux
@pytest.mark.slow_cases(*[f"{n}-{bad}" for bad in BAD for n in (1, 2)][1:])
@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize("workers", [1, 2])
def test_a_bad_birth_changes_no_other(genomes, tmp_path, workers, bad):
    """Values of bundled measures too, which the bad birth would change in its worker."""
    path, lines = tmp_path / "bad.py", []
    path.write_text(SOURCE.replace("NOTES_FOLDER", repr(str(tmp_path))))
    fitness.load_file(path)
    setup = setup_of(names=NAMES[:3], file=path)
    pool = Workers(setup, workers, 30.0, lines.append)
    try:
        expected = pool.run("evaluate", jobs_of(genomes))
        outcomes = pool.run("evaluate", jobs_of(genomes, bad))
    finally:
        pool.close()
    for at, (one, other) in enumerate(zip(expected, outcomes, strict=True)):
        assert one.status == "ok"
        if at != 4:
            assert (one.status, one.error, one.values) == (other.status, other.error, other.values)
            assert one.look.tobytes() == other.look.tobytes()
    assert not list(tmp_path.glob("unpickled*"))
    if bad in ("replaces_evaluate", "ends_the_next"):
        assert outcomes[4].status == "error"
        assert "leaves its worker so changed" in outcomes[4].error
        assert [line for line in lines if "a birth left its worker changed" in line]
    else:
        assert outcomes[4].status == ("died" if bad == "sends_a_pickle" else "ok")


CHANGING = """
import ctypes, numpy as np
from evocity.evaluation.evaluator import Evaluator

@evocity.fitness(goal="max")
def changing(city):
    kind = number(city) % 8
    if kind == 0:
        {deed}
    if kind == 1:
        {rounding}
    return 1.0
"""
DEEDS = {
    "raises": "raise ValueError('a bad mood')",
    "changes": "Evaluator.evaluate = lambda *given, **named: None",
    "changes numpy": "whole = np.rint; np.rint = lambda array: whole(array) + 1",
}


@linux
@pytest.mark.slow
def test_a_run_of_changing_births_has_the_others_as_a_run_of_failing_ones(tmp_path):
    """The births that change their worker are errors, as in the run where they raise an error, so
    both runs go on alike."""
    logs = {}
    for name, deed in DEEDS.items():
        rounding = "ctypes.CDLL(None).fesetround(0x800)" if name != "raises" else "pass"
        for workers in {"raises": (0,), "changes": (1, 2), "changes numpy": (2,)}[name]:
            folder = tmp_path / f"{name} {workers}"
            folder.mkdir()
            goal = '[[fitness]]\nname = "gsi"\ntarget = 0.4\n'
            path = write_toy(
                folder,
                CHANGING.format(deed=deed, rounding=rounding),
                goal,
                workers=workers,
                generations=2,
                max_failures=1.0,
            )
            with Search(read_recipe(path), folder / "run") as search:
                for _ in search:
                    pass
            run = evocity.open_run(folder / "run")
            births = run.individuals(list(range(8 * 3)))
            logs[name, workers] = [
                (
                    one.id,
                    one.parents,
                    one.status,
                    one.status == "ok" and one.values,
                    one.genome and one.genome.digest,
                )
                for one in births
            ]
            events = (folder / "run" / "events.jsonl").read_text()
            assert ("left its worker changed" in events) == (workers > 0)
    first, *others = logs.values()
    assert 2 <= sum(status == "error" for _, _, status, *_ in first) < len(first) / 2
    assert all(other == first for other in others)


def test_a_run_without_workers_says_that_it_is_unprotected():
    assert Here(setup_of()).described["protected"] is False


# -- which births are done again ---------------------------------------------------------


class Worker:
    """A seat, as far as the table of jobs sees it."""

    def __init__(self, job=None, held=()):
        self.job = job
        self.held = [(number, Outcome("ok", values={"a": 1.0})) for number in held]


def table(count: int) -> JobTable:
    jobs = JobTable("evaluate", iter([(number,) for number in range(count)]))
    jobs.draw(count)
    jobs.waiting.clear()
    return jobs


def test_the_births_since_the_last_check_are_done_again_one_by_one():
    jobs = table(4)
    text = jobs.fail(Worker(held=[0, 1, 2]).held)
    assert "the 3 births" in text
    assert list(jobs.waiting) == [0, 1, 2]
    assert not jobs.outcomes
    assert jobs.isolates(Worker(held=[3]), 0)
    assert jobs.isolates(Worker(held=[0]), 3)
    assert not jobs.isolates(Worker(), 0)
    assert not jobs.isolates(Worker(held=[3]), 3)


def test_a_birth_that_fails_a_check_twice_is_the_cause():
    jobs = table(3)
    jobs.fail(Worker(held=[0, 1]).held)
    text = jobs.fail(Worker(held=[1]).held)
    assert "the birth fails" in text
    assert jobs.outcomes[1].status == "error"
    assert not jobs.outcomes[1].values
    jobs.fail(Worker(held=[2]).held)
    assert 2 not in jobs.outcomes  # once may be the fault of another
    jobs.settle(0, Outcome("ok"))


def test_a_birth_after_one_in_doubt_ends_its_worker_but_is_not_blamed_at_once():
    jobs = table(4)
    died = Outcome("died", "the worker ended")
    jobs.settle_ended(Worker(job=2, held=[0, 1]), died)
    assert not jobs.outcomes
    jobs.settle(0, Outcome("ok"))
    assert list(jobs.outcomes) == [0]
    jobs.settle(1, Outcome("ok"))
    assert jobs.outcomes[2] is died
    jobs = table(4)
    jobs.settle_ended(Worker(job=2, held=[0, 1]), died)
    jobs.fail(Worker(held=[1, 3]).held)
    assert sorted(jobs.waiting) == [1, 2, 3]
    assert 2 not in jobs.outcomes
    assert job_table._FAILED == 2
