"""A locked quarter is the same in every individual of a run, pixel for pixel."""

import dataclasses

import numpy as np
import pytest
from codes import uniformly
from test_search_recipe import faults
from test_search_run import rows, run
from toy_runs import without_digests

import evocity
from evocity.coding import decode
from evocity.condensation import Condensation
from evocity.errors import GenomeError, MapError, RecipeError, RunError
from evocity.evaluation.evaluator import Evaluator
from evocity.io import write_map
from evocity.search import Search, read_recipe
from evocity.search.preparation import preparation
from evocity.search.preparation.preparation import prepare
from evocity.store import RunLog

MASK = np.zeros((64, 64), bool)
MASK[10:33, 21:47] = True

LOCKED = '[locked]\nmask = "mask.npy"\n'


@pytest.fixture
def quarter(toy, tmp_path):
    """Function that writes a recipe with a quarter locked, and returns its path."""

    def write(locked=LOCKED, **settings):
        np.save(tmp_path / "mask.npy", MASK)
        return toy(recipe=locked, **settings)

    return write


def check_locked(path, heights, births: int) -> None:
    """All births of a run decode to ``heights`` in the mask, bit for bit."""
    log = RunLog(path)
    individuals = log.individuals(log.births()["id"].to_pylist())
    assert len(individuals) == births
    for birth in individuals:
        assert birth.status == "ok"
        decoded = decode(birth.genome).city.heights
        assert np.array_equal(decoded[MASK], heights[MASK])
    elsewhere = {decode(birth.genome).city.heights[~MASK].tobytes() for birth in individuals}
    assert len(elsewhere) > births / 2  # while all around it is bred


@pytest.mark.slow_cases("2")
@pytest.mark.parametrize("workers", [0, 2])
def test_a_locked_quarter_is_the_same_in_every_individual(quarter, tmp_path, workers):
    out = tmp_path / "run"
    generations = run(quarter(generations=4), out, workers=workers)
    left = np.load(tmp_path / "left.npy")
    check_locked(out, left, births=5 * 8)
    for one in generations[-1].population:
        assert np.array_equal(decode(one.genome).city.heights[MASK], left[MASK])
        assert one.genome == RunLog(out).genome(one.id)


@pytest.mark.slow
def test_workers_and_a_resume_do_not_matter(quarter, tmp_path):
    recipe = quarter(generations=4)
    run(recipe, tmp_path / "here", workers=0)
    run(recipe, tmp_path / "there", workers=2)
    expected = rows(tmp_path / "here")
    assert rows(tmp_path / "there") == expected
    out = tmp_path / "resumed"
    run(recipe, out, workers=0, generations=1)
    np.save(tmp_path / "mask.npy", ~MASK)
    with pytest.raises(RunError, match=r"mask\.npy, which says what is locked"):
        Search.resume(out, generations=4)
    with Search.resume(out, generations=4, workers=0, accept_changes=True) as search:
        assert [one.number for one in search] == [2, 3, 4]
    assert rows(out) == expected
    check_locked(out, np.load(tmp_path / "left.npy"), births=5 * 8)
    Search.resume(out, generations=5, workers=0).close()  # what was accepted is not told again


def test_the_measures_see_what_is_locked(quarter, tmp_path):
    run(quarter(generations=0), tmp_path / "run", workers=0)
    log = RunLog(tmp_path / "run")
    for birth in log.individuals(range(8)):
        assert birth.values["roof"] == float(decode(birth.genome).city.heights.mean())


# -- shares of the parents ------------------------------------------------------------------------

SHARES = LOCKED + '[[fitness]]\nname = "smallest_share"\nmin = 0.05\n'


def shares_by_pixel(genome, counted):
    """The smallest share of the cities in what is built in the pixels that are ``counted``."""
    parents = genome.pavement.raster(genome.parent)[decode(genome).city.built & counted]
    counts = np.bincount(parents, minlength=2)[:2]
    return counts.min() / counts.sum()


