import copy
import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from codes import uniformly

from evocity.errors import GenomeError
from evocity.genome import FIELDS, NUCLEOTIDES, Genome, merged_cities, read_genome
from evocity.pavement import Pavement


@pytest.fixture(scope="module")
def genome(town):
    return uniformly(town).genome


@pytest.mark.parametrize("shape", [(62, 64), (64, 30), (3, 4)])
def test_a_pavement_that_does_not_fit_names_sizes_that_do(shape):
    with pytest.raises(GenomeError, match="multiples of 4") as caught:
        Pavement(*shape, 4)
    for side in shape:
        assert side % 4 == 0 or str(max(side // 4, 1) * 4) in str(caught.value)


def test_blocks_and_raster_undo_each_other():
    pavement = Pavement(12, 20, 4)
    raster = np.arange(240.0).reshape(12, 20)
    blocks = pavement.blocks(raster)
    assert blocks.shape == (len(pavement), 4, 4)
    assert np.array_equal(pavement.raster(blocks), raster)
    y, x = pavement.corners
    assert np.array_equal(blocks[7], raster[y[7] : y[7] + 4, x[7] : x[7] + 4])


def test_file_round_trip_is_exact(genome, tmp_path):
    genome.write(tmp_path / "g.parquet")
    again = read_genome(tmp_path / "g.parquet")
    assert again == genome
    assert again.digest == genome.digest
    for name in FIELDS:
        assert np.array_equal(getattr(again, name), getattr(genome, name))
    for name in ("cities", "attribution", "made", "origin", "crs", "sigma_max"):
        assert getattr(again, name) == getattr(genome, name)


def test_arrays_are_read_only_copies(genome):
    beta = genome.beta.copy()
    child = genome.replace(beta=beta)
    beta[:] = 99
    assert child == genome
    with pytest.raises(ValueError, match="read-only"):
        genome.sigma[0] = 1


@pytest.mark.parametrize("name", NUCLEOTIDES)
def test_each_nucleotide_counts_in_the_digest(genome, name):
    values = getattr(genome, name).copy()
    at = np.flatnonzero(~genome.uniform & (genome.x > 0) & (genome.y > 0))[0]
    values[at] = values[at] - 1 if name in ("x", "y") else (values[at] + 1) % 8
    if name in ("dx", "dy"):
        values[at] = 12
    if name == "sigma":
        values[at] = 0.123
    assert genome.replace(**{name: values}) != genome


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"sigma": 0.95}, "σ beyond"),
        ({"sigma": np.nan}, "σ beyond"),
        ({"beta": np.inf}, "β not finite"),
        ({"x": 60}, "outside the map"),
        ({"y": -1}, "outside the map"),
        ({"dx": 6}, "extent"),
        ({"dy": 4}, "extent"),
        ({"iso": 8}, "iso"),
        ({"parent": 1}, "cities"),
        ({"source": -1}, "source"),
    ],
)
def test_out_of_bounds_is_refused_by_name(genome, change, word):
    at = np.flatnonzero(~genome.uniform)[0]
    (name, value), *_ = change.items()
    values = getattr(genome, name).copy()
    values[at] = value
    with pytest.raises(GenomeError, match=word):
        genome.replace(**{name: values})


def test_fractions_for_whole_nucleotides_are_refused(genome):
    with pytest.raises(GenomeError, match="whole numbers"):
        genome.replace(x=genome.x + 0.5)
    with pytest.raises(GenomeError, match="shape"):
        genome.replace(x=genome.x[:-1])


def rewritten(path, change):
    table = pq.read_table(path)
    about = json.loads(table.schema.metadata[b"evocity.genome"])
    table, about = change(table, about)
    pq.write_table(table.replace_schema_metadata({"evocity.genome": json.dumps(about)}), path)


def check_refused(genome, path, change, word) -> None:
    genome.write(path)
    rewritten(path, change)
    with pytest.raises(GenomeError, match=word):
        read_genome(path)


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda t, a: (t, a | {"schema_version": 99}), "version 99"),
        (lambda t, a: (t.drop(["sigma"]), a), "lacks"),
        (lambda t, a: (t, {k: v for k, v in a.items() if k != "cities"}), "lacks"),
        (lambda t, a: (t, a | {"block": "four"}), "lacks"),
        (lambda t, a: (t, a | {"height": 62}), "62"),
        (lambda t, a: (t, a | {"surprise": 1}), "surprise"),
        (lambda t, a: (t.slice(3), a), "253 lifs"),
        (
            lambda t, a: (t.set_column(0, "sigma", pa.array([2.0] * len(t), pa.float32())), a),
            "σ beyond",
        ),
    ],
)
def test_a_file_at_fault_gives_one_clear_error(genome, tmp_path, change, word):
    check_refused(genome, tmp_path / "g.parquet", change, word)


