"""Genomes and runs of the release before leaves, 9f0cb5b: read, shown, scored and resumed as they
are. `tests/old/expected.json` has what that release made of them."""

import hashlib
import json
import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner
from PIL import Image
from toy_runs import unsealed

import evocity
from evocity import fitness
from evocity.cli import main
from evocity.errors import RunError
from evocity.fitness import registry
from evocity.genome import unpacked
from evocity.pavement import Pavement
from evocity.report import contact_sheet, write_report
from evocity.search import Search

OLD = Path(__file__).parent / "old"
EXPECTED = json.loads((OLD / "expected.json").read_text(encoding="utf-8"))
GENOMES = sorted(path.name for path in OLD.glob("genome-[12]*.parquet"))
RUNS = ("run-1", "run-2")
#: Of a locked run the mask lies beside the recipe, and is watched.
MASK = OLD / "run-2-mask.npy"


@pytest.fixture(autouse=True)
def _child_that_parses():
    """Start the process that parses files without seals, before the time of a case counts."""
    evocity.read_genome(OLD / GENOMES[0])


def call(*words):
    """The outcome of ``evocity WORDS``, which must succeed."""
    result = CliRunner().invoke(main, [str(word) for word in words], prog_name="evocity")
    assert result.exit_code == 0, result.output
    return result


def facts(genome) -> dict:
    """What is kept of a genome in `expected.json`."""
    city = evocity.decode(genome).city
    heights = hashlib.blake2b(city.heights.tobytes(), digest_size=8).hexdigest()
    return {"digest": genome.digest, "heights": heights, "shape": list(city.shape)}


def scores(genome, names) -> dict:
    city = evocity.decode(genome).city
    values = {}
    for name in names:
        value = float(registry.get(name)(city, genome=genome))
        values[name] = value if np.isfinite(value) else None
    return values


def check_scores(genome, expected: dict) -> None:
    """The same values, but for the last bits of float32 sums: 9f0cb5b added in another order."""
    assert scores(genome, expected) == {
        name: None if value is None else pytest.approx(value, rel=1e-6, abs=1e-9)
        for name, value in expected.items()
    }


def test_all_of_them_are_there():
    assert set(GENOMES) | set(RUNS) == set(EXPECTED)
    free = {one.name for one in fitness.measures() if "parents" not in one.needs}
    for name in GENOMES:
        assert set(EXPECTED[name]["values"]) <= free


@pytest.mark.parametrize("name", GENOMES)
def test_a_genome_is_read_as_it_was(name):
    genome, expected = evocity.read_genome(OLD / name), EXPECTED[name]
    assert genome.settle is False
    assert not genome.turn.any()
    assert genome.pavement.uniform
    assert facts(genome) == {key: expected[key] for key in ("digest", "heights", "shape")}
    check_scores(genome, expected["values"])


@pytest.mark.parametrize("name", GENOMES)
def test_a_genome_written_again_is_the_same(name, tmp_path):
    genome = evocity.read_genome(OLD / name)
    genome.write(tmp_path / "again.parquet")
    again = evocity.read_genome(tmp_path / "again.parquet")
    assert again == genome
    for field in ("parent", "source", "turn"):
        assert np.array_equal(getattr(again, field), getattr(genome, field))
    assert (again.made, again.settle, again.crs) == (genome.made, False, genome.crs)


def test_stones_of_a_grown_fabric_lie_in_its_original():
    """Its lifs were numbered by the columns of the 64 px that it was grown around."""
    grown = evocity.read_genome(OLD / "genome-1-grown.parquet")
    row, column = unpacked(grown.source)
    assert (min(row.min(), column.min()), max(row.max(), column.max())) == (0, 60)
    assert not (row % 4).any()
    assert not (column % 4).any()
    p = grown.pavement
    top, left = grown.made["corner"]
    cells = np.arange(len(p)).reshape(p.rows, p.columns)
    own = cells[top : top + 16, left : left + 16]
    places = np.mgrid[0:64:4, 0:64:4]
    assert np.array_equal(row[own], places[0])
    assert np.array_equal(column[own], places[1])
    around = np.setdiff1d(cells, own)
    assert len(np.unique(grown.source[around])) > 100


