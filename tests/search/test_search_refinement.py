"""Refinement: of one individual of a run, and as births of a search; and replaying one birth."""

import json
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_search_commands import SUMMED, steered
from test_search_run import rows, run

import evocity
from evocity.errors import EvocityError, OperatorError, RecipeError, RunError
from evocity.evaluation.evaluator import Evaluator
from evocity.fitness import Aims, Constraint, Objective, Wanted, crumbs, fsi, gsi
from evocity.operators import make
from evocity.search import Search, read_recipe, refine
from evocity.search.breeding.refinement.climb import Score, climb
from evocity.search.breeding.refinement.variables import (
    Tuning,
    height_tuning,
    level_tuning,
    parameter_tuning,
)
from evocity.search.preparation.startup import Crew, start_engine
from evocity.search.record.commands import Pick, Reweight
from evocity.search.resume import refine as refinement
from evocity.search.resume.logged_plans import plan_of
from evocity.search.resume.prepared_run import read_preparation
from evocity.search.resume.refine import Donors
from evocity.store import RunLog

REFINE = '[refine]\nbirths = 2\nevery = 2\nbudget = 6\nway = "heights"\nside = 2\n'
WANTED = """
[[fitness]]
name = "fsi"
target = 1.0
[[fitness]]
name = "gsi"
max = 0.9
"""


@pytest.fixture(scope="module")
def bred(tmp_path_factory):
    """A finished run of two towns by quarters, and its folder."""
    from towns import draw_town

    folder = tmp_path_factory.mktemp("bred")
    for seed, name in ((1, "left"), (2, "right")):
        np.save(folder / f"{name}.npy", draw_town(seed, side=96, buildings=16).heights)
    recipe = evocity.Recipe(
        folder=folder,
        parents=["left.npy", "right.npy"],
        map={"pixels": 96},
        genome={"lifs": 1200, "fit": False},
        fitness=[
            {"name": "fsi", "target": 1.2},
            {"name": "crumbs"},
            {"name": "gsi", "min": 0.01},
        ],
        run={"seed": 4, "population": 8, "generations": 3},
    )
    with Search(recipe, out=folder / "run", workers=0) as search:
        for _ in search:
            pass
    return folder / "run"


def contents(folder):
    return {one: one.read_bytes() for one in folder.rglob("*") if one.is_file()}


# -- one individual --------------------------------------------------------------------------------


@pytest.mark.slow_cases("lambda_field", "parameters")
@pytest.mark.parametrize("way", ["lambda_field", "heights", "parameters"])
def test_the_better_is_found_and_the_run_stays_as_it_is(bred, way):
    before, one = contents(bred), 29
    found = refine(bred, one, way=way, budget=12, side=2)
    again = refine(RunLog(bred), one, way=way, budget=12, side=2)
    assert contents(bred) == before
    assert found.genome == again.genome
    assert 0 < found.evaluations <= 12
    assert (found.failures, found.error, found.violation) == (0, None, 0)
    assert (found.score < found.score_before) == found.better
    (birth,) = RunLog(bred).individuals([one])
    assert found.before == birth.values
    told = found.genome.made["refined"]
    assert (told["way"], told["id"], told["evaluations"]) == (way, one, found.evaluations)
    assert json.loads(json.dumps(told)) == told
    if way == "heights":
        assert found.better
    assert (found.genome == birth.genome) == (not found.better)
    measured = evocity.fitness.fsi(found.city)
    assert float(measured) == pytest.approx(found.values["fsi"], abs=1e-6)


def test_fit_brings_the_map_nearer(bred):
    from towns import draw_town

    target = draw_town(1, side=96, buildings=16)
    found = refine(bred, 30, way="fit", towards=target, budget=8)
    fit = found.genome.made["fit"]
    assert fit["psnr_after"] > fit["psnr_before"]
    assert found.better
    assert found.evaluations <= 8


