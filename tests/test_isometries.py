import numpy as np
import pytest

from evocity import isometries


def test_the_eight_are_different_on_a_block_without_symmetry():
    block = np.arange(9).reshape(3, 3)
    images = {isometries.apply(k, block).tobytes() for k in range(isometries.COUNT)}
    assert len(images) == isometries.COUNT == len(isometries.NAMES)


@pytest.mark.parametrize("size", [2, 3, 4, 8])
def test_gather_table_agrees_with_apply(size):
    block = np.random.default_rng(0).random((size, size))
    for k, source in enumerate(isometries.sources(size)):
        assert np.array_equal(block.ravel()[source].reshape(size, size), isometries.apply(k, block))


def test_composition_and_inverse_make_a_group():
    block = np.random.default_rng(1).random((4, 4))
    for a in range(8):
        undone = isometries.apply(int(isometries.INVERSE[a]), isometries.apply(a, block))
        assert np.array_equal(undone, block)
        for b in range(8):
            both = isometries.apply(a, isometries.apply(b, block))
            composed = isometries.apply(int(isometries.COMPOSITION[a, b]), block)
            assert np.array_equal(both, composed)


def test_isometries_act_on_stacks_of_blocks():
    stack = np.random.default_rng(2).random((5, 4, 4))
    for k in range(8):
        one_by_one = np.stack([isometries.apply(k, block) for block in stack])
        assert np.array_equal(isometries.apply(k, stack), one_by_one)
