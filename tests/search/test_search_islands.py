"""Islands: populations by their own operators, goals and algorithms, migration, one log."""

import json
import re
import shutil
import time

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st
from test_search_commands import events, steered
from test_search_recipe import faults
from test_search_run import rows, run, started
from toy_runs import append_events, unsealed

import evocity
from evocity.analysis.page import Page
from evocity.analysis.page.islands import Islands
from evocity.cli import main
from evocity.cli.shared.search_progress import progress_line
from evocity.errors import RecipeError, RunError
from evocity.recipe.islands import MigrationSection
from evocity.report import write_report
from evocity.search import Search, archive, read_recipe
from evocity.search.breeding.archipelago import Archipelago
from evocity.search.record import commands
from evocity.search.record.commands import Pick, Reweight
from evocity.search.record.grid import binned, grid_of_run
from evocity.search.resume.logged_plans import plan_of
from evocity.search.resume.prepared_run import read_preparation
from evocity.store import RunLog

GSI = """
[[fitness]]
name = "gsi"
target = 0.3
"""

THREE = (
    GSI
    + """
[[islands]]
name = "cells"
population = 5
measures = ["spread"]
algorithm = "map_elites"
descriptors = ["gsi", "fsi"]
grid = [4, 4]
operators = { mutation = 3, pavement_fusion = 1 }
[[islands]]
name = "towers"
measures = ["spread", "roof"]
[[islands]]
name = "crowd"
algorithm = "nsga2"
[migration]
along = "complete"
every = 2
migrants = 2
"""
)

SUMS = """
[[fitness]]
name = "gsi"
target = 0.3
objective = "form"
[[fitness]]
name = "mean_height"
target = 9.0
objective = "form"
[search]
adapt = true
[[islands]]
measures = ["form", "spread"]
weights = { gsi = 20.0 }
[[islands]]
operators = { mutation = 1, lambda_crossover = 2 }
[migration]
every = 1
"""

ASKED = {
    0: [Pick(ids=(3, 7), share=0.7)],
    1: [Reweight(weights={"mutation": 5, "mean_height": 3.0})],
}


def moves(path) -> list[dict]:
    return [
        {"generation": one["generation"], **move}
        for one in events(path, "migration")
        for move in one["moves"]
    ]


def status(path, *options) -> str:
    result = CliRunner().invoke(main, ["status", str(path), *options])
    assert result.exit_code == 0, result.output
    return result.stdout


def without_islands(found: list[dict]) -> list[dict]:
    return [{key: one for key, one in row.items() if key != "island"} for row in found]


# -- laws -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "rest",
    [
        "[search]\nadapt = true\n[refine]\nbirths = 1\nevery = 2\nbudget = 2",
        '[search]\nalgorithm = "nsga3"\ndistinct = 0.2',
    ],
)
def test_one_island_is_a_run_without_islands(toy, tmp_path, rest):
    recipe = toy(recipe=GSI + rest)
    steered(recipe, tmp_path / "plain", ASKED | {1: [Reweight(weights={"mutation": 5})]})
    recipe.write_text(recipe.read_text() + "\n[[islands]]\nname = 'alone'\n")
    steered(recipe, tmp_path / "alone", ASKED | {1: [Reweight(weights={"mutation": 5})]})
    found = rows(tmp_path / "alone")
    assert {row["island"] for row in found} == {"alone"}
    assert without_islands(found) == rows(tmp_path / "plain")
    alone, plain = (RunLog(tmp_path / name) for name in ("alone", "plain"))
    volumes = [[one["hypervolume"] for one in log.history()] for log in (alone, plain)]
    assert volumes[0] == volumes[1]
    last = alone.status()["islands"]["alone"]
    assert (last["hypervolume"], last["best"]) == (volumes[1][-1], plain.status()["best"])
    assert "island" not in plain.births().column_names + plain.members().column_names
    assert (plain.header.schema_version, alone.header.schema_version) == (5, 7)
    assert plain.status()["islands"] == {}


