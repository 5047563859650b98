"""`within`: measures of a part of the map, in recipes, workers, run folders and on resume."""

import json
import shutil

import numpy as np
import pytest
from test_search_recipe import faults
from test_search_run import rows, run

from evocity import fitness
from evocity.citymap import CityMap
from evocity.coding import decode
from evocity.errors import MapError, RecipeError, RunError
from evocity.evaluation.evaluator import Evaluator
from evocity.io import write_map
from evocity.report import write_report
from evocity.search import Search, archive, read_recipe
from evocity.search.preparation.preparation import prepare
from evocity.store import RunLog

GOALS = """
[[fitness]]
name = "gsi"
target = 0.3
within = "quarter.npy"
[[fitness]]
name = "gsi"
target = 0.6
within = "disc.npy"
[[fitness]]
name = "gsi"
min = 0.1
"""


def masks() -> dict[str, np.ndarray]:
    y, x = np.indices((64, 64))
    return {
        "quarter": (y >= 32) & (x < 20),
        "disc": (y - 20) ** 2 + (x - 40) ** 2 < 18**2,
    }


def parted(toy, goals=GOALS, **settings):
    path = toy(recipe=goals, **settings)
    for name, mask in masks().items():
        np.save(path.with_name(f"{name}.npy"), mask.astype(np.float32))
    return path


@pytest.mark.slow_cases("2")
@pytest.mark.parametrize("workers", [0, 2])
def test_each_goal_is_of_its_own_part(toy, tmp_path, workers):
    run(parted(toy, population=6, generations=1), tmp_path / "run", workers=workers)
    found = RunLog(tmp_path / "run")
    assert found.header.measures == ("spread", "roof", "gsi@quarter", "gsi@disc", "gsi")
    for row in found.births().to_pylist():
        built = decode(found.genome(row["id"])).city.heights > 1.5
        for name, mask in masks().items():
            assert row[f"fitness.gsi@{name}"] == built[mask].mean()
        assert row["fitness.gsi"] == built.mean()
    noted = found.provenance["within"]
    assert [one["name"] for one in noted] == ["quarter.npy", "disc.npy"]
    assert [one.get("within") for one in found.provenance["fitness"]][2:] == [
        "quarter.npy",
        "disc.npy",
        None,
    ]
    assert all(np.array_equal(a, b) for a, b in zip(found.parts(), masks().values(), strict=True))
    assert len(archive(found)) > 0
    page = write_report(tmp_path / "run").read_text()
    assert "gsi@quarter" in page
    assert "0.3 is wanted" in page


def test_by_hand_all_is_measured_within_a_part_but_what_is_of_one_already(toy):
    goals = GOALS + '[[fitness]]\nname = "integrity"\n'
    prepared = prepare(read_recipe(parted(toy, goals)))
    genome = prepared.sources[0].genome
    mask = np.zeros((64, 64), bool)
    mask[:20, 10:30] = True
    found = Evaluator(prepared.setup).evaluate_within(genome, fitness.Part("here", mask))
    city = decode(genome).city
    built, cut = city.heights > 1.5, city.within(mask)
    assert found.status == "ok"
    parts = masks()
    assert found.values == {
        "spread": pytest.approx(float(cut.heights.std())),
        "roof": pytest.approx(float(cut.heights.mean())),
        "gsi": built[mask].mean(),
        "gsi@quarter": built[parts["quarter"]].mean(),
        "gsi@disc": built[parts["disc"]].mean(),
    }
    assert "integrity cannot be limited" in found.error  # it asks for the genome of the whole
    found = Evaluator(prepared.setup).evaluate_within(genome, fitness.Part("disc", parts["disc"]))
    assert set(found.values) == {"gsi", "gsi@quarter", "gsi@disc"}
    assert "spread cannot be limited to disc: this part of the map is" in found.error


@pytest.mark.slow
def test_births_do_not_depend_on_workers_nor_on_a_stop(toy, tmp_path):
    goals = GOALS + '[[fitness]]\nname = "fabric_distance"\nwithin = "disc.npy"\n'
    recipe = parted(toy, goals, population=6, max_failures=1.0)
    run(recipe, tmp_path / "0", workers=0)
    for workers in (1, 2):
        run(recipe, tmp_path / f"{workers}", workers=workers)
        assert repr(rows(tmp_path / f"{workers}")) == repr(rows(tmp_path / "0"))
    with Search(read_recipe(recipe), tmp_path / "parted", workers=0) as search:
        next(iter(search))
    (tmp_path / "away").mkdir()
    (tmp_path / "parted").rename(tmp_path / "away" / "parted")
    for path in tmp_path.glob("*.npy"):
        path.unlink()
    with Search.resume(tmp_path / "away" / "parted", workers=0) as search:
        assert search.notes == []
        list(search)
    assert repr(rows(tmp_path / "away" / "parted")) == repr(rows(tmp_path / "0"))