def test_what_cannot_be_refined_is_refused(bred, tmp_path):
    for wrong, says in (
        ({"way": "magic"}, "way = 'magic'"),
        ({"algorithm": "mma"}, "algorithm = 'mma'"),
        ({"budget": 0}, "budget = 0"),
        ({"side": 99}, "side = 99"),
        ({"way": "fit"}, "no map to fit to"),
        ({"towards": object()}, "a map to fit to"),
    ):
        with pytest.raises(EvocityError, match=says):
            refine(bred, 9, **wrong)
    with pytest.raises(RunError, match="no individual 999"):
        refine(bred, 999)
    with pytest.raises(RunError, match="no individual 999"):
        refine(bred, 9, others=[999])
    with pytest.raises(
        RunError, match="all other individuals have the same genome as individual 9"
    ):
        refine(bred, 9, others=[9])
    with pytest.raises(OperatorError, match="no operator bred individual"):
        refine(bred, 0, way="parameters")
    child = next(b for b in RunLog(bred).births().to_pylist() if b["operator"] != "source")
    with pytest.raises(OperatorError, match="no number 'size' to tune"):
        refine(bred, child["id"], way="parameters", tune=["size"])


def test_an_individual_that_failed_is_refused(toy, tmp_path):
    text = """

@evocity.fitness(goal="max")
def odd(city):
    assert number(city) % 3
    return 1.0
"""
    run(toy(text, max_failures=1.0, generations=1), tmp_path / "run", workers=0)
    failed = [b["id"] for b in RunLog(tmp_path / "run").births().to_pylist() if b["error"]]
    assert failed
    with pytest.raises(RunError, match=f"individual {failed[0]} failed"):
        refine(tmp_path / "run", failed[0])


def test_a_changed_measure_is_not_executed(toy, tmp_path):
    recipe = toy(generations=1)
    run(recipe, tmp_path / "run", workers=0)
    (recipe.parent / "toys.py").write_text("raise SystemExit('executed')")
    with pytest.raises(RunError, match="changed since the run began"):
        refine(tmp_path / "run", 9)


# -- the climb -------------------------------------------------------------------------------------


def aims(bound=10.0):
    return Aims(
        (
            Wanted(fsi, Objective(fsi, target=1.0)),
            Wanted(gsi, constraint=Constraint(gsi, high=bound)),
        )
    )


class Child:
    """Stands for a genome."""

    def __init__(self, name):
        self.digest = name


class Outcome:
    def __init__(self, status="ok", values=None, genome=None, error=None):
        self.status, self.values, self.genome, self.error = status, values, genome, error


def climbed(values_of, budget=60, algorithm="sbplx", bound=10.0, start=None):
    """A climb over two numbers that children are; ``values_of`` them, or raises."""
    tuning = Tuning(
        [], np.zeros(2), np.zeros(2), np.ones(2), np.full(2, 0.5), tuple, np.random.default_rng(0)
    )
    points = {}

    def breed(point, parents, rng):
        child = Child(str(point))
        points[child.digest] = point
        return Outcome(genome=child)

    def measure(child, parents):
        values = values_of(*points[child.digest])
        return Outcome("error" if values is None else "ok", values)

    score = Score.of(aims(bound), np.array([[0.0], [2.0]]))
    start = start or {"fsi": 3.0, "gsi": 0.5}
    return climb(Child("start"), start, tuning, score, breed, measure, budget, algorithm)


@pytest.mark.parametrize("algorithm", ["sbplx", "cobyla", "bobyqa"])
def test_the_best_child_is_told(algorithm):
    found = climbed(
        lambda x, y: {"fsi": 1 + abs(x - 0.7) + abs(y - 0.2), "gsi": 0.5}, 150, algorithm
    )
    assert found.better
    assert found.score == (0.0, pytest.approx((found.values["fsi"] - 1) / 2))
    assert found.values["fsi"] < 1.1
    assert found.evaluations <= 150