def test_without_migration_no_island_knows_of_another(toy, tmp_path):
    two = "[[islands]]\nname = 'a'\npopulation = 5\n[[islands]]\nname = 'b'\npopulation = 4\n{}"
    two += "[migration]\nalong = 'none'\n"
    recipe = toy(recipe=GSI + two.format(""))
    recipe.write_text(recipe.read_text().replace("population = 8\n", ""))
    run(recipe, tmp_path / "one", workers=0)
    other = 'measures = ["roof"]\nalgorithm = "single"\noperators = { mutation = 1 }\n'
    recipe.write_text(recipe.read_text().replace(two.format(""), two.format(other)))
    run(recipe, tmp_path / "two", workers=0)
    ours = [
        [row for row in rows(tmp_path / name) if row["island"] == "a"] for name in ("one", "two")
    ]
    assert ours[0]
    keys = ours[1][0].keys() & ours[0][0].keys()
    told = [
        [{k: v for k, v in row.items() if k in keys or "slot" in row} for row in of] for of in ours
    ]
    assert told[0] == told[1]
    theirs = [[row for row in rows(tmp_path / n) if row["island"] == "b"] for n in ("one", "two")]
    assert theirs[0] != theirs[1]
    assert not events(tmp_path / "one", "migration")


@given(st.integers(1, 12), st.sampled_from(["ring", "complete", "none"]))
def test_neighbours(count, along):
    pairs = MigrationSection(along=along).neighbours(count)
    assert len(set(pairs)) == len(pairs)
    assert all(giver != taker for giver, taker in pairs)
    gives = [sum(giver == one for giver, _ in pairs) for one in range(count)]
    takes = [sum(taker == one for _, taker in pairs) for one in range(count)]
    each = {"ring": min(1, count - 1), "complete": count - 1, "none": 0}[along]
    assert gives == takes == [each] * count
    if along == "ring" and count > 1:  # who walks along it passes all
        after, place = dict(pairs), 0
        for _ in range(count):
            place = after[place]
        assert place == 0
        assert len(after) == count


@pytest.mark.slow
def test_workers_do_not_matter(toy, tmp_path):
    recipe = toy(recipe=THREE, population=15)
    for count in (0, 1, 2):
        run(recipe, tmp_path / f"run-{count}", workers=count)
    expected = rows(tmp_path / "run-0")
    assert {row["island"] for row in expected} == {"cells", "towers", "crowd"}
    assert moves(tmp_path / "run-0")
    for count in (1, 2):
        assert rows(tmp_path / f"run-{count}") == expected
        assert moves(tmp_path / f"run-{count}") == moves(tmp_path / "run-0")


@pytest.mark.slow
@pytest.mark.parametrize("rest", [THREE, SUMS])
def test_a_run_that_was_stopped_goes_on_to_the_same_births(toy, tmp_path, rest):
    recipe = toy(recipe=rest, population=15, generations=4)
    steered(recipe, tmp_path / "whole", asked := ASKED if rest is SUMS else {})
    expected = rows(tmp_path / "whole")
    for last in (0, 2, 3) if rest is THREE else (1, 2):
        out = tmp_path / f"stopped-{last}"
        steered(recipe, out, asked, stop_after=last)
        with Search.resume(out, workers=0) as search:
            for generation in search:
                for command in asked.get(generation.number, ()):
                    commands.send(out, command)
        assert rows(out) == expected
        assert moves(out) == moves(tmp_path / "whole")
        assert RunLog(out).history()[-1]["islands"] == generation.islands
    (weighed,) = {json.dumps(sorted(e["weights"])) for e in events(out, "weights")} or {"[]"}
    assert json.loads(weighed) == (["island-1", "island-2"] if rest is SUMS else [])


@pytest.mark.long
def test_a_killed_run_goes_on_to_the_same_births(toy, tmp_path):
    recipe = toy(recipe=THREE, population=15, generations=6)
    run(recipe, tmp_path / "whole", workers=0)
    search, last = (
        started(recipe, tmp_path / "killed"),
        np.random.default_rng(time.time_ns()).integers(5),
    )
    for line in search.stdout:
        if line.strip() == str(last).encode():
            break
    search.kill()
    search.communicate()
    with Search.resume(tmp_path / "killed", workers=0) as search:
        list(search)
    assert rows(tmp_path / "killed") == rows(tmp_path / "whole")


