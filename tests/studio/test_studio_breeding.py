"""Children of picks: which they are, what is kept of them, and what is never executed."""

import json
import shutil
import time
import tomllib
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
from asking import OLD, Client, contents
from toy_runs import unsealed, write_toy

import evocity
from evocity.errors import OperatorError
from evocity.evaluation import Here
from evocity.fitness import registry
from evocity.studio import child_evaluation, kept_children
from evocity.studio import children as rooms
from evocity.studio.children import Breeding, Brood, plan_children
from evocity.studio.run_watcher import RunWatcher
from evocity.studio.server import running_server

# What a stranger's measure would do if anything executed it.
EXECUTED = """
import pathlib
pathlib.Path({place!r}).write_text("executed")
"""


@pytest.fixture(scope="module")
def toy(tmp_path_factory) -> Path:
    """A run that was begun here, with a measure of its own and one of evocity's."""
    folder = tmp_path_factory.mktemp("toy")
    text = '\n[[fitness]]\nname = "alignment"\n'
    path = write_toy(folder, recipe=text, generations=1, workers=0)
    with (
        patch.dict(registry._from_files),
        evocity.Search(evocity.read_recipe(path), out=folder / "run") as search,
    ):
        list(search)
    return folder / "run"


@pytest.fixture
def here(monkeypatch):
    """In this process in place of workers, where no process is what a test is about."""

    def workers(run):
        found, left = child_evaluation.workers_of(run)
        setup = found._setup
        found.close()
        return Here(setup), left

    monkeypatch.setattr(rooms, "workers_of", workers)


def bred(breeding: Breeding, moment, **asked) -> list:
    breeding.begin(Brood(**asked), moment)
    end = time.monotonic() + 120
    while breeding.busy:
        assert time.monotonic() < end
        time.sleep(0.01)
    assert breeding.error is None
    return breeding.children


BROOD = {"operators": ("pavement_fusion", "mutation"), "parents": (0, 1, 5), "count": 6, "seed": 9}


def test_the_same_picks_operators_and_seed_give_the_same_children(toy, here):
    moment, breeding = RunWatcher(toy).moment, Breeding()
    first = bred(breeding, moment, **BROOD)
    again = bred(breeding, moment, **BROOD)
    assert [one.genome.digest for one in first] == [one.genome.digest for one in again]
    assert len({one.genome.digest for one in first}) == len(first)
    other = bred(breeding, moment, **BROOD | {"seed": 10})
    assert first[1].genome.digest != other[1].genome.digest
    more = bred(breeding, moment, **BROOD | {"count": 8})
    assert [one.genome.digest for one in more[:6]] == [one.genome.digest for one in first]
    alone = evocity.operators.make("mutation")
    run = evocity.open_run(toy)
    rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence(9, spawn_key=(1, 0))))
    assert alone([run.genome(0)], rng).digest == first[1].genome.digest
    breeding.close()


def test_what_a_drawing_measures_is_told_while_it_is_measured(monkeypatch):
    breeding = Breeding()
    breeding.part, breeding.marked = object(), {0: {"gsi": 0.5}}

    def finite(values):
        breeding.marked[len(breeding.marked)] = {}  # as the thread that breeds does
        return dict(values)

    monkeypatch.setattr(rooms, "_finite", finite)
    assert breeding.state()["marked"] == {0: {"gsi": 0.5}}


def test_children_are_measured_as_the_run_measures(toy, here):
    moment, breeding = RunWatcher(toy).moment, Breeding()
    children = bred(breeding, moment, **BROOD)
    assert breeding.left == {}
    run = evocity.open_run(toy)
    for one in children:
        assert one.stage == "measured"
        assert set(one.values) == set(run.header.measures) == {"spread", "roof", "alignment"}
        assert one.values["roof"] == pytest.approx(float(one.city.heights.mean()))
    breeding.close()