def test_another_account_of_itself_changes_nothing_else(genome):
    told = {"operator": "by hand"}
    other = genome.replace(made=told)
    told["operator"] = "changed later"
    assert other == genome
    assert (dict(other.made), dict(genome.made)) == ({"operator": "by hand"}, dict(genome.made))
    assert other.made != genome.made
    assert not any(getattr(other, name).flags.writeable for name in FIELDS)

    class Own(Genome):
        pass

    own = Own(**{name: getattr(genome, name) for name in Genome.__dataclass_fields__})
    assert type(own.replace(made={})) is Genome


def test_files_that_are_no_genome(genome, tmp_path):
    with pytest.raises(GenomeError, match="no genome file"):
        read_genome(tmp_path / "missing.parquet")
    (tmp_path / "text.parquet").write_text("not parquet")
    with pytest.raises(GenomeError, match="not a genome file"):
        read_genome(tmp_path / "text.parquet")
    pq.write_table(pa.table({"a": [1]}), tmp_path / "other.parquet")
    with pytest.raises(GenomeError, match="not a genome"):
        read_genome(tmp_path / "other.parquet")
    genome.write(tmp_path / "cut.parquet")
    data = (tmp_path / "cut.parquet").read_bytes()
    (tmp_path / "cut.parquet").write_bytes(data[: len(data) // 2])
    with pytest.raises(GenomeError, match="not a genome file"):
        read_genome(tmp_path / "cut.parquet")


def test_cities_are_merged_without_doubles(genome):
    one = genome.replace(cities=("a", "b"), parent=np.arange(len(genome)) % 2, attribution="A; B")
    two = genome.replace(cities=("b", "c"), parent=np.arange(len(genome)) % 2, attribution="B; C")
    names, (first, second), attribution = merged_cities([one, two])
    assert names == ("a", "b", "c")
    assert attribution == "A; B; C"
    assert set(np.take(names, first)) == {"a", "b"}
    assert np.take(names, second).tolist() == ["b", "c"]


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda t, a: (t, a | {"metres_per_pixel": None}), "metres_per_pixel"),
        (lambda t, a: (t, a | {"metres_per_pixel": "x"}), "metres_per_pixel"),
        (lambda t, a: (t, a | {"metres_per_pixel": float("nan")}), "metres_per_pixel"),
        (lambda t, a: (t, a | {"cities": [1]}), "cities"),
        (lambda t, a: (t, a | {"cities": []}), "cities"),
        (lambda t, a: (t, a | {"cities": ["x"] * 300}), "cities"),
        (lambda t, a: (t, a | {"origin": [1]}), "origin"),
        (lambda t, a: (t, a | {"origin": 5}), "has damaged data"),
        (lambda t, a: (t, a | {"crs": 3}), "crs"),
        (lambda t, a: (t, a | {"attribution": 3}), "attribution"),
        (lambda t, a: (t, a | {"made": 3}), "has damaged data"),
        (lambda t, a: (t, a | {"sigma_max": "big"}), "sigma_max"),
        (lambda t, a: (t, a | {"height": 10**30}), "has damaged data"),
        (lambda t, a: (t, a | {"height": 32764, "width": 32764}), "has damaged data"),
        (lambda t, a: (t, a | {"height": True}), "has damaged data"),
        (lambda t, a: (pa.concat_tables([t] * 50), a), "has damaged data"),
    ],
)
def test_a_strangers_description_is_checked_before_it_is_used(genome, tmp_path, change, word):
    check_refused(genome, tmp_path / "g.parquet", change, word)


@pytest.mark.parametrize("text", ["[]", "3", "[" * 100_000, '{"schema_version": [[1]]}', "{}"])
def test_metadata_that_is_no_description(genome, tmp_path, text):
    path = tmp_path / "g.parquet"
    genome.write(path)
    table = pq.read_table(path).replace_schema_metadata({"evocity.genome": text})
    pq.write_table(table, path)
    with pytest.raises(GenomeError):
        read_genome(path)


def test_what_made_a_genome_may_hold_infinity(genome, tmp_path):
    genome.replace(made={"tolerance": float("inf"), "fill": (0.5, 0.5)}).write(
        tmp_path / "g.parquet"
    )
    assert read_genome(tmp_path / "g.parquet").made == {"tolerance": "inf", "fill": [0.5, 0.5]}


def test_writing_where_nothing_can_be_written(genome, tmp_path):
    with pytest.raises(GenomeError, match="cannot be written"):
        genome.write(tmp_path / "nowhere" / "g.parquet")


def test_a_view_of_a_writeable_array_is_copied(genome):
    base = genome.beta.copy()
    view = base[:]
    view.setflags(write=False)
    other = genome.replace(beta=view)
    base[:] = 99
    assert other == genome


def test_a_genome_from_another_process_is_read_only_too(genome):
    again = copy.deepcopy(genome)
    assert again == genome
    with pytest.raises(ValueError, match="read-only"):
        again.sigma[0] = 1


def test_a_negative_zero_is_zero(genome):
    one = genome.replace(sigma=np.where(genome.sigma == 0, -0.0, genome.sigma))
    assert one.digest == genome.digest
    assert not np.signbit(one.sigma[one.sigma == 0]).any()