def test_each_birth_is_drawn_again_as_it_was(toy, tmp_path):
    run(recipe := toy(recipe=THREE, population=15), tmp_path / "run", workers=0)
    log = RunLog(tmp_path / "run")
    prepared, _ = read_preparation(log)
    for identifier in range(0, 60, 7):
        plan = plan_of(log, prepared, identifier)  # raises unless operator and parents are the same
        (birth,) = log.individuals([identifier])
        assert plan.island == birth.island
        if plan.operator is not None:
            child = plan.operator(plan.genomes, plan.rng)
            assert np.array_equal(child.sigma, birth.genome.sigma)
    assert read_recipe(recipe).at(4).search.algorithm == "map_elites"


# -- who lives where ------------------------------------------------------------------------------


def test_migrants_are_the_best_that_did_not_live_there(toy, tmp_path):
    recipe = toy(recipe=THREE.replace("every = 2", "every = 3"), population=15, generations=2)
    with Search(read_recipe(recipe), out=tmp_path / "short", workers=0) as search:
        list(search)
    lived = living(tmp_path / "short", 2)
    with Search.resume(tmp_path / "short", generations=3, workers=0) as search:
        list(search)
    run(recipe, tmp_path / "none", workers=0, generations=3)  # the same run
    told = moves(tmp_path / "short")
    assert [(one["from"], one["to"]) for one in told] == [
        ("cells", "towers"),
        ("cells", "crowd"),
        ("towers", "crowd"),
        ("towers", "cells"),
        ("crowd", "cells"),
        ("crowd", "towers"),
    ]
    after = living(tmp_path / "short", 3)
    log = RunLog(tmp_path / "short")
    home = dict(zip(*(log.births()[name].to_pylist() for name in ("id", "island")), strict=True))
    newly = set(log.births(3)["id"].to_pylist())
    for one in told:
        assert one["generation"] == 3
        assert 0 < len(one["ids"]) <= 2
        assert one["stayed"] == [two for two in one["ids"] if two in after[one["to"]]]
        assert not set(one["ids"]) & set(lived[one["to"]])
        own = {two for two in newly if home[two] == one["from"]}
        assert set(one["ids"]) <= set(lived[one["from"]]) | own
    for name, ids in after.items():  # whoever lives, was born there, lived there, or came
        came = {two for one in told if one["to"] == name for two in one["ids"]}
        assert set(ids) <= set(lived[name]) | {two for two in newly if home[two] == name} | came
    assert any(one["stayed"] for one in told)


def living(path, generation) -> dict[str, list[int]]:
    found: dict[str, list[int]] = {}
    for row in RunLog(path).members(generation).to_pylist():
        found.setdefault(row["island"], []).append(row["id"])
        assert row["slot"] == len(found[row["island"]]) - 1
    return found


def test_the_sources_settle_on_all_islands(toy, tmp_path):
    run(toy(recipe=THREE, population=30, generations=0), tmp_path / "run", workers=0)
    log = RunLog(tmp_path / "run")
    births = log.births(0).to_pylist()
    assert [one["island"] for one in births] == ["cells"] * 5 + ["towers"] * 13 + ["crowd"] * 12
    assert [one["operator"] for one in births].count("source") == 2
    assert all({0, 1} & set(ids) for ids in living(tmp_path / "run", 0).values())


ON_A_GRID = """
[[islands]]
algorithm = "map_elites"
measures = ["spread"]
descriptors = [{}]
[[islands]]
"""


def test_a_grid_that_parents_span_on_no_island_is_refused_before_the_first_birth(toy, tmp_path):
    same = '@evocity.fitness(goal="max")\ndef same(city):\n    return 1.0'
    recipe = toy(same, ON_A_GRID.format('"same", "gsi"'))
    with pytest.raises(RecipeError, match=r"same is nearly or quite the same .* \(1, 1\)"):
        run(recipe, tmp_path / "run", workers=0)
    assert not (tmp_path / "run").exists()


