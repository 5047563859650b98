"""Declaring a measure, finding it, loading a file of one's own, and every way that goes wrong."""

import gc
import math
import pickle
import sys
import textwrap
import weakref
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from towns import draw_town

import evocity
import evocity.fitness.source_transfer
from evocity.citymap import CityMap
from evocity.errors import FitnessError
from evocity.fitness import Measure, Objective, Undefined, get, gsi, load_file, measures, registry

CITY = CityMap(np.full((8, 8), 9.0), 2.0, name="eight")


@pytest.fixture(autouse=True)
def table_as_it_was(monkeypatch):
    monkeypatch.setattr(registry, "_table", dict(registry._table))
    monkeypatch.setattr(registry, "_from_files", dict(registry._from_files))


@pytest.fixture
def write(tmp_path):
    def write(text, name="mine.py"):
        path = tmp_path / name
        path.write_text(textwrap.dedent(text), encoding="utf-8")
        return path

    return write


GOOD = """\
import evocity.fitness


@evocity.fitness(goal="min", unit="m", range=(0, 500))
def mine(city):
    "Highest roof."
    return city.heights.max()
"""


# -- declaring ---------------------------------------------------------------------------


def test_the_room_is_the_decorator_and_holds_the_measures():
    @evocity.fitness(goal="max", unit="m", range=(0, 10))
    def lowest_roof(city):
        "Lowest roof."
        return city.heights.min()

    assert isinstance(lowest_roof, Measure)
    assert lowest_roof(CITY) == 9.0
    assert type(lowest_roof(CITY)) is float
    assert get("lowest_roof") is lowest_roof
    assert (lowest_roof.goal, lowest_roof.unit, lowest_roof.range) == ("max", "m", (0, 10))
    assert lowest_roof.__doc__ == lowest_roof.doc == "Lowest roof."
    assert lowest_roof.file == __file__
    assert evocity.fitness.gsi is get("gsi") is gsi
    assert [m.name for m in measures()] == sorted(m.name for m in measures())


def named(name):
    """A plain function of a city called ``name``, not yet a measure."""

    def function(city):
        return 1.0

    function.__name__ = name
    return function


def test_running_a_cell_again_redefines_but_another_function_may_not_take_the_name():
    for _ in range(2):

        @evocity.fitness(goal="max")
        def again(city):
            return 1.0

        assert get("again") is again

    for name, file in (("again", "test_fitness_registry"), ("gsi", "density")):
        with pytest.raises(
            FitnessError, match=rf"a second measure has the name {name}.*{file}\.py"
        ):
            evocity.fitness()(named(name))


@pytest.mark.parametrize(
    "options",
    [
        {"goal": "more"},
        {"goal": "target"},
        {"unit": None},
        {"range": (1, 0)},
        {"range": 3},
        {"range": (0, math.nan)},
        {"goal": len},
    ],
)
def test_a_wrong_declaration_is_refused(options):
    with pytest.raises(FitnessError):
        evocity.fitness(**options)


@pytest.mark.parametrize(
    "function",
    [
        lambda city: 1.0,
        len,
        3,
    ],
)
def test_only_a_function_with_a_name_is_a_measure(function):
    with pytest.raises(FitnessError, match="a function with a name"):
        evocity.fitness(goal="max")(function)


def test_the_argument_is_the_city_alone():
    def two(city, other):
        return 1.0

    def none():
        return 1.0

    def optional(city, threshold=3):
        return 1.0

    for function in (two, none):
        with pytest.raises(FitnessError, match="the parameter 'city' first"):
            evocity.fitness(goal="max")(function)
    assert evocity.fitness(goal="max")(optional)(CITY) == 1.0


# -- calling -----------------------------------------------------------------------------


def returning(value):
    @evocity.fitness(goal="max")
    def returned(city):
        return value

    return returned


@pytest.mark.parametrize("value", [1, 1.5, np.float32(1.5), np.int64(3), math.nan, np.float64(-2)])
def test_any_real_number_becomes_a_float(value):
    found = returning(value)(CITY)
    assert type(found) is float
    assert found == value or math.isnan(found)


