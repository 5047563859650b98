"""Parents that were bred before, and recipes made in Python."""

import numpy as np
import pytest
from test_search_run import rows, run

import evocity
from evocity import Recipe, decode, open_run
from evocity.errors import EvocityError, GenomeError, RecipeError, RunError
from evocity.search import Search, read_recipe


@pytest.fixture
def evening(toy, tmp_path):
    """A run that is over, and the recipe of another whose parents are its children."""
    run(toy(genome="block = 4\nfit = false\nsettle = false"), tmp_path / "evening", workers=0)
    opened = open_run(tmp_path / "evening")
    opened.genome(9).write(tmp_path / "child.parquet")
    text = (tmp_path / "toy.toml").read_text()
    maps = text[text.index("[[parents]]") : text.index("[operators]")]

    def write(parents, **replaced):
        again = text.replace(maps, "".join(f"[[parents]]\n{one}\n" for one in parents))
        for old, new in replaced.items():
            assert old in again
            again = again.replace(old, new)
        (tmp_path / "night.toml").write_text(again)
        return tmp_path / "night.toml"

    return write


CHILDREN = ('run = "evening"\nid = 17', 'genome = "child.parquet"', 'map = "left.npy"')


@pytest.mark.slow
def test_a_night_starts_from_the_children_of_another(evening, tmp_path):
    recipe = evening(CHILDREN)
    for count in (0, 2):
        run(recipe, tmp_path / f"night-{count}", workers=count)
    assert rows(tmp_path / "night-0") == rows(tmp_path / "night-2")
    night, before = open_run(tmp_path / "night-0"), open_run(tmp_path / "evening")
    assert night.header.cities[:3] == ("evening-17", "child", "left")
    for number, identifier in enumerate((17, 9)):
        founder, child = night.genome(number), before.genome(identifier)
        assert founder.pavement == child.pavement
        np.testing.assert_array_equal(founder.sigma, child.sigma)
        np.testing.assert_array_equal(decode(founder).city.heights, decode(child).city.heights)
        assert (founder.parent == number).all()
        assert founder.cities == night.header.cities
        city = night.sources()[number].city
        np.testing.assert_array_equal(city.heights, decode(child).city.heights)
    assert night.genome(0).made["bred"]["operator"] == before.genome(17).made["operator"]


def test_it_goes_on_without_what_it_began_with(evening, tmp_path):
    recipe = evening(CHILDREN)
    run(recipe, tmp_path / "whole", workers=0, generations=3)
    run(recipe, tmp_path / "cut", workers=0, generations=1)
    (tmp_path / "evening").rename(tmp_path / "away")
    (tmp_path / "child.parquet").unlink()
    with Search.resume(tmp_path / "cut", workers=0, generations=3) as search:
        list(search)
    assert rows(tmp_path / "cut") == rows(tmp_path / "whole")


def test_a_bred_parent_may_be_compared_with_and_be_like(evening, tmp_path):
    recipe = evening(CHILDREN)
    more = '[[fitness]]\nname = "gsi"\nlike = "evening-17"\n'
    recipe.write_text(recipe.read_text() + more)
    run(recipe, tmp_path / "night", workers=0, generations=0)
    city = decode(open_run(tmp_path / "evening").genome(17)).city
    noted = open_run(tmp_path / "night").provenance["fitness"][-1]
    assert noted["target"] == evocity.fitness.get("gsi")(city)
    Search.resume(tmp_path / "night", workers=0, generations=1).close()


@pytest.mark.parametrize(
    ("parent", "says"),
    [
        ('genome = "nothing.parquet"', "'nothing.parquet' is not a file"),
        ('run = "nowhere"\nid = 3', "'nowhere' is not a run folder"),
        ('run = "evening"', "run without id"),
        ('map = "left.npy"\nid = 3', "id without run"),
        ('map = "left.npy"\ngenome = "child.parquet"', "map and genome"),
        ('name = "west"', "no map; allowed: one of map, genome and run"),
        (
            'genome = "child.parquet"\ncenter = [4.8, 45.7]',
            "the key 'genome' is given together with center",
        ),
        ('run = "evening"\nid = -1', "0 or more"),
    ],
)
def test_parents_of_no_one_place_are_faults(evening, parent, says):
    with pytest.raises(RecipeError, match=says):
        read_recipe(evening([parent]))


