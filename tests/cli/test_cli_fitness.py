"""`evocity fitness`: a measure begun, tried, timed and listed; every way it can be wrong."""

import errno
import io
import json
import math
import os
import textwrap
from importlib import import_module

import numpy as np
import pytest
import rasterio
from affine import Affine
from cli_tools import AT_2_M, PLAIN, call, contents, refused, write_town

import evocity
from evocity.cli.fitness_check import PARENTS, trial_cases
from evocity.cli.fitness_new import measure_text, views
from evocity.fitness import measures, registry
from evocity.towns import PATTERNS

HEADER = 'import evocity\nimport numpy as np\n\n\n@evocity.fitness(goal="max")\n'


@pytest.fixture
def own(tmp_path):
    """Writes a file with the measure ``mine`` whose body begins in line 8."""

    def write(body, name="mine.py", signature="city"):
        path = tmp_path / name
        lines = textwrap.indent(textwrap.dedent(body).strip(), "    ")
        text = f'{HEADER}def mine({signature}):\n    "What it says."\n{lines}\n'
        path.write_text(text, encoding="utf-8")
        return path

    return write


# -- new -------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_new_measure_can_be_used_as_it_is(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    told = call("fitness", "new", "skyline").stdout
    assert "evocity fitness check skyline.py" in told
    assert '[[fitness]]\n  file = "skyline.py"\n' in told
    text = (tmp_path / "skyline.py").read_text(encoding="utf-8")
    for part in ("Formula:", "Unit: none", "Range:", "Empty map:", "Source:"):
        assert part in text
    checked = json.loads(call("fitness", "check", "skyline.py", "--json").stdout)
    assert checked["skyline"]["usable"]
    assert checked["skyline"]["findings"] == []
    assert checked["skyline"]["values"]["empty map"] is None
    assert checked["skyline"]["reasons"]["empty map"] == "nothing is built"
    city = evocity.read_map("lyon-1er", pixels=64)
    scored = json.loads(
        call("score", "lyon-1er", "--pixels", 64, "--fitness", "skyline.py", "--json").stdout
    )
    assert scored == {"skyline": pytest.approx(city.heights[city.built].std())}


@pytest.mark.parametrize("goal", ["max", "min", "none"])
def test_goal_unit_and_place_are_those_asked_for(tmp_path, goal):
    words = ("fitness", "new", "width", "--goal", goal, "--unit", "m²/ha", "-o")
    told = call(*words, tmp_path).stdout
    assert ("target = " in told) == (goal == "none")
    call(*words, tmp_path / "other.py")
    for path in (tmp_path / "width.py", tmp_path / "other.py"):
        listed = json.loads(call("fitness", "list", path, "--json").stdout)["width"]
        assert listed["goal"] == (None if goal == "none" else goal)
        assert listed["unit"] == "m²/ha"
        assert listed["range"] == [0, None]
        assert listed["origin"] == str(path)
        assert "Unit: m²/ha." in path.read_text(encoding="utf-8")


def test_the_file_tells_every_view_and_keeps_its_lines_short():
    text = measure_text("skyline", "max", "", "skyline.py")
    assert views()
    for name in ("heights", "metres_per_pixel", *views()):
        assert f"# city.{name}: " in text
    assert "perimeter" in text  # of the table of buildings
    assert max(map(len, text.splitlines())) <= 100


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("2x", "'2x' cannot be the name"),
        ("my-measure", "evocity fitness new my_measure"),
        ("class", "'class' cannot be the name"),
        ("max", "that neither Python nor the new file uses"),
        ("np", "that neither Python nor the new file uses"),
        ("gsi", "a measure called gsi exists already, from evocity"),
    ],
)
def test_a_name_that_cannot_be_is_refused(tmp_path, name, says):
    refused(tmp_path, "fitness", "new", name, "-o", tmp_path, says=says)


