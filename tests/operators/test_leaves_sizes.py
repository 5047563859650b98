"""Sizes of operators, in metres on any partition, in range blocks on those of one side alone."""

from types import SimpleNamespace

import numpy as np
import pytest
from test_breeding_laws import parents_for
from test_leaves_laws import on_blocks, on_leaves, three

from evocity.errors import OperatorError
from evocity.operators import LambdaCrossover, PavementFusion, RegionFusion, Relocation, make
from evocity.operators.grid import METRES, common_grid, in_cells
from evocity.operators.groups import macro_block_sides


@pytest.mark.parametrize("side", [16.0, 32.0, 64.0])
def test_metres_mean_the_same_on_any_partition(side):
    found = {}
    for parents in ([on_leaves(1), on_leaves(2, 200)], [on_blocks(4), on_blocks(5)]):
        grid = common_grid("test", parents)
        for kind in (PavementFusion, RegionFusion):
            fusion = kind(side_min=side, side_max=side, tolerance=1000.0, fill=0.1, margin=0.05)
            child = fusion(parents, np.random.default_rng(0))
            found.setdefault((kind, "made"), set()).add(
                (child.made["side_min"], child.made["side_max"])
            )
        cells = macro_block_sides(Relocation(side_min=side, side_max=side), grid, parents, 9, 9)
        found.setdefault("sides", set()).add(tuple(np.multiply(cells, grid.block)))
        lambdas = LambdaCrossover(grain_side=side).draft(parents, np.random.default_rng(0)).made
        found.setdefault("grain", set()).add(lambdas["grain_side"])
    assert found == {
        (PavementFusion, "made"): {(side, side)},
        (RegionFusion, "made"): {(side, side)},
        "sides": {(side / 2, side / 2)},
        "grain": {side},
    }


def test_a_macro_block_of_so_many_metres_is_laid():
    for parents in ([on_leaves(1), on_leaves(2, 200)], [on_blocks(4), on_blocks(5)]):
        fusion = PavementFusion(
            side_min=32, side_max=32, fill=0.1, margin=0.05, tolerance=1000, places=[(16, 24)]
        )
        draft = fusion.draft(parents, np.random.default_rng(0)).genome
        truth = np.zeros((64, 64), int)
        truth[8:24, 12:28] = 1
        assert np.array_equal(draft.pavement.raster(draft.parent), truth)


#: Operators and their sizes: the older key, a value in range blocks, the same in metres.
SIZES = [
    ("pavement_fusion", "size_min", 3, 24),
    ("pavement_fusion", "size_max", 9, 72),
    ("pavement_fusion", "positions", [[1, 2]], None),
    ("region_fusion", "limit", 40, 2560),
    ("region_fusion", "size_max", 9, 72),
    ("lambda_crossover", "grain", 5, 40),
    ("symmetric_fusion", "grain", 5, 40),
    ("gene_copy", "group", 3, 24),
    ("gene_exchange", "group", 3, 24),
    ("mutation", "group", 3, 24),
    ("block_exchange", "size_min", 3, 24),
    ("relocation", "size_max", 9, 72),
]


@pytest.mark.parametrize(("name", "key", "blocks", "metres"), SIZES)
def test_range_blocks_of_leaves_are_no_measure(name, key, blocks, metres):
    operator = make(name, **{key: blocks})
    parents = parents_for(operator, three("leaves"))
    with pytest.raises(OperatorError, match=METRES[key]) as caught:
        operator(parents, np.random.default_rng(0))
    if metres is not None:  # ready to be written in a recipe
        assert f"{METRES[key]} = {metres}," in str(caught.value)
    uniform = [on_blocks(4), on_blocks(5)][: len(parents)]
    child = operator(uniform, np.random.default_rng(0))
    if metres is not None:
        same = make(name, **{METRES[key]: metres})(uniform, np.random.default_rng(0))
        assert same == child


@pytest.mark.parametrize(("name", "key", "blocks", "metres"), SIZES)
def test_a_size_is_told_by_one_key(name, key, blocks, metres):
    both = {key: blocks, METRES[key]: [[8.0, 16.0]] if metres is None else metres}
    with pytest.raises(OperatorError, match=f"none where {METRES[key]}|none where places"):
        make(name, **both)


@pytest.mark.parametrize("name", ["pavement_fusion", "region_fusion", "block_exchange",
                                  "relocation"])  # fmt: skip
def test_the_largest_is_no_less_than_the_least(name):
    for unit in ("side", "size"):
        with pytest.raises(OperatorError, match=f"(?s){unit}_max = 3.*no less than {unit}_min"):
            make(name, **{f"{unit}_min": 9, f"{unit}_max": 3})
    with pytest.raises(OperatorError, match="side_max = 3"):  # the least unless told
        make(name, side_max=3)
    made = make(name, side_min=40, size_max=4)  # two units: on a grid alone
    parents = [on_blocks(4), on_blocks(5)][: made.parents[0]]
    with pytest.raises(OperatorError, match=r"size_max = 4 cells of 4 px"):
        made(parents, np.random.default_rng(0))
    wide = make(name, side_min=400)  # with the largest unless told
    assert wide(parents, np.random.default_rng(0)).made["operator"] == name


def test_sizes_are_rounded_to_cells():
    grid, parents = common_grid("test", [on_leaves(1)]), [on_leaves(1)]
    assert grid.block == 4  # the largest side within 8 m
    for metres, cells in ((1, 1), (11.9, 1), (12.1, 2), (64, 8), (None, 4)):
        given = SimpleNamespace(name="test", size_min=None, side_min=metres)
        assert in_cells(given, "size_min", 32.0, grid, parents) == cells
    for area, cells in ((1, 1), (64, 1), (640, 10), (None, 400)):
        given = SimpleNamespace(name="test", limit=None, area_max=area)
        assert in_cells(given, "limit", 25600.0, grid, parents, power=2) == cells
