"""Curves and shapes: how long, how winding, how rough, how far from a line or a picture.

A file of one line in GeoJSON, ``shore.geojson``, gives a measure of curves, ``shore_distance``;
a picture in PNG, ``leaf.png``, one of shapes, ``leaf_distance``.
"""

import io
import math
import warnings

import numpy as np

from evocity.errors import FitnessError
from evocity.fitness.measure import Undefined
from evocity.fitness.registry import TABLES, fitness

#: A picture has no more pixels along a side.
MOST_SIDE = 4096
# Places along a line at which its distance to another is measured.
_PLACES = 256
# Of a line's extent, how far it may lie from the fewest straight pieces that tell it.
_TOLD = 0.01
# Pixels along a side at which the roughness of a line is counted.
_SIDE = 256


@fitness(of="curve", unit="m", range=(0, math.inf))
def curve_length(curve) -> float:
    """Length of the curve, or of a site's first course.

    Formula: Σ of the distances of points that follow each other, at least 256 of them.
    Unit: metres. Range: 0 upwards.
    Source: none needed.
    """
    return curve.length


@fitness(of="curve", range=(1, math.inf))
def sinuosity(curve) -> float:
    """How much longer the curve is than the straight way from its beginning to its end.

    Formula: length / distance of the ends. Range: 1, straight, upwards. Undefined for a curve that
    ends where it begins.
    Source: Schumm 1963, of rivers.
    """
    apart = float(np.hypot(*(curve.line[-1] - curve.line[0])))
    if apart < 1e-6 * curve.side:
        return Undefined("the curve ends where it begins")
    return max(1.0, curve.length / apart)


@fitness(of="curve", range=(0, 2))
def curve_dimension(curve) -> float:
    """Box dimension of the curve: 1 smooth, more the rougher it is, as far as points tell it.

    Formula: slope of the logarithm of the number of boxes that it meets, drawn at 256 px of its
    extent, over that of their sides, 4 to 64 px. Range: 0 to 2.
    Source: Mandelbrot 1967.
    """
    low, high = curve.line.min(axis=0), curve.line.max(axis=0)
    extent = float((high - low).max())
    if extent <= 0:
        return Undefined("a curve of one point")
    return _dimension(_drawn((curve.line - low) / extent))


@fitness(of="curve", goal="max", range=(0, 1))
def simplicity(curve) -> float:
    """How simple the curve is: 1 for a straight one, 1/k for one that takes k straight pieces.

    Formula: 1 / the number of pieces that Douglas and Peucker's method leaves of it within a
    hundredth of its extent. Range: above 0 to 1.
    Source: Douglas & Peucker 1973.
    """
    import shapely

    extent = float(np.ptp(curve.line, axis=0).max())
    left = shapely.LineString(curve.line).simplify(_TOLD * extent, preserve_topology=False)
    return 1.0 / max(1, len(left.coords) - 1)


