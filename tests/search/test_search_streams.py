"""Engines that stream: jobs are drawn as there is room, outcomes come as they are done."""

import os
import subprocess
import time
from itertools import count
from types import SimpleNamespace

import pytest
from codes import uniformly

from evocity import fitness
from evocity.evaluation import Here, Workers, linux_processes, worker_seat
from evocity.evaluation.evaluator import Outcome, Setup
from evocity.evaluation.kernel_warmup import DECODE
from evocity.kinds import KINDS
from evocity.search.breeding.birth_plans import BirthPlan
from evocity.search.breeding.births import stream_offspring

MEASURE = """
import time
import evocity

@evocity.fitness(goal="max")
def named(city, genome):
    name = genome.cities[0]
    if name.startswith("sleep"):
        time.sleep(float(name[5:]))
        return 0.0
    if name == "bad":
        raise ValueError("bad")
    return float(name)
"""


@pytest.fixture(scope="session")
def genome(town):
    return uniformly(town).genome


@pytest.fixture
def engine(tmp_path):
    """Function that makes an engine with so many workers, 0 for this process."""
    engines = []

    def make(workers: int, timeout: float = 30.0):
        path = tmp_path / "named.py"
        path.write_text(MEASURE)
        fitness.load_file(path)
        header = SimpleNamespace(chromosome=KINDS["fabric"], measures=("named",), recorded=())
        # as searches do: else each worker would load the kernels by itself, in a birth's time
        setup = Setup(header, (("named", str(path)),), sides=4, parts=(DECODE,))
        engines.append(Workers(setup, workers, timeout) if workers else Here(setup))
        return engines[-1]

    yield make
    for one in engines:
        one.close()


def job(genome, name):
    return (genome.replace(cities=(str(name),)),)


@pytest.mark.parametrize("workers", [0, 1, 3])
def test_a_stream_has_the_outcomes_of_a_run_by_their_numbers(engine, genome, workers):
    pool = engine(workers)
    names = [*range(17), "bad", *range(18, 30)]
    jobs = [job(genome, name) for name in names]
    told = dict(pool.stream("evaluate", iter(jobs)))
    run = pool.run("evaluate", jobs)
    assert sorted(told) == list(range(30))
    assert [(told[n].status, told[n].values) for n in range(30)] == [
        (one.status, one.values) for one in run
    ]
    assert [one.status for one in run].count("error") == 1
    assert all(one.values == {"named": n} for n, one in enumerate(run) if n != 17)
    assert list(pool.stream("evaluate", iter(()))) == [] == pool.run("evaluate", [])


@pytest.mark.parametrize("workers", [0, 2])
def test_jobs_are_drawn_when_there_is_room_and_wait_for_outcomes_where_told(
    engine, genome, workers
):
    """Each job may be drawn once the outcome of the third before it is known."""
    pool, known, drawn = engine(workers), set(), []

    def jobs():
        for number in range(20):
            while not known >= set(range(number - 2)):
                yield None
            drawn.append((number, len(known)))
            yield job(genome, number)

    for number, outcome in pool.stream("evaluate", jobs()):
        assert outcome.values == {"named": number}
        known.add(number)
    assert known == set(range(20))
    assert all(number - done <= 3 for number, done in drawn)


@pytest.mark.parametrize("workers", [0, 2])
def test_a_stream_without_end_is_drawn_a_little_ahead_and_may_be_left(engine, genome, workers):
    pool, drawn = engine(workers), count()
    stream = pool.stream("evaluate", (job(genome, next(drawn)) for _ in count()))
    taken = [next(stream) for _ in range(40)]
    stream.close()
    held = worker_seat.MOST_HELD if workers else 0  # outcomes that wait for a check
    assert next(drawn) <= 40 + (5 + held) * max(1, workers)
    assert len({number for number, _ in taken}) == 40
    assert [one.values for one in pool.run("evaluate", [job(genome, 7)])] == [{"named": 7}]


