"""`evocity recipe new`, and what `run` says of bounds that no parent keeps."""

import json
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from cli_tools import call, contents, refused, write_recipe
from towns import draw_town

import evocity
from evocity import search
from evocity.coding import decode
from evocity.errors import RecipeError
from evocity.recipe.mixture import plan_operators, usual_operators
from evocity.recipe.reader import recipe_of
from evocity.recipe.sections import GenomeSection
from evocity.search.calibration import recipe_text
from evocity.search.calibration.calibration import BESIDE
from evocity.search.calibration.recipe_notes import _note_best, _note_heights
from evocity.search.calibration.recipe_text import MANY_BIRTHS, Goal, RecipeSettings
from evocity.search.preparation.preparation import prepare

#: Of what children have of their sources, too little for a bound of .5.
KIN = """
import evocity

@evocity.fitness(goal="max", range=(0, 1))
def kin(city, genome, sources):
    return 0.25 + 0.125 * genome.parent[0]
"""


# -- bounds that no parent keeps ---------------------------------------------------------------


def test_run_tells_of_a_bound_that_no_parent_keeps_before_the_first_birth(tmp_path):
    fitness = 'name = "alignment"\n[[fitness]]\nname = "gsi"\nmax = 0.05'
    path = write_recipe(tmp_path, fitness=fitness)
    told = call("run", path, "--out", tmp_path / "run").stderr
    first = told.index("Note: no parent's own code keeps gsi ≤ 0.05: left ")
    assert told.index("encoding right …") < first < told.index("generation 0/2")


def test_run_refuses_a_guard_that_no_parent_keeps(tmp_path):
    fitness = 'name = "alignment"\n[[fitness]]\nfile = "kin.py"\nmin = 0.5'
    (tmp_path / "kin.py").write_text(KIN)
    path = write_recipe(tmp_path, fitness=fitness)
    says = "no parent's own code keeps kin ≥ 0.5: left 0.25, right 0.375"
    message = refused(tmp_path, "run", path, "--out", tmp_path / "run", says=says)
    assert "what to do: write min = 0.375 for kin" in message


# -- a recipe to begin from --------------------------------------------------------------------


@pytest.mark.parametrize(
    ("parents", "cores", "living", "births"),
    [(1, 2, 24, None), (2, 8, 24, None), (2, 9, 24, 27), (3, 12, 36, None), (3, 16, 36, 48)],
)
def test_twelve_individuals_of_each_parent_live_and_each_core_has_three_births(
    monkeypatch, parents, cores, living, births
):
    monkeypatch.setattr(recipe_text, "available_cores", lambda: cores)
    settings = RecipeSettings("night", [{"map": "lyon-1er"}] * parents)
    goals = [Goal(evocity.fitness.get("alignment"))]
    recipe = recipe_of(recipe_text.recipe_text(settings, goals, []), None, {}, "night.toml")
    assert (recipe.run.population, recipe.search.births) == (living, births)
    assert recipe.generation_size == (births or living)


OWN = """
import evocity

@evocity.fitness(goal="max", unit="m")
def tallest(city):
    "Height of the highest roof."
    print("measuring")
    return city.heights.max()

@evocity.fitness()
def middling(city):
    return city.heights.mean()
"""


@pytest.fixture(scope="module")
def towns(tmp_path_factory):
    """A folder with two towns and a measure of one's own."""
    folder = tmp_path_factory.mktemp("towns")
    for seed, name in enumerate(("left", "right")):
        np.save(folder / f"{name}.npy", draw_town(seed + 1, side=128, buildings=150).heights)
    (folder / "own.py").write_text(OWN)
    return folder


@pytest.fixture(scope="module")
def night(towns):
    """What `recipe new` tells and writes of two towns, in another folder than they lie in."""
    (towns / "runs").mkdir()
    path = towns / "runs" / "night.toml"
    words = (towns / "left.npy", towns / "right.npy", "--pixels", 128, "--metres-per-pixel", 2)
    own = ("--fitness", towns / "own.py", "--fitness", "gsi")
    return path, call("recipe", "new", *words, *own, "-o", path, "--json")


