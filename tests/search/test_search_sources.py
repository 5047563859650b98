"""Measures that ask for the source cities get their maps, wherever a run is evaluated."""

import pytest

from evocity.fitness.heredity import integrity_of
from evocity.search import Search, read_recipe
from evocity.search.preparation.preparation import prepare
from evocity.store import RunLog

INTEGRITY = '[[fitness]]\nname = "integrity"\n'


def bred(recipe, out):
    with Search(read_recipe(recipe), out) as search:
        for _ in search:
            pass
    return RunLog(out)


def assert_traced(run, fewest: int) -> None:
    sources = [source.city for source in run.sources()]
    values = {row["id"]: row["fitness.integrity"] for row in run.births().to_pylist()}
    known = {number: value for number, value in values.items() if value is not None}
    assert len(known) >= fewest
    for number, value in known.items():
        assert value == integrity_of(run.genome(number), sources)
    assert known[0] == known[1] == 1
    assert len(set(known.values())) > 2


@pytest.mark.slow_cases("2")
@pytest.mark.parametrize("workers", [0, 2])
def test_children_are_traced_to_the_sources_of_the_run(toy, tmp_path, workers):
    recipe = toy(recipe=INTEGRITY, population=6, generations=2, workers=workers)
    assert_traced(bred(recipe, tmp_path / "run"), 9)


def test_a_resumed_run_has_the_same_sources(toy, tmp_path):
    recipe = toy(recipe=INTEGRITY, population=6, generations=2, workers=0)
    with Search(read_recipe(recipe), tmp_path / "run") as search:
        next(iter(search))
    with Search.resume(tmp_path / "run") as search:
        for _ in search:
            pass
    assert_traced(RunLog(tmp_path / "run"), 9)


def test_who_evaluates_elsewhere_may_ask_here(toy):
    recipe = read_recipe(toy(recipe=INTEGRITY, population=4, generations=1, workers=0))
    with Search(recipe) as search:
        genomes = search.ask()
        setup = prepare(recipe).setup
        assert [city.name for city in setup.sources] == ["left", "right"]
        assert integrity_of(genomes[0], setup.sources) == 1


def test_maps_stay_here_unless_a_measure_asks(toy):
    assert prepare(read_recipe(toy())).setup.sources == ()


def test_progress_calls_a_parent_by_its_name(toy):
    path = toy()
    named = path.read_text().replace('map = "left.npy"', 'map = "left.npy"\nname = "the old town"')
    path.write_text(named)
    said = []
    prepare(read_recipe(path), said.append)
    assert said[:2] == ["reading the old town", "reading right.npy"]