def test_nothing_is_overwritten(tmp_path, own):
    path = own("return 1.0")
    refused(tmp_path, "fitness", "new", "mine", "-o", tmp_path, says="exists already")
    refused(tmp_path, "fitness", "new", "other", "-o", path, says="exists already")
    words = ("fitness", "new", "other", "-o")
    refused(tmp_path, *words, tmp_path / "nowhere" / "x.py", says="there is no folder")
    refused(tmp_path, *words, tmp_path / "x.txt", says="a file name that ends in .py")
    refused(tmp_path, "fitness", "new", "other", "--unit", 'm"', "-o", tmp_path, says="--unit")


@pytest.mark.parametrize("full", ["dense.csv", "dense.py"])
def test_a_field_measure_without_space_leaves_no_file(tmp_path, monkeypatch, full):
    town, field = write_town(tmp_path / "town.npy"), tmp_path / "places.csv"
    field.write_text("x,y,gsi\n64,64,0.4\n")
    words = ("fitness", "new", "dense", "--field", field, "--map", town, *AT_2_M, "-o", tmp_path)

    class FullDisk(io.StringIO):
        def write(self, text):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def open_or_fail(path, mode="r", **more):
        if path != tmp_path / full or mode != "x":
            return open(path, mode, **more)
        path.touch(exist_ok=False)
        return FullDisk()

    for module in ("evocity.cli.fitness_new", "evocity.views.wanted_density"):
        monkeypatch.setattr(import_module(module), "open", open_or_fail, raising=False)
    message = refused(tmp_path, *words, says="No space left")
    assert str(tmp_path / full) in message
    monkeypatch.undo()
    call(*words)
    assert {"dense.csv", "dense.py"} < {path.name for path in tmp_path.iterdir()}
    (tmp_path / "dense.py").unlink()
    refused(tmp_path, *words, says="dense.csv' exists already")


def write_field_raster(path, crs, left, top, pixel):
    transform = Affine(pixel, 0, left, 0, -pixel, top)
    with rasterio.open(
        path, "w", driver="GTiff", height=4, width=4, count=1, dtype="float32", crs=crs,
        transform=transform, nodata=-1,
    ) as target:  # fmt: skip
        target.write(np.full((1, 4, 4), 1.5, np.float32))


def test_a_field_outside_the_map_or_without_its_place_is_refused(tmp_path):
    town, outside = write_town(tmp_path / "town.npy"), tmp_path / "outside.csv"
    outside.write_text("x,y,fsi\n1e6,1e6,1.5\n")
    # one degree west of Lyon, and on Lyon, which a map without a place does not have
    write_field_raster(tmp_path / "west.tif", "EPSG:4326", 3.83, 45.77, 1e-4)
    write_field_raster(tmp_path / "placed.tif", "EPSG:2154", 842_000, 6_520_000, 10)
    for city, field, says in (
        ([town, *AT_2_M], outside, "none of the 1 places"),
        (["lyon-1er"], tmp_path / "west.tif", "none of the 16 places"),
        ([town, *AT_2_M], tmp_path / "placed.tif", "raster of the map's own pixels"),
    ):
        words = "fitness", "new", "dense", "--field", field, "--map", *city, "-o", tmp_path
        refused(tmp_path, *words, says=says)


# -- check -----------------------------------------------------------------------------------


@pytest.fixture(scope="module", autouse=True)
def _trial_cases_are_there():
    """A process makes them once: the first test would bear it for all."""
    trial_cases()


def test_measures_are_tried_on_districts_towns_and_children():
    cases = trial_cases()
    names = [case.city.name for case in cases]
    assert names[: len(PARENTS)] == list(PARENTS)
    assert set(evocity.cities()) < set(names)
    assert sum(name.endswith("-town") for name in names) == len(PATTERNS)
    assert {case.city.shape for case in cases} == {(256, 256)}
    coded = [case for case in cases if case.genome is not None]
    assert sum(name.startswith("child by ") for name in names) == 5
    for case in coded:
        assert np.array_equal(evocity.decode(case.genome).city.heights, case.city.heights)
    sources = [case.parents[0] for case in coded[: len(PARENTS)]]
    assert all(set(case.parents) <= set(sources) for case in coded)