def test_no_child_that_breaks_a_bound_comes_before_one_that_keeps_it():
    found = climbed(lambda x, y: {"fsi": 1.0 + (x < 0.5), "gsi": 0.5 + (x >= 0.5)}, bound=1.0)
    assert found.score[0] == 0
    assert found.values["fsi"] == 2.0
    worse = climbed(lambda x, y: {"fsi": 1.0, "gsi": 2.0}, bound=1.0)
    assert not worse.better
    mended = climbed(lambda x, y: {"fsi": 9.0, "gsi": 0.45 - 0.1 * x}, bound=0.4)
    assert mended.better
    assert mended.score[0] == 0  # what it was refined from broke the bound


@pytest.mark.parametrize("algorithm", ["sbplx", "cobyla", "bobyqa"])
@pytest.mark.parametrize("raised", [KeyboardInterrupt, ZeroDivisionError])
def test_what_a_measure_raises_passes_through(algorithm, raised):
    asked = []

    def fails(x, y):
        asked.append(x)
        if len(asked) == 4:
            raise raised("here")
        return {"fsi": 2 - x, "gsi": 0.5}

    with pytest.raises(raised, match="here"):
        climbed(fails, algorithm=algorithm)
    assert len(asked) == 4


def test_ctrl_c_in_a_measure_ends_a_refinement(toy, tmp_path, monkeypatch):
    run(toy(generations=1), tmp_path / "run", workers=0)
    calls = []

    def pressed(self, *job):
        calls.append(job)
        raise KeyboardInterrupt

    monkeypatch.setattr("evocity.evaluation.evaluator.Evaluator._measure", pressed)
    with pytest.raises(KeyboardInterrupt):
        refine(tmp_path / "run", 9, way="heights", budget=5)
    assert len(calls) == 1


def test_failed_children_are_counted_and_not_chosen(toy, tmp_path):
    text = """

@evocity.fitness(goal="min")
def picky(city):
    if number(city) % 2:
        raise ValueError("not this one")
    return float(city.heights.sum())
"""
    run(toy(text, generations=1, max_failures=1.0), tmp_path / "run", workers=0)
    alive = next(b for b in RunLog(tmp_path / "run").births().to_pylist() if not b["error"])
    found = refine(tmp_path / "run", alive["id"], way="heights", budget=12)
    assert found.failures > 0
    assert "not this one" in found.error
    assert found.values["picky"] <= found.before["picky"] or not found.better


@pytest.mark.slow
def test_a_lambda_field_finds_what_another_has(bred):
    """Floor space as wanted: some blocks of a higher town."""
    opened = RunLog(bred)
    births = [one for one in opened.individuals(opened.births()["id"].to_pylist()) if one.ok]
    births.sort(key=lambda one: one.values["crumbs"])
    found = [refine(bred, one.id, budget=30, side=2, rounds=3) for one in births[:4]]
    assert any(one.better for one in found)
    assert all(one.score < one.score_before for one in found if one.better)
    assert all(set(one.others) <= {birth.id for birth in births} for one in found)


@pytest.mark.slow
@pytest.mark.parametrize("rounds", [None, 2])
def test_rounds_spend_the_budget_and_no_more(bred, monkeypatch, rounds):
    asked = []
    climbing = refinement.climb
    monkeypatch.setattr(
        refinement, "climb", lambda *these: asked.append(these[6]) or climbing(*these)
    )
    found = refine(bred, 29, budget=30, side=2, rounds=rounds)
    assert found.evaluations == 30
    assert max(asked) == (10 if rounds is None else 15)
    assert len(asked) >= 30 / max(asked)


