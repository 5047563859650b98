"""What is kept is kept bit for bit: in the layer, in a genome, in its file."""

import copy
import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from codes import uniformly
from hypothesis import given
from hypothesis import strategies as st
from towns import draw_town

from evocity.condensation import Condensation, merged
from evocity.errors import GenomeError
from evocity.genome import read_genome
from evocity.genome.writer import CONDENSED
from evocity.pavement import Pavement

#: A genome file of schema version 1, written before there were others.
OLD = Path(__file__).parent / "old" / "genome-1.parquet"


def draw_layer(seed: int, shape=(16, 24), share: float = 0.3) -> Condensation:
    rng = np.random.default_rng(seed)
    mask = rng.random(shape) < share
    mask[tuple(rng.integers(0, shape))] = True
    return Condensation(rng.uniform(0, 30, shape), mask)


layers = st.builds(draw_layer, st.integers(0, 10**6), share=st.floats(0, 1))


@pytest.fixture(scope="module")
def genome(town):
    mask = np.zeros(town.shape, bool)
    mask[10:30, 6:41] = True
    return uniformly(town, condensation=Condensation.cut(town, mask)).genome


# -- the layer --------------------------------------------------------------------------------


@given(layers)
def test_what_is_laid_stands_and_all_else_is_as_it_was(layer):
    heights = np.random.default_rng(0).uniform(0, 30, layer.shape).astype(np.float32)
    laid = layer.laid(heights)
    assert laid.dtype == np.float32
    assert np.array_equal(laid[layer.mask], layer.heights[layer.mask])
    assert np.array_equal(laid[~layer.mask], heights[~layer.mask])
    assert np.array_equal(layer.laid(laid), laid)
    assert len(layer) == layer.mask.sum()


@given(layers, layers, layers)
def test_of_two_layers_the_upper_is_kept(first, second, third):
    both = first.over(second)
    assert np.array_equal(both.mask, first.mask | second.mask)
    expected = np.where(first.mask, first.heights, second.heights)
    assert np.array_equal(both.heights, expected * both.mask)
    assert first.over(first) == first
    assert first.over(second).over(third) == first.over(second.over(third))
    assert merged([None, first, second, first, None, third]) == both.over(third)


def test_nothing_merged_is_nothing():
    assert merged([]) is None
    assert merged([None, None]) is None
    layer = draw_layer(1)
    assert merged([layer, copy.deepcopy(layer), None]) is layer