@pytest.mark.slow
def test_what_is_placed_and_locked_by_hand_is_bred_bit_for_bit(toy):
    """As pavement fusion's ``positions`` has it, under a lock, through the server."""
    run = evocity.open_run(toy)
    parents = [run.genome(0), run.genome(1)]
    pavement, pixel = parents[0].pavement, parents[0].metres_per_pixel
    block, corners = pavement.block, [(0, 1), (1, 2)]
    told = {"fill": 0.5, "margin": 0, "tolerance": 1000}
    drawn = told | {
        "places": [[row * block * pixel, column * block * pixel] for row, column in corners],
        "side_min": block * pixel,
        "side_max": block * pixel,
    }
    city = evocity.decode(parents[0]).city
    mask = np.zeros(city.shape, bool)
    mask[:2, :3] = True
    cells = "".join("1" if one else "0" for one in mask.ravel())
    asked = {"operators": ["pavement_fusion"], "parameters": drawn, "parents": [0, 1], "count": 1}
    asked |= {"board": True, "drawing": {"locked": {"cell": 1, "marked": cells}}}
    with running_server(toy) as server:
        client = Client(server)
        client.open()
        about, lifs = client.get("/api/0/board?ids=0,1").framed
        assert (about["grid"], about["lifs"]) == (block, len(pavement))
        corner = np.frombuffer(lifs, "<i4").reshape(-1, 3)
        assert np.array_equal(corner[:, :2].T, pavement.corners)
        for cut, status in ((cells[:-1], 409), ("1" * len(cells), 409), ("2", 400)):
            lock = {"locked": {"cell": 1, "marked": cut}}
            assert client.post("/api/0/breed", asked | {"drawing": lock}).status == status
        assert client.get("/api/0/board?ids=0").status == 400
        assert client.post("/api/0/breed", asked).status == 200
        end = time.monotonic() + 120
        while client.get("/api/0/brood?board=1").json["busy"]:
            assert time.monotonic() < end
            time.sleep(0.05)
        (child,) = server.studio.runs[0].board.children
        assert client.get("/api/0/brood").json["children"] == []  # the others are as they were
    layer = evocity.Condensation.cut(city, mask)
    by_hand = evocity.operators.make(
        "pavement_fusion", positions=corners, size_min=1, size_max=1, **told
    )
    rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence(0, spawn_key=(0, 0))))
    wanted = by_hand([one.replace(condensation=layer) for one in parents], rng)
    assert child.genome.digest == wanted.digest != parents[0].digest
    assert child.genome.condensation == layer
    assert (child.city.heights[mask] == city.heights[mask]).all()


def squares(mask: np.ndarray) -> dict:
    """As the page sends what is marked, a cell a pixel."""
    return {"cell": 1, "marked": "".join("1" if one else "0" for one in mask.ravel())}


