"""Births as columns: who passes, in which order, as bytes; what is no filter."""

import io
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from evocity.errors import EvocityError
from evocity.viewer import module_bundle
from evocity.viewer.sheet import Sheet
from evocity.viewer.table import Column, Table

NUMBERS = st.floats(width=32, allow_nan=True, allow_infinity=True)
FINITE = st.floats(-1e6, 1e6, width=32)


def table(**more) -> Table:
    numbers = np.array([2.0, np.nan, -1.0, 2.0, np.inf], np.float32)
    columns = (
        Column("size", numbers, **more),
        Column.of_words("operator", np.array(["b", "a", "b", "c", ""])),
        Column.of_flags("alive", np.array([True, False, True, True, False])),
    )
    return Table(np.array([3, 5, 8, 13, 21]), columns)


@given(st.lists(NUMBERS, max_size=20), st.lists(st.tuples(FINITE, FINITE), max_size=3))
def test_who_passes_lies_in_one_of_the_spans(values, ends):
    spans = [tuple(sorted(one)) for one in ends]
    births = Table(np.arange(len(values)), (Column("x", np.array(values, np.float32)),))
    kept = births.matches({"x": spans})
    naive = [not spans or any(low <= one <= high for low, high in spans) for one in values]
    assert kept.tolist() == naive


@given(
    st.lists(NUMBERS, max_size=20),
    st.sampled_from([{}, {"goal": "max"}, {"goal": "min"}, {"target": 0.5}]),
    st.booleans(),
)
def test_orders_are_what_they_say(values, wanted, is_reversed):
    column = Column("x", np.array(values, np.float32), **wanted)
    rows = Table(np.arange(len(values)), (column,)).row_order("x", is_reversed)
    assert sorted(rows.tolist()) == list(range(len(values)))
    loss = {"max": lambda one: -one, "target": lambda one: np.float32(abs(one - 0.5))}
    key = loss.get(wanted.get("goal", "target" if "target" in wanted else ""), lambda one: one)
    told = [float(values[row]) for row in rows]
    for (a, first), (b, second) in pairwise(zip(told, rows, strict=True)):
        if np.isnan(a) or np.isnan(b):
            assert np.isnan(b)
        else:
            assert key(b) <= key(a) if is_reversed else key(a) <= key(b)
        if a == b:
            assert first < second


def test_brushes_are_made_plain():
    births = table()
    assert births.check_brushes({"size": (1, 2)}) == {"size": [[1.0, 2.0]]}
    assert births.check_brushes({"size": [(1, None), (None, 0)]}) == {
        "size": [[-1.0, 0.0], [1.0, 2.0]]
    }
    assert births.check_brushes({"operator": "a"}) == {"operator": ["a"]}
    assert births.check_brushes({"operator": ["b", "a", "b"], "size": []}) == {
        "operator": ["b", "a"]
    }
    assert births.matches({"operator": ["b", ""], "alive": ["yes"]}).tolist() == [1, 0, 1, 0, 0]
    assert births.matches({"size": (None, None)}).tolist() == [1, 0, 1, 1, 0]


@pytest.mark.parametrize(
    ("brushes", "told"),
    [
        ({"sise": (1, 2)}, "did you mean size"),
        ({"size": (2, 1)}, "the lower number first"),
        ({"size": [1, 2, 3]}, "two numbers"),
        ({"size": "ab"}, "two numbers"),
        ({"size": [(0, float("nan"))]}, "two numbers"),
        ({"size": True}, "two numbers"),
        ({"operator": ["d"]}, "some of"),
        ({"operator": 3}, "some of"),
        (3, "a mapping from columns to filters"),
        ([("size", 1)], "a mapping from columns to filters"),
    ],
)
def test_what_is_no_brush_is_refused(brushes, told):
    with pytest.raises(EvocityError, match=told):
        table().check_brushes(brushes)


def test_the_buffer_is_ids_and_columns():
    births = table()
    whole = births.buffer
    assert np.frombuffer(whole, "<i4", 5).tolist() == births.ids.tolist()
    columns = np.frombuffer(whole, "<f4", offset=20).reshape(3, 5)
    assert np.array_equal(columns, [one.values for one in births.columns], equal_nan=True)
    assert [one["words"] for one in births.about["columns"]] == [
        [],
        ["", "a", "b", "c"],
        ["no", "yes"],
    ]
    assert births.known_ids([13, 4, 10**30, -1, 3]) == [13, 3]


@pytest.mark.parametrize("kind", ["PNG", "BMP", "WEBP"])
def test_pictures_lie_side_by_side_in_their_order(kind):
    pictures = {n: np.full((4, 6, 3), (10 * n, n, 255 - n), np.uint8) for n in range(11)}
    sheet = Sheet.of(pictures, {99: "timeout"}, kind.lower())
    opened = Image.open(io.BytesIO(sheet.image), formats=[kind])
    assert sheet.about["kind"] == opened.get_format_mimetype() == f"image/{kind.lower()}"
    seen = np.asarray(opened)
    for place, one in enumerate(sheet.ids):
        top, left = place // sheet.across * 4, place % sheet.across * 6
        assert (seen[top : top + 4, left : left + 6] == pictures[one]).all()
    assert sheet.about["lacking"] == [[99, "timeout"]]
    assert Sheet.of({}, {}).image == b""


def test_a_smaller_picture_lies_at_the_top_left_of_its_place():
    pictures = {5: np.full((3, 6, 3), 9, np.uint8), 7: np.full((4, 5, 3), 8, np.uint8)}
    sheet = Sheet.of(pictures, {}, "bmp")
    assert (sheet.width, sheet.height) == (6, 4)
    seen = np.asarray(Image.open(io.BytesIO(sheet.image)))[..., 0]
    wanted = np.zeros((4, 12), int)
    wanted[:3, :6], wanted[:, 6:11] = 9, 8
    assert seen.tolist() == wanted.tolist()


def test_the_page_is_one_module_that_fetches_nothing():
    whole = module_bundle.module()
    assert "import " not in whole
    assert whole.count("export default") == 1
    assert len(whole) + len(module_bundle.text("viewer.css")) < 120_000
    files = {name: text for name, text in module_bundle.files().items() if name.endswith(".js")}
    for name, text in files.items():
        for forbidden in (
            "innerHTML",
            "outerHTML",
            "insertAdjacent",
            "eval",
            "Function(",
            "http",
            "fetch",
            "document.write",
        ):
            own = text.replace('"http://www.w3.org/2000/svg"', "")  # a name, not an address
            assert forbidden not in own, f"{name}: {forbidden}"
    own = {path.stem for path in module_bundle.PAGE.glob("*.js")}
    assert own == set(module_bundle.MODULES)
    views = {path.stem for path in module_bundle.PAGE.glob("views/*.js")}
    assert views <= set(module_bundle.views())
