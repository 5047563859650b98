"""MAP-Elites: cells and their holders, what is logged of them, and runs that fill a grid."""

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_search_recipe import faults
from test_search_run import rows, run
from toy_runs import unsealed

import evocity
from evocity.errors import RecipeError, RunError
from evocity.search import Search, read_recipe
from evocity.search.record.grid import binned, grid_of_run
from evocity.selection.algorithms import First, algorithms
from evocity.selection.cells import Grid, Quality, ranges_around
from evocity.selection.fronts import Hypervolume
from evocity.selection.individual import Individual
from evocity.store import RunLog

KIND = algorithms()["map_elites"]
GRID = Grid(("a", "b"), (3, 4), ((0.0, 3.0), (-2.0, 2.0)))
NUMBERS = st.floats(allow_nan=True, allow_infinity=False)


def naive_cell(grid: Grid, values) -> int:
    """The cell whose edges lie about the values; the outer ones have no outer edge."""
    number = 0
    for value, count, (low, high) in zip(values, grid.counts, grid.ranges, strict=True):
        if math.isnan(value):
            return -1
        inner = [low + (high - low) * k / count for k in range(1, count)]
        number = number * count + sum(value >= edge for edge in inner)
    return number


# -- cells ----------------------------------------------------------------------------------------


@given(st.lists(st.tuples(NUMBERS, NUMBERS), max_size=9))
def test_values_lie_in_the_cell_between_whose_edges_they_are(values):
    assert GRID.cells(np.array(values)).tolist() == [naive_cell(GRID, one) for one in values]


@given(st.lists(st.integers(1, 9), min_size=2, max_size=3), st.data())
def test_a_cell_is_where_its_places_say(counts, data):
    ranges = tuple((-1.0, 1.0 + k) for k in range(len(counts)))
    grid = Grid(("a", "b", "c")[: len(counts)], tuple(counts), ranges)
    number = data.draw(st.integers(0, len(grid) - 1))
    places = grid.places([number])[0]
    middle = [
        (grid.edges(axis)[place] + grid.edges(axis)[place + 1]) / 2
        for axis, place in enumerate(places)
    ]
    assert grid.cells([middle]).tolist() == [number]


def test_huge_values_lie_at_the_ends():
    grid = Grid(("a", "b"), (5, 5), ((-1.7e308, 1.7e308), (0.0, 1.0)))
    assert grid.cells([[1.75e308, 1e308], [-1.75e308, -1e308], [0.0, 0.5]]).tolist() == [24, 0, 12]


def test_ranges_lie_around_the_parents_within_what_measures_declare():
    parents = [{"a": 0.2, "b": -4.0}, {"a": 0.6, "b": 4.0, "c": 1.0}, {"b": 0.0}]
    found = ranges_around(("a", "b"), parents, {"a": (0.0, 0.7)})
    assert found == (pytest.approx((0.0, 0.7)), (-8.0, 8.0))
    assert ranges_around(("a",), parents, {}) == (pytest.approx((0.0, 0.8)),)


@pytest.mark.parametrize(
    ("parents", "says"),
    [
        (
            [{"a": 0.4}, {"a": 0.4}],
            "a is nearly or quite the same in the parents' codes (0.4, 0.4)",
        ),
        ([{"a": 0.4}, {"a": 0.401}], "a is nearly"),
        ([{"a": 0.0}, {"a": 0.0}], "a is nearly"),
        ([{"a": 0.4}, {}], "a has a value in 1 of 2 parents' codes"),
        ([{}, {"a": math.nan}], "a has a value in 0 of 2"),
        ([{"a": 0.4}], "a has a value in 1 of 1"),
    ],
)
def test_parents_that_are_alike_give_no_ranges(parents, says):
    with pytest.raises(RecipeError) as caught:
        ranges_around(("a",), parents, {})
    assert says in caught.value.found
    assert "ranges = [[low, high]" in caught.value.remedy


