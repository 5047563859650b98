"""Births whose children equal a parent: drawn again, counted, replayed and resumed."""

from collections import Counter

import pytest

import evocity
from evocity.errors import RecipeError
from evocity.operators import make
from evocity.search.breeding.births import breed_plans
from evocity.search.breeding.redraws import relax
from evocity.search.preparation.startup import Crew, compile_and_start
from evocity.search.resume.logged_plans import plan_of
from evocity.search.resume.prepared_run import read_preparation

RECIPE = """
[run]
name = "redraws"
seed = 5
population = 10
generations = 4
[map]
pixels = 128
[genome]
fit = false
block = 4
reach = 8
[[parents]]
map = "cape-town-salt-river"
[[parents]]
map = "lyon-1er"
[operators]
region_fusion = { weight = 1, cut = 0.0 }
[[fitness]]
name = "alignment"
[evaluation]
workers = 0
"""


def written(folder, redraws, more=""):
    path = folder / f"redraws-{redraws}.toml"
    keys = "[search]\n" + (f"redraws = {redraws}\n" if redraws is not None else "") + more
    path.write_text(RECIPE + keys)
    return evocity.read_recipe(path)


def carried_out(recipe, out, **settings):
    with evocity.Search(recipe, out=out, **settings) as search:
        for _ in search:
            pass
    return evocity.open_run(out)


def rows(run):
    columns = ["id", "parents", "operator", "genome", "made", "fitness.alignment"]
    return run.births(columns=columns).to_pylist()


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("redraws")
    return {
        number: carried_out(written(folder, number), folder / f"run-{number}")
        for number in (None, 0, 3)
    }


def naive_copies(run):
    """The births whose genome is that of one of their parents, one after the other."""
    digests = {birth.id: birth.digest for birth in run.individuals(list(range(len(run))))}
    return [
        birth.id
        for birth in run.individuals(list(range(len(run))))
        if any(digests[parent] == birth.digest for parent in birth.parents)
    ]


def test_at_most_one_of_forty_children_equals_a_parent(runs):
    assert len(naive_copies(runs[0])) > 10
    assert len(naive_copies(runs[3])) <= len(runs[3]) / 40


def test_credit_counts_copies_and_draws(runs):
    for run in runs.values():
        credit = run.credit()
        births = run.individuals(list(range(len(run))))
        assert credit["copies"].sum() == len(naive_copies(run))
        rejected = Counter(name for birth in births for name in birth.made.get("redrawn", ()))
        assert credit["redrawn"].to_dict() == {name: rejected[name] for name in credit.index}
    assert runs[3].credit()["redrawn"].sum() > 10
    assert runs[0].credit()["redrawn"].sum() == 0


def test_a_recipe_without_the_key_breeds_as_before(runs):
    assert rows(runs[None]) == rows(runs[0])


def test_draws_before_the_first_copy_are_the_same(runs):
    pairs = list(zip(rows(runs[0]), rows(runs[3]), strict=True))
    first = min(naive_copies(runs[0]))
    assert all(before == now for before, now in pairs[:first])
    assert '"redrawn"' in pairs[first][1]["made"]


def test_redrawn_births_are_replayed(runs):
    assert all(one.same for one in evocity.replay(runs[3].path))
    (redrawn, *_) = [row["id"] for row in rows(runs[3]) if '"redrawn"' in row["made"]]
    prepared, _ = read_preparation(runs[3], None)
    plan = plan_of(runs[3], prepared, redrawn)
    (birth,) = runs[3].individuals([redrawn])
    assert plan.rejected == birth.made["redrawn"]
    engine = compile_and_start(prepared, Crew(0), print)
    (child,) = breed_plans(engine, [plan])
    assert child.breeding.genome.digest == birth.digest


@pytest.mark.slow
@pytest.mark.parametrize("more", ["", "window = 4\n"])
def test_redraws_are_resumed_whatever_the_workers(tmp_path, runs, more):
    recipe = written(tmp_path, 3, more)
    whole = carried_out(recipe, tmp_path / "whole", workers=1)
    if not more:
        assert rows(whole) == rows(runs[3])
    with evocity.Search(recipe, out=tmp_path / "parts") as search:
        for generation in search:
            if generation.number == 2:
                break
    with evocity.Search.resume(tmp_path / "parts") as search:
        for _ in search:
            pass
    parts = evocity.open_run(tmp_path / "parts")
    assert rows(parts) == rows(whole)
    assert len(naive_copies(parts)) <= 1


@pytest.mark.slow
def test_omitted_genomes_of_redrawn_births_are_bred_again(tmp_path, runs):
    path = tmp_path / "omitted.toml"
    path.write_text(RECIPE + '[search]\nredraws = 3\n[log]\ngenomes = "front"\n')
    run = carried_out(evocity.read_recipe(path), tmp_path / "omitted")
    everything = list(range(len(run)))
    pairs = zip(run.individuals(everything), runs[3].individuals(everything), strict=True)
    assert all(one.genome.digest == other.digest for one, other in pairs)


def test_births_measured_elsewhere_are_drawn_again(tmp_path, runs):
    with evocity.Search(written(tmp_path, 3), out=tmp_path / "asked") as search:
        for _ in range(3):
            genomes = search.ask()
            cities = [evocity.decode(genome).city for genome in genomes]
            search.tell([{"alignment": float(evocity.fitness.alignment(city))} for city in cities])
    asked = rows(evocity.open_run(tmp_path / "asked"))
    same = [(row["id"], row["genome"], row["operator"]) for row in rows(runs[3])[: len(asked)]]
    assert [(row["id"], row["genome"], row["operator"]) for row in asked] == same


def test_other_operators_come_first(tmp_path):
    path = tmp_path / "several.toml"
    path.write_text(RECIPE.replace("[[fitness]]", "mutation = 1e-9\n[[fitness]]", 1))
    path.write_text(path.read_text() + "[search]\nredraws = 2\n")
    run = carried_out(evocity.read_recipe(path), tmp_path / "several")
    redrawn = [row for row in rows(run) if '"redrawn"' in row["made"]]
    assert {row["operator"] for row in redrawn} == {"mutation"}


def test_relaxed_operators_admit_more():
    strict = make("region_fusion", cut=0.0)
    relaxed = strict.relaxed()
    assert (relaxed.cut, relaxed.tolerance, relaxed.area_max) == (0.4, 24.0, 51_200.0)
    assert relaxed.relaxed().relaxed().cut == 1.0
    assert make("region_fusion", size_min=4, size_max=8, limit=9).relaxed().area_max is None
    assert make("pavement_fusion", tolerance=0.0).relaxed().tolerance == 1.0
    wide = make("region_fusion", area_max=9e6)
    for _ in range(16):
        wide = relax(wide)
    assert (wide.cut, wide.area_max) == (1.0, 1e7)


@pytest.mark.parametrize("wrong", [-1, 17, 1.5, True])
def test_redraws_have_a_range(tmp_path, wrong):
    with pytest.raises(RecipeError, match=r"search\.redraws"):
        evocity.Recipe(parents=["lyon-1er"], fitness=["alignment"], search={"redraws": wrong})