@given(layers, st.sampled_from([1, 2, 3]))
def test_resampled_pixels_come_from_where_their_centres_lie(layer, factor):
    height, width = layer.shape
    finer = layer.resampled(height * factor, width * factor)
    assert np.array_equal(finer.mask, layer.mask.repeat(factor, 0).repeat(factor, 1))
    assert np.array_equal(finer.heights, layer.heights.repeat(factor, 0).repeat(factor, 1))
    assert finer.resampled(height, width) == layer
    coarse = layer.resampled(height // 2, width // 2)
    kept = layer.mask[1::2, 1::2]
    assert (coarse is None) == (not kept.any())
    assert coarse is None or np.array_equal(coarse.mask, kept)


@given(layers)
def test_raster_and_column_undo_each_other(layer):
    assert Condensation.from_raster(layer.raster) == layer
    pavement = Pavement(*layer.shape, 4)
    column = layer.column(pavement)
    taken = pavement.blocks(layer.mask).any(axis=(1, 2))
    assert np.array_equal(column.is_valid().to_numpy(zero_copy_only=False), taken)
    assert Condensation.from_column(pa.chunked_array([column[:7], column[7:]]), pavement) == layer


def test_equal_layers_are_equal_and_others_are_not():
    heights, mask = np.ones((4, 6)), np.zeros((4, 6), bool)
    mask[1:3, 2:5] = True
    layer = Condensation(heights, mask)
    elsewhere = np.where(mask, heights, 99)
    assert Condensation(elsewhere, mask) == layer
    assert hash(Condensation(elsewhere, mask)) == hash(layer)
    assert Condensation(-np.zeros((4, 6)), mask) == Condensation(np.zeros((4, 6)), mask)
    higher = Condensation(heights + 1, mask)
    wider = Condensation(heights, mask | np.roll(mask, 1))
    turned = Condensation(heights.T, mask.T)
    assert len({layer, higher, wider, turned}) == 4
    assert layer != "layer"


def test_a_layer_is_a_read_only_copy():
    heights, mask = np.ones((4, 4)), np.ones((4, 4), bool)
    layer = Condensation(heights, mask)
    heights[:], mask[:] = 5, False
    assert len(layer) == 16
    assert (layer.heights == 1).all()
    for array in (layer.heights, layer.mask):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_what_comes_from_another_process_is_one_object(genome):
    first, second = copy.deepcopy(genome), copy.deepcopy(genome)
    assert first == genome
    assert first.condensation is second.condensation
    assert first.condensation is not genome.condensation
    assert first.condensation == genome.condensation
    with pytest.raises(ValueError, match="read-only"):
        first.condensation.mask[0] = True


@pytest.mark.parametrize(
    ("heights", "mask", "word"),
    [
        (np.ones((4, 4)), np.ones((4, 5), bool), "of shape"),
        (np.ones(4), np.ones(4, bool), "of shape"),
        (np.full((4, 4), "a"), np.ones((4, 4), bool), "numbers"),
        (np.ones((4, 4)), np.ones((4, 4), np.uint8), "mask > 0"),
        (
            np.ones((4, 4)),
            np.zeros((4, 4), bool),
            "the mask of the fixed heights marks no pixel",
        ),
        (np.full((4, 4), -0.5), np.ones((4, 4), bool), "16 fixed heights"),
        (np.full((4, 4), np.nan), np.ones((4, 4), bool), "NaN"),
        (np.full((4, 4), 1e39), np.ones((4, 4), bool), "infinite"),
    ],
)
def test_arrays_at_fault_are_refused(heights, mask, word):
    with pytest.raises(GenomeError, match=word):
        Condensation(heights, mask)


def test_layers_of_two_sizes_are_not_laid_over_one_another():
    with pytest.raises(GenomeError, match=r"16 × 24 px and 24 × 16 px"):
        draw_layer(1).over(draw_layer(1, (24, 16)))


# -- in a genome, and in its file -------------------------------------------------------------


def test_a_genome_is_another_with_another_layer(genome):
    bare = genome.replace(condensation=None)
    other = genome.replace(condensation=draw_layer(1, (64, 64)))
    assert len({genome, bare, other}) == 3
    assert genome.replace(beta=genome.beta + 1).condensation is genome.condensation
    assert genome.replace(condensation=copy.deepcopy(genome.condensation)) == genome


@pytest.mark.parametrize("wrong", [draw_layer(1), "river", np.ones((64, 64), bool)])
def test_what_is_no_layer_of_the_maps_size_is_refused(genome, wrong):
    with pytest.raises(GenomeError, match="condensation = "):
        genome.replace(condensation=wrong)


def test_file_round_trip_is_exact(genome, tmp_path):
    genome.write(tmp_path / "g.parquet")
    again = read_genome(tmp_path / "g.parquet")
    assert again == genome
    assert again.condensation == genome.condensation


@pytest.mark.parametrize("block", [2, 8])
def test_the_layer_is_cut_along_any_pavement(tmp_path, block):
    layer = draw_layer(3, (32, 32), 0.02)
    coded = uniformly(draw_town(2, side=32), block=block, condensation=layer).genome
    coded.write(tmp_path / "g.parquet")
    assert read_genome(tmp_path / "g.parquet").condensation == layer


def test_a_genome_without_a_layer_is_what_it_was(genome, tmp_path):
    old = read_genome(OLD)
    assert old.digest == "abdfcedf27485fa12127c71db2debc1c"
    assert old.condensation is None
    old.write(tmp_path / "again.parquet")
    before, now = (pq.read_schema(path) for path in (OLD, tmp_path / "again.parquet"))
    assert now.equals(before, check_metadata=True)
    genome.write(tmp_path / "g.parquet")
    told = json.loads(pq.read_schema(tmp_path / "g.parquet").metadata[b"evocity.genome"])
    assert told["schema_version"] == 2


def rewritten(path, change):
    table = pq.read_table(path)
    pq.write_table(change(table), path)


def column_of(values, kind):
    return lambda t: t.set_column(
        t.column_names.index(CONDENSED), CONDENSED, pa.array([values] * len(t), kind)
    )


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda t: t.drop([CONDENSED]), "lacks"),
        (column_of(1.0, pa.float32()), "or has damaged data"),
        (column_of([1.0] * 9, pa.list_(pa.float32(), 9)), "or has damaged data"),
        (column_of([1.0] * 16, pa.list_(pa.float32())), "or has damaged data"),
        (column_of([1.0] * 16, pa.list_(pa.float64(), 16)), "or has damaged data"),
        (
            column_of(None, pa.list_(pa.float32(), 16)),
            "the mask of the fixed heights marks no pixel",
        ),
        (column_of([-1.0] * 16, pa.list_(pa.float32(), 16)), "below 0"),
        (column_of([np.inf] * 16, pa.list_(pa.float32(), 16)), "infinite"),
    ],
)
def test_a_file_at_fault_gives_one_clear_error(genome, tmp_path, change, word):
    path = tmp_path / "g.parquet"
    genome.write(path)
    rewritten(path, change)
    with pytest.raises(GenomeError, match=word):
        read_genome(path)


def test_a_layer_told_as_metadata_is_refused(genome, tmp_path):
    path = tmp_path / "g.parquet"
    genome.replace(condensation=None).write(path)
    table = pq.read_table(path)
    about = json.loads(table.schema.metadata[b"evocity.genome"]) | {"condensation": [[1.0]]}
    pq.write_table(table.replace_schema_metadata({"evocity.genome": json.dumps(about)}), path)
    with pytest.raises(GenomeError, match="condensation"):
        read_genome(path)