@given(st.lists(st.floats(-9, 9), min_size=1, max_size=8), st.lists(st.floats(-9, 9), max_size=8))
def test_the_qd_score_is_the_hypervolume_of_each_cell(first, losses):
    volume = Hypervolume(np.array(first)[:, None])
    expected = [volume(np.array([[one]])) for one in losses]
    quality = Quality(np.array(first))
    assert quality.worth(np.array(losses)) == pytest.approx(expected)
    told = quality.summary(GRID, np.array(losses))
    assert told["cells"] == len(losses)
    assert told["coverage"] == len(losses) / 12
    assert told["qd_score"] == pytest.approx(sum(expected))


# -- who lives, and who breeds --------------------------------------------------------------------


def some(count, seed):
    rng = np.random.default_rng(seed)
    return [
        Individual(
            id=int(one),
            genome=None,
            values={"a": float(rng.choice([0.5, 1.5, 9.0])), "b": float(rng.choice([-1, 1]))}
            if rng.random() < 0.9
            else {"a": 1.0},
            losses=(float(rng.integers(4)),),
            violation=float(rng.choice([0, 0, 1, 2])),
        )
        for one in rng.permutation(100)[:count]
    ]


def begun():
    keys = KIND.Keys(descriptors=["a", "b"], grid=[3, 4], ranges=[[0.0, 3.0], [-2.0, 2.0]])
    search = KIND(4, keys)
    search.begin(First(np.array([[0.0], [3.0]])))
    return search


def unseen(one):
    raise AssertionError("nobody needs a map")


@given(st.integers(0, 30), st.integers(0, 2**32))
def test_the_best_of_each_cell_lives(count, seed):
    candidates, search = some(count, seed), begun()
    living = search.survivors(candidates, unseen, None)
    best = {}
    for one in candidates:
        cell = naive_cell(GRID, [one.values.get(name, math.nan) for name in "ab"])
        worth = (one.violation, one.losses[0], one.id)
        if cell >= 0 and worth < best.get(cell, (math.inf,)):
            best[cell] = worth
    assert {int(one.marks["cell"]): one.id for one in living} == {c: w[2] for c, w in best.items()}
    assert [(one.violation, one.losses[0]) for one in living] == sorted(
        w[:2] for w in best.values()
    )
    assert all((one.rank == 0) is (one.violation == 0) for one in living)
    # a run that is taken up again knows those who lived, and judges them alike
    assert search.judged(living[::-1]) == living
    assert search.survivors(living, unseen, None) == living
    kept = [one for one in living if not one.violation]
    told = search.summary(living)
    assert (told["cells"], told["coverage"]) == (len(kept), len(kept) / 12)
    assert told["qd_score"] == pytest.approx(sum(max(0, 1.1 - one.losses[0] / 3) for one in kept))


@given(st.integers(1, 30), st.integers(1, 4), st.integers(0, 99))
def test_parents_hold_filled_cells_and_differ_while_they_can(count, wanted, seed):
    search = begun()
    living = search.survivors(some(count, seed), unseen, None)
    if not living:
        return
    chosen = search.parents(living, wanted, np.random.default_rng(seed))
    kept = sum(not one.violation for one in living)
    assert len(chosen) == wanted
    assert len(set(chosen)) == min(wanted, len(living))
    assert sum(not living[place].violation for place in chosen[: len(living)]) == min(wanted, kept)


def test_parents_are_drawn_evenly():
    search, rng = begun(), np.random.default_rng(0)
    living = [
        Individual(k, None, {"a": 0.5 + k, "b": 0.0}, (float(k),), marks={"cell": 4.0 * k})
        for k in range(3)
    ]
    drawn = [place for _ in range(600) for place in search.parents(living, 2, rng)]
    assert all(350 < drawn.count(place) < 450 for place in range(3))


# -- recipes --------------------------------------------------------------------------------------


def grid_recipe(toy, search="", fitness='file = "toys.py"\nname = "spread"', **settings):
    """A recipe with one goal; the grid lies over gsi, which nothing records, and roof."""
    path = toy(**settings)
    text = path.read_text().replace('file = "toys.py"', fitness)
    text = text.replace("[map]", 'record = [{ file = "toys.py", name = "roof" }]\n[map]')
    path.write_text(
        text + '[search]\nalgorithm = "map_elites"\ndescriptors = ["gsi", "roof"]\n' + search
    )
    return path