def test_check_tells_in_words(own):
    told = call("fitness", "check", own("return float(city.heights.mean())")).stdout
    lines = told.splitlines()
    assert lines[0].startswith("mine: goal max, -∞…∞; ")
    assert "mine.py, line 5" in lines[0]
    (row,) = [line.split() for line in lines if line.startswith("lyon-1er ")]
    assert row[1] == f"{evocity.read_map('lyon-1er').heights.mean(dtype=float):.4g}"
    assert any(line.startswith("time: first call ") for line in lines)
    assert "the same map again: the same bits" in lines
    assert any(line.startswith("turned and mirrored: no change") for line in lines)
    assert "at half the resolution: no change" in told
    assert "mine can be used. In a recipe:\n  [[fitness]]\n" in told


def test_check_tells_a_document(own):
    path = own("return float(city.heights[: city.shape[0] // 2 + 1].mean())")
    told = json.loads(call("fitness", "check", path, "gsi", "--json").stdout)
    assert list(told) == ["mine", "gsi"]
    mine = told["mine"]
    assert mine["usable"]
    assert mine["findings"] == []
    assert mine["turned"]["before"] == mine["values"]["lyon-1er"]
    assert mine["turned"]["after"] != mine["turned"]["before"]
    assert 0 < mine["median_ms"] < 1000
    assert set(mine["milliseconds"]) == set(mine["values"])
    assert mine["memory"] >= 0


def test_measures_of_genome_and_parents_are_tried_on_children():
    told = json.loads(call("fitness", "check", "integrity", "--json").stdout)["integrity"]
    assert told["usable"]
    assert told["values"]["lyon-1er, decoded"] == 1
    assert 0 < told["values"]["child by pavement_fusion"] < 1
    assert told["values"]["child by quarter_fusion"] == 1
    assert told["values"]["lyon-1er"] is None
    assert "genome and sources" in told["reasons"]["lyon-1er"]