def test_a_variant_is_offered_beside_one_of_the_living_unless_others_are_named(bred):
    opened = RunLog(bred)
    prepared, _ = read_preparation(opened)
    living = opened.members(3)["id"].to_pylist()
    (birth,) = opened.individuals(living[:1])
    pool = start_engine(prepared, Crew(0), (), print, print)
    told = {one.genome.digest for one in opened.individuals(opened.births()["id"].to_pylist())}

    def offers(ids, seed=0):
        sources = [one.genome for one in prepared.sources]
        breed = lambda *job: pool.run("breed", [job])[0]  # noqa: E731
        return Donors(opened, birth, ids, prepared.recipe, sources, breed, seed)

    drawn = offers(None)
    other, variant = drawn.offer(birth.genome)
    assert other.digest in told
    assert variant.digest not in told
    assert set(drawn.offered_ids) <= set(living)
    assert [one.digest for one in offers(None).offer(birth.genome)] == [
        other.digest,
        variant.digest,
    ]
    assert [one.digest for one in offers(None, 1).offer(birth.genome)][1] != variant.digest
    named = [one for one in living if one != birth.id][:2]
    only = offers(named)
    assert [one.digest for one in only.offer(birth.genome)] == [
        one.genome.digest for one in opened.individuals(named)
    ]
    assert list(only.offered_ids) == named


@given(st.integers(1, 9), st.integers(1, 3), st.integers(0, 5), st.data())
def test_levels_sum_up_to_every_field(side, others, seed, data):
    """The first numbers are of the whole map, and each field of λ has a point."""
    fields = []
    tuning = level_tuning(
        None,
        [None] * others,
        side,
        lambda side, values: fields.append(values),
        np.random.default_rng(seed),
    )
    count = tuning.start.size
    assert count >= others * side * side
    tuning.operator(tuning.start)
    assert not fields[-1].any()
    for number in range(others):
        tuning.operator(np.eye(count)[number])
        assert sorted(fields[-1]) == [0.0] * (others - 1) * side**2 + [1.0] * side**2
    wanted = np.array(
        data.draw(st.lists(st.floats(0, 1), min_size=others * side**2, max_size=others * side**2))
    )
    single = np.zeros((count, others * side**2))
    for number in range(count):
        tuning.operator(np.eye(count)[number])
        single[number] = fields[-1]
    finest = np.flatnonzero(single.sum(axis=1) == 1)[-others * side**2 :]
    point = np.zeros(count)
    point[finest] = single[finest] @ wanted
    tuning.operator(point)
    np.testing.assert_allclose(fields[-1], wanted)


@pytest.mark.parametrize("algorithm", ["sbplx", "cobyla", "bobyqa"])
def test_children_that_fail_are_no_way_out_of_a_broken_bound(algorithm):
    def fails_afar(x, y):
        if x > 0.3:
            raise ArithmeticError
        return {"fsi": 1.0, "gsi": 50.0 - 10 * x - 30 * y}

    def safely(x, y):
        try:
            return fails_afar(x, y)
        except ArithmeticError:
            return None

    found = climbed(safely, 100, algorithm, bound=0.02, start={"fsi": 1.0, "gsi": 60.0})
    assert found.better
    assert found.failures < found.evaluations / 2


def test_parameters_that_do_not_go_together_cost_a_child_alone(bred, monkeypatch):
    def refuse(name, **parameters):
        raise OperatorError("these", "others", "change them")

    found = refine(bred, 29, way="parameters", budget=4)
    assert found.failures == 0
    tuning = Tuning(
        [], np.zeros(1), np.zeros(1), np.ones(1), np.full(1, 0.5), refuse, np.random.default_rng(0)
    )
    score = Score.of(aims(), np.array([[0.0], [2.0]]))
    values = {"fsi": 3.0, "gsi": 0.5}
    told = climb(Child("a"), values, tuning, score, None, None, 3, "sbplx")
    assert (told.better, told.failures, told.evaluations) == (False, 3, 3)
    assert "these" in told.error