@pytest.mark.parametrize(
    ("search", "key", "says"),
    [
        ("grid = [1000, 1000, 1000]", "search.grid", "2 numbers of cells"),
        ("grid = [31623, 31]", "search.grid[0]", "1000 or less"),
        ("grid = [0, 3]", "search.grid[0]", "1 or more"),
        ("grid = [4]", "search.grid", "2 or more of them"),
        ("grid = [4, 4.5]", "search.grid[1]", "a whole number"),
        ("ranges = [[0.0, 1.0]]", "search.ranges", "2 ranges [low, high]"),
        ("ranges = [[0.0, 1.0], [2.0, 2.0]]", "search.ranges[1]", "the lower first"),
        ("ranges = [[0.0, 1.0], [2.0]]", "search.ranges[1]", "[low, high]"),
        ("ranges = [[0.0, 1.0], [2.0, inf]]", "search.ranges[1][1]", "a finite number"),
        ("distinct = 0.5", "search.distinct", "and single, not of map_elites"),
        ("gird = [2, 2]", "search.gird", "unknown key, did you mean grid?"),
    ],
)
def test_a_grid_at_fault_is_told(toy, search, key, says):
    (told,) = faults(grid_recipe(toy, search))
    assert told.startswith(f"{key}: ")
    assert says in told


@pytest.mark.parametrize(
    ("descriptors", "key", "says"),
    [
        ('["gsi", "gsi"]', "search.descriptors", "'gsi' twice"),
        ('["gsi", "gsy"]', "search.descriptors", "did you mean gsi?"),
        ('["gsi", "towers"]', "search.descriptors", "spread, roof"),
        ('["gsi", "gsi@west"]', "search.descriptors", "no measure 'gsi@west' of one number"),
        ('["gsi"]', "search.descriptors", "2 or more"),
        ('["gsi", "fsi", "roof", "spread"]', "search.descriptors", "3 or fewer"),
        ("3", "search.descriptors", "a list"),
    ],
)
def test_descriptors_at_fault_are_told(toy, descriptors, key, says):
    path = grid_recipe(toy)
    path.write_text(path.read_text().replace('["gsi", "roof"]', descriptors))
    (told,) = faults(path)
    assert told.startswith(f"{key}: ")
    assert says in told


@pytest.mark.parametrize(
    ("descriptors", "search", "told"),
    [
        ('["gsi", "gsi", "gsy"]', "grid = [4, 4]\nranges = [[1.0, 0.0], [0.0, 1.0]]",
         {"search.descriptors": ("gsi?", "twice"), "search.grid": ("3 numbers",),
          "search.ranges": ("3 ranges",), "search.ranges[0]": ("the lower first",)}),
        ('["gsi", "gsy"]', 'grid = [4, 0]\nranges = [[0.0, "b"], [1.0, 2.0]]\ngird = 2',
         {"search.descriptors": ("gsi?",), "search.grid[1]": ("1 or more",),
          "search.ranges[0][1]": ("a number",), "search.gird": ("unknown key",)}),
        ('["gsi", "roof"]', 'grid = [4, 4, 4]\nranges = [["a", 1.0], [1.0, 2.0]]',
         {"search.grid": ("2 numbers",), "search.ranges[0][0]": ("a number",)}),
        ('["gsi"]', "grid = [4, 4, 4]\nranges = [[0.0, 1.0, inf]]",
         {"search.descriptors": ("2 or more",), "search.ranges[0][2]": ("a finite number",)}),
    ],
)  # fmt: skip
def test_all_faults_of_a_grid_are_told_at_once(toy, descriptors, search, told):
    path = grid_recipe(toy, search)
    path.write_text(path.read_text().replace('["gsi", "roof"]', descriptors))
    found = faults(path)
    assert {one.partition(": ")[0] for one in found} == set(told)
    assert len(found) == sum(map(len, told.values()))
    for key, words in told.items():
        assert all(any(one.startswith(f"{key}: ") and w in one for one in found) for w in words)
    # nor do other sections hide them, nor they those
    path.write_text(path.read_text().replace("generations = 3", "generations = -3"))
    beside, unmeasured = faults(path), {one for one in found if "no measure" in one}
    assert any(one.startswith("run.generations: -3") for one in beside)
    assert set(found) - unmeasured < set(beside)