@pytest.mark.parametrize("shape", ["rectangle", "corner"])
def test_what_is_marked_is_what_is_measured_and_the_recipe_says_so(toy, here, tmp_path, shape):
    run = shutil.copytree(toy, tmp_path / "runs" / "night")
    for name in ("toys.py", "left.npy", "right.npy"):
        shutil.copy(toy.parent / name, tmp_path / "runs" / name)
    told = evocity.open_run(run)
    mask = np.zeros(told[0].city.shape, bool)
    mask[8:40, 4:30] = True
    if shape == "corner":
        mask[8:20, 4:15] = False
    lock = np.zeros_like(mask)
    lock[:20] = True
    asked = {"operators": ["mutation"], "parents": [1, 0], "count": 1, "board": True}
    asked |= {"drawing": {"within": squares(mask), "locked": squares(lock)}}
    taken = {"alignment": evocity.fitness.get("alignment")}
    with patch.dict(registry._from_files):
        if shape == "rectangle":  # measures of one's own do not say that they know of others
            taken |= {one.name: one for one in evocity.fitness.load_file(run.parent / "toys.py")}

    def within(city) -> dict:
        cut = city.within(mask)
        return {name: pytest.approx(float(measure(cut))) for name, measure in taken.items()}

    with running_server(run) as server:
        client = Client(server)
        client.open()
        assert client.post("/api/0/breed", asked).status == 200
        while (brood := client.get("/api/0/brood?board=1").json)["busy"]:
            time.sleep(0.01)
        (child,) = server.studio.runs[0].board.children
        assert brood["children"][0]["values"] == within(child.city)
        # parents as they are, without the lock
        assert brood["marked"] == {str(n): within(told[n].city) for n in (0, 1)}
        assert ("spread" in (child.error or "")) == (shape == "corner")
        kept = client.post("/api/0/keep", {"brood": 1, "children": [0], "board": True}).json
        asked["drawing"] = {"within": squares(np.zeros_like(mask))}
        client.post("/api/0/breed", asked)  # nothing is marked: the whole is measured
        while (brood := client.get("/api/0/brood?board=1").json)["busy"]:
            time.sleep(0.01)
        assert brood["marked"] is None
        assert set(brood["children"][0]["values"]) == {"alignment", "spread", "roof"}
    folder = Path(kept["folder"])
    assert np.array_equal(np.load(folder / "marked.npy").astype(bool), mask)
    with patch.dict(registry._from_files):
        recipe = evocity.read_recipe(folder / "recipe.toml")
        of = {one.name.partition("@")[0]: one.name.partition("@")[2] for one in recipe.measures}
        assert of == {name: "marked" * (name in taken) for name in ("spread", "roof", "alignment")}
        assert any("marked part for spread" in one for one in kept["left"]) == (shape == "corner")
        with evocity.Search(recipe, out=tmp_path / "next") as search:
            next(iter(search))
    first = evocity.open_run(tmp_path / "next")[0]
    assert first.scores["alignment@marked"] == within(first.city)["alignment"]
    assert kept_children._free_file(recipe) == "marked-2.npy"


def test_operators_and_parents_take_turns():
    plan = plan_children(Brood(**BROOD | {"vary": True}))
    assert [one.operator.name for one in plan] == ["pavement_fusion", "mutation"] * 3
    assert [one.parents for one in plan] == [
        (0, 1), (0,), (1, 5), (1,), (5, 0), (5,),
    ]  # fmt: skip
    plain = plan_children(Brood(**BROOD))[::2]
    assert [one.parents for one in plain] == [(0, 1, 5), (1, 5, 0), (5, 0, 1)]
    brood = Brood(operators=("quarter_fusion",), parents=(3, 4), count=4, vary=True)
    fills = [one.operator.fill for one in plan_children(brood)]
    assert len(set(fills)) == 4
    assert all(0.1 <= fill <= 0.9 for fill in fills)
    told = Brood(operators=("quarter_fusion",), parents=(3, 4), vary=True, parameters={"fill": 0.5})
    assert {one.operator.fill for one in plan_children(told)} == {0.5}


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        ({"operators": ("fuse",)}, "no operator is called"),
        ({"operators": ("pavement_fusion",), "parents": (3,)}, "pick more births"),
        ({"operators": ("mutation",), "parameters": {"rate": "x"}}, "mutation"),
        ({"operators": ("mutation",), "parameters": {"__class__": 1}}, "unknown"),
        ({"parameters": {"repair": 1}}, "choose one operator"),
    ],
)
def test_what_does_not_go_together_is_refused(asked, told):
    with pytest.raises(OperatorError, match=told):
        plan_children(Brood(**BROOD | asked))


def stranger(toy: Path, folder: Path) -> Path:
    """The run as it comes from another machine, its measure one that leaves a trace."""
    run = shutil.copytree(toy, folder / "run")
    path = run / "provenance.json"
    told = unsealed(path)
    told["marks"] = []
    path.write_text(json.dumps(told))
    trace = folder / "trace"
    for file in (run / "fitness").rglob("*.py"):
        file.write_text(EXECUTED.format(place=str(trace)) + file.read_text())
    (folder / "toys.py").write_text(EXECUTED.format(place=str(trace)))
    return run


