"""Measures of a session: packed, sent, made anew; what cannot be sent is refused."""

import itertools
import linecache
import pickle
import sys
import textwrap
import types

import numpy as np
import pytest

import evocity.fitness
from evocity.citymap import CityMap
from evocity.errors import FitnessError
from evocity.fitness import registry
from evocity.fitness.source_transfer import shipped, unpacked

CITY = CityMap(np.full((8, 8), 9.0), 2.0, name="eight")
_numbers = itertools.count(1)


@evocity.fitness()
def of_this_module(city):
    return city.heights.max() + 1


registry._table.pop(of_this_module.name)  # modules are imported before any test begins


@pytest.fixture(autouse=True)
def table_as_it_was(monkeypatch):
    monkeypatch.setattr(registry, "_table", dict(registry._table))
    monkeypatch.setattr(registry, "_from_files", dict(registry._from_files))


@pytest.fixture
def cell(monkeypatch):
    """Runs the text of a cell as a notebook does; returns what stands in the session then."""
    session = types.ModuleType("__main__")
    monkeypatch.setitem(sys.modules, "__main__", session)

    def run(text):
        text, file = textwrap.dedent(text), f"<cell {next(_numbers)}>"
        monkeypatch.setitem(
            linecache.cache, file, (len(text), None, text.splitlines(keepends=True), file)
        )
        exec(compile(text, file, "exec"), session.__dict__)
        return session

    return run


def sent(measure):
    """The measures as another process makes them, which has none of the session."""
    packed = pickle.dumps(shipped([measure]))
    return unpacked(pickle.loads(packed)[0])


CELL = """
import math
import numpy as np
from math import hypot as length
from numpy import hypot
import evocity
from evocity.fitness import gsi, Undefined

STEP, TABLE = np.float64(3.0), {"a": [1, (2, None)], "b": np.arange(3)}


def helper(city, deep=2):
    return deep and STEP + helper(city, deep - 1)


@evocity.fitness(goal="max", unit="m")
def mine(city, factor=STEP):
    "What it says."
    if city.name == "odd":
        return Undefined("odd")
    inner = [helper(city) + k for k in range(2)]
    return math.fsum(inner) + factor * gsi(city) + TABLE["b"].sum() + length(3, 4) + hypot(3, 4)
"""


def test_a_measure_of_a_cell_is_made_anew(cell):
    mine = cell(CELL).mine
    (again,) = sent(mine)
    assert again.function is not mine.function
    assert again(CITY) == mine(CITY) == 6 + 7 + 3 + 3 + 5 + 5
    assert again(CITY.replace(CITY.heights, name="odd")).reason == "odd"
    told = ("name", "goal", "unit", "doc", "file", "line", "needs", "origin", "range")
    assert all(getattr(again, one) == getattr(mine, one) for one in told)
    assert sent(mine)[0].function.__globals__ is not again.function.__globals__


def test_errors_of_what_was_sent_tell_the_lines_of_the_cell(cell):
    mine = cell(
        """
        import evocity

        @evocity.fitness(
            goal="max"
        )
        def broken(city):
            x = 1

            return x / 0
        """
    ).broken
    (again,) = sent(mine)
    for one in (mine, again):
        with pytest.raises(FitnessError, match=r"<cell \d+>, line 10"):
            one(CITY)


def test_several_numbers_and_other_measures_of_the_session_are_sent(cell):
    session = cell(
        """
        import evocity

        @evocity.fitness(numbers=("low", "high"))
        def both(city):
            calls.append(1) if False else None
            return {"low": city.heights.min(), "high": city.heights.max()}

        @evocity.fitness()
        def one(city):
            return 2 * city.heights.mean()

        @evocity.fitness()
        def composed(city):
            return one(city) + both(city)["high"]

        calls = []
        """
    )
    low, high = sent(session.both.measures[0]), sent(session.both.measures[1])
    assert (low[0](CITY), high[0].name) == (9, "both.high")
    together = unpacked(pickle.loads(pickle.dumps(shipped(session.both.measures)))[0])
    assert [one.name for one in together] == ["both.low", "both.high"]
    assert sent(session.composed)[0](CITY) == 27


def test_a_measure_of_a_module_is_imported():
    (packed,) = shipped([of_this_module])
    assert packed.place == (__name__, "of_this_module")
    assert unpacked(packed) == [of_this_module]


def test_what_others_find_by_name_or_file_is_not_sent(tmp_path):
    path = tmp_path / "own.py"
    path.write_text("import evocity\n@evocity.fitness()\ndef own(city):\n    return 1\n")
    own = evocity.fitness.load_file(path)
    assert shipped([*own, evocity.fitness.get("gsi")]) == ()


REFUSED = {
    "an object": ("class Odd:\n    x = 1\nodd = Odd()", "return odd.x", "uses odd, a Odd"),
    "an open file": ("log = open('/dev/null')", "return len(log.name)", "uses log, a Text"),
    "a generator": ("rng = np.random.default_rng(1)", "return rng.random()", "a Generator"),
    "what is changed": (
        "count = 0",
        "global count\ncount += 1\nreturn count",
        "changes the global variable count",
    ),
    "a lambda": ("f = lambda x: x", "return f(1)", "uses f, a function"),
    "what is not there": ("", "return missing", "uses missing, which is not defined"),
    "objects in arrays": ("a = np.array([print], object)", "return a.size", "uses a, a ndarray"),
    "what a helper uses": (
        "odd = object()\ndef helper():\n    return odd",
        "return helper() is None",
        "helper uses odd, a object",
    ),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_cannot_be_sent_is_refused_and_what_to_do_is_said(cell, what):
    before, body, says = REFUSED[what]
    text = "import evocity\nimport numpy as np\n" + before + "\n\n@evocity.fitness()\n"
    text += "def mine(city):\n" + textwrap.indent(body, "    ") + "\n"
    session = cell(text)
    with pytest.raises(FitnessError, match="cannot be sent to worker processes") as caught:
        shipped([session.mine])
    assert says in caught.value.found
    assert "mine.py" in caught.value.remedy
    assert "workers=0" in caught.value.remedy
    if hasattr(session, "log"):
        session.log.close()


def test_a_measure_made_in_a_function_or_without_source_is_refused(cell):
    session = cell(
        """
        import evocity

        def make(factor):
            @evocity.fitness()
            def made(city):
                return factor
            return made

        mine = make(3)
        """
    )
    with pytest.raises(FitnessError, match="made uses factor of its outer function"):
        shipped([session.mine])
    exec("@evocity.fitness()\ndef typed(city):\n    return 1", session.__dict__)
    with pytest.raises(FitnessError, match="the source of typed is not available"):
        shipped([session.typed])


def test_a_source_that_has_changed_is_refused(cell, tmp_path):
    mine = cell(CELL).mine
    file = mine.file
    size, when, lines, name = linecache.cache[file]
    lines = [line.replace("math.fsum(inner)", "sum(inner)") for line in lines]
    linecache.cache[file] = size, when, lines, name
    with pytest.raises(FitnessError, match="it has changed since it was read"):
        shipped([mine])