@pytest.mark.parametrize("workers", [0, 2])
def test_to_wait_for_nothing_is_told(engine, genome, workers):
    with pytest.raises(RuntimeError, match="no job is at work"):
        list(engine(workers).stream("evaluate", iter([None, job(genome, 1)])))


def test_outcomes_come_as_they_are_done_and_late_ones_cost_themselves_alone(engine, genome):
    pool = engine(2, timeout=4.0)
    pool.run("evaluate", [job(genome, 1)] * 2)  # workers start
    names = ["sleep600", *range(1, 9)]
    told = list(pool.stream("evaluate", iter([job(genome, name) for name in names])))
    assert [number for number, _ in told][-1] == 0
    assert told[-1][1].status == "timeout"
    assert {outcome.status for _, outcome in told[:-1]} == {"ok"}


class Losing:
    """An engine that loses every third child, and breeds it when it is asked again."""

    def __init__(self):
        self.asked = []

    def stream(self, method, jobs):
        assert method == "born"
        at_work, number = [], -1
        jobs = iter(jobs)
        while True:
            while (one := next(jobs, "end")) not in (None, "end"):
                number += 1
                at_work.append((number, one))
            if not at_work:
                return
            done, (_, genomes, rng, measured) = at_work.pop()  # the last comes first
            self.asked.append((rng, measured))
            if not measured:
                yield done, Outcome("ok", None, 0.5, genome=genomes[0])
            elif rng % 3 == 0:
                yield done, Outcome("timeout", "no result", 9.0)
            else:
                yield done, Outcome("ok", None, 1.0, {"named": rng}, genomes[0])


@pytest.mark.skipif(not linux_processes.LINUX, reason="what Linux gives")
@pytest.mark.parametrize("where", ["drawing", "telling", "waiting"])
def test_time_in_which_all_stand_still_counts_for_no_deadline(engine, genome, where):
    """As Ctrl-Z and fg do. Jobs of a quarter second have two, and all stand still longer,
    while a job is drawn, while the outcome of another is at hand, or while the pool waits."""
    pool, me = engine(2, timeout=2.0), os.getpid()

    def stand_still(after: float = 0.0) -> subprocess.Popen:
        workers = [seat.pid for seat in pool._seats.values()]
        all_of_us = " ".join(map(str, (me, *workers)))
        words = f"sleep {after}; kill -STOP {all_of_us}; sleep 2.5; kill -CONT {all_of_us}"
        helper = subprocess.Popen(["sh", "-c", words])
        if not after:
            time.sleep(0.3)  # until stopped
        return helper

    def drawn():
        for number in range(8):
            if where == "drawing" and number == 7:
                helpers.append(stand_still())
            yield job(genome, "sleep.25")

    helpers, outcomes = [], []
    for _, outcome in pool.stream("evaluate", drawn()):
        outcomes.append(outcome)
        if len(outcomes) == 3 and where != "drawing":
            helpers.append(stand_still(0.05 * (where == "waiting")))
    assert [one.wait() for one in helpers] == [0]
    assert [(one.status, one.error) for one in outcomes] == [("ok", None)] * 8


def test_lost_children_are_bred_again_while_others_are_at_work(genome):
    pool, operator = Losing(), SimpleNamespace(name="some")
    plans = [BirthPlan(n, operator, (0,), (genome,), n) for n in range(7)]
    found = sorted(stream_offspring(pool, iter(plans)), key=lambda one: one.plan.id)
    assert [one.plan.id for one in found] == list(range(7))
    assert [one.evaluation.status for one in found] == [
        "timeout" if n % 3 == 0 else "ok" for n in range(7)
    ]
    assert all(one.breeding.status == "ok" and one.breeding.genome is genome for one in found)
    assert found[3].evaluation.seconds == 9.0
    assert sorted(rng for rng, measured in pool.asked if not measured) == [0, 3, 6]
    early = [one.plan.id for one in stream_offspring(Losing(), iter(plans))]
    assert early != sorted(early)
    assert sorted(early) == list(range(7))