@pytest.mark.parametrize(
    "value",
    ["1.0", None, True, np.bool_(True), 1j, np.ones(3), np.array(1.0), [1.0], 10**400, math.inf],
    ids=lambda value: type(value).__name__,
)
def test_anything_else_is_refused_by_file_and_line(value):
    measure = returning(value)
    with pytest.raises(FitnessError, match=r"returned .* for eight") as caught:
        measure(CITY)
    assert f"({__file__}, line {measure.line})" in str(caught.value)


def test_undefined_is_nan_with_a_reason_and_survives_the_call():
    value = returning(Undefined("no streets"))(CITY)
    assert math.isnan(value)
    assert value.reason == "no streets"


def test_an_error_names_the_line_that_raised(write):
    (measure,) = load_file(
        write(
            """\
            import evocity.fitness

            def helper(city):
                return 1 / 0

            @evocity.fitness(goal="max")
            def broken(city):
                return helper(city)
            """
        )
    )
    with pytest.raises(FitnessError, match=r"mine.py, line 4\) raised ZeroDivisionError") as caught:
        measure(CITY)
    assert isinstance(caught.value.__cause__, ZeroDivisionError)


def test_a_measure_cannot_change_its_map(write):
    (measure,) = load_file(
        write(GOOD.replace("return city.heights.max()", "city.built[0] = True; return 1.0"))
    )
    with pytest.raises(FitnessError, match="read-only"):
        measure(CITY)


def test_only_a_city_map_is_measured():
    with pytest.raises(FitnessError, match="gsi cannot measure a ndarray"):
        gsi(CITY.heights)


# -- finding -----------------------------------------------------------------------------


def test_an_unknown_name_is_told_with_the_one_most_like_it():
    with pytest.raises(FitnessError, match=r"(?s)aligment.*did you mean alignment"):
        get("aligment")


# -- files -------------------------------------------------------------------------------


def test_a_file_is_loaded_and_found(write, capsys):
    path = write(GOOD + "print('loading')\n")
    (measure,) = load_file(path)
    assert measure(CITY) == 9.0
    assert (measure.file, measure.line) == (str(path), 4)
    assert get("mine") is measure
    printed = capsys.readouterr()
    assert (printed.out, printed.err) == ("", "loading\n")  # --json owns standard output


def test_a_file_changed_and_loaded_again_is_another_source(write):
    (first,) = load_file(write(GOOD))
    (same,) = load_file(write(GOOD))
    path = write(GOOD.replace("max()", "min()"))
    assert first.source_hash == same.source_hash  # of what was loaded, not of the file now
    (second,) = load_file(path)
    assert second.source_hash != first.source_hash
    assert get("mine") is second


SIBLING = """
import evocity.fitness
from helper import HEIGHT
import parts.roofs
import lone.roofs as others


@evocity.fitness()
def {name}(city):
    return HEIGHT + parts.roofs.more() + others.MORE
"""


def folder_of(path, name, height):
    for below in ("parts", "lone"):
        (path / below).mkdir(parents=True)
    (path / "helper.py").write_text(f"HEIGHT = {height}\n")
    (path / "parts" / "__init__.py").write_text("")
    # a sibling imports siblings; that of a relative name too
    (path / "parts" / "roofs.py").write_text(
        "from .more import MORE\nimport helper\ndef more():\n    return MORE + helper.HEIGHT\n"
    )
    (path / "parts" / "more.py").write_text("MORE = 100\n")
    (path / "lone" / "roofs.py").write_text("MORE = 0.5\n")  # without an __init__.py
    (path / f"{name}.py").write_text(SIBLING.format(name=name))
    return path / f"{name}.py"


def test_a_file_imports_what_lies_beside_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "helper", mine := SimpleNamespace(HEIGHT=-1))
    before = dict(sys.modules), list(sys.path), list(sys.meta_path)
    (left,) = load_file(folder_of(tmp_path / "left", "low", 1))
    (right,) = load_file(folder_of(tmp_path / "right", "high", 20))
    assert (left(CITY), right(CITY)) == (102.5, 140.5)
    assert sys.modules["helper"] is mine
    assert not {"parts", "parts.roofs", "lone"} & set(sys.modules)
    assert (sys.path, sys.meta_path) == before[1:]
    assert not [*tmp_path.rglob("__pycache__")]
    assert [Path(one).name for one in left.beside] == [
        "helper.py", "roofs.py", "__init__.py", "more.py", "roofs.py",
    ]  # fmt: skip
    # edited, it is another source, at once
    (tmp_path / "left" / "helper.py").write_text("HEIGHT = 3\n")
    (edited,) = load_file(tmp_path / "left" / "low.py")
    assert edited(CITY) == 106.5
    assert len({left.source_hash, edited.source_hash, right.source_hash}) == 3