def test_targets_of_note_heights_are_noted():
    heights = np.zeros((32, 32), np.float32)
    heights[4:20, 4:20] = 6.0
    goals = [Goal(evocity.fitness.get(name)) for name in ("gsi", "mean_height", "fsi", "alignment")]

    def told(**rules):
        return _note_heights(goals, evocity.CityMap(heights, 2.0, name="here", height_rules=rules))

    assert [one.split(" on")[0] for one in told(default=3, height=2)] == [
        "mean_height, fsi: their targets rest"
    ]
    assert told(default=1, height=2) == told(height=2) == told() == []
    goals[2:] = []
    assert told(default=1)[0].startswith("mean_height: its target rests")


def test_a_goal_that_one_parent_has_reached_is_told():
    names = ("crumbs", "alignment", "autosimilarity", "mean_height")
    goals = [Goal(evocity.fitness.get(name)) for name in names]
    goals[3] = replace(goals[3], target=9.0)
    values = {
        "crumbs": {"left": (0, 29.0), "right": (3, 0.0)},
        "alignment": {"left": (1, 1.0), "right": (1, 1.0)},
        "autosimilarity": {"left": (1, 0.99), "right": (1, 0.98)},
        "mean_height": {"left": (0, 0.0), "right": (3, 3.0)},
    }
    (told,) = _note_best(goals, values)
    assert told.startswith(
        "crumbs: right has 0 already, the best possible value; children of only it"
    )
    values["crumbs"]["middle"] = (0, 0.0)
    (told,) = _note_best(goals, values)
    assert told.startswith("crumbs: right and middle have 0 already")
    assert "children of only these may win" in told


@pytest.mark.slow
def test_a_parent_whose_file_tells_no_attribution_has_a_place_for_it(night, towns, tmp_path):
    text = night[0].read_text(encoding="utf-8")
    assert text.count('# attribution = "…"') == 2  # an array tells none
    credited = text.replace('# attribution = "…"', 'attribution = "© the towns"')
    (night[0].parent / "credited.toml").write_text(credited, encoding="utf-8")
    recipe = search.read_recipe(night[0].parent / "credited.toml")
    prepared = prepare(recipe)
    assert {one.city.attribution for one in prepared.sources} == {"© the towns"}
    assert prepared.header.attribution == "© the towns"
    with pytest.raises(RecipeError, match=r"parents\[0\].attribution"):
        recipe_of(credited.replace("© the towns", "  ", 1), night[0].parent, {}, name="night")
    genome = credited.replace('map = "../left.npy"', 'genome = "../left.npy"')
    with pytest.raises(RecipeError, match="the key 'genome' is given together with attribution"):
        recipe_of(genome, night[0].parent, {}, name="night")


def test_the_recipe_runs_from_where_it_lies(night, tmp_path):
    path, _ = night
    recipe = search.read_recipe(path)
    assert recipe.run.name == "night"
    assert [parent.map for parent in recipe.parents] == ["../left.npy", "../right.npy"]
    assert (recipe.map.pixels, recipe.map.metres_per_pixel) == (128, 2.0)
    assert dict(recipe.operators) == plan_operators()
    assert recipe.search.settings | {"per_plan": 8, "twins": 0.005} == recipe.search.settings
    usual = GenomeSection(settle="roofs")
    assert recipe.genome == usual
    short = search.read_recipe(path, generations=1, population=6, workers=0)
    with search.Search(short, out=tmp_path / "run") as breeding:
        last = list(breeding)[-1]
    assert not [note for note in breeding.notes if "keeps" in note]
    assert last.failures == 0
    assert not [note for note in breeding.notes if "smallest_share" in note]


