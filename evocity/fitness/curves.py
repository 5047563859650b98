"""Measures of curves and shapes: length, sinuosity, dimension, distance to a line or a picture.

A GeoJSON file of one line, ``shore.geojson``, declares a measure of curves, ``shore_distance``. A
PNG picture, ``leaf.png``, declares a measure of shapes, ``leaf_distance``.
"""

import io
import math
import warnings

import numpy as np

from evocity.errors import FitnessError
from evocity.fitness.measure import Undefined
from evocity.fitness.registry import TABLES, fitness

#: Most pixels along a side of a picture.
MOST_SIDE = 4096
# Number of places along a line at which its distance to another is measured.
_PLACES = 256
# Share of a line's extent that it may lie from the straight pieces that replace it.
_TOLERANCE = 0.01
# Pixels along a side of the mask on which the dimension of a line is counted.
_SIDE = 256


@fitness(of="curve", unit="m", range=(0, math.inf))
def curve_length(curve) -> float:
    """Length of the curve, or of a site's first course.

    Formula: Σ of the distances of successive points, at least 256 points.
    Unit: metres. Range: 0 upwards.
    Source: none needed.
    """
    return curve.length


@fitness(of="curve", range=(1, math.inf))
def sinuosity(curve) -> float:
    """Ratio of the curve's length to the straight distance of its ends.

    Formula: length / distance of the ends. Range: 1 (straight) upwards. Undefined for a curve that
    ends where it begins.
    Source: Schumm 1963, for rivers.
    """
    distance = float(np.hypot(*(curve.line[-1] - curve.line[0])))
    if distance < 1e-6 * curve.side:
        return Undefined("the curve ends where it begins")
    return max(1.0, curve.length / distance)


@fitness(of="curve", range=(0, 2))
def curve_dimension(curve) -> float:
    """Box dimension of the curve: 1 for a smooth curve, more for a rough one.

    Formula: −slope of ln N(ε) on ln ε, with N(ε) the number of boxes of side ε that meet the curve,
    drawn at 256 px across its extent. Sides are 4 to 64 px. Range: 0 to 2.
    Source: Mandelbrot 1967.
    """
    low, high = curve.line.min(axis=0), curve.line.max(axis=0)
    extent = float((high - low).max())
    if extent <= 0:
        return Undefined("a curve of one point")
    return _dimension(_draw((curve.line - low) / extent))


@fitness(of="curve", goal="max", range=(0, 1))
def simplicity(curve) -> float:
    """Simplicity of the curve: 1 for a straight one, 1/k for one of k straight pieces.

    Formula: 1 / k, with k the number of straight pieces of the curve after Douglas and Peucker's
    method, within a hundredth of its extent. Range: above 0 to 1.
    Source: Douglas & Peucker 1973.
    """
    import shapely

    extent = float(np.ptp(curve.line, axis=0).max())
    left = shapely.LineString(curve.line).simplify(_TOLERANCE * extent, preserve_topology=False)
    return 1.0 / max(1, len(left.coords) - 1)


@fitness(of="shape", range=(0, 2))
def shape_dimension(shape) -> float:
    """Box dimension of the shape, at the run's pixels.

    Formula: as for `curve_dimension`, over the pixels of the shape. Range: 0 to 2. Undefined below
    64 px.
    Source: Mandelbrot 1967; `evocity.shapes` has the exact dimension for similitudes.
    """
    return _dimension(shape.mask)


@fitness(of="shape", range=(0, 1))
def shape_cover(shape) -> float:
    """Share of the window that the shape covers, at the run's pixels. Range: 0 to 1.

    Source: none needed.
    """
    return shape.mask.mean()


def _dimension(mask: np.ndarray) -> float:
    from evocity.shapes import ShapeError, boxes_of

    try:
        return min(2.0, max(0.0, boxes_of(mask).dimension))
    except ShapeError as error:
        return Undefined(error.found)


def _draw(line: np.ndarray) -> np.ndarray:
    """Draw a line within the unit square as a mask, without gaps."""
    steps = np.sqrt((np.diff(line, axis=0) ** 2).sum(axis=1))
    reached = np.append(0, np.cumsum(steps))
    at = np.linspace(0, reached[-1], max(2, int(4 * _SIDE * reached[-1])))
    points = np.column_stack([np.interp(at, reached, axis) for axis in line.T])
    cells = np.clip((points * _SIDE).astype(int), 0, _SIDE - 1)
    mask = np.zeros((_SIDE, _SIDE), bool)
    mask[cells[:, 1], cells[:, 0]] = True
    return mask