def test_siblings_do_not_stand_in_for_what_is_installed(write):
    for name in ("numpy", "evocity", "math"):
        write("raise RuntimeError('the wrong one')", f"{name}.py")
    (mine,) = load_file(write("import math, numpy\n" + GOOD))
    assert (mine(CITY), mine.beside) == (9.0, ())


def test_a_measure_that_is_imported_is_a_helper(write):
    write(GOOD)
    (two,) = load_file(
        write("import evocity\nfrom mine import mine\n@evocity.fitness()\ndef two(city):\n"
              "    return 2 * mine(city)\n", "two.py")
    )  # fmt: skip
    assert two(CITY) == 18.0
    with pytest.raises(FitnessError, match="mine"):
        registry.get("mine")


def test_a_sibling_at_fault_is_told(write):
    write("x = (", "helper.py")
    path = write("import helper\n" + GOOD)
    with pytest.raises(FitnessError, match=r"mine\.py, line 1 raised SyntaxError.*helper\.py"):
        load_file(path)
    with pytest.raises(FitnessError, match=r"put absent\.py in the folder of mine\.py"):
        load_file(write("import absent\n" + GOOD))
    write("x = 1", "helper.py")
    late = GOOD.replace("    return", "    import helper\n    return")
    (mine,) = load_file(write(late))
    with pytest.raises(FitnessError, match="import helper at the top of the file"):
        mine(CITY)


def test_measures_and_objectives_travel_to_worker_processes(write):
    (mine,) = load_file(write(GOOD))
    sent = pickle.dumps([Objective(gsi, target=0.35), Objective(mine)])
    registry._from_files.clear()  # a fresh process has not loaded the file
    packaged, own = pickle.loads(sent)
    assert packaged == Objective(gsi, target=0.35)
    assert (own.goal, own.measure(CITY)) == ("min", 9.0)
    assert own.measure.source_hash == mine.source_hash
    value = pickle.loads(pickle.dumps(Undefined("no streets")))
    assert (str(value), value.reason) == ("nan", "no streets")


def test_hashes_tell_packaged_measures_of_different_files_apart():
    assert gsi.source_hash != get("alignment").source_hash
    assert len(gsi.source_hash) == 32


def test_a_file_may_hold_several_measures_and_dataclasses(write):
    text = """\
    from __future__ import annotations
    from dataclasses import dataclass
    import evocity.fitness
    from evocity.fitness import gsi

    @dataclass
    class Point:
        x: float = 2.0

    @evocity.fitness(goal="max")
    def one(city):
        return Point().x

    @evocity.fitness(goal="max")
    def two(city):
        return gsi(city)
    """
    assert [m.name for m in load_file(write(text))] == ["one", "two"]
    assert get("two")(CITY) == 1.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("import evocity.fitness\ndef mine(city:\n", r"mine.py, line 2: .*py_compile"),
        ("import numpy\n\nimport nowhere_to_be_found\n", "mine.py, line 3 raised ModuleNotFound"),
        ("x = 1\n1 / 0\n", "mine.py, line 2 raised ZeroDivisionError"),
        ("raise SystemExit(0)\n", "mine.py, line 1 raised SystemExit"),
        ("def mine(city):\n    return 1.0\n", r"the file declares no measure.*@evocity.fitness\("),
        ("", "the file declares no measure"),
        (GOOD.replace("mine(city)", "mine(city, other)"), r"line 4: mine\(city, other\)"),
        (GOOD.replace('goal="min"', 'goal="least"'), "line 4: goal = 'least'"),
        (GOOD.replace('(goal="min", unit="m", range=(0, 500))', ""), "without brackets"),
        (GOOD.replace("mine", "gsi"), r"a second measure has the name gsi \(line 4\).*density.py"),
        (GOOD + GOOD, "a second measure has the name mine"),
        ("import evocity.fitness\nevocity.fitness.get('nothing')\n", "line 2: no measure is call"),
        ("x = '\0'", r"mine.py"),
        ("\nexec(compile('def', 'other.py', 'exec'))\n", "mine.py, line 2 raised SyntaxError"),
    ],
)
def test_a_faulty_file_is_refused_and_leaves_nothing(write, text, message):
    names, modules = [m.name for m in measures()], set(sys.modules)
    with pytest.raises(FitnessError, match=f"(?s){message}"):
        load_file(write(text))
    assert [m.name for m in measures()] == names
    assert not [name for name in set(sys.modules) - modules if name.startswith("evocity_user")]