def test_a_strangers_measures_are_never_executed(toy, here, tmp_path):
    run = stranger(toy, tmp_path)
    before = contents(run)
    with running_server(run) as server:
        client = Client(server)
        client.open()
        brood = json.loads(json.dumps(BROOD))
        assert client.post("/api/0/breed", brood).status == 200
        end = time.monotonic() + 120
        while (told := client.get("/api/0/brood").json)["busy"]:
            assert time.monotonic() < end
        assert told["error"] is None
        assert [set(one["values"]) for one in told["children"]] == [{"alignment"}] * 6
        assert set(told["left"]) == {"spread", "roof"}
        assert "was not started on this machine" in told["left"]["roof"]
        kept = client.post("/api/0/keep", {"brood": 1, "children": [0], "picks": [5]}).json
        assert "toys.py" in kept["left"]
    recipe = tomllib.loads(Path(kept["recipe"]).read_text())
    assert [one["name"] for one in recipe["fitness"]] == ["alignment"]
    assert "evaluation" not in recipe
    assert not (tmp_path / "trace").exists()
    assert contents(run) == before


def test_what_is_kept_goes_on_by_its_recipe(toy, here, tmp_path):
    run = shutil.copytree(toy, tmp_path / "runs" / "night")
    for name in ("toys.py", "left.npy", "right.npy"):
        shutil.copy(toy.parent / name, tmp_path / "runs" / name)
    with running_server(run) as server:
        client = Client(server)
        client.open()
        client.post("/api/0/breed", json.loads(json.dumps(BROOD)))
        while client.get("/api/0/brood").json["busy"]:
            time.sleep(0.01)
        sheet, _ = client.get("/api/0/brood-tiles?brood=1&ids=0,3,77").framed
        assert sheet["tiles"] == [0, 3]
        picture = client.get("/api/0/brood-picture?brood=1&id=3")
        assert picture.content.startswith(b"\x89PNG")
        assert client.get("/api/0/brood-picture?brood=2&id=3").status == 409
        for asked in ({"children": [77]}, {"brood": 9}, {"picks": [999]}):
            refused = client.post("/api/0/keep", {"brood": 1, "children": [3], "picks": []} | asked)
            assert refused.status == 409
        assert not (run.parent / "night-children").exists()
        before = contents(run)
        told = [
            client.post("/api/0/keep", {"brood": 1, "children": [3, 0], "picks": [5]}).json
            for _ in range(2)
        ]
        genome = server.studio.runs[0].breeding.child(1, 3).genome
        assert contents(run) == before
    assert [Path(one["folder"]).name for one in told] == ["night-children", "night-children-2"]
    folder = Path(told[0]["folder"])
    assert told[0]["files"] == ["child-0.parquet", "child-3.parquet", "recipe.toml"]
    kept = evocity.read_genome(folder / "child-3.parquet")
    assert kept == genome
    assert kept.made["studio"] == {
        "run": "night",
        "parents": [1],
        "parameters": {},
        "number": 3,
        "seed": 9,
    }
    with patch.dict(registry._from_files):
        recipe = evocity.read_recipe(folder / "recipe.toml")
        assert recipe.run.name == "night-children"
        with evocity.Search(recipe, out=tmp_path / "next") as search:
            next(iter(search))
    sources = evocity.open_run(tmp_path / "next").sources()
    assert [one.genome.digest for one in sources[:2]] == [
        kept.digest,
        evocity.read_genome(folder / "child-0.parquet").digest,
    ]
    assert sources[2].genome.digest == evocity.open_run(run).genome(5).digest