def test_a_label_tells_parts_apart_and_one_file_may_have_two(toy, tmp_path):
    (tmp_path / "other").mkdir()
    np.save(tmp_path / "other" / "quarter.npy", masks()["disc"].astype(np.float32))
    goals = """
[[fitness]]
name = "fsi"
goal = "max"
within = "quarter.npy"
[[fitness]]
name = "fsi"
goal = "max"
within = "other/quarter.npy"
label = "east bank"
[[fitness]]
name = "gsi"
goal = "min"
within = "quarter.npy"
label = "west"
"""
    recipe = parted(toy, goals, population=4, generations=0)
    run(recipe, tmp_path / "run", workers=0)
    names = RunLog(tmp_path / "run").header.measures[2:]
    assert names == ("fsi@quarter", "fsi@east bank", "gsi@west")
    prepared = prepare(read_recipe(recipe))
    assert len(prepared.within) == 2
    assert prepared.setup.within["fsi@quarter"] is prepared.setup.within["gsi@west"]


@pytest.mark.slow
def test_own_measures_and_recorded_ones_take_parts_too(toy, tmp_path):
    goals = """
[[fitness]]
file = "more.py"
within = "quarter.npy"
"""
    path = parted(toy, goals, population=4, generations=1)
    path.with_name("help.py").write_text("def highest(city):\n    return city.heights.max()\n")
    path.with_name("more.py").write_text(
        "import evocity\nfrom help import highest\n"
        "@evocity.fitness(goal='max')\ndef tall(city):\n    return highest(city)\n"
        "@evocity.fitness(goal='max', numbers=('a', 'b'))\n"
        "def two(city):\n    return {'a': 1.0, 'b': city.area}\n"
    )
    record = "record = [{ name = 'mean_height', within = 'disc.npy' }]"
    path.write_text(path.read_text().replace("seed = 3", f"seed = 3\n{record}"))
    for workers in (0, 2):
        out = tmp_path / f"run-{workers}"
        run(path, out, workers=workers)
        found = RunLog(out)
        assert found.header.measures[2:] == ("tall@quarter", "two.a@quarter", "two.b@quarter")
        for row in found.births().to_pylist():
            city = decode(found.genome(row["id"])).city
            assert row["fitness.tall@quarter"] == city.heights[masks()["quarter"]].max()
            assert row["fitness.two.b@quarter"] == masks()["quarter"].sum() * 4
            expected = fitness.mean_height(city.within(masks()["disc"]))
            assert row["fitness.mean_height@disc"] == expected
    path.with_name("help.py").write_text("def highest(city):\n    return 0.0\n")
    with pytest.raises(RunError, match=r"the source of the measure tall@quarter \(more.py, or"):
        Search.resume(tmp_path / "run-0", generations=2)


@pytest.mark.slow
def test_a_measure_of_the_session_takes_a_part(toy, tmp_path):
    from evocity.fitness import registry

    @fitness.fitness(goal="max")
    def tallest_here(city):
        return float(city.heights.max())

    try:
        goals = "[[fitness]]\nname = 'tallest_here'\nwithin = 'quarter.npy'\n"
        goals += "[[fitness]]\nname = 'tallest_here'\n"
        run(parted(toy, goals, population=4), tmp_path / "run", workers=2, generations=0)
    finally:
        del registry._table["tallest_here"]
    for row in RunLog(tmp_path / "run").births().to_pylist():
        city = decode(RunLog(tmp_path / "run").genome(row["id"])).city
        assert row["fitness.tallest_here@quarter"] == city.heights[masks()["quarter"]].max()
        assert row["fitness.tallest_here"] == city.heights.max()


def test_like_is_of_the_whole_city_to_be_like(toy):
    goals = '[[fitness]]\nname = "fsi"\nlike = "left"\nwithin = "quarter.npy"\n'
    prepared = prepare(read_recipe(parted(toy, goals)))
    wanted = prepared.aims.wanted[-1]
    assert wanted.measure.name == "fsi@quarter"
    assert wanted.objective.target == fitness.fsi(prepared.sources[0].city)