def test_a_source_that_failed_is_told_where_a_grid_has_no_ranges(toy, tmp_path):
    fails = """
@evocity.fitness(goal="max")
def moody(city):
    if city.heights.mean() < {}:
        raise ValueError("too low")
    return 1.0
"""
    means = [float(np.load(toy().with_name(f"{side}.npy")).mean()) for side in ("left", "right")]
    recipe = toy(fails.format(np.mean(means)), ON_A_GRID.format('"gsi", "fsi"'))
    with pytest.raises(RecipeError) as told:
        run(recipe, tmp_path / "run", workers=0)
    assert "gsi has a value in 1 of 2 parents' codes" in str(told.value)
    assert re.search(r"; source [01] failed: .* raised ValueError: too low", str(told.value))


def test_columns_and_figures_are_those_of_each_island(toy, tmp_path):
    told = run(toy(recipe=THREE, population=15), tmp_path / "run", workers=0)
    log = RunLog(tmp_path / "run")
    assert log.header.marks == ("cell", "contribution", "crowding")
    own = {"cells": "cell", "towers": "contribution", "crowd": "crowding"}
    for row in log.members().to_pylist():
        assert [row[mark] is not None for mark in own.values()] == [
            name == row["island"] for name in own
        ]
    last = log.status()["islands"]
    assert last == told[-1].islands
    assert set(last["cells"]["algorithm"]) == {"coverage", "cells", "qd_score"}
    assert [list(last[name]["best"]) for name in own] == [
        ["spread"],
        ["spread", "roof"],
        ["spread", "roof", "gsi"],
    ]
    together = {one for ids in living(tmp_path / "run", 3).values() for one in ids}
    assert {one.id for one in told[-1].population} == together
    assert len(told[-1].population) == len(together)
    values = {one.id: one.values for one in told[-1].population}
    assert log.status()["best"]["roof"] == min(one["roof"] for one in values.values())
    assert log.status()["hypervolume"] == pytest.approx(archive(log).hypervolume_alive)
    for name, ids in living(tmp_path / "run", 3).items():
        best = max(values[one]["spread"] for one in ids)
        assert (last[name]["living"], last[name]["best"]["spread"]) == (len(ids), best)
    grid = grid_of_run(log, "cells")
    assert grid.descriptors == ("gsi", "fsi")
    assert [grid_of_run(log), grid_of_run(log, "towers")] == [None, None]
    found = binned(log, grid, goal="spread")
    assert len(found) >= last["cells"]["living"]
    with pytest.raises(RunError, match="no island 'nowhere'"):
        grid_of_run(log, "nowhere")


def test_commands_count_on_all_islands(toy, tmp_path):
    recipe, out = toy(recipe=SUMS, population=8), tmp_path / "run"
    steered(recipe, out, {0: [Pick(ids=(7,), share=1.0), Reweight(weights={"gsi": 9.0})]})
    births = RunLog(out).births(2).to_pylist()
    assert {one["parents"][0] for one in births} == {7}
    with Search.resume(out, generations=4, workers=0) as search:
        aims = [island.aims for island in search._population.islands]
        assert [[w.weight for w in one.wanted if w.total] for one in aims] == [[9.0, 1.0]] * 2
    nothing = Reweight(weights={"mutation": 0, "lambda_crossover": 0})
    with pytest.raises(
        RunError, match=r"all operators of an island \(mutation, lambda_crossover\)"
    ):
        commands.send(out, nothing)
    with pytest.raises(RunError, match="has no weight 'height_scaling'"):
        commands.send(out, Reweight(weights={"height_scaling": 1}))
    with Search(read_recipe(recipe), workers=0) as search:
        search.reweight(mutation=0, lambda_crossover=0)
        search.reweight(pavement_fusion=3)
        next(iter(search))
        assert search._steering.orders.weights == {"pavement_fusion": 3}


def test_weights_of_an_island_count_there_alone(toy):
    prepared = Search(read_recipe(toy(recipe=SUMS)), workers=0)
    with prepared as search:
        search.prepare()
        weights = [
            {w.measure.name: w.weight for w in island.aims.wanted if w.total}
            for island in Archipelago(search._prepared).islands
        ]
    assert weights == [{"gsi": 20.0, "mean_height": 1.0}, {"gsi": 1.0, "mean_height": 1.0}]
    assert search._prepared.aims.names == ("spread", "roof", "form")