def test_a_file_that_is_not_utf8_or_not_there_or_not_python(tmp_path, write):
    (tmp_path / "latin.py").write_bytes("x = 'é'\n".encode("latin-1"))
    with pytest.raises(FitnessError, match=r"latin\.py"):
        load_file(tmp_path / "latin.py")
    with pytest.raises(FitnessError, match="no Python file at"):
        load_file(tmp_path / "nowhere.py")
    with pytest.raises(FitnessError, match="is not a Python file"):
        load_file(write(GOOD, "mine.txt"))
    (tmp_path / "folder.py").mkdir()
    with pytest.raises(FitnessError, match="no Python file at"):
        load_file(tmp_path / "folder.py")


# -- several numbers, and what else a measure may ask for ------------------------------------

SEVERAL = """\
import evocity


calls = []


@evocity.fitness(
    numbers=("count", "tallest"), goal={"count": "max"}, unit={"tallest": "m"}, range=(0, 1e4)
)
def towers(city):
    "Towers, and how high they are."
    calls.append(city)
    return {"count": (city.heights > 30).sum(), "tallest": city.heights.max()}
"""


def test_a_function_of_several_numbers_is_called_once_a_map(write):
    count, tallest = registry.load_file(write(SEVERAL))
    assert (count.name, count.goal, count.unit) == ("towers.count", "max", "")
    assert (tallest.name, tallest.goal, tallest.unit) == ("towers.tallest", None, "m")
    assert registry.named("towers") == [count, tallest]
    assert registry.named("towers.count") == [count]
    calls = count.function._function.__globals__["calls"]
    for city in (draw_town(1), draw_town(2)):
        assert (count(city), tallest(city)) == ((city.heights > 30).sum(), city.heights.max())
    assert len(calls) == 2
    assert pickle.loads(pickle.dumps(tallest)).name == "towers.tallest"


def test_several_numbers_come_by_their_names(write):
    @evocity.fitness(numbers=("low", "high"))
    def extremes(city):
        return {"low": city.heights.min(), "high": city.heights.max()}

    town = draw_town(3)
    assert extremes(town) == {"low": town.heights.min(), "high": town.heights.max()}
    assert [one.name for one in extremes.measures] == ["extremes.low", "extremes.high"]


def test_a_cell_with_several_numbers_may_run_again():
    for factor in (1, 2):

        def sizes(city, factor=factor):
            return {"small": 0, "large": factor}

        family = evocity.fitness(numbers=("small", "large"))(sizes)
    assert family(CITY) == {"small": 0, "large": 2}
    assert registry.get("sizes.large")(CITY) == 2


def test_a_family_is_no_measure():
    @evocity.fitness(numbers=("low", "high"), goal="max")
    def ends(city):
        return {"low": 0, "high": 1}

    with pytest.raises(FitnessError, match=r"Family.* cannot be an objective"):
        Objective(ends)


def test_several_numbers_know_the_parents_they_are_of():
    @evocity.fitness(numbers=("count", "first"))
    def litter(city, parents):
        return {"count": len(parents), "first": parents[0], "city": city}

    count, first = litter.measures
    for given in ([1], [2], [3, 3]):  # each list may lie where the one before lay
        town = CITY
        assert (count(town, parents=given), first(town, parents=given)) == (len(given), given[0])
    town = draw_town(5)
    gone = weakref.ref(town)
    count(town, parents=[1])
    del town
    gc.collect()
    assert gone() is None


@pytest.mark.parametrize(
    ("value", "told"),
    [("3.0", "float 3.0"), ('{"count": 1}', "a mapping of count"), ("None", "None")],
)
def test_a_number_that_does_not_come_is_told(write, value, told):
    text = SEVERAL.replace(SEVERAL[SEVERAL.index('{"count": (') :].strip(), value)
    *_, tallest = registry.load_file(write(text))
    with pytest.raises(FitnessError, match=rf"towers \(.*mine.py, line 7\) returned {told}"):
        tallest(draw_town(1))