def test_footprints_lie_where_the_map_lies(toy, tmp_path):
    """A quarter drawn for one of the sources, which need not be the first."""
    west, east = (CityMap(np.load(p), 2.0, name=p.stem) for p in _written(toy, tmp_path))
    for city, x in ((west, 840_000.0), (east, 850_000.0)):
        placed = city.replace(city.heights, origin=(x, 6_520_000.0), crs="EPSG:2154")
        write_map(placed, tmp_path / f"{city.name}.tif")
    x, y = 850_000.0, 6_520_000.0
    ring = [[x + 20, y - 30], [x + 90, y - 30], [x + 90, y - 100], [x + 20, y - 30]]
    feature = {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon"}}
    feature["geometry"]["coordinates"] = [ring]
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::2154"}}
    collection = {"type": "FeatureCollection", "crs": crs, "features": [feature]}
    (tmp_path / "bank.geojson").write_text(json.dumps(collection))
    goals = '[[fitness]]\nname = "gsi"\ngoal = "max"\nwithin = "bank.geojson"\n'
    path = toy(recipe=goals)
    for name in ("left", "right"):
        path.write_text(path.read_text().replace(f"{name}.npy", f"{name}.tif"))
    part = prepare(read_recipe(path)).within["bank.geojson"]
    rows_, columns = np.nonzero(part.mask)
    assert (rows_.min(), rows_.max(), columns.min(), columns.max()) == (15, 48, 11, 44)
    assert part.mask.sum() == pytest.approx(35 * 35 / 2, rel=0.05)


def _written(toy, folder):
    toy()
    return folder / "left.npy", folder / "right.npy"


@pytest.mark.parametrize(
    ("mask", "says"),
    [
        (np.ones((32, 32)), "quarter has 32 × 32 px, but left has 64 × 64 px"),
        (np.zeros((64, 64)), "no value above 0 on the map left"),
    ],
)
def test_masks_that_do_not_serve_are_refused_before_the_run(toy, tmp_path, mask, says):
    path = parted(toy)
    np.save(tmp_path / "quarter.npy", mask.astype(np.float32))
    with pytest.raises(MapError, match=says):
        Search(read_recipe(path), tmp_path / "run", workers=0).ask()
    assert not (tmp_path / "run").exists()


def test_measures_that_cannot_tell_a_part_are_refused_before_the_run(toy, tmp_path):
    goals = "[[fitness]]\nname = 'lacunarity'\ngoal = 'max'\nwithin = '{}.npy'\n"
    path = parted(toy, goals.format("disc"))
    with pytest.raises(
        RecipeError, match=r"fitness\[1\]: lacunarity cannot be limited to disc.npy: this part"
    ):
        Search(read_recipe(path), tmp_path / "run", workers=0).ask()
    assert not (tmp_path / "run").exists()
    prepare(read_recipe(parted(toy, goals.format("quarter"))))


@pytest.mark.parametrize(
    ("goal", "key", "says"),
    [
        (
            "name = 'gsi'\ntarget = 0.3\nwithin = 'none.npy'",
            "fitness[1].within (gsi)",
            "is not a file",
        ),
        ("name = 'gsi'\ntarget = 0.3\nwithin = 3", "fitness[1].within (gsi)", "text in quotes"),
        ("name = 'gsi'\ntarget = 0.3\nlabel = 'west'", "fitness[1] (gsi)", "without within"),
        ("name = 'integrity'\nwithin = 'disc.npy'", "fitness[1]", "the whole map: genome and "),
        (
            "name = 'gsi'\ntarget = 0.3\nwithin = 'disc.npy'\n[[fitness]]\n"
            "name = 'gsi'\ntarget = 0.5\nwithin = 'disc.npy'",
            "fitness",
            "gsi@disc twice; allowed: each measure once a part; a label tells parts apart",
        ),
    ],
)
def test_parts_at_fault_are_told(toy, goal, key, says):
    (line,) = faults(parted(toy, f"[[fitness]]\n{goal}\n"))
    assert line.startswith(f"{key}: ")
    assert says in line


def test_a_changed_mask_is_told_and_the_runs_own_goes_on(toy, tmp_path):
    run(parted(toy, population=4), tmp_path / "run", workers=0, generations=0)
    np.save(tmp_path / "quarter.npy", np.ones((64, 64), np.float32))
    with pytest.raises(RunError, match=r"quarter\.npy, a part that is measured \(the run keeps"):
        Search.resume(tmp_path / "run", generations=1)
    with Search.resume(tmp_path / "run", generations=1, workers=0, accept_changes=True) as search:
        list(search)
    for row in RunLog(tmp_path / "run").births(1).to_pylist():
        built = decode(RunLog(tmp_path / "run").genome(row["id"])).city.heights > 1.5
        assert row["fitness.gsi@quarter"] == built[masks()["quarter"]].mean()


@pytest.mark.parametrize("harm", ["gone", "another", "numbers"])
def test_harmed_masks_are_told(toy, tmp_path, harm):
    run(parted(toy, population=4), tmp_path / "run", workers=0, generations=0)
    file = tmp_path / "run" / "within" / "00.npy"
    if harm == "gone":
        shutil.rmtree(file.parent)
    else:
        np.save(file, ~np.load(file) if harm == "another" else np.zeros((64, 64)))
    with pytest.raises(RunError, match="within"):
        Search.resume(tmp_path / "run", generations=1)


def test_another_part_is_another_run(toy, tmp_path):
    run(parted(toy, population=4), tmp_path / "run", workers=0, generations=0)
    recipe = tmp_path / "run" / "recipe.toml"
    text = recipe.read_text().replace('within = "disc.npy"', 'within = "left.npy"\nlabel = "disc"')
    recipe.write_text(text)
    with pytest.raises(RunError, match=r"the parts that are measured was .* and is now"):
        Search.resume(tmp_path / "run", generations=1, accept_changes=True)