def test_ten_to_the_nine_cells_are_too_many(toy):
    path = grid_recipe(toy, "grid = [1000, 1000, 1000]")
    path.write_text(path.read_text().replace('["gsi", "roof"]', '["gsi", "roof", "spread"]'))
    (told,) = faults(path)
    assert "1000 × 1000 × 1000, 1000000000 cells; allowed: 1000000 cells or fewer in all" in told


def test_one_goal_is_the_quality(toy):
    path = grid_recipe(toy, fitness='file = "toys.py"')
    path.write_text(path.read_text().replace('record = [{ file = "toys.py", name = "roof" }]', ""))
    (told,) = faults(path)
    assert "'map_elites' with 2 goals" in told
    assert "objective" in told


def test_descriptors_are_recorded_once(toy):
    recipe = read_recipe(grid_recipe(toy))
    assert [one.name for one in recipe.recorded] == ["roof", "gsi"]
    assert len(recipe.run.record) == 1


# -- runs -----------------------------------------------------------------------------------------


@pytest.fixture
def filled(toy, tmp_path):
    """A run of four generations, and its recipe."""
    recipe = grid_recipe(toy, "grid = [6, 5]\n")
    run(recipe, tmp_path / "filled", workers=0)
    return tmp_path / "filled", recipe


@pytest.mark.slow
def test_workers_and_stops_do_not_matter(filled, tmp_path):
    out, recipe = filled
    expected = rows(out)
    for count in (1, 4):
        run(recipe, tmp_path / f"run-{count}", workers=count)
        assert rows(tmp_path / f"run-{count}") == expected
    with Search(read_recipe(recipe), out=tmp_path / "stopped", workers=0) as search:
        next(iter(search))
    for generations in (2, 3):
        with Search.resume(tmp_path / "stopped", generations, workers=0) as search:
            list(search)
    assert rows(tmp_path / "stopped") == expected
    told = [one["algorithm"] for one in RunLog(out).history()]
    assert [one["algorithm"] for one in RunLog(tmp_path / "stopped").history()] == told


def test_every_cell_has_a_row(filled):
    out, recipe = filled
    log = RunLog(out)
    archive = evocity.archive(log)
    births, members = archive.births.to_pydict(), log.members(3).to_pydict()
    assert dict(zip(births["cell"], births["id"], strict=True)) == {
        int(cell): one for cell, one in zip(members["cell"], members["id"], strict=True)
    }
    assert all(births["alive"])
    grid = grid_of_run(log)
    assert archive.grid == grid
    assert grid.counts == (6, 5)
    values = np.column_stack([births["fitness.gsi"], births["fitness.roof"]])
    assert grid.cells(values).tolist() == births["cell"]
    places = np.column_stack([births["cell.gsi"], births["cell.roof"]])
    assert places.tolist() == grid.places(births["cell"]).tolist()
    # of all births in a cell the best
    every = log.births(columns=["id", "fitness.spread", "fitness.gsi", "fitness.roof"]).to_pydict()
    cells = grid.cells(np.column_stack([every["fitness.gsi"], every["fitness.roof"]]))
    for cell, most in zip(births["cell"], births["fitness.spread"], strict=True):
        assert most == np.array(every["fitness.spread"])[cells == cell].max()
    assert set(births["cell"]) == set(cells)
    told = log.status()["algorithm"]
    assert told["cells"] == len(archive)
    assert told["coverage"] == len(archive) / 30
    assert told["qd_score"] == pytest.approx(binned(log).qd_score, rel=1e-12)
    assert len(members["id"]) > read_recipe(recipe).run.population
    with Search.resume(out, workers=0) as search:
        assert {one.id for one in search._population.living} == set(members["id"])
        assert search._population.summary == told


def test_the_log_tells_what_it_holds(filled):
    log = RunLog(filled[0])
    assert log.header.schema_version == 6
    assert log.header.marks == ("cell",)
    assert log.header.figures == ("coverage", "cells", "qd_score")
    assert log.header.recorded == ("roof", "gsi")
    assert log.provenance["schema_version"] == 6
    assert log.provenance["descriptors"] == [
        {"name": "gsi", "low": 0.0, "high": 1.0},
        {"name": "roof", "low": None, "high": None},
    ]
    for about in log.history():
        assert set(about["algorithm"]) == {"coverage", "cells", "qd_score"}
    filled_cells = [about["algorithm"]["cells"] for about in log.history()]
    assert filled_cells == sorted(filled_cells)