def test_islands_in_python():
    recipe = evocity.Recipe(
        parents=["lyon-1er", "montpellier-pas-du-loup"],
        fitness=["alignment", {"name": "gsi", "min": 0.3, "max": 0.5}, "crumbs"],
        run={"population": 10},
        operators={"quarter_fusion": {"weight": 2, "fill": 0.3}, "mutation": 1},
        islands=[
            {"measures": ["crumbs"], "operators": {"mutation": 1, "quarter_fusion": 4}},
            {"name": "rest", "population": 7},
        ],
        migration={"along": "complete", "every": 3, "migrants": 1},
    )
    assert [one.name for one in recipe.islands] == ["island-1", "rest"]
    assert recipe.slots == [range(3), range(3, 10)]
    first, rest = recipe.local
    assert list(first.operators) == ["mutation", "quarter_fusion"]
    assert first.operators["quarter_fusion"].weight == 4
    assert first.parameters("quarter_fusion") == rest.parameters("quarter_fusion") == {"fill": 0.3}
    assert evocity.Recipe(parents=["lyon-1er"], fitness=["crumbs"]).local[0].islands == []


# -- bad input ------------------------------------------------------------------------------------

FAULTS = [
    ('[[islands]]\nname = "a"\n[[islands]]\nname = "a"', "islands[1].name: 'a' twice"),
    ('[[islands]]\nname = "a/b"', "islands[0].name: 'a/b'"),
    ("[[islands]]\npopulation = 1\n[[islands]]", "islands[0].population: 1; allowed: 2 or more"),
    ("[[islands]]\npopulation = 7\n[[islands]]", "run.population: 8 on 2 islands; allowed: 9 or"),
    ("[[islands]]\npopulation = 5\n[[islands]]\npopulation = 5", "run.population: 8; allowed: 10,"),
    ("[[islands]]\n" * 5, "run.population: 8 on 5 islands; allowed: 10 or more"),
    ("[[islands]]\npopulatoin = 4", "unknown key, did you mean population?"),
    ('[[islands]]\nmeasures = ["spreed"]', "islands[0].measures: 'spreed', which is not a goal"),
    ('[[islands]]\nmeasures = ["spread", "spread"]', "'spread' twice; allowed: each goal once"),
    ("[[islands]]\nmeasures = []", "islands[0].measures: []; allowed: 1 or more"),
    (
        "[[islands]]\nweights = { spread = 2 }",
        "islands[0].weights: 'spread', which is in no sum",
    ),
    ("[[islands]]\nweights = { spread = 0 }", "islands[0].weights.spread: 0; allowed: above 0"),
    ('[[islands]]\nalgorithm = "map_elite"', "did you mean map_elites?"),
    ('[[islands]]\nalgorithm = "single"', "islands[0].algorithm: 'single' with 2 goals"),
    ('[[islands]]\nalgorithm = "cma"', "islands[0].algorithm: 'cma', which breeds by itself"),
    ("[[islands]]\ndistinct = 3", "islands[0].distinct: 3; allowed: 1.0 or less"),
    ("[[islands]]\ngrid = [2, 2]", "islands[0].grid: a key of map_elites, not of hypervolume"),
    ("[[islands]]\nadapt = true", "islands[0].adapt: unknown key"),
    (
        '[[islands]]\nalgorithm = "map_elites"\nmeasures = ["roof"]\ndescriptors = ["gsi", "gsy"]',
        "islands[0].descriptors: no measure 'gsy'",
    ),
    (
        "[[islands]]\noperators = { mutatoin = 1 }",
        "islands[0].operators.mutatoin: unknown operator",
    ),
    (
        "[[islands]]\noperators = { pavement_fusion = { side_max = 2.0 } }",
        "islands[0].operators.pavement_fusion",
    ),
    ("[[islands]]\noperators = { mutation = 0 }", "islands[0].operators: all weights are 0"),
    ("[[islands]]\noperators = 3", "islands[0].operators: 3; allowed: a table"),
    ("islands = 3", "islands: 3; allowed: a list"),
    ("[migration]\nevery = 3", "migration: without islands"),
    ('[[islands]]\n[migration]\nalong = "rign"', "migration.along: 'rign'; allowed: 'ring', "),
    ("[[islands]]\n[migration]\nevery = 0", "migration.every: 0; allowed: 1 or more"),
    ("[[islands]]\n[migration]\nmigrants = 9", "migration.migrants: 9; allowed: 8 or fewer"),
    ("[[islands]]\n[migration]\nmigrant = 9", "unknown key, did you mean migrants?"),
    ("[[islands]]\n[[islands]]\n[refine]\nbirths = 5", "refine.births: 5 of 4 births a generation"),
    ("[search]\nwindow = 8\n[[islands]]", "search.window: 8, with 1 islands; allowed: no window"),
    ('[search]\nalgorithm = "cma"\n[[islands]]', "search.algorithm: 'cma', which breeds by itself"),
]


