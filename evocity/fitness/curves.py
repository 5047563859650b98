"""Measures of curves, shapes and sites: length, dimension, distance to a line or a picture.

A GeoJSON file of one line, ``shore.geojson``, declares a measure of curves, ``shore_distance``. A
PNG picture, ``leaf.png``, declares a measure of shapes, ``leaf_distance``.
"""

import io
import math
import warnings

import numpy as np

from evocity.errors import FitnessError
from evocity.fitness.measure import Undefined
from evocity.fitness.registry import TABLES, fitness, name_of_file

#: Reach of a course, metres from its bank.
NEAR = 50.0
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
    """Length of the curve; for a site, the length of the site's first course.

    Formula: sum of the distances between successive points of the curve, which has at least 256
        points.
    Unit: metres. Range: 0 upwards.
    Source: none needed.
    """
    return curve.length


@fitness(of="curve", range=(1, math.inf))
def sinuosity(curve) -> float:
    """Ratio of the curve's length to the straight distance between its ends.

    Formula: length of the curve / distance between its ends. Range: 1 (straight) upwards. The
    measure is undefined for a curve that ends where it begins.
    Source: Schumm 1963, for rivers.
    """
    distance = float(np.hypot(*(curve.line[-1] - curve.line[0])))
    if distance < 1e-6 * curve.side:
        return Undefined("the curve ends where it begins")
    return max(1.0, curve.length / distance)


@fitness(of="curve", range=(0, 2))
def curve_dimension(curve) -> float:
    """Box dimension of the curve: 1 for a smooth curve, and more than 1 for a rough curve.

    Formula: −slope of ln N(ε) on ln ε, with N(ε) the number of boxes of side ε that the curve
    passes through. The longer side of the drawn curve has 256 px, and the boxes have sides of 4 to
    64 px.
    Range: 0 to 2.
    Source: Mandelbrot 1967.
    """
    low, high = curve.line.min(axis=0), curve.line.max(axis=0)
    extent = float((high - low).max())
    if extent <= 0:
        return Undefined("a curve of one point")
    return _dimension(_draw((curve.line - low) / extent))


@fitness(of="curve", goal="max", range=(0, 1))
def simplicity(curve) -> float:
    """Simplicity of the curve: 1 for a straight line, and 1/k for a line of k straight segments.

    Formula: 1 / k, with k the number of straight segments after simplification by Douglas and
    Peucker's method. The tolerance of the simplification is a hundredth of the curve's extent.
    Range: above 0 to 1. Source: Douglas & Peucker 1973.
    """
    import shapely

    extent = float(np.ptp(curve.line, axis=0).max())
    left = shapely.LineString(curve.line).simplify(_TOLERANCE * extent, preserve_topology=False)
    return 1.0 / max(1, len(left.coords) - 1)


@fitness(of="shape", range=(0, 2))
def shape_dimension(shape) -> float:
    """Box dimension of the shape, counted in the pixels of the run.

    Formula: that of `curve_dimension`, applied to the pixels of the shape. Range: 0 to 2. The
    measure is undefined for windows of less than 64 × 64 px.
    Source: Mandelbrot 1967; `evocity.shapes` has the exact dimension for similitudes.
    """
    return _dimension(shape.mask)


@fitness(of="shape", range=(0, 1))
def shape_cover(shape) -> float:
    """Share of the window that the shape covers, counted in the pixels of the run. Range: 0 to 1.

    Source: none needed.
    """
    return shape.mask.mean()


@fitness(of="site", goal="min", range=(0, 1))
def built_area_lost(site) -> float:
    """Share of the built ground that the courses of the site cover.

    Formula: number of built pixels under the courses / number of all built pixels, on the map
    without courses. Range: 0 to 1. The measure is undefined for a site without buildings.
    Source: none needed.
    """
    built = site.before.built
    if not built.any():
        return Undefined("a fabric without buildings")
    return np.count_nonzero(built & site.mask) / np.count_nonzero(built)


@fitness(of="site", goal="max", range=(0, 1))
def buildings_near_course(site) -> float:
    """Share of the buildings that lie within 50 m of a course, such as a river through the site.

    Formula: number of buildings with a pixel within 50 m of a course / number of all buildings, on
    the site's map with its courses. Distances are measured between the centres of pixels. Range: 0
    to 1. The measure is undefined for a site without buildings.
    Source: none needed.
    """
    labels = site.city.building_labels
    count = labels.max(initial=0)
    if not count:
        return Undefined("no building to measure")
    return len(np.setdiff1d(np.unique(labels[_near(site)]), [0])) / count


@fitness(of="site", goal="max", unit="m²", range=(0, math.inf))
def area_within_reach(site) -> float:
    """Area of the built ground within 50 m of a course, such as a river through the site.

    Formula: n · a on the site's map with its courses, with n the number of built pixels within 50 m
    of a course, and a the area of a pixel. Distances are measured between the centres of pixels.
    Unit: m². Source: none needed.
    """
    return np.count_nonzero(site.city.built & _near(site)) * site.metres_per_pixel**2


def _near(site) -> np.ndarray:
    """Select the pixels within reach of a course, without those of the courses: bool ``(H, W)``."""
    import scipy

    distance = scipy.ndimage.distance_transform_edt(~site.mask) * site.metres_per_pixel
    return (distance <= NEAR) & ~site.mask


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

    name = name_of_file(stem, ".geojson", "target")
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
    name = name_of_file(stem, ".png", "target")
    dark = read_dark(content, name)
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


def read_dark(content: bytes, name: str) -> np.ndarray:
    """Read the pixels of a PNG file that are darker than mid-grey, bool ``(H, W)``."""
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
                        "shrink the picture to this size",
                    )
                over = Image.new("RGBA", picture.size, "white")
                over.alpha_composite(picture.convert("RGBA"))
                dark = np.asarray(over.convert("L")) < 128
    except FitnessError:
        raise
    except Exception as error:  # Pillow raises many exceptions for damaged files
        raise FitnessError(
            f"the picture cannot be read ({type(error).__name__})",
            "a complete PNG file",
            "export the picture again as a PNG file",
        ) from None
    if not dark.any() or dark.all():
        raise FitnessError(
            f"the picture is {'all' if dark.all() else 'nowhere'} dark",
            "a dark shape on a light ground",
            "draw a dark shape on a light ground, or invert the picture",
        )
    return dark


def _resample(dark: np.ndarray, pixels: int) -> np.ndarray:
    """Resample a picture to ``pixels`` × ``pixels``: a pixel is dark if any of its part is."""
    rows, columns = (np.nonzero(dark)[axis] * pixels // dark.shape[axis] for axis in (0, 1))
    resampled = np.zeros((pixels, pixels), bool)
    resampled[rows, columns] = True
    return resampled


TABLES[".geojson"] = _declare_line
TABLES[".png"] = _declare_picture
