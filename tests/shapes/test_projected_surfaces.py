"""Surfaces: exact for polynomials, exact with all details, near a spline of as many numbers."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import parts_of_surface
from scipy.interpolate import BSpline, make_lsq_spline
from scipy.special import comb

from evocity.shapes import (
    Curve,
    DetailedSurface,
    ShapeError,
    StoredSurface,
    Surface,
    fit_surface,
    polynomial_maps,
    read_surface,
    surface_rms,
    write_surface,
)
from evocity.shapes.detail import point_count

DATA = Path(__file__).resolve().parents[2].parent / "shared" / "data" / "more"


def ground(side, seed, roughness=1.6):
    """Hills whose amplitudes fall with their frequency."""
    waves = np.fft.fft2(np.random.default_rng(seed).normal(size=(side, side)))
    across, down = np.fft.fftfreq(side) * side, np.fft.fftfreq(side)[:, None] * side
    waves /= np.maximum(1, np.hypot(across, down)) ** roughness
    heights = np.fft.ifft2(waves).real
    return 20 * heights / heights.std()


def bernstein(n, t):
    return np.array([comb(n - 1, i) * t**i * (1 - t) ** (n - 1 - i) for i in range(n)]).T


def spline_rms(heights, rows, columns):
    """RMS of the least-squares cubic B-spline of ``rows`` × ``columns`` coefficients."""
    near = heights
    for count in (rows, columns):
        at = np.arange(len(near))
        knots = np.r_[[0] * 3, np.linspace(0, len(near) - 1, count - 2), [len(near) - 1] * 3]
        near = make_lsq_spline(at, near, knots, 3)(at).T
    return float(np.sqrt(((near - heights) ** 2).mean()))


sizes = st.tuples(st.integers(2, 5), st.integers(2, 5), st.integers(1, 3), st.integers(0, 500))


@settings(deadline=None, max_examples=25)
@given(sizes, st.integers(0, 4))
def test_surfaces_are_exact_for_polynomials_of_their_degree(size, depth):
    n, m, d, seed = size
    points = np.random.default_rng(seed).normal(0, 10, (n, m, d))
    t = np.linspace(0, 1, 2**depth + 1)
    exact = np.einsum("rn,nmd,cm->rcd", bernstein(n, t), points, bernstein(m, t))
    np.testing.assert_allclose(Surface.bezier(points).grid(depth), exact, atol=1e-9)
    patch = Surface.b_spline(points)

    def basis(count):
        degree = count - 1
        knots = np.arange(2 * degree + 2, dtype=float)
        return BSpline(knots, np.eye(count), degree)(degree + t)

    exact = np.einsum("rn,nmd,cm->rcd", basis(n), points, basis(m))
    np.testing.assert_allclose(patch.grid(depth), exact, atol=1e-9)
    np.testing.assert_allclose(
        patch.patches(min(depth, 2)), parts_of_surface(patch, min(depth, 2)), atol=1e-9
    )


@settings(deadline=None, max_examples=25)
@given(st.integers(2, 5), st.integers(2, 3), st.integers(1, 3), st.integers(0, 500))
def test_heights_of_a_polynomial_need_no_details(size, parts, depth, seed):
    side = point_count(size, parts, depth, True)
    x = np.linspace(0, 1, side)
    numbers = np.random.default_rng(seed).normal(0, 10, (size, size))
    heights = np.polynomial.polynomial.polygrid2d(x, x, numbers)
    maps = polynomial_maps(size, parts)
    found = DetailedSurface.of(heights, maps, maps, depth)
    np.testing.assert_allclose(found.dropped(depth).heights(), heights, atol=1e-9)
    assert found.amounts.max() < 1e-9


@settings(deadline=None, max_examples=25)
@given(
    st.integers(2, 4), st.integers(2, 4), st.integers(2, 3), st.integers(1, 3), st.integers(0, 99)
)
def test_all_details_give_the_heights_and_there_is_no_number_too_many(n, m, parts, depth, seed):
    shape = point_count(n, parts, depth, True), point_count(m, 2, depth, True)
    heights = np.random.default_rng(seed).normal(0, 10, shape)
    found = DetailedSurface.of(heights, polynomial_maps(n, parts), polynomial_maps(m, 2), depth)
    np.testing.assert_allclose(found.heights(), heights, atol=1e-8)
    assert found.points.size + sum(one.size for own in found.details for one in own) == heights.size
    # without details, the rows and the columns are those of curves
    rough = found.dropped(1)
    again = DetailedSurface.of(rough.heights(), found.rows, found.columns, depth)
    np.testing.assert_allclose(again.heights(depth - 1), found.heights(depth - 1), atol=1e-7)
    doubled = found.amplified(2.0).heights() - found.amplified(0.0).heights()
    np.testing.assert_allclose(doubled, 2 * (heights - found.amplified(0.0).heights()), atol=1e-7)


def test_details_go_to_another_ground_and_follow_its_size():
    maps = polynomial_maps(4, 2)
    one = DetailedSurface.of(ground(49, 1), maps, maps, 4, (2.0, 2.0))
    other = DetailedSurface.of(ground(49, 2), maps, maps, 4, (2.0, 2.0))
    moved = one.transferred(other, 3)
    np.testing.assert_array_equal(moved.heights(1), one.heights(1))
    np.testing.assert_allclose(
        moved.heights() - one.dropped(3).heights(),
        other.heights() - other.dropped(3).heights(),
        atol=1e-9,
    )
    np.testing.assert_allclose(one.transferred(one, 3).heights(), one.heights(), atol=1e-9)
    # a ground of half the size, in all three directions, gives the same details
    small = DetailedSurface.of(other.heights() / 2, maps, maps, 4, (1.0, 1.0))
    np.testing.assert_allclose(one.transferred(small, 3).heights(), moved.heights(), atol=1e-9)
    np.testing.assert_allclose(one.transferred(other, 3, 0).heights(), one.dropped(3).heights())


def spline_of(numbers):
    """The sides of the largest nearly square spline of at most as many numbers."""
    side = int(np.sqrt(numbers))
    return side, numbers // side


@pytest.mark.slow
@pytest.mark.parametrize("roughness", [1.6, 2.2])
def test_a_fitted_ground_is_within_a_tenth_of_a_spline_of_as_many_numbers(roughness):
    heights = ground(193, 4, roughness)
    found = fit_surface(heights)
    assert found.number_count(3) == 25 * 25 + 2 * 66
    assert surface_rms(found, 3) <= 1.1 * spline_rms(heights, *spline_of(25 * 25 + 2 * 66))
    assert all(Curve(np.zeros((7, 2)), m).contraction.proved for m in (found.rows, found.columns))


@pytest.mark.slow
@pytest.mark.skipif(not DATA.exists(), reason="the rasters lie beside the repository")
@pytest.mark.parametrize("name", ["athens-dem.tif", "original-goteborg-dem.tif"])
@pytest.mark.parametrize("depth", [4, 5])
def test_a_real_ground_is_within_a_tenth_of_a_spline_of_as_many_numbers(name, depth):
    from evocity.io.ground_rasters import read_ground

    raster = read_ground(DATA / name)
    found = fit_surface(raster.heights, depth=depth, spacing=raster.spacing)
    numbers = found.number_count(3)
    assert numbers == {4: 301, 5: 757}[depth]
    assert surface_rms(found, 3) <= 1.1 * spline_rms(found.heights(), *spline_of(numbers))


def test_a_fitted_polynomial_is_exact():
    x = np.linspace(-1, 1, 25)
    heights = 100 + np.add.outer(30 * x**3 - x, 5 * x**2) + 4 * np.outer(x, x**3)
    found = fit_surface(heights, starts=1)
    assert surface_rms(found, found.depth) < 1e-9


def test_a_surface_is_the_same_after_a_file(tmp_path):
    maps = polynomial_maps(3, 2)
    found = DetailedSurface.of(ground(33, 3), maps, maps, 4, (1.5, 2.0)).dropped(1)
    for name in ("a.json", "a.parquet"):
        write_surface(StoredSurface(found, "EPSG:2154", (3.0, 4.0), "© a"), tmp_path / name)
        again = read_surface(tmp_path / name)
        assert (again.crs, again.corner, again.attribution) == ("EPSG:2154", (3.0, 4.0), "© a")
        assert again.surface.spacing == found.spacing
        assert again.surface.depth == 4
        np.testing.assert_allclose(again.surface.heights(), found.heights(), atol=1e-9)
    (tmp_path / "b.json").write_text('{"evocity": "surface", "version": 1, "depth": 2}')
    (tmp_path / "c.json").write_text('{"evocity": "curve", "version": 1}')
    for name in ("b.json", "c.json"):
        with pytest.raises(ShapeError):
            read_surface(tmp_path / name)


@pytest.mark.parametrize(("key", "wrong"), [("rows", 3.0), ("columns", [1.0]), ("rows", [[2.0]])])
def test_files_at_fault_are_refused(tmp_path, key, wrong):
    surface = fit_surface(ground(33, 1), depth=2, starts=1, rounds=2)
    write_surface(StoredSurface(surface), tmp_path / "a.json")
    document = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))
    (tmp_path / "a.json").write_text(json.dumps(document | {key: wrong}), encoding="utf-8")
    with pytest.raises(ShapeError):
        read_surface(tmp_path / "a.json")


def test_grounds_at_fault_are_refused_with_a_remedy():
    holed = ground(25, 1)
    holed[3, 4:6] = np.nan
    with pytest.raises(ShapeError, match=r"holes: 2 of 625[\s\S]*gdal_fillnodata"):
        fit_surface(holed)
    for few in (np.zeros((3, 25)), np.zeros((1, 1)), np.zeros(9), "x"):
        with pytest.raises(ShapeError, match="at least 7 heights"):
            fit_surface(few)
    maps = polynomial_maps(4, 2)
    with pytest.raises(ShapeError, match="64"):
        Surface(np.zeros((1, 4, 3)), maps, maps)
    with pytest.raises(ShapeError):
        Surface(np.zeros((4, 4, 3)), maps, polynomial_maps(3, 2))
    with pytest.raises(ShapeError, match="depth = 40"):
        Surface(np.zeros((4, 4, 3)), maps, maps).grid(40)
    one = DetailedSurface.of(ground(25, 1), maps, maps, 3)
    other = DetailedSurface.of(ground(25, 1), maps, maps, 2)
    for wrong in (
        lambda: one.transferred(other),
        lambda: one.dropped(4),
        lambda: one.amplified(np.nan),
        lambda: one.amplified(2, [3]),
        lambda: fit_surface(ground(25, 1), depth=20),
        lambda: DetailedSurface.of(ground(25, 1), maps, maps, 3, (0, 1)),
        lambda: DetailedSurface.drawn(np.zeros((5, 5)), maps, maps, 2, 3),
        lambda: DetailedSurface(one.points, one.rows, one.columns, other.details[::-1]),
    ):
        with pytest.raises(ShapeError):
            wrong()