def line_distance(line: np.ndarray, other: np.ndarray) -> float:
    """Measure how far two lines ``(n, 2)`` are apart, in their unit: the mean distance of places
    along each line from the other line."""
    import shapely

    lines = [shapely.LineString(points) for points in (line, other)]
    share = np.linspace(0, 1, _PLACES)
    distances = []
    for start, end in (lines, lines[::-1]):
        shapely.prepare(end)
        places = shapely.line_interpolate_point(start, share, normalized=True)
        distances.append(float(shapely.distance(places, end).mean()))
    return (distances[0] + distances[1]) / 2


def _declare_line(stem: str, content: bytes) -> None:
    """Declare the measure ``stem_distance`` of a line in GeoJSON."""
    from evocity.kinds.window_lines import cut_to_window, line_in, place_line

    name = _check_stem(stem, ".geojson")
    points, degrees = line_in(content, name)
    known: dict[object, np.ndarray] = {}

    def distance(curve) -> float:
        window = curve.side, curve.origin, curve.crs
        if window not in known:
            here = place_line(points, degrees, *window, name)
            known[window] = cut_to_window(here, curve.side, name)
        return line_distance(curve.line, known[window])

    distance.__doc__ = f"""Distance of the curve to the line of {name}, within the window.

    Formula: mean distance of 256 places along each line from the other. Unit: metres."""
    distance.__name__, distance.__qualname__ = f"{stem}_distance", f"{name}:{stem}_distance"
    fitness(goal="min", unit="m", range=(0, math.inf), of="curve")(distance)


def _declare_picture(stem: str, content: bytes) -> None:
    """Declare the measure ``stem_distance`` of a picture in PNG: pixels darker than half are the
    target."""
    name = _check_stem(stem, ".png")
    dark = _read_dark(content, name)
    known: dict[int, tuple[np.ndarray, np.ndarray]] = {}

    def distance(shape) -> float:
        import scipy

        if shape.pixels not in known:
            there = _resample(dark, shape.pixels)
            known[shape.pixels] = there, scipy.ndimage.distance_transform_edt(~there)
        there, from_there = known[shape.pixels]
        from_shape = scipy.ndimage.distance_transform_edt(~shape.mask)
        total = from_there[shape.mask].mean() + from_shape[there].mean()
        return float(total) / 2 / shape.pixels

    distance.__doc__ = f"""Distance of the shape to the dark pixels of {name}.

    Formula: mean distance of the pixels of each from the other. Unit: sides of the window."""
    distance.__name__, distance.__qualname__ = f"{stem}_distance", f"{name}:{stem}_distance"
    fitness(goal="min", range=(0, 2), of="shape")(distance)


def _read_dark(content: bytes, name: str) -> np.ndarray:
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of large pictures: this function checks the size
            with Image.open(io.BytesIO(content), formats=["PNG"]) as picture:
                if max(picture.size) > MOST_SIDE:
                    raise FitnessError(
                        f"the picture has {picture.width} × {picture.height} px, which is too "
                        "large",
                        f"at most {MOST_SIDE} px along each side",
                        "shrink the picture",
                    )
                over = Image.new("RGBA", picture.size, "white")
                over.alpha_composite(picture.convert("RGBA"))
                dark = np.asarray(over.convert("L")) < 128
    except FitnessError:
        raise
    except Exception as error:  # Pillow raises many exceptions for damaged files
        raise FitnessError(
            f"the picture cannot be read ({type(error).__name__})",
            "a PNG",
            "export the picture again",
        ) from None
    if not dark.any() or dark.all():
        raise FitnessError(
            f"the picture is {'all' if dark.all() else 'nowhere'} dark",
            "a dark shape on a light ground",
            "draw a shape, or invert the picture",
        )
    return dark


def _resample(dark: np.ndarray, pixels: int) -> np.ndarray:
    """Resample a picture to ``pixels`` × ``pixels``: a pixel is dark if any of its part is."""
    rows, columns = (np.nonzero(dark)[axis] * pixels // dark.shape[axis] for axis in (0, 1))
    resampled = np.zeros((pixels, pixels), bool)
    resampled[rows, columns] = True
    return resampled


def _check_stem(stem: str, suffix: str) -> str:
    if not stem.isidentifier():
        raise FitnessError(
            f"the file name {stem}{suffix} cannot name a measure",
            "a file name that is a valid name of a measure",
            f"rename the file, for example to target{suffix}",
        )
    return f"{stem}{suffix}"


TABLES[".geojson"] = _declare_line
TABLES[".png"] = _declare_picture