@pytest.mark.parametrize(
    "options",
    [
        {"numbers": "count"},
        {"numbers": ("a", "a")},
        {"numbers": ("a b",)},
        {"numbers": ("a",), "goal": {"b": "max"}},
        {"numbers": ("a",), "goal": {"a": "more"}},
    ],
)
def test_wrong_numbers_are_refused(options):
    with pytest.raises(FitnessError):
        evocity.fitness(**options)(lambda city: 1)


def test_genome_and_parents_are_given_to_those_that_name_them(town):
    @evocity.fitness()
    def steep(city, genome, floor=0.0):
        return np.abs(genome.sigma).max() + floor

    @evocity.fitness()
    def litter(city, parents, genome):
        return len(parents)

    genome = evocity.encode(town).genome
    assert (steep.needs, litter.needs) == (("genome",), ("genome", "parents"))
    assert steep(town, genome=genome, parents=[genome]) == np.abs(genome.sigma).max()
    assert litter(town, genome=genome, parents=[genome, genome]) == 2
    with pytest.raises(FitnessError, match=r"litter of .* without its parents"):
        litter(town, genome=genome)
    with pytest.raises(FitnessError, match="without its genome"):
        steep(town)


def test_where_a_measure_comes_from_is_known(write):
    (mine,) = registry.load_file(write(GOOD))
    assert mine.origin == mine.file
    assert registry.get("gsi").origin == "evocity"
    assert evocity.fitness()(named("here")).origin == "this session"


@pytest.mark.parametrize(
    ("body", "remedy"),
    [
        ("city.heights[0, 0] = 1", "change a copy"),
        ("city.heights = 0 * city.heights", "change a copy"),
        ("city.built.fill(True)", "change a copy"),
        ('open("nothing.csv")', "pathlib.Path(__file__)"),
        ("import nothing_such", "install nothing_such"),
        ("city.height", "did you mean heights?"),
        ("city.street_graph.lenght.sum()", "did you mean length?"),
        ("city.streets.nothing_like_it", "a Streets has length, "),
        ("raise SystemExit('bye')", "correct that line"),
    ],
)
def test_remedies_fit_what_was_raised(write, body, remedy):
    text = GOOD.replace("    return", f"    {body}\n    return")
    (mine,) = registry.load_file(write(text))
    with pytest.raises(FitnessError, match=r"mine.py, line 7") as caught:
        mine(draw_town(1))
    assert remedy in caught.value.remedy


# -- plugins -----------------------------------------------------------------------------


class Entry:
    def __init__(self, name, load):
        self.name, self.value, self.load = name, f"somewhere:{name}", load
        self.dist = SimpleNamespace(name="somewhere", version="1.2")


@pytest.fixture
def plugins(monkeypatch):
    def install(*entries):
        monkeypatch.setattr("evocity.plugins.entry_points", lambda group: entries)
        registry.plugin_warnings.cache_clear()

    yield install
    registry.plugin_warnings.cache_clear()


def test_plugins_are_found_and_broken_ones_only_told(plugins):
    def plugin():
        @evocity.fitness(goal="max")
        def from_afar(city):
            return 1.0

        return from_afar

    def raising():
        raise ImportError("its library is missing")

    def clashing():
        evocity.fitness()(named("fsi"))
        return ModuleType("clashing")

    plugins(
        Entry("broken", raising),
        Entry("odd", lambda: 3),
        Entry("clash", clashing),
        Entry("good", plugin),
    )
    assert get("from_afar")(CITY) == 1.0
    assert get("fsi").file.endswith("density.py")
    broken, odd, clash = registry.plugin_warnings()
    assert "broken" in broken
    assert "its library is missing" in broken
    assert "not a measure" in odd
    assert "a second measure has the name fsi" in clash
    with pytest.raises(FitnessError, match="its library is missing"):
        get("what_broken_would_have_had")


def test_plugins_are_looked_for_under_the_documented_group(plugins, monkeypatch):
    asked = []
    monkeypatch.setattr("evocity.plugins.entry_points", lambda group: asked.append(group) or ())
    registry.plugin_warnings.cache_clear()
    measures()
    assert asked == ["evocity.fitness"]


# -- goals -------------------------------------------------------------------------------