def test_the_goals_are_the_users_and_the_guard_is_calibrated(night):
    path, result = night
    told = json.loads(result.stdout)
    assert "measuring" in result.stderr
    recipe = search.read_recipe(path)
    cities = [
        evocity.read_map(path.parents[1] / f"{n}.npy", metres_per_pixel=2)
        for n in ("left", "right")
    ]
    codes = [evocity.encode(city, settle="roofs").genome for city in cities]
    decoded = [decode(code).city for code in codes]
    goals = {one.measures[0].name: one for one in recipe.fitness if one.is_objective}
    assert list(goals) == ["tallest", "gsi"]  # of a file those that have a goal, if one has
    assert goals["tallest"].file == "../own.py"
    assert goals["gsi"].target == pytest.approx(evocity.fitness.gsi(decoded[0]), rel=1e-3)
    bounds = {one.name: (one.min, one.max) for one in recipe.fitness if not one.is_objective}
    assert bounds["integrity"] == (0.5, None)
    reference = evocity.fitness.Reference.sources(cities)
    fabric = [
        evocity.fitness.fabric_distance(one, genome=code, reference=reference)
        for one, code in zip(decoded, codes, strict=True)
    ]
    assert told["values"]["fabric_distance"]["left"]["code"] == fabric[0]
    assert bounds["fabric_distance"][1] == pytest.approx(max(0.15, 2 * max(fabric)), rel=0.01)
    assert bounds["fabric_distance"][1] >= 2 * max(fabric)
    small = [evocity.fitness.small_buildings(one) for one in cities]
    kept = max(1.3 * max(small), min(map(evocity.fitness.small_buildings, decoded)))
    assert bounds["small_buildings"][1] == pytest.approx(kept, rel=0.01)
    most = max(map(evocity.fitness.slivers, decoded))
    assert bounds["slivers"][1] == pytest.approx(most + 0.06, rel=0.01)
    assert bounds["slivers"][1] >= most + 0.06
    assert bounds["smallest_share"] == (0.25, None)
    assert bounds["repetition"] == (None, 0.01)
    assert "gsi" not in bounds  # a goal of the user
    floors = [evocity.fitness.fsi(one) for one in [*cities, *decoded]]
    assert bounds["fsi"] == pytest.approx((0.9 * min(floors), 1.1 * max(floors)), rel=0.01)
    assert told["bounds"] == {
        name: {key: one for key, one in zip(("min", "max"), pair, strict=True) if one is not None}
        for name, pair in bounds.items()
    }
    assert told["births"] == recipe.generation_size * (recipe.run.generations + 1)
    pace = (told["seconds"] + BESIDE) / recipe.worker_count
    assert told["duration"] == pytest.approx(told["births"] * pace)
    night = 8 * 3600
    assert night - recipe.generation_size * pace < told["duration"] <= night
    assert recipe.log.genomes == ("survivors" if told["births"] > MANY_BIRTHS else "all")


def test_the_comments_tell_what_the_parents_have_and_how_long_it_takes(night):
    path, result = night
    text = " ".join(path.read_text(encoding="utf-8").replace("\n# ", " ").split())
    told = json.loads(result.stdout)
    for name, of in told["values"].items():
        for parent, had in of.items():
            assert f"of {parent} has {had['map']:.3g}, its code {had['code']:.3g}" in text, name
    assert f"{told['births']} births; one took {1000 * told['seconds']:.0f} ms here" in text
    assert "tallest: Height of the highest roof. More of it is better." in text
    assert max(map(len, path.read_text(encoding="utf-8").splitlines())) <= 100


@pytest.mark.parametrize(
    ("hours", "way_out"),
    [
        ("0", "leave --hours out, for a night of 8 hours"),
        ("-1", "write --hours 0.5 for half an hour"),
        ("nan", "write --hours 0.5"),
        ("1000", "a run goes on for longer with evocity resume RUN --generations N"),
        ("inf", "write --hours 168 or less"),
    ],
)
def test_no_run_takes_so_many_hours(towns, tmp_path, hours, way_out):
    words = (towns / "left.npy", "--hours", hours, "-o", tmp_path / "one.toml")
    result = call("recipe", "new", *words, code=2)
    assert f"--hours {float(hours):g} is not a length of a run" in result.stderr
    assert "above 0, and at most 168 (a week)" in result.stderr
    assert way_out in result.stderr
    assert not (tmp_path / "one.toml").exists()


def test_it_tells_what_it_calibrated_and_what_comes_next(towns, tmp_path):
    words = (towns / "left.npy", "--pixels", 64, "--fitness", "crumbs", "-o")
    result = call("recipe", "new", *words, tmp_path / "one.toml")
    assert "integrity" in result.stdout
    assert f"wrote {tmp_path / 'one.toml'}" in result.stdout
    assert f"evocity run {tmp_path / 'one.toml'}" in result.stdout
    # a recipe that exists is written over when asked to alone
    refused(tmp_path, "recipe", "new", *words, tmp_path / "one.toml", says="exists already")
    call("recipe", "new", *words, tmp_path / "one.toml", "--force")


def test_a_guard_that_is_a_goal_too_stands_once(towns, tmp_path):
    words = (towns / "left.npy", towns / "right.npy", "--pixels", 128)
    call("recipe", "new", *words, "--fitness", "fabric_distance", "-o", tmp_path / "a.toml")
    (one,) = [
        one
        for one in tomllib.loads((tmp_path / "a.toml").read_text())["fitness"]
        if one["name"] == "fabric_distance"
    ]
    assert one["goal"] == "min"
    assert one["max"] >= 0.15