WRONG = {
    # file's text or the function's body, line, what is said, what to do
    "syntax": (HEADER + "def mine(city)\n    return 1\n", 6, "expected ':'", "correct the syntax"),
    "signature": (
        HEADER + "def mine(city, size):\n    return 1\n",
        5,
        "missing a required argument: 'size'",
        "or give them default values",
    ),
    "text": ("x = 1\nreturn 'much'", 9, "returned str 'much'", "return float(...)"),
    "array": (
        "return city.heights",
        8,
        "returned ndarray of shape (256, 256)",
        "float(np.mean(...))",
    ),
    "none": ("x = 1", 8, "for lyon-1er", "return float(...)"),
    "nan": ("return float('nan')", 8, "NaN without a reason", "evocity.fitness.Undefined"),
    "complex": ("return 1j", 8, "returned complex 1j", "return float(...)"),
    "raises": ("y = 0\nreturn 1 / y", 9, "raised ZeroDivisionError", "correct that line"),
    "empty": ("return city.heights[city.built].min()", 8, "on empty map", "correct that line"),
    "missing": ("return float(open('gone.txt').read())", 8, "gone.txt", "measure's own folder"),
    "draws": ("return np.random.default_rng().random()", 8, "draws random", "default_rng(0)"),
    "changes": ("h = city.heights\nh[0] = 1\nreturn 1.0", 9, "read-only", "city.heights.copy()"),
    "view": ("city.built[0] = True\nreturn 1.0", 8, "read-only", "change a copy"),
    "unlocks": (
        "city.heights.setflags(write=True)\nreturn city.heights.max()",
        8,
        "made city.heights writable",
        "city.heights.copy()",
    ),
    "slow": ("import time\ntime.sleep(60)\nreturn 1.0", 9, "after 0.3 s", "whole arrays"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_told_with_file_line_and_remedy(tmp_path, own, name):
    body, line, says, remedy = WRONG[name]
    path = own(body)
    if body.startswith("import evocity"):
        path.write_text(body, encoding="utf-8")
    before = contents(tmp_path)
    seconds = 0.3 if name == "slow" else 60
    result = call("fitness", "check", path, "--timeout", seconds, code=1)
    assert result.stderr == ""
    (head, parts) = result.stdout.split(f"{path}, line {line}: ")
    assert head.rstrip().endswith(("Error in", "Error:", "Warning:"))
    found, expected, to_do = parts.splitlines()[:3]
    assert says in found
    assert expected.startswith("  expected: ")
    assert to_do.startswith("  what to do: ")
    assert remedy in to_do
    assert contents(tmp_path) == before
    words = ("fitness", "check", path, "--timeout", seconds, "--json")
    told = json.loads(call(*words, code=1).stdout)
    (about,) = told.values()
    assert not about["usable"]
    assert any(says.split()[0] in one["found"] for one in about["findings"])
    assert all(one["file"] == str(path) for one in about["findings"])


def test_prints_are_told_with_their_line_and_are_no_error(own):
    result = call("fitness", "check", own("x = 1\nprint('x is', x)\nreturn city.heights.max()"))
    assert result.stderr == ""
    assert "mine.py, line 9: mine prints 'x is 1' on lyon-1er" in result.stdout
    assert "what to do: remove the print" in result.stdout
    assert "mine can be used (1 warning)" in result.stdout


def test_what_loads_is_tried_though_another_does_not(tmp_path, own):
    broken = tmp_path / "broken.py"
    broken.write_text("def f(:", encoding="utf-8")
    told = json.loads(call("fitness", "check", broken, own("return 1"), "--json", code=1).stdout)
    assert list(told) == [str(broken), "mine"]
    assert told[str(broken)]["findings"][0]["about"] == "loading"


def test_a_function_given_up_is_not_tried_for_each_of_its_numbers(tmp_path):
    path = tmp_path / "several.py"
    path.write_text(
        "import time\nimport evocity\n@evocity.fitness(numbers=('low', 'high'))\n"
        "def slow(city):\n    time.sleep(5)\n",
        encoding="utf-8",
    )
    told = call("fitness", "check", path, "--timeout", 0.1, "--json", code=1).stdout
    assert list(json.loads(told)) == ["slow.low"]


def test_check_is_told_misuse(tmp_path, own, monkeypatch):
    refused(tmp_path, "fitness", "check", tmp_path / "gone.py", says="no Python file")
    refused(tmp_path, "fitness", "check", "alignmemt", says="did you mean alignment")
    own("return 1")
    monkeypatch.chdir(tmp_path)
    refused(tmp_path, "fitness", "check", "mine", says="did you mean mine.py?")
    assert "Missing argument" in call("fitness", "check", code=2).stderr
    assert "--timeout" in call("fitness", "check", "gsi", "--timeout", 0, code=2).stderr


# -- bench and list --------------------------------------------------------------------------


@pytest.mark.slow
def test_bench_sorts_by_cost_and_tells_all_together(tmp_path, own):
    town = write_town(tmp_path / "town.npy", side=64)
    # the dearest view: a busy machine cannot hide what it costs
    path = own("import time\ntime.sleep(0.02)\nreturn float(len(city.outline))")
    words = ("fitness", "bench", path, "gsi", "--map", "lyon-1er", "--repeats", 5)
    told = json.loads(call(*words, "--json").stdout)
    assert list(told["measures"]) == ["gsi", "mine"]
    mine = told["measures"]["mine"]
    assert mine["alone"]["least"] >= mine["shared"]["least"] >= 20
    assert mine["alone"]["least"] <= mine["alone"]["median"]
    assert told["together"]["least"] >= 20
    lines = call(*words).stdout.splitlines()
    assert [line.split()[0] for line in lines[2:]] == ["gsi", "mine", "all"]
    refused(tmp_path, "fitness", "bench", "gsi", "--map", town, says="--metres-per-pixel 2.0")
    assert "64 × 64 px" in call("fitness", "bench", "gsi", "--map", town, *AT_2_M).stdout
    refused(tmp_path, "fitness", "bench", own("return 1j"), says="returned complex")


@pytest.mark.slow
def test_bench_measures_the_maps_own_code_for_those_who_ask(tmp_path):
    genome = tmp_path / "lyon.parquet"
    call("encode", "lyon-1er", "--pixels", 64, "-o", genome)
    for source in ("lyon-1er", genome):
        words = ("fitness", "bench", "integrity", "--map", source, "--repeats", 1, "--json")
        assert json.loads(call(*words).stdout)["measures"]["integrity"]["alone"]["least"] > 0


def test_list_tells_cost_and_origin(own, monkeypatch):
    # a machine that runs other tests beside this one needs longer than a user waits
    monkeypatch.setattr(import_module("evocity.cli.fitness"), "_ALL", 100)
    path = own("return 1.0")
    told = json.loads(call("fitness", "list", path, "--cost", "--json").stdout)
    assert list(told) == sorted([m.name for m in measures()] + ["mine"])
    assert told["mine"]["origin"] == str(path)
    assert told["mine"]["doc"] == "What it says."
    assert told["gsi"]["origin"] == "evocity"
    assert 0 < told["gsi"]["milliseconds"] < 10_000  # of a measure that takes less than one
    assert told["gsi"]["range"] == [0, 1]
    assert told["integrity"]["milliseconds"] is None
    none = json.loads(call("fitness", "list", "--json").stdout)
    assert all(about["milliseconds"] is None for about in none.values())


@pytest.mark.slow
def test_list_waits_for_no_slow_or_failing_measure(own):
    told = call("fitness", "list", own("import time\ntime.sleep(20)"), "--cost", "--json").stdout
    assert json.loads(told)["mine"]["milliseconds"] is None
    told = call("fitness", "list", own("return 1 / 0"), "--cost", "--json").stdout
    assert json.loads(told)["mine"]["milliseconds"] is None


@pytest.mark.parametrize(
    ("each", "whole", "body", "cost"),
    [
        (0.2, 100, "import time\ntime.sleep(20)", "?"),
        (2, 0, "return 1.0", "?"),
        (2, 100, "return 1 / 0", "-"),
    ],
)
def test_list_tells_what_was_not_measured_in_time(own, monkeypatch, each, whole, body, cost):
    module = import_module("evocity.cli.fitness")
    monkeypatch.setattr(module, "_EACH", each)
    monkeypatch.setattr(module, "_ALL", whole)
    (mine,) = evocity.fitness.load_file(own(body))
    integrity = evocity.fitness.integrity
    costs = module._costs([mine, integrity])
    assert module._row(mine, costs)[4] == cost
    assert module._row(integrity, costs)[4] == "-"  # it asks for more than a map


class Entry:
    """An entry point of another package."""

    dist = type("Distribution", (), {"name": "afar", "version": "1.2"})

    def __init__(self, name, load):
        self.name, self.value, self.load = name, f"afar:{name}", load


@pytest.fixture
def plugins(monkeypatch):
    from evocity.io import map_reader
    from evocity.operators import registry as operator_registry

    caches = (registry.plugin_warnings, operator_registry._plugins, map_reader._from_plugins)
    monkeypatch.setattr(registry, "_table", dict(registry._table))

    def install(group, *entries):
        monkeypatch.setattr(
            "evocity.plugins.entry_points", lambda group: entries if group == asked[0] else ()
        )
        asked[:] = [group]
        for one in caches:
            one.cache_clear()

    asked = [""]
    yield install
    for one in caches:
        one.cache_clear()


def missing():
    raise ImportError("its library is missing")


def test_lists_tell_where_plugins_come_from_and_which_are_broken(plugins):
    def measure():
        @evocity.fitness(goal="max")
        def from_afar(city):
            "From afar."
            return 1.0

        return from_afar

    class Foreign:
        "Breeds from afar."

        name, parents = "foreign", (1, 1)

    def read(path, request):
        "Read an ASCII grid."

    for group, words, entry in (
        ("evocity.fitness", ("fitness", "list"), Entry("from_afar", measure)),
        ("evocity.operators", ("operators", "list"), Entry("foreign", lambda: Foreign)),
        ("evocity.readers", ("readers", "list"), Entry(".grid", lambda: read)),
    ):
        plugins(group, Entry("broken", missing), entry)
        result = call(*words)
        (line,) = [s for s in result.stdout.splitlines() if s.startswith(f"{entry.name} ")]
        assert "afar 1.2" in line
        assert "plugin broken (afar:broken) not loaded" in result.stderr
        assert "its library is missing" in result.stderr
        told = json.loads(call(*words, "--json").stdout)
        assert told[entry.name]["origin"] == "afar 1.2"
        assert {about["origin"] for about in told.values()} == {"evocity", "afar 1.2"}


def test_readers_tell_content_and_options():
    told = json.loads(call("readers", "list", "--json").stdout)
    assert set(told) == set(evocity.io.READERS)
    assert told[".gpkg"]["content"] == "SQLite (GeoPackage)"
    assert told[".gpkg"]["options"] == ["--height-column", "--layer", "--levels-column"]
    assert told[".png"]["options"] == ["--height-scale", "--nodata", "--terrain"]
    assert all(about["doc"] for about in told.values())


# -- score -----------------------------------------------------------------------------------


@pytest.fixture
def towns(tmp_path):
    return [write_town(tmp_path / f"{name}.npy", seed) for seed, name in enumerate("ab", 1)]


def test_several_maps_are_a_table_a_document_or_rows(towns):
    words = ("score", *towns, *AT_2_M, "--fitness", "gsi", "--fitness", "salingaros")
    cities = [evocity.read_map(town, metres_per_pixel=2) for town in towns]
    values = [evocity.fitness.gsi(city) for city in cities]
    told = json.loads(call(*words, "--json").stdout)
    assert told == {
        str(town): {"gsi": pytest.approx(value), "salingaros": None}
        for town, value in zip(towns, values, strict=True)
    }
    header, *rows = call(*words, "--csv").stdout.splitlines()
    assert header == "map,gsi,salingaros"
    assert rows == [f"{town},{v!r}," for town, v in zip(towns, values, strict=True)]
    lines = call(*words).stdout.splitlines()
    assert lines[2].split() == ["measure", *map(str, towns), "unit"]
    assert lines[3].split() == ["gsi", *(f"{value:.4g}" for value in values)]
    assert lines[4].split() == ["salingaros", "undefined", "undefined"]
    assert lines[5].startswith(f"undefined: salingaros of {towns[0]}: ")


def test_one_map_has_a_row_too(towns):
    lines = call("score", towns[0], *AT_2_M, "--fitness", "gsi", "--csv").stdout.splitlines()
    assert lines[0] == "map,gsi"
    assert lines[1].startswith(f"{towns[0]},0.")
    assert "--csv" in call("score", towns[0], "--json", "--csv", code=2).stderr


def test_the_name_of_a_function_gives_all_its_numbers(tmp_path, towns):
    own = tmp_path / "roofs.py"
    own.write_text(
        "import evocity\n@evocity.fitness(numbers=('low', 'high'))\n"
        "def roofs(city):\n    return {'low': city.heights.min(), 'high': city.heights.max()}\n",
        encoding="utf-8",
    )
    told = call("score", towns[0], *AT_2_M, "--fitness", own, "--json").stdout
    city = evocity.read_map(towns[0], metres_per_pixel=2)
    assert json.loads(told) == {"roofs.low": 0, "roofs.high": city.heights.max()}
    words = ("score", towns[0], *AT_2_M, "--fitness", own, "--fitness")
    assert json.loads(call(*words, "roofs", "--json").stdout) == json.loads(told)
    assert list(json.loads(call(*words, "roofs.low", "--json").stdout)) == list(json.loads(told))


@pytest.fixture(scope="module")
def finished(finished_runs, tmp_path_factory):
    return finished_runs.copy("commanded", tmp_path_factory.mktemp("scored"))


def test_individuals_of_a_run_have_their_parents(finished):
    run = evocity.open_run(finished)
    born = run.births().to_pylist()
    bred = next(row["id"] for row in born if len(row["parents"]) == 2)
    words = ("score", finished, "--id", 0, "--id", bred, "--fitness", "integrity", "--json")
    told = json.loads(call(*words).stdout)
    genome = run.genome(bred)
    city = evocity.decode(genome).city
    sources = [source.city for source in run.sources()]
    expected = evocity.fitness.integrity(city, genome=genome, sources=sources)
    assert told == {
        f"{finished} --id 0": {"integrity": 1},
        f"{finished} --id {bred}": {"integrity": pytest.approx(expected)},
    }
    assert 0 < expected < 1


def test_an_id_for_each_run_among_maps(tmp_path, finished, towns):
    words = (finished, towns[0], finished, "--fitness", "gsi", *AT_2_M, "--json")
    told = json.loads(call("score", *words, "--id", 1, "--id", 2).stdout)
    assert list(told) == [f"{finished} --id 1", str(towns[0]), f"{finished} --id 2"]
    refused(
        tmp_path,
        "score",
        *words,
        "--id",
        1,
        says="the number of --id options is 1, but the number of run folders is 2",
    )


def test_what_asks_for_more_than_there_is_is_undefined_unless_named(tmp_path, towns):
    genome = tmp_path / "town.parquet"
    call("encode", towns[0], *AT_2_M, *PLAIN, "-o", genome)
    for words, lacks in (((towns[0], *AT_2_M), "the genome"), ((genome,), "the sources")):
        assert json.loads(call("score", *words, "--json").stdout)["integrity"] is None
        (line,) = [
            s for s in call("score", *words).stdout.splitlines() if s.startswith("integrity ")
        ]
        assert line.split(maxsplit=2)[1] == "undefined"
        assert f"it needs {lacks}" in line
        message = refused(tmp_path, "score", *words, "--fitness", "integrity", says="without its")
        assert "evocity score RUN --id N" in message


def test_a_genome_is_given_to_measures_that_ask_for_it(tmp_path, towns):
    own = tmp_path / "lifs.py"
    own.write_text(
        "import evocity\n@evocity.fitness()\ndef lifs(city, genome):\n    return len(genome)\n",
        encoding="utf-8",
    )
    genome = tmp_path / "town.parquet"
    call("encode", towns[0], *AT_2_M, *PLAIN, "-o", genome)
    told = json.loads(call("score", genome, "--fitness", own, "--json").stdout)
    assert told == {"lifs": 256}
    assert not math.isnan(told["lifs"])


# -- comparing cities ------------------------------------------------------------------------


def test_what_compares_says_how_to_name_a_city(tmp_path, towns):
    says = "evocity score --reference CITY"
    refused(tmp_path, "score", towns[0], *AT_2_M, "--fitness", "fabric_distance", says=says)
    (line,) = [
        line
        for line in call("score", towns[0], *AT_2_M).stdout.splitlines()
        if line.startswith("fabric_distance ")
    ]
    assert "--reference CITY" in line
    words = ("score", towns[0], *AT_2_M, "--fitness", "gsi", "--reference", towns[1])
    refused(tmp_path, *words, says="no measure compares cities")


def test_cities_are_compared_with_those_named():
    names = [f"fabric_distance{number}" for number in ("", ".height", ".roughness")]
    wanted = [word for name in names for word in ("--fitness", name)]
    flat, lyon = "villeurbanne-gratte-ciel", "lyon-1er"
    told = call("score", lyon, *wanted, "--reference", flat, "--reference", lyon, "--json")
    cities = [evocity.read_map(name) for name in (flat, lyon)]
    expected = {name: evocity.fitness.get(name)(cities[1], cities) for name in names}
    assert json.loads(told.stdout) == pytest.approx(expected)
    told = call("score", lyon, *wanted, "--reference", flat)
    assert "leaves out share of party walls, roughness, height" in told.stderr


def test_individuals_of_a_run_are_compared_with_its_sources(finished):
    told = call("score", finished, "--id", 1, "--fitness", "fabric_distance").stdout
    assert (
        "the comparison needs 20" in told
    )  # its toy towns are too small; without them it would ask


def test_measures_that_compare_are_checked_and_timed():
    told = json.loads(call("fitness", "check", "fabric_distance", "--json").stdout)
    about = told["fabric_distance"]
    assert about["usable"]
    assert abs(about["values"]["lyon-1er"]) < 0.05 < about["values"]["montpellier-pas-du-loup"]
    assert about["turned"]
    timed = json.loads(call("fitness", "bench", "fabric_distance", "--repeats", 1, "--json").stdout)
    assert timed["measures"]["fabric_distance"]["shared"]["least"] < 50
