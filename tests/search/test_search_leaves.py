"""Runs on leaves, the default: bred, logged, taken up again; births that diverge."""

import numpy as np
import pytest
from test_search_run import rows, run

import evocity
from evocity import operators
from evocity.report import contact_sheet, write_report
from evocity.search import Search
from evocity.store import RunLog


@pytest.fixture
def leafy(toy):
    """Function that writes a recipe as the defaults have it, but for the sizes of its blocks."""

    def write(lines: str = "lifs = 500", **settings):
        path = toy(genome=lines, **settings)
        text = path.read_text().replace(
            "size_max = 6, size_min = 2", "side_max = 48, side_min = 16"
        )
        path.write_text(text)
        return path

    return write


@pytest.mark.slow
def test_a_run_on_leaves_is_what_its_log_says(leafy, tmp_path):
    out = tmp_path / "run"
    told = run(leafy(generations=2), out, workers=0)
    log = RunLog(out)
    assert (log.header.block, log.header.settle, log.header.schema_version) == (None, True, 5)
    births = log.individuals(log.births()["id"].to_pylist())
    assert {one.status for one in births} == {"ok"}
    for source in log.sources():
        assert source.genome == evocity.encode(source.city, lifs=500).genome
        assert len(source.genome) <= 500
    assert len({one.genome.pavement for one in births}) > 4
    for one in births:
        area = int(one.genome.pavement.area.sum())
        assert area == 64 * 64
        assert one.genome.settle is True
        city = evocity.decode(one.genome).city
        assert one.values["roof"] == pytest.approx(float(city.heights.mean()), abs=0)
    alive = {one.id: one for one in told[-1].population}
    for one in log.individuals(list(alive)):
        assert alive[one.id].genome.digest == one.genome.digest
        assert np.array_equal(alive[one.id].genome.source, one.genome.source)
        assert np.array_equal(alive[one.id].genome.turn, one.genome.turn)
    assert min(contact_sheet(evocity.open_run(log.path)).size) > 128
    assert write_report(out).is_file()


@pytest.mark.slow
def test_a_run_on_leaves_resumes_to_the_same_rows(leafy, tmp_path):
    whole, parted = tmp_path / "whole", tmp_path / "parted"
    recipe = leafy(generations=3)
    run(recipe, whole, workers=0)
    run(recipe, parted, workers=0, generations=1)
    with Search.resume(parted, workers=2, generations=3) as search:
        list(search)
    assert rows(parted) == rows(whole)


def test_roofs_are_left_as_they_are_if_the_recipe_says_so(leafy, tmp_path):
    run(leafy("block = 4\nfit = false\nsettle = false", generations=0), tmp_path / "run", workers=0)
    log = RunLog(tmp_path / "run")
    assert log.header.settle is False
    for source in log.sources():
        raw = evocity.encode(source.city, block=4, fit=False, settle=False).genome
        assert source.genome == raw
        assert not np.array_equal(
            evocity.decode(raw).city.heights, evocity.decode(raw, settle=True).city.heights
        )


@pytest.mark.slow
def test_roofs_settle_one_by_one_if_the_recipe_says_so(leafy, tmp_path):
    recipe = leafy('lifs = 500\nsettle = "roofs"', generations=2)
    run(recipe, tmp_path / "whole", workers=0)
    run(recipe, tmp_path / "parted", workers=0, generations=1)
    with Search.resume(tmp_path / "parted", workers=2, generations=2) as search:
        list(search)
    assert rows(tmp_path / "parted") == rows(tmp_path / "whole")
    log = RunLog(tmp_path / "whole")
    assert (log.header.settle, log.header.schema_version) == ("roofs", 11)
    births = log.individuals(log.births()["id"].to_pylist())
    assert {one.genome.settle for one in births} == {"roofs"}
    for one in births:
        city = evocity.decode(one.genome, settle="roofs").city
        assert one.values["roof"] == pytest.approx(float(city.heights.mean()), abs=0)
    assert not rows_alike(births)


def rows_alike(births) -> bool:
    """Whether all births look alike with settled roofs and with settled buildings."""
    return all(
        np.array_equal(
            *(evocity.decode(one.genome, settle=how).city.heights for how in ("roofs", True))
        )
        for one in births
    )


def test_surroundings_decide_if_the_recipe_says_so(leafy, tmp_path):
    lines = "block = 4\nfit = false\ntopological = 0.2"
    run(leafy(lines, generations=0), tmp_path / "run", workers=0)
    for source in RunLog(tmp_path / "run").sources():
        by_surroundings = evocity.encode(source.city, block=4, fit=False, topological=0.2).genome
        assert source.genome == by_surroundings
        assert source.genome != evocity.encode(source.city, block=4, fit=False).genome


class Steep:
    """An operator of another package, whose children's σ are all at the run's cap."""

    name = "steep"
    parents = (1, 1)

    def __call__(self, parents, rng):
        sigma = np.where(parents[0].uniform, 0, parents[0].sigma_max).astype(np.float32)
        return parents[0].replace(sigma=sigma)


@pytest.mark.slow
@pytest.mark.parametrize("block", ["block = 4\nfit = false", "lifs = 500\nfit = false"])
def test_births_that_diverge_fail_with_a_text_and_the_run_goes_on(
    leafy, tmp_path, monkeypatch, block
):
    monkeypatch.setitem(operators.OPERATORS, "steep", Steep)
    recipe = leafy(f"{block}\nsigma_max = 1.5", population=16, generations=2, max_failures=0.9)
    recipe.write_text(recipe.read_text().replace("mutation = 2", "mutation = 2\nsteep = 6"))
    told = run(recipe, tmp_path / "run", workers=0)
    assert [one.number for one in told] == [0, 1, 2]
    log = RunLog(tmp_path / "run")
    assert log.header.sigma_max == 1.5
    births = log.individuals(log.births()["id"].to_pylist())
    failed = [one for one in births if one.status != "ok"]
    assert {one.status for one in failed} == {"invalid"}
    assert "steep" in {one.operator for one in failed}
    assert all(one.genome is not None and not one.values for one in failed)
    for one in failed:
        assert "diverges" in one.error or "did not converge" in one.error
    alive = {one.id for generation in told for one in generation.population}
    assert alive
    assert not alive & {one.id for one in failed}
    assert {one.status for one in births if one.id in alive} == {"ok"}
    with Search.resume(tmp_path / "run", generations=3, workers=0) as search:
        assert [one.number for one in search] == [3]