def test_individuals_that_were_never_born_or_failed_are_refused(toy, tmp_path):
    body = """
@evocity.fitness(goal="max")
def some(city):
    if number(city) % 3 == 0:
        raise ValueError("no")
    return 1.0
"""
    text = toy(body, max_failures=1).read_text()
    run(tmp_path / "toy.toml", tmp_path / "evening", workers=0)
    births = open_run(tmp_path / "evening").births().to_pylist()
    failed = next(b["id"] for b in births if b["status"] != "ok")
    for identifier, says in ((99, "no individual 99"), (failed, f"{failed} failed")):
        parent = f'run = "evening"\nid = {identifier}'
        (tmp_path / "night.toml").write_text(text.replace('map = "right.npy"', parent))
        with pytest.raises(RunError, match=says):
            run(tmp_path / "night.toml", tmp_path / "night", workers=0)
        assert not (tmp_path / "night").exists()


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("pixels = 64", "pixels = 32", "64 × 64 px of 2 m(.|\n)*32 × 32 px of 2 m"),
        ("metres_per_pixel = 2.0", "metres_per_pixel = 1.0", "of 2 m(.|\n)*of 1 m"),
        ("[genome]", "[genome]\nsigma_max = 0.01", "up to 0.9"),
    ],
)
def test_genomes_of_another_window_or_cap_are_refused(evening, tmp_path, old, new, says):
    with pytest.raises(GenomeError, match=says):
        run(evening(CHILDREN[:2], **{old: new}), tmp_path / "night", workers=0)
    assert not (tmp_path / "night").exists()


# -- recipes made in Python ------------------------------------------------------------------


def test_a_recipe_made_in_python_breeds_as_its_text(toy, tmp_path):
    read = read_recipe(toy())
    made = Recipe(
        folder=tmp_path,
        run={"name": "toy", "seed": np.int64(3), "population": 8, "generations": 3},
        map={"pixels": 64, "metres_per_pixel": 2.0},
        genome={"block": 4, "fit": False, "lifs": None},
        parents=["left.npy", {"map": tmp_path / "right.npy"}],
        operators={
            "pavement_fusion": {"weight": 4, "size_max": 6, "size_min": 2},
            "lambda_crossover": 1,
            "mutation": 2,
        },
        fitness=[{"file": "toys.py"}],
        evaluation={"workers": 0},
    )
    with Search(made, out=tmp_path / "made") as search:
        list(search)
    with Search(read, out=tmp_path / "read", workers=0) as search:
        list(search)
    ours, theirs = (open_run(tmp_path / one) for one in ("made", "read"))
    columns = ["generation", "id", "parents", "operator", "genome", "fitness.spread"]
    assert ours.births(columns=columns).equals(theirs.births(columns=columns))
    (tmp_path / "again.toml").write_text(ours.recipe_text)
    assert read_recipe(tmp_path / "again.toml").run == made.run
    Search.resume(tmp_path / "made", workers=0, generations=4).close()


def test_measures_of_the_session_are_named_by_themselves(toy, tmp_path):
    toy()

    @evocity.fitness(goal="max")
    def tallest(city):
        return float(city.heights.max())

    made = Recipe(
        folder=tmp_path,
        parents=["left.npy", "right.npy"],
        fitness=[tallest, "alignment"],
        run={"record": ["crumbs"]},
        map={"pixels": 64},
    )
    assert [one.name for one in made.measures] == ["tallest", "alignment"]
    assert [one.name for one in made.recorded] == ["crumbs"]


@pytest.mark.parametrize(
    ("sections", "says"),
    [
        ({}, "parents: missing"),
        ({"parents": ["lyon"], "fitness": ["gsi"]}, "'lyon' is neither a file"),
        ({"parents": ["lyon-1er"], "fitness": ["alignmnt"]}, "did you mean alignment"),
        ({"parents": ["lyon-1er"], "fitness": ["crumbs"], "rum": {}}, "did you mean run"),
        ({"parents": [object()], "fitness": ["crumbs"]}, "cannot be written as TOML"),
        ({"parents": 3, "fitness": ["crumbs"]}, "a list"),
        ({"parents": ["lyon-1er"], "fitness": ["crumbs"], "run": {"seed": -1}}, "run.seed: -1"),
    ],
)
def test_faults_of_recipes_made_in_python_are_told_alike(sections, says):
    with pytest.raises(EvocityError, match=says):
        Recipe(**sections)
