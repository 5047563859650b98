"""What an error tells, in Python and on the way elsewhere."""

import pickle

import numpy as np
import pytest

from evocity.errors import (
    EvocityError,
    MapError,
    RunError,
    check_word,
    keyword,
    none_setting,
    replace_parameters,
    setting,
)


def test_python_reads_parameters_as_it_types_them():
    error = MapError(
        f"layer=a.npy: {setting('pixels', 2.5)}",
        f"{keyword('pixels')}, or {none_setting('pixels')}",
        f"give {keyword('center', (4.8, 45.7))}",
    )
    assert error.found == "layer=a.npy: pixels = 2.5"
    assert error.expected == "pixels=, or None"
    assert error.remedy == "give center=(4.8, 45.7)"
    assert str(error) == (
        "layer=a.npy: pixels = 2.5\n  expected: pixels=, or None\n"
        "  what to do: give center=(4.8, 45.7)"
    )
    # in another process its parameters are known as well
    again = pickle.loads(pickle.dumps(error))
    assert str(again) == str(error)
    seen = []
    replace_parameters(again.args[0], lambda *parameter: seen.append(parameter) or "")
    assert seen == [("pixels", " = ", "2.5")]


def test_a_text_that_looks_marked_does_no_harm():
    odd = "\ufdd0a\ufdd1 \ufdd2\ufdd1"
    error = MapError(odd, setting("name", odd), keyword("name", odd))
    for part in (error.found, error.expected, error.remedy):
        assert not set(part) & set("\ufdd0\ufdd1\ufdd2")


def test_a_word_is_one_of_those_that_are_known():
    known = {"looks": 1, "scores": 2}
    check_word("by", "looks", known)
    for value in ("look", "", None, ["looks"], {"looks"}, 1, np.array(["looks", "scores"])):
        with pytest.raises(RunError, match="by = ") as caught:
            check_word("by", value, known, "leave it out", RunError)
        assert caught.value.expected == "one of looks, scores"
    for value, remedy in (("look", "did you mean looks?"), (1, "leave it out")):
        with pytest.raises(EvocityError) as caught:
            check_word("by", value, known, "leave it out")
        assert caught.value.remedy == remedy