@pytest.mark.slow
def test_bands_replace_the_guard_and_join_goals(towns, tmp_path):
    words = (towns / "left.npy", "--pixels", 64, "--fitness", "gsi", "--fitness", "daylight")
    bands = ("--band", "fsi", 2.1, 2.3, "--band", "gsi", 0, 0.42, "--band", "winter_sun", 2, 12)
    result = call("recipe", "new", *words, *bands, "-o", tmp_path / "a.toml", "--json")
    told = json.loads(result.stdout)
    assert told["bounds"]["fsi"] == {"min": 2.1, "max": 2.3}
    assert told["bounds"]["gsi"] == {"max": 0.42}  # 0 is the end of its range
    assert told["bounds"]["winter_sun"] == {"min": 2.0}
    assert set(told["values"]) >= {"fsi", "gsi", "winter_sun", "daylight", "integrity"}
    entries = tomllib.loads((tmp_path / "a.toml").read_text())["fitness"]
    assert len({one["name"] for one in entries}) == len(entries)
    recipe = search.read_recipe(tmp_path / "a.toml")
    goals = {one.measures[0].name: one for one in recipe.fitness if one.is_objective}
    assert list(goals) == ["gsi", "daylight"]
    assert goals["gsi"].max == 0.42
    text = (tmp_path / "a.toml").read_text()
    assert text.index('name = "fsi"') < text.index("-- the guard:")


@pytest.mark.slow
def test_what_is_undefined_of_a_parent_is_not_bounded(tmp_path):
    heights = np.zeros((64, 64))
    heights[8:24, 8:24] = heights[40:56, 30:50] = 9.0
    np.save(tmp_path / "two.npy", heights)
    result = call("recipe", "new", tmp_path / "two.npy", "--pixels", 64, "-o", tmp_path / "a.toml")
    few = "no bound, because it is undefined for two ("
    assert f"Note: fabric_distance: {few}" in result.stderr
    none = "Note: salingaros_law: no goal, because it is undefined for two ("
    assert none in result.stderr
    recipe = search.read_recipe(tmp_path / "a.toml")
    names = [one.name for one in recipe.fitness]
    assert "fabric_distance" not in names
    assert "salingaros_law" not in names  # nor a goal that is undefined
    assert {"autosimilarity", "crumbs", "integrity", "small_buildings"} <= set(names)
    bounds = {one.name: one.max for one in recipe.fitness}
    assert bounds["small_buildings"] == 0.1  # of none at all, some are granted
    assert bounds["slivers"] == 0.06
    assert "smallest_share" not in names  # a lone parent has all
    assert recipe.operators == usual_operators()