@pytest.fixture(params=RUNS)
def name(request):
    return request.param


def test_a_run_is_opened_and_its_births_are_those_written(name):
    run, expected = evocity.open_run(OLD / name), EXPECTED[name]
    assert run.header.schema_version == (1 if name == "run-1" else 2)
    assert (run.header.block, run.header.settle, run.header.kind) == (4, False, "fabric")
    columns = list(expected["births"][0])
    assert run.births(columns=columns).to_pylist() == expected["births"]
    assert run.members(3)["id"].to_pylist() == expected["living"]
    assert run.generations == range(4)
    for identifier, told in expected["decoded"].items():
        genome = run.genome(int(identifier))
        assert genome.settle is False
        assert facts(genome) == {key: told[key] for key in ("digest", "heights", "shape")}
        check_scores(genome, told["values"])


def test_every_individual_is_the_genome_its_digest_tells(name):
    run = evocity.open_run(OLD / name)
    log = run.births(columns=["id", "genome"]).to_pylist()
    for one, birth in zip(log, run.individuals([row["id"] for row in log]), strict=True):
        assert birth.genome.digest == one["genome"]
        assert birth.genome.pavement == Pavement(64, 64, 4)
        assert (birth.genome.condensation is not None) == (name == "run-2")
        row, column = unpacked(birth.genome.source)
        assert max(row.max(), column.max()) <= 60
    for source in run.sources():
        assert np.array_equal(source.genome.parent, np.full(256, source.genome.parent[0]))
        assert facts(source.genome)["shape"] == [64, 64]


@pytest.mark.parametrize("path", sorted(OLD.glob("*/provenance.json")), ids=lambda p: p.parent.name)
def test_births_are_decoded_alike_without_their_stones(path):
    run = evocity.open_run(path.parent)
    ids = [birth.id for birth in run if birth.status == "ok"]
    whole = run.individuals(ids, rebred=False)
    bare = run.individuals(ids, rebred=False, stones=False)
    for one, other in zip(whole, bare, strict=True):
        if one.genome is None:
            assert other.left_out == one.left_out
            continue
        assert other.genome == one.genome
        kind = run.header.chromosome
        maps = [kind.express(birth.genome).city for birth in (one, other)]
        np.testing.assert_array_equal(*(city.heights for city in maps))


@pytest.mark.slow_cases("run-2")
def test_a_run_is_shown_and_told(name, tmp_path):
    folder = tmp_path / name
    shutil.copytree(OLD / name, folder)
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    run = evocity.open_run(folder)
    sheet = contact_sheet(run)
    assert min(sheet.size) > 128
    assert json.loads(call("status", folder, "--json").stdout)["births"] == 24
    best = evocity.archive(run)
    assert 0 < len(best.births) <= 24
    identifier = next(iter(EXPECTED[name]["decoded"]))
    call("show", folder, "--id", identifier, "--ancestry", "-o", tmp_path / "whose.png")
    call("show", folder, "-o", tmp_path / "bred.png")
    with Image.open(tmp_path / "bred.png") as picture:
        assert picture.size == sheet.size
    call("decode", folder, "--id", identifier, "-o", tmp_path / "one.npy")
    heights = hashlib.blake2b(np.load(tmp_path / "one.npy").tobytes(), digest_size=8).hexdigest()
    assert heights == EXPECTED[name]["decoded"][identifier]["heights"]
    assert {path: path.read_bytes() for path in before} == before
    page = write_report(folder).read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") > 3


def moved(run: Path, recipe_folder: Path) -> None:
    """Tell a run that its recipe, and what lies beside it, is in another folder."""
    path = run / "provenance.json"
    about = unsealed(path)
    about["recipe"]["folder"] = str(recipe_folder)
    path.write_text(json.dumps(about), encoding="utf-8")