def test_a_lone_individual_is_left_as_it_is(toy, tmp_path):
    lines = REFINE.replace("heights", "lambda_field") + "[search]\nalgorithm = 'single'\n"
    recipe = toy(recipe=lines, generations=2, population=2)
    text = recipe.read_text().replace(
        '[[fitness]]\nfile = "toys.py"', '[[fitness]]\nname = "gsi"\ntarget = 0.3'
    )
    recipe.write_text(text)
    run(recipe, tmp_path / "run", workers=0)
    assert RunLog(tmp_path / "run").births()["status"].to_pylist() == ["ok"] * 6


def test_those_who_measure_elsewhere_are_not_measured_for(toy):
    recipe = read_recipe(toy(recipe=WANTED + REFINE, generations=2))
    with Search(recipe, workers=0) as search:
        for _ in range(3):
            asked = search.ask()
            known = {"spread": 1.0, "roof": 2.0, "fsi": 1.0, "gsi": 0.5}
            generation = search.tell([known | {"spread": float(k)} for k in range(len(asked))])
        assert generation.births == 24
        assert search.finished


# -- what is tuned ---------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_each_birth_of_a_run_is_replayed(toy, tmp_path, seed):
    asked = {0: [Pick(ids=(3, 5), share=0.9)], 1: [Reweight(weights={"mutation": 0, "gsi": 50.0})]}
    extra = "[search]\nadapt = true\n" * seed + SUMMED + REFINE
    steered(toy(recipe=extra, generations=4), tmp_path / "run", asked)
    replayed(tmp_path / "run")


@pytest.mark.slow
def test_births_by_quarters_are_replayed(bred):
    replayed(bred)


def replayed(path):
    opened = RunLog(path)
    prepared, _ = read_preparation(opened)
    for birth in opened.individuals(opened.births()["id"].to_pylist()):
        plan = plan_of(opened, prepared, birth.id)
        assert (plan.id, plan.name, plan.parents) == (birth.id, birth.operator, birth.parents)
        if plan.operator is None:
            assert plan.genomes[0] == birth.genome
        elif hasattr(plan.operator, "bred_within"):
            here = Evaluator(prepared.setup)
            assert here.breed(plan.operator, plan.genomes, plan.rng).genome == birth.genome
        else:
            assert plan.operator(plan.genomes, plan.rng).digest == birth.genome.digest


def test_parameters_begin_as_they_were_and_stay_within_their_ranges(bred):
    opened = RunLog(bred)
    prepared, _ = read_preparation(opened)
    seen = set()
    for birth in opened.individuals(opened.births()["id"].to_pylist()):
        if birth.operator == "source" or birth.operator in seen:
            continue
        seen.add(birth.operator)
        plan = plan_of(opened, prepared, birth.id)
        tuning = parameter_tuning(plan, prepared.recipe.parameters(birth.operator))
        assert (tuning.lower <= tuning.start).all()
        assert (tuning.start <= tuning.upper).all()
        first = tuning.operator(tuning.start)(tuning.parents, tuning.generator)
        assert first.digest == birth.genome.digest
        for end in (tuning.lower, tuning.upper):
            tuning.operator(end)  # is allowed
    assert seen >= set(prepared.recipe.operators)  # and by what founders are bred


def test_the_field_of_heights_begins_with_the_individual(bred):
    (birth,) = RunLog(bred).individuals([9])
    tuning = height_tuning(birth.genome, 3, partial(make, "height_field"))
    child = tuning.operator(tuning.start)(tuning.parents, tuning.generator)
    assert child.digest == birth.genome.digest


def test_a_score_is_in_units_of_the_first_births():
    three = Aims((Wanted(crumbs, Objective(crumbs)), Wanted(fsi, Objective(fsi, target=1.0))))
    score = Score.of(three, np.array([[2.0, 0.5], [6.0, 0.5]]))
    assert score({"crumbs": 4.0, "fsi": 1.75}) == (0.0, pytest.approx(0.5 + 0.25))
    heavy = Score.of(three, np.array([[2.0, 0.5], [6.0, 0.5]]), weights=(2.0, 0.0))
    assert heavy({"crumbs": 4.0, "fsi": 9.0}) == (0.0, pytest.approx(1.0))
    assert Score.of(aims(0.4), np.array([[0.0], [1.0]]))({"fsi": 1.0, "gsi": 0.5})[0] > 0