def test_a_lower_loss_is_closer_to_the_goal():
    salingaros, crumbs = get("salingaros"), get("crumbs")
    assert Objective(salingaros).goal == "max"
    assert Objective(salingaros).loss(0.4) < Objective(salingaros).loss(0.3)
    assert Objective(crumbs).goal == "min"
    assert Objective(crumbs).loss(2.0) < Objective(crumbs).loss(3.0)
    assert Objective(crumbs, "max").loss(2.0) == -2.0
    wanted = Objective(gsi, "target", 0.35)
    assert wanted == Objective(gsi, target=0.35)
    assert wanted.loss(0.35) == 0
    assert wanted.loss(0.3) == pytest.approx(wanted.loss(0.4)) == pytest.approx(0.05)
    assert math.isnan(wanted.loss(math.nan))
    assert math.isnan(Objective(salingaros).loss(math.nan))


def test_to_be_like_a_city_is_to_have_its_value():
    half = CityMap(np.r_[np.zeros((4, 8)), np.full((4, 8), 9.0)], 2.0)
    like = Objective.like(gsi, half)
    assert (like.goal, like.target) == ("like", 0.5)
    assert like.loss(gsi(half)) == 0
    with pytest.raises(FitnessError, match="salingaros is undefined on eight: 1 built"):
        Objective.like(get("salingaros"), CITY)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "gsi has no default goal"),
        ({"goal": "best"}, "goal = 'best'"),
        ({"goal": "target"}, "target = None"),
        ({"goal": "like"}, "target = None"),
        ({"target": math.nan}, "target = nan"),
        ({"target": math.inf}, "target = inf"),
        ({"target": "0.3"}, "target = '0.3'"),
        ({"target": True}, "target = True"),
        ({"goal": "max", "target": 0.3}, "a goal or a target"),
    ],
)
def test_an_objective_that_cannot_be_meant_is_refused(options, message):
    with pytest.raises(FitnessError, match=message):
        Objective(gsi, **options)


# -- data files ----------------------------------------------------------------------------------

READS = """
import evocity
from pathlib import Path

@evocity.fitness(goal="max", data={data})
def level(city):
    return float((Path(__file__).parent / "level.csv").read_text())
"""


def test_data_is_part_of_a_measures_source(tmp_path):
    path = tmp_path / "level.py"
    path.write_text(READS.format(data="'level.csv'"))
    found = []
    for text in ("3", "4", "3"):
        (tmp_path / "level.csv").write_text(text)
        found += load_file(path)
    assert [one(CITY) for one in found] == [3.0, 3.0, 3.0]  # it is read when it is called
    assert found[0].beside == (str(tmp_path / "level.csv"),)
    assert (found[0].data, found[0].source_hash) == (("level.csv",), found[2].source_hash)
    assert found[0].source_hash != found[1].source_hash


@pytest.mark.parametrize(
    "data",
    ["'../level.csv'", "'/level.csv'", "''", "3", "('a', 4)", r"'a\\b'", "'c:level.csv'", "'.'"],
)
def test_data_lies_beside_the_file(tmp_path, data):
    (tmp_path / "level.py").write_text(READS.format(data=data))
    with pytest.raises(FitnessError, match=r"level\.py, line 5.*data = "):
        load_file(tmp_path / "level.py")


def test_data_that_is_not_there_or_too_much_is_told_at_once(tmp_path, monkeypatch):
    path = tmp_path / "level.py"
    path.write_text(READS.format(data="('level.csv', 'more.csv')"))
    with pytest.raises(FitnessError, match=r"data file 'level\.csv' cannot be read: No such file"):
        load_file(path)
    for name in ("level.csv", "more.csv"):
        (tmp_path / name).write_text("12345")
    monkeypatch.setattr("evocity.fitness.local_imports.MOST_DATA", 10)
    load_file(path)
    monkeypatch.setattr("evocity.fitness.local_imports.MOST_DATA", 9)
    with pytest.raises(FitnessError, match=r"the data files up to 'more\.csv' have 0 MB"):
        load_file(path)


def test_data_of_a_measure_of_the_session_is_refused_where_it_would_not_come_along():
    @evocity.fitness(goal="max", data="level.csv")
    def of_a_cell(city):
        return 1.0

    with pytest.raises(FitnessError, match=r"it reads data, level\.csv, which only files have"):
        evocity.fitness.source_transfer.shipped([of_a_cell])
