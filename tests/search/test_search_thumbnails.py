"""Thumbnails of a run's births, from its workers to the pictures of them."""

import shutil

import duckdb
import naive
import numpy as np
import polars
import pyarrow.parquet as pq
import pytest

import evocity
from evocity.analysis.births import Births
from evocity.analysis.thumbnails import Thumbnails
from evocity.citymap import CityMap
from evocity.errors import RunError
from evocity.search import Search
from evocity.search.steering.estimate import largest_run
from evocity.store import Thumbnails as Logged

RECIPE = """
[run]
seed = 3
population = 5
generations = 2
[map]
pixels = 144
[[parents]]
map = "left.npy"
[[parents]]
map = "right.npy"
[genome]
lifs = 300
fit = false
[[fitness]]
file = "choosy.py"
[[fitness]]
name = "gsi"
target = 0.3
"""

CHOOSY = """
from evocity.fitness import fitness


@fitness(goal="max", unit="m")
def choosy(city):
    \"\"\"Fails for every third height.\"\"\"
    high = float(city.heights.max())
    if int(city.heights.sum()) % 3 == 0:
        raise ValueError("not this one")
    return high
"""


def town(seed: int) -> np.ndarray:
    blocks = np.random.default_rng(seed).integers(0, 3, (24, 24)) * 9.0
    return np.kron(blocks, np.ones((6, 6)))


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Writes the run of `RECIPE`, with ``more`` in it, by so many ``workers``."""

    def write(more: str = "", workers: int = 0) -> "evocity.Run":
        folder = tmp_path_factory.mktemp("thumbnails")
        for seed, name in enumerate(("left.npy", "right.npy")):
            np.save(folder / name, town(seed))
        (folder / "choosy.py").write_text(CHOOSY)
        (folder / "night.toml").write_text(RECIPE + more)
        recipe = evocity.read_recipe(folder / "night.toml")
        with Search(recipe, out=folder / "night", workers=workers) as search:
            list(search)
        return evocity.open_run(folder / "night")

    return write


@pytest.fixture(scope="module")
def night(written):
    return written()


def test_the_log_has_a_small_map_of_every_birth_that_was_decoded(night):
    births = night.individuals(range(15))
    assert {"ok", "error"} <= {one.status for one in births}
    small = night.thumbnails([one.id for one in births])
    assert night.header.thumbnails.pixels == 2
    step = night.header.thumbnails.metres / 255
    for one in births:
        city = night.header.chromosome.express(one.genome).city
        means = np.minimum(naive.cell_means(city.heights, 2), night.header.thumbnails.metres)
        assert small[one.id].shape == (72, 72)
        assert np.abs(small[one.id].heights - means).max() <= step / 2 + 1e-4


def test_what_is_no_birth_has_none(night):
    with pytest.raises(RunError, match="no individual 15"):
        night.thumbnails([3, 15])
    with pytest.raises(RunError, match="a whole number"):
        night.thumbnails(["3"])
    assert night.thumbnails([]) == {}


def test_small_maps_are_not_logged(night, tmp_path):
    text = night.recipe_text.replace("pixels = 144", "pixels = 128")
    (tmp_path / "small.toml").write_text(text)
    (tmp_path / "choosy.py").write_text(CHOOSY)
    for seed, name in enumerate(("left.npy", "right.npy")):
        np.save(tmp_path / name, town(seed)[:128, :128])
    recipe = evocity.read_recipe(tmp_path / "small.toml")
    with Search(recipe, out=tmp_path / "small", workers=0) as search:
        next(iter(search))
    small = evocity.open_run(tmp_path / "small")
    assert small.header.thumbnails is None
    assert small.header.schema_version < 10
    assert "thumbnail" not in small.births(0).column_names
    assert small.thumbnails([0, 1]) == {}


def test_pictures_of_them_need_no_genome_and_look_alike(night, monkeypatch):
    told = Births(night)
    small, large = Thumbnails(told), Thumbnails(told)
    ids = [int(one) for one in told.ids]
    decoded = large._decoded(ids, 96)

    def refused(*_, **__):
        raise AssertionError("a genome was read")

    monkeypatch.setattr(type(night), "individuals", refused)
    pictures, lacking = small.of(ids, 96)
    assert small.logged
    assert not lacking
    for one in ids:
        assert pictures[one].shape == decoded[one].shape == (96, 96, 3)
        assert np.abs(pictures[one].astype(int) - decoded[one]).mean() < 12
    with pytest.raises(AssertionError, match="a genome was read"):
        small.of(ids, 108)  # half as large again


def test_a_genome_that_is_left_out_has_its_picture(written):
    run = written('[log]\ngenomes = "front"\n')
    assert (run.header.schema_version, run.header.genomes) == (10, "front")
    births = run.individuals(range(15), rebred=False)
    out = [one.id for one in births if one.left_out]
    assert out
    assert set(run.thumbnails(range(15))) == set(range(15))
    pictures, lacking = Thumbnails(Births(run)).of(out, 64)
    assert (set(pictures), lacking) == (set(out), {})


def test_a_run_that_began_without_goes_on_without(written, monkeypatch):
    with monkeypatch.context() as before:
        before.setattr(Logged, "of", classmethod(lambda *_: None))
        run = written()
    assert run.header.thumbnails is None
    with Search.resume(run.path, generations=3, workers=0) as search:
        list(search)
    again = evocity.open_run(run.path)
    assert (len(again.generations), again.header.thumbnails) == (4, None)
    pictures, lacking = Thumbnails(Births(again)).of(range(20), 64)
    assert len(pictures) + len(lacking) == 20


def test_others_read_them_without_this_package(night):
    files = str(night.path / "births" / "*.parquet")
    expected = night.thumbnails([7])[7].heights
    metres = night.header.thumbnails.metres
    rows = duckdb.sql(f"select thumbnail, sigma from '{files}' where id = 7").fetchall()
    frame = polars.read_parquet(files).filter(polars.col("id") == 7)
    sigma = night.genome(7).sigma.tolist()
    assert rows[0][1] == frame["sigma"][0].to_list() == sigma
    assert not night.births(0).schema.field("sigma").type.value_field.nullable
    for content in (rows[0][0], frame["thumbnail"][0]):
        heights = np.frombuffer(content, np.uint8).reshape(72, 72) * np.float32(metres / 255)
        np.testing.assert_array_equal(heights, expected)


def test_a_damaged_thumbnail_is_told(night, tmp_path):
    folder = shutil.copytree(night.path, tmp_path / "night")
    file = next((folder / "births").glob("*0.parquet"))
    about = pq.read_metadata(file)
    at = about.schema.names.index("thumbnail")
    column = about.row_group(0).column(at)
    content = bytearray(file.read_bytes())
    start = column.dictionary_page_offset or column.data_page_offset
    content[start + column.total_compressed_size // 2] ^= 0xFF
    file.write_bytes(content)
    with pytest.raises(RunError, match="damaged"):
        evocity.open_run(folder).thumbnails([0])


def test_a_map_is_as_large_as_its_cells(night):
    assert isinstance(night.thumbnails([0])[0], CityMap)
    assert night.thumbnails([0])[0].metres_per_pixel == 2 * night.header.metres_per_pixel


@pytest.mark.slow
def test_workers_make_the_same(night, written):
    other = written(workers=2)
    for run in (night, other):
        assert run.births()["thumbnail"].null_count == 0
    assert other.births()["thumbnail"].equals(night.births()["thumbnail"])


def test_what_somebody_else_evaluates_has_none(night):
    recipe = evocity.read_recipe(night.path.parent / "night.toml")
    out = night.path.parent / "asked"
    with Search(recipe, out=out, workers=0) as search:
        genomes = search.ask()
        search.tell([{"choosy": 1.0, "gsi": 0.3 + n / 100} for n in range(len(genomes))])
    run = evocity.open_run(out)
    assert (run.header.schema_version, run.thumbnails(range(5))) == (10, {})
    pictures = Thumbnails(Births(run))
    assert not pictures.logged
    assert len(pictures.of(range(5), 64)[0]) == 5


def test_the_bound_of_a_run_counts_them(night):
    recipe = evocity.read_recipe(night.path.parent / "night.toml")
    births, most = largest_run(night.path / "sources", recipe)
    sizes = [one.stat().st_size for one in night.path.glob("sources/*.genome.parquet")]
    assert (births, most) == (15, 15 * (max(sizes) + 72 * 72))
    taken = sum(one.stat().st_size for one in night.path.glob("births/*"))
    assert taken < most


def test_more_bytes_than_a_run_has_are_not_read(night, tmp_path, monkeypatch):
    folder = shutil.copytree(night.path, tmp_path / "night")
    monkeypatch.setattr("evocity.store.read_limits.MOST_FIXED", 5 * 72 * 72 - 1)
    run = evocity.open_run(folder)
    assert len(run.generations) == 3  # their other columns were looked at
    with pytest.raises(RunError, match="25920 bytes of thumbnail in one generation"):
        run.thumbnails([0])
    assert run.genome(0)