# -- births of a search ----------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("way", ["heights", "lambda_field"])
def test_some_births_are_refined_and_are_births_like_any_other(toy, tmp_path, way):
    recipe = toy(recipe=WANTED + REFINE.replace("heights", way), generations=4)
    run(recipe, tmp_path / "whole", workers=0)
    run(recipe, tmp_path / "two", workers=2)
    expected = rows(tmp_path / "whole")
    assert rows(tmp_path / "two") == expected
    births = RunLog(tmp_path / "whole").births().to_pylist()
    mine = [one for one in births if one["operator"] == "refinement"]
    assert {(one["generation"], one["id"] % 8) for one in mine} == {
        (generation, slot) for generation in (2, 4) for slot in (6, 7)
    }
    assert all(one["status"] == "ok" for one in mine)
    for one in RunLog(tmp_path / "whole").individuals([one["id"] for one in mine]):
        told = one.genome.made["refined"]
        assert told["score"] <= told["score_before"]
        assert 1 <= told["evaluations"] <= 6
        assert len(one.parents) == (1 if way == "heights" else 3)
        assert sum(told["weights"]) == pytest.approx(3, abs=1e-3)
    with Search(read_recipe(recipe), out=tmp_path / "stopped", workers=0) as search:
        for generation in search:
            if generation.number == 2:
                break
    with Search.resume(tmp_path / "stopped") as search:
        for _ in search:
            pass
    assert rows(tmp_path / "stopped") == expected


@pytest.mark.slow
def test_refinement_finds_what_is_wanted(toy, tmp_path):
    wanted = '[[fitness]]\nname = "mean_height"\ntarget = 30.0\n'
    many = REFINE.replace("budget = 6", "budget = 30")
    recipe = toy(recipe=wanted + many, generations=2)
    run(recipe, tmp_path / "run", workers=0)
    births = RunLog(tmp_path / "run").births(2)
    births = births.to_pylist()
    refined = [b["fitness.mean_height"] for b in births if b["operator"] == "refinement"]
    others = [b["fitness.mean_height"] for b in births if b["operator"] != "refinement"]
    assert max(refined) > max(others)


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        ("births = 9", "refine.births: 9 of 8 births"),
        ("births = -1", "refine.births: -1"),
        ("budget=0", "refine.budget: 0; allowed: 1 or more"),
        ('way = "magic"', "refine.way"),
        ("births = 1\nside = 40", "refine.side: 40"),
        ("birth = 1", "did you mean births"),
        ('algorithm = "mma"', "refine.algorithm"),
    ],
)
def test_faults_of_the_section_are_told(toy, lines, says):
    with pytest.raises(RecipeError, match=says):
        read_recipe(toy(recipe=f"[refine]\n{lines}\n"))


def test_an_algorithm_that_breeds_by_itself_refines_nobody(toy):
    lines = "[refine]\nbirths = 1\n[search]\nalgorithm = 'cma'\n"
    with pytest.raises(RecipeError, match="this algorithm breeds by itself"):
        read_recipe(toy(recipe=lines))


def test_births_that_learnt_from_others_are_not_replayed(toy, tmp_path):
    recipe = toy(recipe="[search]\nalgorithm = 'cma'\nside = 2\n", generations=2)
    run(recipe, tmp_path / "run", workers=0)
    opened = RunLog(tmp_path / "run")
    prepared, _ = read_preparation(opened)
    assert plan_of(opened, prepared, 5).operator.values == pytest.approx(
        opened.individuals([5])[0].genome.made["values"], abs=1e-4
    )
    with pytest.raises(RunError, match="bred individual 9 with its own operator"):
        plan_of(opened, prepared, 9)