def check_shares(out, counted):
    log = RunLog(out)
    for birth in log.individuals(log.births()["id"].to_pylist()):
        expected = shares_by_pixel(birth.genome, counted)
        assert birth.values["smallest_share"] == pytest.approx(expected, abs=1e-12)
    assert all(one.same for one in evocity.replay(out, range(8, 24)))


def test_locked_pixels_do_not_count_in_the_smallest_share(quarter, tmp_path):
    out = tmp_path / "run"
    run(quarter(SHARES, generations=3), out, workers=0)
    header = RunLog(out).header
    assert (header.shares, header.schema_version) == ("free", 12)
    check_shares(out, ~MASK)


def test_older_runs_count_locked_pixels_as_before(quarter, tmp_path, monkeypatch):
    """A run that an older release began: its births are resumed and replayed with its values."""
    out, made = tmp_path / "run", preparation._header

    def older(*arguments):
        return dataclasses.replace(made(*arguments), shares="all")

    with monkeypatch.context() as patched:
        patched.setattr(preparation, "_header", older)
        run(quarter(SHARES, generations=2), out, workers=0)
    header = RunLog(out).header
    assert (header.shares, header.schema_version) == (
        "all",
        5 if header.marks != ("crowding",) else 3,
    )
    with Search.resume(out, generations=3, workers=0) as search:
        assert [one.number for one in search] == [3]
    check_shares(out, MASK | True)


def test_a_parent_that_stands_in_the_lock_is_told_before_the_first_birth(quarter, tmp_path):
    path = quarter(SHARES)
    np.save(tmp_path / "right.npy", np.where(MASK, np.load(tmp_path / "right.npy"), 0))
    with pytest.raises(RecipeError, match=r"all buildings of right stand in locked pixels"):
        run(path, tmp_path / "run", workers=0)
    assert not (tmp_path / "run").exists()


# -- what stands there ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("more", "expected"),
    [
        ("", lambda left, right: left),
        ('city = "left"', lambda left, right: left),
        ('city = "right"', lambda left, right: right),
        ('heights = "right.npy"', lambda left, right: right),
        ("heights = 0", lambda left, right: left * 0),
        ("heights = 12.5", lambda left, right: left * 0 + 12.5),
    ],
)
def test_the_heights_are_those_asked_for(quarter, tmp_path, more, expected):
    layer = prepare(read_recipe(quarter(LOCKED + more))).condensation
    left, right = (np.load(tmp_path / f"{name}.npy") for name in ("left", "right"))
    assert layer == Condensation(expected(left, right), MASK)


def test_both_sources_are_coded_with_it_and_kept_as_they_were(quarter, tmp_path):
    prepared = prepare(read_recipe(quarter()))
    assert prepared.header.locked == prepared.condensation.digest
    for source, name in zip(prepared.sources, ("left", "right"), strict=True):
        assert np.array_equal(source.city.heights, np.load(tmp_path / f"{name}.npy"))
        layer = prepared.condensation
        expected = uniformly(source.city, settle=True, condensation=layer).genome
        assert source.genome == expected


def test_licences_of_what_is_imported_are_told(quarter, tmp_path, town):
    write_map(town.replace(town.heights, attribution="a survey"), tmp_path / "dsm.tif")
    out = tmp_path / "run"
    run(quarter(LOCKED + 'heights = "dsm.tif"', generations=0), out, workers=0)
    assert RunLog(out).genome(7).attribution == "a survey"
    check_locked(out, town.heights, births=8)


def test_a_foreign_operator_cannot_lose_it(quarter):
    setup = prepare(read_recipe(quarter())).setup

    def forgetful(parents, rng):
        return parents[0].replace(condensation=None)

    genome = prepare(read_recipe(quarter())).sources[0].genome
    bred = Evaluator(setup).breed(forgetful, [genome], np.random.default_rng(0))
    assert bred.genome == genome


