"""Languages: counted as enumerated, and combined as sets of words are."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evocity.shapes import Language, ShapeError

LETTERS = 3


@st.composite
def languages(draw):
    states = draw(st.integers(1, 4))
    table = draw(
        st.lists(
            st.lists(st.integers(-1, states - 1), min_size=LETTERS, max_size=LETTERS),
            min_size=states,
            max_size=states,
        )
    )
    accepting = draw(st.lists(st.booleans(), min_size=states, max_size=states))
    return Language(np.array(table), np.array(accepting))


def words(language, most=4):
    """All words up to a length, by asking for each."""
    every = (word for n in range(most + 1) for word in product(range(language.letters), repeat=n))
    return {word for word in every if word in language}


@pytest.mark.slow
@given(languages(), st.integers(0, 5))
def test_as_many_words_are_enumerated_as_counted_in_order(language, length):
    found = list(language.words(length))
    assert len(found) == language.count(length)
    assert found == sorted(found)
    assert set(found) == {word for word in words(language, length) if len(word) == length}


@given(languages(), languages())
def test_combinations_are_those_of_sets(a, b):
    first, second = words(a), words(b)
    assert words(a | b) == first | second
    assert words(a & b) == first & second
    assert words(a - b) == first - second
    every = words(Language.every(LETTERS))
    assert words(~a) == every - first
    together = {one + other for one in first for other in second if len(one + other) <= 4}
    assert words(a @ b) == together


@given(languages())
def test_the_least_automaton_has_the_same_words_and_no_two_like_states(language):
    least = language.minimal
    assert words(least, 5) == words(language, 5)
    assert least == language
    assert hash(least) == hash(language)
    assert len(least.table) <= len(language.table)
    assert (~~language) == language


@given(languages(), st.lists(st.lists(st.integers(0, 1), max_size=2), min_size=3, max_size=3))
def test_letters_become_words(language, images):
    replaced = language.substituted(dict(enumerate(images)), 2)
    told = {
        tuple(letter for one in word for letter in images[one]) for word in words(language, 4)
    }  # fmt: skip
    # what longer words become is not among `told`, so one way alone where letters may vanish
    assert {word for word in told if len(word) <= 4} <= words(replaced, 4)
    if all(images):
        assert {word for word in told if len(word) <= 4} == words(replaced, 4)


@given(st.lists(st.lists(st.integers(0, 2), min_size=1, max_size=3), max_size=3))
def test_forbidden_words_do_not_occur(forbidden):
    language = Language.without(LETTERS, *forbidden)
    for word in product(range(LETTERS), repeat=4):
        occurs = any(
            list(word[k : k + len(bad)]) == bad for bad in forbidden for k in range(5 - len(bad))
        )
        assert (word in language) == (not occurs)


@given(st.lists(st.lists(st.integers(0, 2), max_size=3).map(tuple), max_size=5))
def test_a_list_of_words_is_a_language(some):
    language = Language.of_words(LETTERS, some)
    assert words(language) == set(some)
    assert not language.lasts


def test_no_3_after_3():
    language = Language.without(4, (3, 3))
    assert language.count(10) == 641_520
    assert len(str(language.count(400))) == 232
    assert language.lasts
    assert sum(1 for _ in language.words(7)) == language.count(7)


def test_a_level_has_words_of_one_length():
    assert words(Language.level(2, 3), 5) == set(product(range(2), repeat=3))
    assert Language.level(2, 0).count(0) == 1


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        (lambda: Language(np.zeros((2, 2))), "the table of the language has the shape"),
        (lambda: Language(np.array([[5]])), "the state 5, which does not exist"),
        (lambda: Language(np.array([[0]]), np.array([True, False])), "'accepting' has the shape"),
        (lambda: Language.every(2) | Language.every(3), "the languages have 2 and 3 letters"),
        (lambda: Language.every(2) @ Language.every(3), "the languages have 2 and 3 letters"),
        (lambda: Language.without(2, (0, 5)), "the word .0, 5. is invalid"),
        (lambda: Language.of_words(2, [(7,)]), "word"),
        (lambda: Language.every(2).count(-1), "length"),
        (lambda: Language.every(5000), "5000 letters"),
    ],
)
def test_what_is_no_language_is_told(fault, says):
    with pytest.raises(ShapeError, match=says):
        fault()