def test_other_runs_stay_as_they_were(toy, tmp_path):
    out = tmp_path / "run"
    (first, *_) = run(toy(), out, workers=0, generations=0)
    assert first.algorithm == {}
    log = RunLog(out)
    assert log.header.schema_version == 5
    assert "algorithm" not in log.history()[0]
    assert log.status()["algorithm"] == {}
    assert grid_of_run(log) is None
    with pytest.raises(RunError, match="has no grid, and the call gives no grid"):
        binned(log)
    with pytest.raises(RunError, match="2 goals"):
        binned(log, GRID)
    grid = Grid(("roof", "spread"), (3, 3), ((5.0, 6.0), (6.0, 6.3)))
    best = {goal: binned(log, grid, goal=goal).births["id"] for goal in ("roof", "spread")}
    assert best["roof"] != best["spread"]


def test_births_of_any_run_of_one_goal_are_binned(toy, tmp_path, filled):
    path = grid_recipe(toy)
    text = path.read_text().split("[search]")[0].replace('"roof" }]', '"roof" }, "gsi"]')
    path.write_text(text)
    run(path, tmp_path / "other", workers=0)
    log, grid = RunLog(tmp_path / "other"), grid_of_run(RunLog(filled[0]))
    found = binned(log, grid)
    births = log.births(columns=["generation", "fitness.spread", "fitness.gsi", "fitness.roof"])
    values = {name: np.array(births[name]) for name in births.column_names}
    cells = grid.cells(np.column_stack([values["fitness.gsi"], values["fitness.roof"]]))
    losses = -values["fitness.spread"]
    first = losses[values["generation"] == 0]
    reference = first.max() + 0.1 * np.ptp(first)
    best = [losses[cells == cell].min() for cell in np.unique(cells)]
    assert len(found) == len(best)
    assert found.qd_score == pytest.approx(
        sum(max(0.0, reference - one) for one in best) / np.ptp(first)
    )
    assert found.coverage == len(best) / 30
    other = Grid(("gsi", "fsi"), (2, 2), grid.ranges)
    with pytest.raises(RunError, match="does not log the descriptors fsi"):
        binned(log, other)
    assert binned(log, grid, 0).births["generation"].to_pylist() == [0] * len(binned(log, grid, 0))


UNDEFINED = """
@evocity.fitness(range=(0, 9))
def odd(city):
    return evocity.fitness.Undefined("it is even") if number(city) % 3 else 1.0 + number(city) % 7

@evocity.fitness()
def same(city):
    return 2.0

@evocity.fitness()
def never(city):
    return evocity.fitness.Undefined("never")
"""


def with_roof_as(toy, name, search=""):
    path = grid_recipe(toy, search, measures=UNDEFINED)
    path.write_text(path.read_text().replace('"roof"', f'"{name}"'))
    return path


def test_a_birth_without_a_value_is_logged_and_does_not_enter(toy, tmp_path):
    path = with_roof_as(toy, "odd", "ranges = [[0.0, 1.0], [0.0, 9.0]]\n")
    run(path, tmp_path / "run", workers=0)
    log = RunLog(tmp_path / "run")
    births = log.births(columns=["id", "status", "error", "fitness.odd"]).to_pylist()
    without = {one["id"] for one in births if one["fitness.odd"] is None}
    assert without
    assert {one["status"] for one in births} == {"ok"}
    assert all("it is even" in one["error"] for one in births if one["id"] in without)
    assert not without & set(log.members()["id"].to_pylist())
    assert not without & set(evocity.archive(log).births["id"].to_pylist())


@pytest.mark.parametrize(
    ("name", "says"),
    [("same", "same is nearly or quite the same"), ("never", "never has a value in 0 of 2")],
)
def test_what_the_parents_do_not_differ_in_gives_no_grid(toy, tmp_path, name, says):
    path = with_roof_as(toy, name)
    with pytest.raises(RecipeError, match=says):
        run(path, tmp_path / "run", workers=0)
    search = Search(read_recipe(path), out=tmp_path / "run", workers=0)
    with pytest.raises(RecipeError, match=says):
        search.prepare()
    assert not (tmp_path / "run").exists()
    # who evaluates elsewhere is told once the parents' values are
    search = Search(read_recipe(path), workers=0)
    count = len(search.ask())
    values = {"spread": 1.0, "gsi": 0.5} | ({"same": 2.0} if name == "same" else {})
    with pytest.raises(RecipeError, match="the grid of map_elites has no ranges"):
        search.tell([values] * count)