def resumed(name: str, folder: Path) -> Path:
    """A copy of an old run with two generations more."""
    folder.mkdir(exist_ok=True)
    shutil.copytree(OLD / name, folder / name)
    shutil.copy(MASK, folder / "mask.npy")
    moved(folder / name, folder)
    # measures have changed since, and say so
    with Search.resume(folder / name, generations=5, workers=0, accept_changes=True) as search:
        told = list(search)
    assert [one.number for one in told] == [4, 5]
    return folder / name


def test_a_run_goes_on_as_it_began(name, tmp_path):
    path, old = resumed(name, tmp_path), evocity.open_run(OLD / name)
    run = evocity.open_run(path)
    assert run.header == old.header
    assert run.generations == range(6)
    assert run.births(3).equals(old.births(3))
    new = pq.read_table(path / "births" / "generation-00000005.parquet")
    assert new.schema.equals(old.births().schema)
    assert new.schema.field("sigma").type == pa.list_(pa.float32(), 256)
    assert not {"turn", "side"} & set(new.column_names)
    about = json.loads(new.schema.metadata[b"evocity.run"])
    assert (about["schema_version"], about["block"]) == (run.header.schema_version, 4)
    ids = [*run.births(4)["id"].to_pylist(), *run.births(5)["id"].to_pylist()]
    assert ids == list(range(24, 36))
    births = run.individuals(ids)
    assert {birth.status for birth in births} == {"ok"}
    assert {birth.operator for birth in births} > {"pavement_fusion"}
    for birth in births:
        assert birth.genome.pavement == Pavement(64, 64, 4)
        assert birth.genome.settle is False
        city = evocity.decode(birth.genome).city
        assert birth.values["gsi"] == evocity.fitness.gsi(city)
        if run.condensation is not None:
            kept = np.load(OLD / "run-2" / "sources" / "locked.npy")
            assert np.array_equal(city.heights[~np.isnan(kept)], kept[~np.isnan(kept)])
    assert json.loads(call("status", path, "--json").stdout)["generation"] == 5


def test_a_run_goes_on_alike_whenever_it_is_resumed(tmp_path):
    once = evocity.open_run(resumed("run-1", tmp_path / "once")).births()
    (tmp_path / "twice").mkdir()
    shutil.copytree(OLD / "run-1", tmp_path / "twice" / "run")
    moved(tmp_path / "twice" / "run", tmp_path / "twice")
    for generations in (4, 5):
        again = {"workers": 0, "accept_changes": True, "generations": generations}
        with Search.resume(tmp_path / "twice" / "run", **again) as search:
            list(search)
    twice = evocity.open_run(tmp_path / "twice" / "run").births()
    assert once.drop_columns("seconds").equals(twice.drop_columns("seconds"))


def test_a_recipe_that_says_nothing_of_range_blocks_goes_on_with_those_it_had(tmp_path):
    """9f0cb5b took B = 4 where today's default is leaves, whose sizes are metres."""
    path = tmp_path / "run"
    shutil.copytree(OLD / "run-1", path)
    recipe = (path / "recipe.toml").read_text(encoding="utf-8")
    assert "size_max" in recipe
    (path / "recipe.toml").write_text(recipe.replace("block = 4\n", ""), encoding="utf-8")
    with Search.resume(path, generations=4, workers=0, accept_changes=True) as search:
        assert search.recipe.genome.block == 4
        assert (search.recipe.genome.fit, search.recipe.genome.settle) == (False, False)
    (path / "recipe.toml").write_text(recipe.replace("block = 4", "block = 8"), encoding="utf-8")
    with pytest.raises(RunError, match=r"genome\.block was 4 and is now 8"):
        Search.resume(path, generations=4, workers=0, accept_changes=True)
    text = recipe.replace("block = 4", "block = 4\nsettle = true")
    (path / "recipe.toml").write_text(text, encoding="utf-8")
    with pytest.raises(RunError, match=r"genome\.settle was False and is now True"):
        Search.resume(path, generations=4, workers=0, accept_changes=True)