@pytest.mark.parametrize(("text", "says"), FAULTS)
def test_faults_are_told_with_their_keys(toy, text, says):
    recipe = toy()
    before = recipe.read_text()
    at = before.index("[[fitness]]") if text.startswith("islands") else len(before)
    recipe.write_text(text + "\n" + before if text.startswith("islands") else before[:at] + text)
    (told,) = faults(recipe)
    assert says in told


def test_all_faults_at_once(toy):
    text = '[[islands]]\npopulation = 1\nmeasures = "all"\n[[islands]]\nalgorithm = "x"\n'
    told = faults(toy(recipe=text + "[migration]\nalong = 1\nevry = 2\n"))
    keys = ["population", "measures", "algorithm"]
    for key in [*(f"islands[{number // 2}].{key}" for number, key in enumerate(keys))]:
        assert any(one.startswith(key) for one in told), key
    assert any("migration.along" in one for one in told)
    assert any("did you mean every?" in one for one in told)


def test_what_islands_a_run_has_is_not_changed(toy, tmp_path):
    run(toy(recipe=THREE, population=15, generations=1), tmp_path / "run", workers=0)
    recipe = tmp_path / "run" / "recipe.toml"
    text = recipe.read_text()
    for old, new in [
        ('name = "towers"', 'name = "heaps"'),
        ('algorithm = "nsga2"', 'algorithm = "hypervolume"'),
        ("population = 5", "population = 6"),
    ]:
        recipe.write_text(text.replace(old, new))
        with pytest.raises(RunError, match="islands was"):
            Search.resume(tmp_path / "run", workers=0, accept_changes=True)
    recipe.write_text(text.replace("every = 2", "every = 1"))
    with Search.resume(tmp_path / "run", 2, workers=0, accept_changes=True) as search:
        list(search)
    assert [one["generation"] for one in events(tmp_path / "run", "migration")] == [2]


def test_a_stranger_s_islands_are_checked(toy, tmp_path):
    run(toy(recipe=THREE, population=15, generations=1), tmp_path / "run", workers=0)
    for kind in ("births", "membership"):
        shutil.copytree(tmp_path / "run", tmp_path / kind)
        path = tmp_path / kind / kind / "generation-00000001.parquet"
        table = pq.read_table(path)
        at = table.column_names.index("island")
        strange = pa.array(["nowhere"] * len(table)).dictionary_encode()
        pq.write_table(table.set_column(at, table.schema.field(at), strange), path)
        read = {"births": evocity.store.RunLog.births, "membership": evocity.store.RunLog.members}[
            kind
        ]
        with pytest.raises(RunError, match="an island other than cells, towers, crowd"):
            read(RunLog(tmp_path / kind), 1)
    told = unsealed(tmp_path / "run" / "provenance.json")
    told["header"]["islands"] = ["a", "a", "b"]
    (tmp_path / "run" / "provenance.json").write_text(json.dumps(told))
    with pytest.raises(RunError, match="a name twice"):
        RunLog(tmp_path / "run")


def test_deap_has_no_islands(toy):
    recipe = read_recipe(toy(recipe=THREE, population=15))
    with pytest.raises(RecipeError, match="islands"):
        evocity.deap_toolbox(recipe, workers=0)