@pytest.mark.slow
def test_one_brood_at_a_time_in_workers_that_end_with_the_server(tmp_path):
    run, other = (shutil.copytree(OLD / "run-6", tmp_path / one) for one in ("night", "other"))
    with running_server(run, other) as server:
        client = Client(server)
        client.open()
        assert client.post("/api/0/ready", {}).status == 200
        while client.get("/api/0/brood").json["busy"]:
            time.sleep(0.05)
        assert client.post("/api/0/ready", {"x": 1}).status == 400
        assert client.get("/api/1/births").status == 200  # the other run is open by then
        asked = {"operators": ["mutation"], "parents": [3], "count": 24, "seed": 1}
        assert client.post("/api/0/breed", asked).status == 200
        refused = client.post("/api/0/breed", asked)
        assert (refused.status, refused.json["error"]["expected"]) == (
            409,
            "one group of children at a time",
        )
        waiting = client.post("/api/1/ready", {})
        assert (waiting.status, waiting.json["waits"]) == (200, True)
        assert client.post("/api/0/ready", {"board": True}).json["waits"]
        seen = set()
        while (told := client.get("/api/0/brood").json)["busy"]:
            seen |= {one["stage"] for one in told["children"]}
        stages = [one["stage"] for one in told["children"]]
        assert set(stages) <= {"measured", "failed"}
        workers = server.studio.runs[0].breeding._workers
        assert workers.described["engine"] == "workers"
        assert client.post("/api/1/ready", {}).status == 200
        assert workers._seats == {}
        assert [one["stage"] for one in client.get("/api/0/brood").json["children"]] == stages
        while client.get("/api/1/brood").json["busy"]:
            time.sleep(0.05)
        workers = server.studio.runs[1].breeding._workers
        assert workers._seats
        assert client.post("/api/1/stop", {}).status == 200
    assert workers._seats == {}


def test_a_run_breeds_the_same_beside_a_studio(toy, tmp_path, monkeypatch):
    """Whose births are asked for after every generation, with pictures and picks."""
    monkeypatch.setattr("evocity.studio.run_watcher.FRESH", 0.0)
    path = write_toy(
        tmp_path, recipe='\n[[fitness]]\nname = "alignment"\n', generations=1, workers=0
    )
    with (
        patch.dict(registry._from_files),
        evocity.Search(evocity.read_recipe(path), out=tmp_path / "run") as search,
    ):
        generations = iter(search)
        next(generations)
        search.flush()
        with running_server(tmp_path / "run") as server:
            client = Client(server)
            client.open()
            assert client.get("/api/0/changes?after=-1").json["going"] is True
            for _ in range(2):
                about, _ = client.get("/api/0/births").framed
                client.get("/api/0/tiles?ids=0,1,2,3,4,5&side=96")
                client.post("/api/0/pick", {"change": "pick", "ids": [about["count"] - 1]})
                next(generations, None)
                search.flush()
            assert client.get("/api/0/births").framed[0]["generation"] == 1
    left, right = (evocity.open_run(one) for one in (toy, tmp_path / "run"))
    names = [name for name in left.births().column_names if name != "seconds"]
    assert left.births(columns=names).equals(right.births(columns=names))


@pytest.mark.parametrize(
    "body",
    [
        {},
        {"operators": [], "parents": [3]},
        {"operators": ["mutation"], "parents": []},
        {"operators": ["mutation"], "parents": [3], "count": 25},
        {"operators": ["mutation"], "parents": [3], "count": 0},
        {"operators": ["mutation"], "parents": [3], "seed": -1},
        {"operators": ["mutation"], "parents": [3], "seed": 2**63},
        {"operators": ["mutation"] * 13, "parents": [3]},
        {"operators": ["mutation"], "parents": list(range(17))},
        {"operators": ["mutation"], "parents": [3], "file": "x.py"},
        {"operators": ["mutation"], "parents": ["3"]},
        {"operators": [["os", "system"]], "parents": [3]},
    ],
)
def test_broods_are_asked_for_in_one_form(asked, body):
    assert asked.post("/api/0/breed", body).status == 400
    assert asked.get("/api/0/brood").json["brood"] == 0


@pytest.mark.parametrize("parents", [[99_999], [2**62]])
def test_who_is_no_birth_is_no_parent(asked, parents):
    told = asked.post("/api/0/breed", {"operators": ["mutation"], "parents": parents})
    assert told.status == 409


def test_every_operator_is_told_with_its_parameters(asked):
    told = {one["name"]: one for one in asked.get("/api/0/operators").json["operators"]}
    assert set(told) == set(evocity.operators.operators())
    turns = {name for name, one in told.items() if one["turns"] and one["of"] == "fabric"}
    assert turns == {
        "quarter_fusion",
        "region_fusion",
        "lambda_crossover",
        "quarter_refill",
        "relocation",
        "height_scaling",
        "interpolation",
        "mutation",
    }
    fusion = told["quarter_fusion"]
    assert fusion["reason"] == "it needs 2 or more parents"
    assert {"name": "density", "default": "0.5"} in fusion["parameters"]
    for one in told.values():
        for parameter in one["parameters"]:
            json.loads(parameter["default"])


