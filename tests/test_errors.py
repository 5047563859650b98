"""What an error tells, in Python and on the way elsewhere."""

import pickle

from evocity.errors import MapError, keyword, setting, told_by, unset


def test_python_reads_parameters_as_it_types_them():
    error = MapError(
        f"layer=a.npy: {setting('pixels', 2.5)}", f"{keyword('pixels')}, or {unset('pixels')}",
        f"give {keyword('center', (4.8, 45.7))}",
    )  # fmt: skip
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
    told_by(again.args[0], lambda *parameter: seen.append(parameter) or "")
    assert seen == [("pixels", " = ", "2.5")]


def test_a_text_that_looks_marked_does_no_harm():
    odd = "\ufdd0a\ufdd1 \ufdd2\ufdd1"
    error = MapError(odd, setting("name", odd), keyword("name", odd))
    for part in (error.found, error.expected, error.remedy):
        assert not set(part) & set("\ufdd0\ufdd1\ufdd2")