# -- faults -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("locked", "key", "word"),
    [
        ("[locked]", "locked", "neither footprints nor mask; allowed: one of footprints and mask"),
        (
            LOCKED + 'footprints = "left.npy"',
            "locked",
            "footprints and mask; allowed: one of footprints and mask",
        ),
        ('[locked]\nmask = "nowhere.npy"', "locked.mask", "'nowhere.npy' is not a file"),
        ('[locked]\nfootprints = "lyon-1er"', "locked.footprints", "'lyon-1er' is not a file"),
        ("[locked]\nmask = 3", "locked.mask", "3; allowed: text in quotes"),
        (LOCKED + "heights = -1", "locked.heights", "-1; allowed: a map file, a bundled city, or"),
        (LOCKED + "heights = nan", "locked.heights", "0 to 1000 m"),
        (LOCKED + "heights = true", "locked.heights", "True; allowed: a map file"),
        (LOCKED + 'heights = "lyon-1"', "locked.heights", "did you mean lyon-1er?"),
        (LOCKED + "city = 1", "locked.city", "1; allowed: text in quotes"),
        (LOCKED + "hights = 1", "locked.hights", "did you mean heights?"),
        ("locked = 3\n", "locked", "3; allowed: a table"),
    ],
)
def test_faults_of_the_table_are_told_with_their_keys(quarter, locked, key, word):
    path = quarter(locked)
    if not locked.startswith("["):
        path.write_text(locked + path.read_text().replace(locked, ""))
    (found,) = faults(path)
    assert found.startswith(f"{key}: ")
    assert word in found


@pytest.mark.parametrize(
    ("mask", "more", "error", "word"),
    [
        (MASK, 'city = "middle"', RecipeError, "'middle' is not a source of this recipe"),
        (MASK, 'city = "rigth"', RecipeError, "did you mean right?"),
        (np.ones((64, 64)), "", RecipeError, r"mask\.npy covers every pixel of left"),
        (np.zeros((64, 64)), "", MapError, "no value above 0 on the map left"),
        (
            MASK[:32],
            "",
            MapError,
            "locked.mask = 'mask.npy': mask has 32 × 64 px, but left has 64 × 64 px",
        ),
        (np.array("text"), "", MapError, "of shape"),
        (MASK, 'heights = "mask.png"', MapError, r"locked.heights = 'mask\.png': .* grey levels"),
    ],
)
def test_what_does_not_serve_is_refused_before_anything_is_written(
    quarter, tmp_path, mask, more, error, word
):
    (tmp_path / "mask.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    recipe = quarter(LOCKED + more)
    np.save(tmp_path / "mask.npy", mask)
    with pytest.raises(error, match=word):
        run(recipe, tmp_path / "run", workers=0)
    assert not (tmp_path / "run").exists()


def test_a_run_cannot_lock_something_else_later(quarter, tmp_path):
    out = tmp_path / "run"
    run(quarter(generations=0), out, workers=0)
    recipe = out / "recipe.toml"
    for locked in ("", LOCKED + "heights = 0\n"):
        recipe.write_text(quarter(locked).read_text())
        quarter()
        with pytest.raises(RunError, match=r"locked was {'mask': 'mask\.npy'} and is now"):
            Search.resume(out, accept_changes=True)


def test_the_runs_own_copy_is_checked(quarter, tmp_path):
    out = tmp_path / "run"
    run(quarter(generations=0), out, workers=0)
    kept = np.load(out / "sources" / "locked.npy")
    np.save(out / "sources" / "locked.npy", kept + 1)
    with pytest.raises(RunError, match=r"locked\.npy is not the file that was written"):
        Search.resume(out, generations=1)
    without_digests(out)
    with pytest.raises(RunError, match="another layer than the one the run began with"):
        Search.resume(out, generations=1)


def test_a_run_begun_without_a_lock_goes_on(toy, tmp_path):
    out = tmp_path / "run"
    run(toy(), out, workers=0, generations=0)
    assert "locked" not in RunLog(out).provenance
    with Search.resume(out, generations=1, workers=0) as search:
        assert [one.number for one in search] == [1]


def test_a_layer_of_another_size_is_no_layer(quarter):
    genome = prepare(read_recipe(quarter())).sources[0].genome
    with pytest.raises(GenomeError, match="condensation"):
        genome.replace(condensation=Condensation(np.ones((32, 32)), np.ones((32, 32), bool)))
