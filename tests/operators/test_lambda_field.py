"""λ-field: street blocks by numbers. What zeros and ones must give, and what stays whole."""

import numpy as np
import pytest
from codes import uniformly
from hypothesis import given, settings
from hypothesis import strategies as st

from evocity.citymap import CityMap
from evocity.coding import decode
from evocity.coding.decoding_cache import decoded
from evocity.condensation import Condensation
from evocity.errors import OperatorError
from evocity.fitness.heredity import integrity_of
from evocity.genome import Genome
from evocity.operators import LambdaField
from evocity.operators.crossover import raw_heights
from evocity.operators.grid import common_grid
from evocity.operators.street_blocks import street_blocks


def lots(seed: int, side: int = 96, pixel: float = 2.0) -> CityMap:
    """A town of 6 × 6 lots with a building each, of any size and height, streets in between."""
    rng = np.random.default_rng(seed)
    heights, lot = np.zeros((side, side), np.float32), side // 6
    for row in range(0, side, lot):
        for column in range(0, side, lot):
            tall, wide = rng.integers(6, lot - 2, 2)
            heights[row + 1 : row + 1 + tall, column + 1 : column + 1 + wide] = 3 * rng.integers(
                2, 9
            )
    return CityMap(heights, pixel, name=f"lots-{seed}", attribution="drawn")


@pytest.fixture(scope="module")
def genomes() -> list[Genome]:
    return [uniformly(lots(seed)).genome for seed in (1, 2, 3)]


def laid(parents, values, side=2, **others) -> Genome:
    operator = LambdaField(side=side, values=tuple(values), density=0.1, area_min=0, **others)
    return operator(parents, np.random.default_rng(0))


def chosen(parents, values, side=2) -> np.ndarray:
    return LambdaField(side=side, values=tuple(values), density=0.1, area_min=0).choice(parents)


def test_zeros_give_the_first_parent(genomes):
    child = laid(genomes[:2], [0] * 4)
    assert child == genomes[0]
    assert child.made["street_blocks"] == 0


def test_ones_fill_each_block_that_can_be(genomes):
    child = laid(genomes[:2], [1] * 4)
    filled = child.made["street_blocks"]
    assert filled == np.count_nonzero(chosen(genomes[:2], [1] * 4)) > 3
    assert child != genomes[0]


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_more_of_a_field_never_fills_less(genomes, seed):
    values = np.random.default_rng(seed).random(9)
    before, after = (chosen(genomes[:2], one, side=3) for one in (values, values**0.5))
    assert not (before.astype(bool) & ~after.astype(bool)).any()


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_values_and_parents_decide_not_the_generator(genomes, seed):
    values = np.random.default_rng(seed).random(8)
    operator = LambdaField(side=2, values=tuple(values.tolist()))
    one, other = (operator(genomes, np.random.default_rng(k)) for k in (seed, seed + 1))
    assert one == other
    assert one.made == other.made
    again = LambdaField(side=2, values=one.made["values"])(genomes, np.random.default_rng(0))
    assert again == one


def test_equal_choices_are_equal_children(genomes):
    values = np.full(4, 0.51)
    assert (chosen(genomes[:2], values) == chosen(genomes[:2], values + 0.001)).all()
    assert laid(genomes[:2], values) == laid(genomes[:2], values + 0.001)


def test_each_parent_has_a_field(genomes):
    second, third = [1] * 4 + [0] * 4, [0] * 4 + [1] * 4
    assert set(chosen(genomes, second)) <= {0, 1}
    assert set(chosen(genomes, third)) <= {0, 2}
    both = LambdaField(side=2, values=(0.6,) * 8)(genomes, np.random.default_rng(0))
    assert sum(both.made["filled_by"]) == both.made["street_blocks"]
    assert len(both.made["filled_by"]) == 2


def test_a_corner_of_the_field_fills_that_corner_of_the_map(genomes):
    parents = genomes[:2]
    grid = common_grid("lambda_field", parents, 0.0)
    blocks = street_blocks(decoded(parents[0]).city, grid)
    child = laid(parents, [1, 0, 0, 0], repair=None)
    apart = np.abs(raw_heights(child) - raw_heights(parents[0])) > 1
    half = [side // 2 for side in apart.shape]
    assert apart[: half[0], : half[1]].mean() > 10 * apart[half[0] :, half[1] :].mean()
    assert blocks.labels.max() > 4


def test_no_building_is_cut(genomes):
    maps = [lots(seed) for seed in (1, 2)]
    for values in ([1, 0, 0.5, 1], [0.4, 0.6, 0.2, 0.9]):
        child = laid(genomes[:2], values)
        assert child.made["street_blocks"] > 3
        assert integrity_of(child, maps) > 0.95


def test_what_differs_in_place_is_taken_in_place(genomes):
    """A child and its parent have the same streets: the field goes between them block by block,
    and ones lead from the one to the other."""
    first = genomes[0]
    child = laid(genomes[:2], [1, 1, 0, 0])
    back = LambdaField(side=1, values=(1.0,), density=0, area_min=0)(
        [child, first], np.random.default_rng(0)
    )
    assert back.made["in_place"] > 0
    before, after = (np.abs(raw_heights(one) - raw_heights(first)).mean() for one in (child, back))
    apart = before - after
    assert apart > 0


def test_what_is_locked_stays(genomes):
    mask = np.zeros((genomes[0].pavement.height, genomes[0].pavement.width), bool)
    mask[:40, :40] = True
    layer = Condensation(raw_heights(genomes[0]), mask)
    parents = [one.replace(condensation=layer) for one in genomes[:2]]
    child = laid(parents, [1] * 4)
    heights = decode(parents[0]).city.heights
    assert (decode(child).city.heights[mask] == heights[mask]).all()


def test_genomes_of_other_windows_are_refused(genomes):
    other = uniformly(lots(4, side=72)).genome
    with pytest.raises(OperatorError, match=r"different grids, .* px"):
        laid([genomes[0], other], [0.5] * 4)
    coarse = genomes[1].replace(metres_per_pixel=4.0)
    with pytest.raises(OperatorError, match="4 m"):
        laid([genomes[0], coarse], [0.5] * 4)


def test_faults_of_values(genomes):
    with pytest.raises(OperatorError, match="3 numbers"):
        laid(genomes[:2], [0.5] * 3)
    with pytest.raises(OperatorError, match="numbers of 0…1"):
        LambdaField(values=(0.5, 1.5))
    with pytest.raises(OperatorError, match="side"):
        LambdaField(side=0)
    with pytest.raises(OperatorError, match="values"):
        LambdaField().choice(genomes[:2])


def test_a_choice_between_other_windows_is_refused(genomes):
    small = uniformly(lots(5, side=120)).genome
    fine = uniformly(lots(6, pixel=1.0)).genome
    for other in (small, fine):
        with pytest.raises(OperatorError):
            chosen([genomes[0], other], [1] * 4)
        with pytest.raises(OperatorError):
            laid([genomes[0], other], [1] * 4)