def test_where_nobody_has_a_cell_the_run_ends_and_says_so(toy, tmp_path):
    path = with_roof_as(toy, "never", "ranges = [[0.0, 1.0], [0.0, 9.0]]\n")
    with pytest.raises(
        RunError, match=r"no birth of the 8 in generation 0 can survive(.|\n)*never"
    ):
        run(path, tmp_path / "run", workers=0)


def test_where_all_births_fail_the_run_says_why(toy, tmp_path):
    fails = "@evocity.fitness(goal='max')\ndef broken(city):\n    raise OSError('no disk')\n"
    path = grid_recipe(toy, "", 'file = "toys.py"\nname = "broken"', measures=fails)
    with pytest.raises(RunError, match=r"8 of 8 births of generation 0 failed(.|\n)*no disk"):
        run(path, tmp_path / "run", workers=0)


def test_constraints_come_first(toy, tmp_path):
    path = grid_recipe(toy, "grid = [3, 3]\n")
    text = path.read_text()
    bound = open_bound(toy, tmp_path)
    path.write_text(
        text.replace("[evaluation]", f"[[fitness]]\nname = 'fsi'\nmax = {bound}\n[evaluation]")
    )
    run(path, tmp_path / "run", workers=0)
    log = RunLog(tmp_path / "run")
    births = {one["id"]: one for one in log.births(columns=["id", "feasible"]).to_pylist()}
    members = log.members(3).to_pylist()
    kept = [one for one in members if births[one["id"]]["feasible"]]
    assert 0 < len(kept) < len(members)
    assert [one["rank"] == 0 for one in members] == [one in kept for one in members]
    assert log.status()["algorithm"]["cells"] == len(kept) == len(evocity.archive(log))


def open_bound(toy, tmp_path) -> float:
    """FSI that half of the births of a run keep."""
    path = grid_recipe(toy, "grid = [3, 3]\n")
    path.write_text(
        path.read_text().replace("[map]", "[map]", 1).replace('"roof" }]', '"roof" }, "fsi"]')
    )
    run(path, tmp_path / "before", workers=0, generations=0)
    return float(np.median(RunLog(tmp_path / "before").births()["fitness.fsi"].to_numpy()))


def test_three_descriptors(toy, tmp_path):
    path = grid_recipe(toy, "grid = [3, 4, 2]\nranges = [[0.4, 0.6], [5.0, 6.0], [6.0, 6.4]]\n")
    path.write_text(path.read_text().replace('["gsi", "roof"]', '["gsi", "roof", "spread"]'))
    run(path, tmp_path / "run", workers=0, generations=1)
    archive = evocity.archive(RunLog(tmp_path / "run"))
    assert len(archive.grid) == 24
    assert {"cell.gsi", "cell.roof", "cell.spread"} <= set(archive.births.column_names)


@pytest.mark.parametrize(
    "noted",
    [
        {"grid": [10**5, 10**5]},
        {"grid": "many"},
        {"ranges": [[1, 0], [0, 1]]},
        {"descriptors": ["gsi"]},
        {"descriptors": ["gsi", "nothing"]},
    ],
)
def test_a_damaged_grid_is_told(filled, noted):
    out, _ = filled
    about = unsealed(out / "provenance.json")
    about["recipe"]["search"] |= noted
    (out / "provenance.json").write_text(json.dumps(about))
    with pytest.raises(RunError, match=r"lacks the run's grid|logs no nothing"):
        binned(RunLog(out))


def test_three_descriptors_have_a_smaller_grid(toy):
    path = grid_recipe(toy)
    text = path.read_text()
    path.write_text(text.replace('["gsi", "roof"]', '["gsi", "roof", "spread"]'))
    assert read_recipe(path).search.keys.grid == [10, 10, 10]
