"""Curves and shapes in files: what is read is what was written, and what is none is told."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from evocity.shapes import (
    Curve,
    Detailed,
    Language,
    Shape,
    ShapeError,
    known,
    read_curve,
    read_shape,
    write_curve,
    write_shape,
)
from evocity.shapes import files as written
from evocity.shapes.curve_fit import bezier_maps

LINE = np.cumsum(np.random.default_rng(2).normal(0.3, 1, (3 * 32 + 1, 2)), axis=0)
ONE = Detailed.of(LINE, bezier_maps(4, 2))


@pytest.mark.parametrize("suffix", [".json", ".parquet"])
@pytest.mark.parametrize("levels", [0, 2, 5])
def test_a_curve_is_read_as_it_was_written(tmp_path, suffix, levels):
    one = ONE.dropped(levels)
    write_curve(one, tmp_path / f"a{suffix}", "EPSG:2154", "© somebody")
    found = read_curve(tmp_path / f"a{suffix}")
    assert (found.crs, found.attribution) == ("EPSG:2154", "© somebody")
    assert (found.detailed.depth, found.detailed.kept) == (5, 5 - levels)
    np.testing.assert_allclose(found.detailed.line(), one.line(), atol=1e-9)
    for before, after in zip(one.details, found.detailed.details, strict=True):
        np.testing.assert_allclose(after, before, atol=1e-9)


def test_a_dropped_curve_takes_less_room(tmp_path):
    for levels, name in ((0, "all"), (3, "eighth")):
        write_curve(ONE.dropped(levels), tmp_path / f"{name}.json")
    numbers = [
        len(json.loads((tmp_path / f"{name}.json").read_text())["points"])
        for name in ("all", "eighth")
    ]
    assert numbers == [97, 13]


def test_polygons_that_share_no_ends_are_kept_so(tmp_path):
    one = Detailed.of(LINE[:64], Curve.b_spline(LINE[:4]).maps).dropped(1)
    write_curve(one, tmp_path / "a.json")
    found = read_curve(tmp_path / "a.json").detailed
    assert not found.shared
    np.testing.assert_allclose(found.line(), one.line(), atol=1e-9)


def test_a_shape_is_read_from_parquet_as_from_json(tmp_path):
    quarters = [[[0.5, 0, x], [0, 0.5, y]] for x in (0, 0.5) for y in (0, 0.5)]
    shapes = [
        Shape(quarters, "square", Language.without(4, (3, 3)), np.eye(4)[:, :3], 0.3),
        known("menger"),
        known("fern"),
    ]
    for number, one in enumerate(shapes):
        write_shape(one, tmp_path / f"{number}.parquet")
        found = read_shape(tmp_path / f"{number}.parquet")
        np.testing.assert_array_equal(found.maps, one.maps)
        assert found.language.minimal == one.language.minimal
        assert (found.colours is None) == (one.colours is None)
        assert (found.mix, found.primitive is None) == (one.mix, one.primitive is None)


def changed(**keys):
    def change(document):
        return document | keys

    return change


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (changed(evocity="shape"), "not a curve"),
        (changed(version=9), "version 9"),
        (changed(points=[[0, 0]] * 5), r"points have the shape \(5, 2\)"),
        (changed(points="secret"), "values are not numbers"),
        (changed(depth=60), "depth = 60"),
        (changed(depth=10**30), "depth"),
        (changed(kept=6), "kept"),
        (changed(kept=True), "kept"),
        (changed(shared=1), "shared"),
        (changed(maps=[1, 2]), "the maps have the shape|the maps for"),
        (changed(maps=[[[9, 0], [-8, 1]]] * 2), "map"),
        (changed(crs=["x"]), "crs"),
        (lambda document: {k: v for k, v in document.items() if k != "maps"}, "keys are missing"),
    ],
)
def test_what_a_stranger_changed_is_told(tmp_path, change, says):
    write_curve(ONE, tmp_path / "a.json")
    document = json.loads((tmp_path / "a.json").read_text())
    (tmp_path / "a.json").write_text(json.dumps(change(document)))
    with pytest.raises(ShapeError, match=says):
        read_curve(tmp_path / "a.json")


def test_parquet_of_others_and_cut_off_is_told(tmp_path, monkeypatch):
    path = tmp_path / "a.parquet"
    write_curve(ONE, path)
    content = path.read_bytes()
    faults = [content[: len(content) // 2], content[:200] + b"\0" * 40 + content[240:]]
    for fault in faults:
        path.write_bytes(fault)
        with pytest.raises(ShapeError, match=r"not a curve|is damaged"):
            read_curve(path)
    pq.write_table(pa.table({"a": [1, 2]}), path)
    with pytest.raises(ShapeError, match="not a curve"):
        read_curve(path)
    path.write_bytes(content)
    monkeypatch.setattr(written, "MOST_NUMBERS", 100)
    with pytest.raises(ShapeError, match="not a curve"):
        read_curve(path)
    monkeypatch.setattr(written, "MOST_BYTES", 100)
    with pytest.raises(ShapeError, match="exceeds 100 bytes"):
        read_curve(path)
    with pytest.raises(ShapeError, match="No such file"):
        read_curve(tmp_path / "none.json")


def test_nothing_is_written_where_nothing_can_be(tmp_path):
    with pytest.raises(ShapeError, match="cannot be written"):
        write_curve(ONE, tmp_path / "none" / "a.json")
    assert list(tmp_path.iterdir()) == []
