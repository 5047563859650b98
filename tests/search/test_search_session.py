"""Measures declared in a session, a script or a notebook's cell, in searches with workers."""

import subprocess
import sys

import pytest

import evocity
from evocity.errors import FitnessError
from evocity.fitness import registry
from evocity.search import Search, read_recipe

SCRIPT = '''
import linecache
import sys

import evocity
from evocity.search import Search, read_recipe

CELL = """FACTOR = 2.0
def doubled(x):
    return FACTOR * x
@evocity.fitness(goal="max")
def of_cell(city):
    return doubled(float(city.heights.std()))
"""
OFFSET = 3.0


@evocity.fitness(goal="max")
def of_script(city):
    return OFFSET + float(city.heights.std())


if __name__ == "__main__":
    # as a notebook runs a cell
    linecache.cache["<cell>"] = len(CELL), None, CELL.splitlines(keepends=True), "<cell>"
    exec(compile(CELL, "<cell>", "exec"))
    OFFSET = 4.0

    @evocity.fitness(goal="max")
    def of_main(city):
        return OFFSET + float(city.heights.std())

    recipe, out = sys.argv[1:]
    told = []
    for workers in (0, 1):
        with Search(read_recipe(recipe), out=f"{out}-{workers}", workers=workers) as search:
            told.append([one.values for last in search for one in last.population])
    assert told[0] == told[1]
    for values in told[0]:
        spread = values["spread"]
        assert values["of_cell"] == 2 * spread
        assert values["of_script"] == values["of_main"] == 4 + spread
    print(len(told[0]))
'''


@pytest.mark.slow
def test_measures_of_a_script_and_of_a_cell_serve_in_workers(toy, tmp_path):
    named = "".join(
        f'[[fitness]]\nname = "{name}"\n' for name in ("of_cell", "of_script", "of_main")
    )
    recipe = toy(recipe=named, generations=1, population=4)
    (tmp_path / "script.py").write_text(SCRIPT)
    words = [sys.executable, tmp_path / "script.py", recipe, tmp_path / "run"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=300)
    assert (done.returncode, done.stdout) == (0, "8\n"), done.stderr


def test_a_measure_that_cannot_be_sent_is_refused_before_any_work(toy, tmp_path, monkeypatch):
    monkeypatch.setattr(registry, "_table", dict(registry._table))
    inner = object()

    @evocity.fitness(goal="max")
    def holding(city):
        return float(inner is not None) + float(city.heights.std())

    recipe = toy(recipe='[[fitness]]\nname = "holding"\n', generations=0)
    told = []
    with pytest.raises(FitnessError, match="holding uses inner of its outer function"):
        Search(read_recipe(recipe), out=tmp_path / "run", workers=1, progress=told.append)
    assert told == []
    assert not (tmp_path / "run").exists()
    with Search(read_recipe(recipe), out=tmp_path / "run", workers=0) as search:
        (only,) = search
    assert all(one.values["holding"] == 1 + one.values["spread"] for one in only.population)
    with pytest.raises(FitnessError, match="holding"):
        Search.resume(tmp_path / "run", generations=1, workers=1)
    Search.resume(tmp_path / "run", generations=1, workers=0).close()  # its lock is free


def test_a_file_loaded_in_the_session_serves_by_the_names_of_its_measures(toy, tmp_path):
    path = tmp_path / "loaded.py"
    path.write_text(
        "import evocity\n@evocity.fitness(goal='max')\ndef loaded(city):\n"
        "    return 5 + float(city.heights.std())\n"
    )
    evocity.fitness.load_file(path)
    recipe = toy(recipe='[[fitness]]\nname = "loaded"\n', generations=0)
    with Search(read_recipe(recipe), workers=1) as search:
        (only,) = search
    assert all(one.values["loaded"] == 5 + one.values["spread"] for one in only.population)