@fitness(of="shape", range=(0, 2))
def shape_dimension(shape) -> float:
    """Box dimension of the shape, as it is drawn in its window.

    Formula: as of `curve_dimension`, of the run's own pixels. Range: 0 to 2. Undefined below 64 px.
    Source: Mandelbrot 1967; `evocity.shapes` has the exact one of similitudes.
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


def _drawn(line: np.ndarray) -> np.ndarray:
    """A line within the unit square as a mask, without gaps."""
    steps = np.sqrt((np.diff(line, axis=0) ** 2).sum(axis=1))
    reached = np.append(0, np.cumsum(steps))
    at = np.linspace(0, reached[-1], max(2, int(4 * _SIDE * reached[-1])))
    points = np.column_stack([np.interp(at, reached, axis) for axis in line.T])
    cells = np.clip((points * _SIDE).astype(int), 0, _SIDE - 1)
    mask = np.zeros((_SIDE, _SIDE), bool)
    mask[cells[:, 1], cells[:, 0]] = True
    return mask


def line_distance(line: np.ndarray, other: np.ndarray) -> float:
    """How far two lines ``(n, 2)`` lie apart, in their unit: the mean of the distances of places
    along the one from the other, and of the other from the one."""
    import shapely

    lines = [shapely.LineString(one) for one in (line, other)]
    share = np.linspace(0, 1, _PLACES)
    apart = []
    for one, to in (lines, lines[::-1]):
        shapely.prepare(to)
        places = shapely.line_interpolate_point(one, share, normalized=True)
        apart.append(float(shapely.distance(places, to).mean()))
    return (apart[0] + apart[1]) / 2


def _declare_line(stem: str, content: bytes) -> None:
    """The measure ``stem_distance`` of a line in GeoJSON."""
    from evocity.forms.lines import cut_to, line_in, placed

    name = _checked_stem(stem, ".geojson")
    told, degrees = line_in(content, name)
    known: dict[object, np.ndarray] = {}

    def distance(curve) -> float:
        window = curve.side, curve.origin, curve.crs
        if window not in known:
            here = placed(told, degrees, *window, name)
            known[window] = cut_to(here, curve.side, name)
        return line_distance(curve.line, known[window])

    distance.__doc__ = f"""Distance of the curve to the line of {name}, within the window.

    Formula: mean of the distances of 256 places along each from the other. Unit: metres."""
    distance.__name__, distance.__qualname__ = f"{stem}_distance", f"{name}:{stem}_distance"
    fitness(goal="min", unit="m", range=(0, math.inf), of="curve")(distance)


def _declare_picture(stem: str, content: bytes) -> None:
    """The measure ``stem_distance`` of a picture in PNG: what is darker than half is the target."""
    name = _checked_stem(stem, ".png")
    dark = _dark(content, name)
    known: dict[int, tuple[np.ndarray, np.ndarray]] = {}

    def distance(shape) -> float:
        import scipy

        if shape.pixels not in known:
            there = _resampled(dark, shape.pixels)
            known[shape.pixels] = there, scipy.ndimage.distance_transform_edt(~there)
        there, from_there = known[shape.pixels]
        from_shape = scipy.ndimage.distance_transform_edt(~shape.mask)
        apart = from_there[shape.mask].mean() + from_shape[there].mean()
        return float(apart) / 2 / shape.pixels

    distance.__doc__ = f"""Distance of the shape to what is dark in {name}.

    Formula: mean of the distances of the pixels of each from the other. Unit: sides
    of the window."""
    distance.__name__, distance.__qualname__ = f"{stem}_distance", f"{name}:{stem}_distance"
    fitness(goal="min", range=(0, 2), of="shape")(distance)


def _dark(content: bytes, name: str) -> np.ndarray:
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of size, which is looked at here
            with Image.open(io.BytesIO(content), formats=["PNG"]) as picture:
                if max(picture.size) > MOST_SIDE:
                    raise FitnessError(
                        f"a picture of {picture.width} × {picture.height} px",
                        f"{MOST_SIDE} px or fewer along each side",
                        "shrink it",
                    )
                over = Image.new("RGBA", picture.size, "white")
                over.alpha_composite(picture.convert("RGBA"))
                dark = np.asarray(over.convert("L")) < 128
    except FitnessError:
        raise
    except Exception as error:  # of a damaged file Pillow raises many things
        raise FitnessError(
            f"no picture that can be read ({type(error).__name__})", "PNG", "export it again"
        ) from None
    if not dark.any() or dark.all():
        raise FitnessError(
            f"a picture that is {'all' if dark.all() else 'nowhere'} dark",
            "a dark shape on a light ground",
            "draw one, or invert it",
        )
    return dark


def _resampled(dark: np.ndarray, pixels: int) -> np.ndarray:
    """A picture at ``pixels`` × ``pixels``: each with the nearest dark it has."""
    rows, columns = (np.nonzero(dark)[axis] * pixels // dark.shape[axis] for axis in (0, 1))
    found = np.zeros((pixels, pixels), bool)
    found[rows, columns] = True
    return found


def _checked_stem(stem: str, suffix: str) -> str:
    if not stem.isidentifier():
        raise FitnessError(
            f"a file called {stem}{suffix}",
            "a name that measures can have",
            f"rename it, such as target{suffix}",
        )
    return f"{stem}{suffix}"


TABLES[".geojson"] = _declare_line
TABLES[".png"] = _declare_picture

__all__ = [
    "curve_dimension",
    "curve_length",
    "line_distance",
    "shape_cover",
    "shape_dimension",
    "simplicity",
    "sinuosity",
]
