"""Arrays and columns of Arrow, against what Arrow itself makes of them."""

import math

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evocity.columns import array_of, column_of, known_of, lists_of, words_of

WORDS = st.lists(st.none() | st.text(max_size=3), max_size=20)
NUMBERS = st.lists(st.none() | st.floats(-9, 9), max_size=20)


def cut(values, kind, data) -> pa.ChunkedArray:
    """The ``values`` in chunks, each a slice of something longer."""
    ends = sorted(data.draw(st.lists(st.integers(0, len(values)), max_size=3)))
    parts = [values[a:b] for a, b in zip([0, *ends], [*ends, len(values)], strict=True)]
    slices = [pa.array([None, *part, None], kind).slice(1, len(part)) for part in parts]
    return pa.chunked_array(slices, kind)


@given(st.data(), WORDS, st.booleans())
def test_words_are_those_of_arrow(data, words, coded):
    kind = pa.dictionary(pa.int32(), pa.string()) if coded else pa.string()
    column = cut(words, kind, data)
    assert words_of(column).tolist() == words
    assert words_of(column.combine_chunks()).tolist() == words


@given(st.data(), NUMBERS)
def test_numbers_are_those_of_arrow(data, numbers):
    column = cut(numbers, pa.float64(), data)
    expected = [math.nan if one is None else one for one in numbers]
    np.testing.assert_array_equal(array_of(column), np.array(expected, float))
    assert known_of(column).tolist() == [one is not None for one in numbers]


@given(st.data(), st.lists(st.booleans(), max_size=40))
def test_truths_are_those_of_arrow(data, truths):
    assert array_of(cut(truths, pa.bool_(), data)).tolist() == truths
    assert column_of(np.array(truths, bool)).to_pylist() == truths


def test_whole_numbers_have_no_word_for_none():
    with pytest.raises(ValueError, match="a column of int64 with nulls"):
        array_of(pa.array([1, None]))


@given(st.data(), st.lists(st.none() | st.lists(st.integers(-9, 9), max_size=3), max_size=12))
def test_lists_are_those_of_arrow(data, lists):
    column = cut(lists, pa.list_(pa.int64()), data)
    told = [one or [] for one in lists]
    for same in (column, column.combine_chunks()):
        lengths, values = lists_of(same)
        assert lengths.tolist() == list(map(len, told))
        assert values.tolist() == [one for some in told for one in some]


def test_what_stands_in_a_list_that_is_none_is_left_out():
    lists = pa.ListArray.from_arrays(
        [0, 2, 3, 5], [1, 2, 3, 4, 5], mask=pa.array([False, True, False])
    )
    assert lists.values[2].as_py() == 3
    lengths, values = lists_of(lists)
    assert (lengths.tolist(), values.tolist()) == ([2, 0, 2], [1, 2, 4, 5])


def test_a_null_in_a_list_is_told():
    with pytest.raises(ValueError, match="a column of int64 with nulls"):
        lists_of(pa.array([[1, None]]))