def test_centers_are_of_the_map_files(tmp_path, towns):
    from evocity.cli.recipe import _parents

    np.save(tmp_path / "a.npy", np.zeros((8, 8)))
    files = [str(tmp_path / "a.npy"), "lyon-1er"]
    here, there = (4.8, 45.7), (4.9, 45.8)
    (first, second) = _parents(files, [here], {}, tmp_path)
    assert (first, second) == ({"map": "a.npy", "center": [4.8, 45.7]}, {"map": "lyon-1er"})
    (first, second) = _parents(files, [here, there], {"height_scale": 2.0}, tmp_path)
    assert first == {"map": "a.npy", "center": [4.8, 45.7], "height_scale": 2.0}
    assert second == {"map": "lyon-1er", "center": [4.9, 45.8]}
    (first, second) = _parents(files, [(None, None), there], {}, tmp_path)
    assert (first, second) == ({"map": "a.npy"}, {"map": "lyon-1er", "center": [4.9, 45.8]})


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("left.npy", "--pixels", 100), "--pixels 100"),
        (("left.npy", "--pixels", 4), "--pixels 4"),
        (("left.npy", "--metres-per-pixel", 0), "--metres-per-pixel 0"),
        (("missing.npy",), "no file"),
        (("lyon-2e",), "no bundled city"),
        (("left.npy", "--fitness", "no_such"), "no measure is called 'no_such'"),
        (("left.npy", "--fitness", "missing.py"), "no Python file"),
        (("left.npy", "--fitness", "broken.py"), "out of sorts"),
        (("left.npy", "--fitness", "never.py"), "never is undefined for left (it never is)"),
        (("left.npy", "--fitness", "never.py"), "evocity score MAP --fitness never.py, or"),
        (("left.npy", "--band", "no_such", 1, 2), "no measure is called 'no_such'"),
        (("left.npy", "--band", "fsi", 2, 2), "--band fsi 2 2 is not a band"),
        (("left.npy", "--band", "fsi", 2, "nan"), "--band fsi 2 nan is not a band"),
        (
            ("left.npy", "--band", "gsi", 0, 1),
            "--band gsi 0 1 bounds nothing: values of gsi are 0…1",
        ),
        (("left.npy", "--band", "gsi", 2, 3), "--band gsi 2 3 bounds nothing"),
        (("left.npy", *("--band", "gsi", 0.1, 0.3) * 2), "is the second band of gsi"),
        (("left.npy", "flat.npy"), "flat: the map (flat.npy) has no buildings"),
        (("flat.npy",), "the window with --center and --pixels, or"),
        (("left.npy", "--layer", "houses"), "--layer houses"),
        (
            ("left.npy", "right.npy", *("--center", 4.8, 45.7) * 3),
            "--center is given 3 times for 2 maps",
        ),
        (("left.npy", "right.npy", *("--center", 4.8, 45.7) * 3), "write --center own own"),
        (("left.npy", "--center", "own", 45.7), "--center own 45.7"),
        (("left.npy", "-o", "a.txt"), "cannot be written here"),
        (("left.npy", "-o", "nowhere/a.toml"), "no folder"),
        (("left.npy", "-o", "kept.toml"), "exists already"),
    ],
)
def test_bad_input_is_refused(towns, tmp_path, monkeypatch, words, says):
    for name in ("left.npy", "right.npy"):
        (tmp_path / name).write_bytes((towns / name).read_bytes())
    np.save(tmp_path / "flat.npy", np.zeros((128, 128)))
    (tmp_path / "kept.toml").write_text("mine")
    head = "import evocity\n\n@evocity.fitness(goal='max')\n"
    (tmp_path / "broken.py").write_text(
        head + "def broken(city):\n    raise ValueError('out of sorts')\n"
    )
    (tmp_path / "never.py").write_text(
        head + "def never(city):\n    return evocity.fitness.Undefined('it never is')\n"
    )
    monkeypatch.chdir(tmp_path)
    output = () if "-o" in words else ("-o", "night.toml")
    pixels = () if "--pixels" in words else ("--pixels", 64)
    refused(tmp_path, "recipe", "new", *words, *pixels, *output, says=says)
    assert (tmp_path / "kept.toml") in contents(tmp_path)


#: Of the parents a number, of no child.
BARREN = """
import evocity

@evocity.fitness(goal="max")
def barren(city, genome, parents):
    return 1.0 if parents[0] is genome else evocity.fitness.Undefined("a child")
"""


def test_births_that_fail_are_told_loudly(towns, tmp_path):
    (tmp_path / "barren.py").write_text(BARREN)
    words = (towns / "left.npy", towns / "right.npy", "--pixels", 64)
    own = ("--fitness", tmp_path / "barren.py", "-o", tmp_path / "a.toml")
    result = call("recipe", "new", *words, *own)
    assert "Warning: 10 of 10 trial births failed; the first: barren is nan: a child" in (
        result.stderr
    )
    assert "A run stops when more than 50 % of a generation's births fail" in result.stderr
    assert "Read its comments" not in result.stdout
    assert "Correct what makes births fail, then:" in result.stdout


def test_what_was_taken_of_a_map_is_told_before_an_error_of_a_goal(tmp_path):
    (tmp_path / "never.py").write_text(
        "import evocity\n\n@evocity.fitness(goal='max')\n"
        "def never(city):\n    return evocity.fitness.Undefined('it never is')\n"
    )
    own = ("--fitness", tmp_path / "never.py", "-o", tmp_path / "a.toml")
    told = call("recipe", "new", "lyon-1er", "--pixels", 64, *own, code=2).stderr
    assert told.count("Note: lyon-1er: a window of ") == 1
    assert told.index("Note: lyon-1er: a window of ") < told.index("encoding lyon-1er")
    assert told.index("encoding lyon-1er") < told.index("never is undefined for lyon-1er")
