"""Lines as curves with details: python benchmarks/curves.py

Koch's curve found from its points; three real edges of fabrics: how exact they come back, how near
dropped levels are to least squares, the error of an eighth beside that of a cubic B-spline of as
many coefficients, Douglas-Peucker's, and of maps that are not fitted; whether the fitted maps
contract; the same by NLopt; transfer under similarities, and gains.
"""

import os

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import sys
import time
import warnings
from pathlib import Path

import nlopt
import numpy as np
import shapely
from _machine import description
from scipy.interpolate import make_lsq_spline

import evocity
from evocity.scene import fabric_edges
from evocity.shapes import Detailed, fit_curve, known, resampled, rms_of
from evocity.shapes.curve_fit import _Model, bezier_maps
from evocity.shapes.lines import lengths_of

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
from naive import all_that_maps_draw, nearest_of

TOWNS = ("montpellier-pas-du-loup", "villeurbanne-gratte-ciel", "cape-town-salt-river")
SIZE, PARTS, DRAWN = 4, 2, 3


def off(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.sqrt(((one - other) ** 2).sum(axis=1).mean()))


def spline(line: np.ndarray, count: int) -> np.ndarray:
    """The cubic B-spline of ``count`` coefficients that is nearest, knots at equal steps."""
    at = np.linspace(0, 1, len(line))
    knots = np.r_[[0.0] * 3, np.linspace(0, 1, count - 2), [1.0] * 3]
    return make_lsq_spline(at, line, knots, 3)(at)


def simplified(line: np.ndarray, count: int) -> np.ndarray:
    """By Douglas-Peucker with ``count`` points, and back to as many as the line has."""
    drawn, low, high = shapely.linestrings(line), 0.0, 1e3
    for _ in range(60):
        middle = (low + high) / 2
        fewer = shapely.simplify(drawn, middle, preserve_topology=False)
        low, high = (middle, high) if len(fewer.coords) > count else (low, middle)
    kept = shapely.get_coordinates(shapely.simplify(drawn, high, preserve_topology=False))
    near = shapely.distance(shapely.points(line), shapely.linestrings(kept))
    return float(np.sqrt((near**2).mean()))


def by_nlopt(line: np.ndarray, depth: int) -> tuple[float, float]:
    """RMS and processor seconds of LBFGS on the same sum of squares, from the same six starts."""
    extent = np.ptp(line, axis=0).max()
    model = _Model((line - line[0]) / extent, SIZE, PARTS, depth, DRAWN)
    rng, best, start = np.random.default_rng(0), np.inf, time.process_time()

    def cost(numbers, gradient):
        left = model.residuals(numbers)
        if gradient.size:
            gradient[:] = 2 * left @ model.jacobian(numbers)
        return float(left @ left)

    for number in range(6):
        optimiser = nlopt.opt(nlopt.LD_LBFGS, model.unknown)
        optimiser.set_min_objective(cost)
        optimiser.set_maxeval(200)
        optimiser.set_ftol_rel(1e-12)
        try:
            found = optimiser.optimize(model.start(rng if number else None))
        except (RuntimeError, ValueError):
            continue
        left = model.residuals(found)
        if not (left[model.rest :] > 0).any():
            best = min(best, float((left[: model.rest] ** 2).sum()))
    return float(np.sqrt(best / len(line)) * extent), time.process_time() - start


def koch() -> None:
    line = np.vstack([known("koch").pieces(4).maps[:, :, 2], [1, 0]])
    start = time.process_time()
    one = fit_curve(line, points=3, maps=2, drawn=None)
    spent = time.process_time() - start
    numbers = one.curve.points.size + _Model(line, 3, 2, 7, 7).unknown
    far = np.abs(one.dropped(one.depth).line() - line).max()
    print(f"koch: {numbers} numbers, at most {far:.1e} of its size off, {spent:.2f} s")


def town(name: str, depth: int) -> Detailed:
    edge = fabric_edges(evocity.read_map(name))[0]
    start = time.process_time()
    one = fit_curve(edge, SIZE, PARTS, depth, DRAWN)
    spent = time.process_time() - start
    line = resampled(edge, len(one.line()))
    exact, maps = np.abs(one.line() - line).max(), one.curve.maps
    least = max(
        np.abs(
            free.dropped(k).line()
            - nearest_of(all_that_maps_draw(maps, depth, k, shared), data, shared)
        ).max()
        for shared, data in ((True, line), (False, resampled(edge, SIZE * PARTS**depth)))
        for free in [Detailed.of(data, maps, depth, shared)]
        for k in range(1, 5)
    )
    kept = len(one.points(depth - DRAWN))
    own, cubic = rms_of(one, DRAWN), off(spline(line, kept), line)
    plain = rms_of(Detailed.of(line, bezier_maps(SIZE, PARTS), depth), DRAWN)
    borrowed, took = by_nlopt(line, depth)
    told = one.curve.contraction
    rough = [
        lengths_of(some)[-1] / lengths_of(line)[-1]
        for some in (one.dropped(DRAWN).line(), spline(line, kept))
    ]
    print(
        f"{name}: {len(line)} points, {kept} kept; exact to {exact:.1e} m, dropped 1 to 4 levels "
        f"within {least:.1e} m of least squares\n"
        f"  RMS {own:.3f} m, {own / cubic:.3f} of a cubic B-spline's; Bézier maps "
        f"{plain / cubic:.3f}, Douglas-Peucker (distance to the line) "
        f"{simplified(line, kept) / cubic:.3f}; length {rough[0]:.2f} of the line's, spline "
        f"{rough[1]:.2f}\n"
        f"  {spent:.2f} s; NLopt's LBFGS {borrowed / own:.3f} of that RMS, {took:.2f} s; joint "
        f"spectral radius {told.lower:.3f} to {told.upper:.3f}: "
        f"{'proved' if told.proved else 'not proved, not refuted'}"
    )
    return one


def carried(one: Detailed, other: Detailed) -> None:
    other = other.recoded(one)
    line = one.transferred(other).line()
    turn = 3.7 * np.exp(2.1j)
    matrix = np.array([[turn.real, turn.imag], [-turn.imag, turn.real]])

    def moved(some: Detailed) -> Detailed:
        return Detailed.of(some.line() @ matrix + 1000, some.curve.maps, some.depth)

    apart = max(
        np.abs(moved(one).transferred(other).line() - (line @ matrix + 1000)).max(),
        np.abs(one.transferred(moved(other)).line() - line).max(),
    )
    again = Detailed.of(one.amplified(1.7, [5, 6]).line(), one.curve.maps, one.depth)
    gains = max(
        np.abs(after - (1.7 if level in (5, 6) else 1.0) * before).max()
        for level, (before, after) in enumerate(zip(one.details, again.details, strict=True))
    )
    print(f"transfer commutes with similarities to {apart:.1e} m; a gain to {gains:.1e}")


def main() -> None:
    print(description())
    koch()
    warnings.simplefilter("ignore")  # of lines that cross themselves
    for depth in (8, 9):
        found = [town(name, depth) for name in TOWNS]
    carried(found[0], found[1])


if __name__ == "__main__":
    main()