def test_operators_that_do_not_suit_the_picks_say_why(asked, toy, here):
    """Each of those that suit breeds a child; the others are refused before they fail."""
    listed = asked.get("/api/0/operators?ids=3,20").json["operators"]
    reasons = {one["name"]: one["reason"] for one in listed}
    of_fabric = set(evocity.operators.operators(["fabric"]))
    for name, reason in reasons.items():
        assert (name in of_fabric) != ("not city fabrics" in reason)
    assert {name for name in of_fabric if reasons[name]} == {"plan_spread", "plan_return"}
    breeding = Breeding()
    suiting = [name for name, reason in reasons.items() if not reason]
    moment = RunWatcher(toy).moment
    for names in (suiting[:12], suiting[12:]):
        children = bred(breeding, moment, operators=tuple(names), parents=(0, 1), count=len(names))
        assert [one.operator.name for one in children if one.stage != "measured"] == []
    for name in set(reasons) - set(suiting):
        with pytest.raises(OperatorError, match=f"the operator {name} does not suit"):
            breeding.begin(Brood(operators=(name,), parents=(0, 1), count=1), moment)
    filled = bred(breeding, moment, operators=("plan_fusion",), parents=(0, 1), count=1)[0].genome
    if filled.made["faces"]:
        kind = evocity.operators.operators()["plan_return"]
        assert evocity.operators.reason_against(kind, ["fabric"], [filled]) == ""
    breeding.close()


def test_a_field_that_changes_nothing_says_why(toy, here):
    moment, breeding = RunWatcher(toy).moment, Breeding()
    parents, side = [moment.run.genome(n) for n in (0, 1)], 8
    field = evocity.operators.make

    def reason(values, genomes=parents, **more) -> str:
        return field("lambda_field", side=side, values=values, **more).reason_unchanged(genomes)

    none, low, all_of = ([value] * side**2 for value in (0, 0.001, 1))
    assert reason(none) == "λ is 0 everywhere"
    assert reason(low).startswith("λ is at most 0.00 in street blocks that first change at ")
    assert reason(all_of) == ""
    assert "no large street block" in reason(all_of, area_min=1e6)
    bare = parents[0].replace(beta=parents[0].beta * 0, sigma=parents[0].sigma * 0)
    assert reason(all_of, [parents[0], bare]).startswith("no buildings of the other parents fit")
    asked = {"operators": ("lambda_field",), "parents": (0, 1), "count": 1, "board": True}
    for values, unchanged in ((none, "λ is 0 everywhere"), (all_of, None)):
        parameters = {"side": side, "values": values}
        (child,) = bred(breeding, moment, **asked, parameters=parameters)
        assert child.state["unchanged"] == unchanged
    breeding.close()


def test_the_lock_of_a_drawing_is_hatched_on_its_child(toy, here):
    moment, breeding = RunWatcher(toy).moment, Breeding()
    mask = np.zeros((64, 64), bool)
    mask[:20] = True
    asked = {"operators": ("mutation",), "parents": (0,), "count": 1}
    pictures = []
    for drawing in (None, {"locked": squares(mask)}):
        bred(breeding, moment, **asked, drawing=drawing)
        child = breeding.child(breeding.number, 0)
        pictures.append(np.asarray(breeding.picture(breeding.number, 0)))
        child.city = moment.run[0].city  # the same map
        pictures[-1] = np.asarray(breeding.picture(breeding.number, 0))
    changed = np.abs(pictures[0].astype(int) - pictures[1]).sum(axis=2) > 0
    rows, columns = np.nonzero(changed)
    zoom = 5  # the map has 64 px
    assert np.ptp(rows) == 20 * zoom - 1
    assert np.ptp(columns) == 64 * zoom - 1
    assert 0.1 < changed.sum() / mask.sum() / zoom**2 < 0.5
    breeding.close()