# -- what is told ---------------------------------------------------------------------------------


@pytest.mark.slow
def test_status_and_report_tell_of_each_island(toy, tmp_path):
    out = tmp_path / "run"
    run(toy(recipe=THREE, population=15, generations=4), out, workers=0)
    told = json.loads(status(out, "--json"))
    assert told["islands"] == RunLog(out).status()["islands"]
    ids = {one for lives in living(out, 4).values() for one in lives}
    values = {one.id: one.values for one in RunLog(out).individuals(sorted(ids))}
    losses = {one: (-of["spread"], of["roof"], abs(of["gsi"] - 0.3)) for one, of in values.items()}
    front = {  # by all goals
        one
        for one in ids
        if not any(
            all(a <= b for a, b in zip(losses[other], losses[one], strict=True))
            and losses[other] != losses[one]
            for other in ids
        )
    }
    assert set(told["front"]) == front
    assert len(told["front"]) == len(front)
    lines = status(out).splitlines()
    (cells,) = [line for line in lines if line.startswith("on cells")]
    assert f"{told['islands']['cells']['living']} living, hypervolume" in cells
    assert "coverage" in cells
    assert "best spread" in cells
    page = write_report(out).read_text()
    assert "<h3>islands</h3>" in page
    facts = Page(evocity.open_run(out))
    assert facts.about["grid"]["island"] == "cells"
    assert "mutation 3, pavement_fusion 1" in page
    opened = evocity.open_run(out)
    islands = Islands(opened)
    assert opened.columns.front.tolist() == sorted(front)
    assert sum(born for _, _, born, *_ in islands.figures) == 75
    lived = living(out, 4)
    home = dict(
        zip(*(RunLog(out).births()[name].to_pylist() for name in ("id", "island")), strict=True)
    )
    for name, counts in islands.homes:
        expected = [sum(home[one] == other for one in lived[name]) for other in islands.names]
        assert counts == expected
    sent = {(giver, taker): (count, stayed) for giver, taker, count, stayed in islands.moves}
    for pair, counts in sent.items():
        of = [one for one in moves(out) if (one["from"], one["to"]) == pair]
        assert counts == tuple(sum(len(one[key]) for one in of) for key in ("ids", "stayed"))
    curves = {one["name"]: one for one in facts.curves if one["group"] == "island"}
    assert {name: one["values"][-1] for name, one in curves.items()} == {
        name: told["islands"][name]["hypervolume"] for name in islands.names
    }


def test_the_line_that_shows_a_run_tells_of_islands(toy):
    with Search(read_recipe(toy(recipe=THREE, population=15)), workers=0) as search:
        line = progress_line(generation := next(iter(search)), 3, {})
    volume = generation.islands["towers"]["hypervolume"]
    assert f" · towers {volume:.4g} · " in line
    assert re.search(r" · cells \S+ \(\d+ % filled\) · ", line)


def test_a_report_of_a_stranger_s_islands_is_no_harm(toy, tmp_path):
    out = tmp_path / "run"
    recipe = toy(recipe=THREE.replace('"towers"', '"<b>towers"'), population=15)
    assert any("'<b>towers'" in one for one in faults(recipe))
    run(toy(recipe=THREE, population=15), out, workers=0)
    told = unsealed(out / "provenance.json")
    told["recipe"]["islands"] = [{"name": "cells", "operators": 3, "search": {}}]
    del told["fitness"]
    (out / "provenance.json").write_text(json.dumps(told))
    for moved in (3, [5], [{"from": "<script>", "to": [], "ids": "all"}]):
        append_events(out, {"event": "migration", "generation": 1, "moves": moved})
    page = write_report(out).read_text()
    assert "<h3>islands</h3>" in page
    assert "<script>'" not in page
    assert "&lt;script&gt;" in page
    assert json.loads(status(out, "--json"))["generation"] == 3


def test_a_run_of_one_island_and_one_generation_has_a_report(toy, tmp_path):
    run(toy(recipe="[[islands]]\n", generations=0), tmp_path / "run", workers=0)
    assert "No individual migrated." in write_report(tmp_path / "run").read_text()
