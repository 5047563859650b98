"""Pictures of the modeller by `evocity.shapes`: a PNG, PNG frames in a zip, an animated WebP."""

import io
import threading
import time
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from typing import Annotated, Literal

import numpy as np
from PIL import Image, ImageDraw
from pydantic import Field

from evocity.errors import EvocityError
from evocity.shapes import Curve, Primitive, Shape, ShapeError, picture_of
from evocity.shapes._kernels import DEEPEST
from evocity.shapes.checks import corners
from evocity.shapes.linear import determinants
from evocity.shapes.rendering import Frame
from evocity.shapes.shape import walk
from evocity.studio.modeller import ShapeFields, morph_of
from evocity.studio.request_fields import Body, whole_field

#: Frames of a film, and pieces of a picture of one level; at most.
MOST_FRAMES, MOST_LEVEL = 240, 20_000
#: Pieces as fine as pixels, at most: those that are listed, and those that only mark pixels.
MOST_FINE, MOST_LAID = 2_000_000, 30_000_000
#: Seconds for all frames of one file, and points of a curve.
PATIENCE, CURVE_POINTS = 120.0, 4096
KINDS = {"webp": "image/webp", "zip": "application/zip", "png": "image/png"}
# The sides of a picture that the shape around it may take.
_WIDEST = 4
_PAPER, _INK = (255, 255, 255), (31, 41, 51)
# As in modeller-raster.js.
_RAMP = np.array([(247, 224, 190), (226, 150, 90), (176, 64, 63), (70, 20, 50)], float)
# The least weight that a mixture of colours may have: the first map alone decides.
_FIRST = 1e-9


class PictureRequest(Body):
    """A request for a picture of a shape, or for ``frames`` of its metamorphosis to ``last``.

    The picture shows a square from (left, low). ``level``: n of 𝒯ⁿK; None for the attractor.
    """

    shape: ShapeFields
    last: ShapeFields | None = None
    kind: Literal["webp", "zip", "png"]
    frames: Annotated[int, whole_field("frames", 2, MOST_FRAMES)] = 2
    milliseconds: Annotated[int, whole_field("milliseconds per frame", 10, 10_000)] = 40
    side: Annotated[int, whole_field("side in pixels", 16, 1200)] = 600
    left: float
    low: float
    wide: Annotated[float, Field(gt=0)]
    level: Annotated[int | None, Field(ge=0, le=DEEPEST)] = None
    paint: Literal["ink", "first", "mixture", "measure"] = "ink"


_busy = threading.Lock()


def picture_file(request: PictureRequest) -> tuple[bytes, str]:
    """Make a file of pictures; return it with its type. Raises `EvocityError`."""
    if not _busy.acquire(blocking=False):
        raise EvocityError(
            "studio is already drawing frames", "one film at a time", "wait for the other film"
        )
    try:
        out = io.BytesIO()
        if request.kind == "png":
            draw(request, 0).save(out, "PNG")
        elif request.kind == "webp":
            first, *rest = _frames(request)
            first.save(
                out, "WEBP", save_all=True, append_images=rest, loop=0, lossless=True, method=2,
                duration=request.milliseconds,
            )  # fmt: skip
        else:
            with zipfile.ZipFile(out, "w") as archive:
                for number, frame in enumerate(_frames(request), 1):
                    content = io.BytesIO()
                    frame.save(content, "PNG")
                    archive.writestr(f"frame-{number:04d}.png", content.getvalue())
        return out.getvalue(), KINDS[request.kind]
    finally:
        _busy.release()


def _frames(request: PictureRequest) -> Iterator[Image.Image]:
    if request.last is None:
        raise ShapeError(
            "a film needs a second shape", "a shape at “metamorphosis to”", "choose a second shape"
        )
    end = time.monotonic() + PATIENCE
    for number in range(request.frames):
        if time.monotonic() > end:
            raise ShapeError(
                f"{number} of {request.frames} frames took {PATIENCE:.0f} seconds",
                f"frames that take at most {PATIENCE:.0f} seconds together",
                "choose fewer frames, or a smaller side",
            )
        yield draw(request, number / (request.frames - 1))


def draw(request: PictureRequest, t: float) -> Image.Image:
    """Draw the shape at time ``t``, as the page shows it."""
    fields = request.shape
    if request.last is not None:
        shape = morph_of(fields, request.last)(t)
    else:
        shape = fields.curve() if fields.is_curve else fields.shape()
    low = np.array([request.left, request.low])
    box = np.stack([low, low + request.wide])
    if isinstance(shape, Curve):
        return _draw_curve(shape, Frame.of(box, request.side), request.level)
    if request.paint in ("ink", "measure"):
        shape = replace(shape, colours=None)
    elif request.paint == "first":
        shape = replace(shape, mix=_FIRST)
    if request.level is not None:
        return picture_of(shape, request.side, request.level, box, MOST_LEVEL)
    return draw_attractor(shape, Frame.of(box, request.side), request.paint == "measure")


def draw_attractor(shape: Shape, frame: Frame, by_measure: bool) -> Image.Image:
    """Draw the attractor within a ``frame``: later words cover earlier words; or by its measure."""
    side, ends = frame.side, frame.to_pixels(shape.box)
    before, after = (max(0, int(np.ceil(far.max()))) for far in (-ends[0], ends[1] - side))
    whole = side + before + after
    if not by_measure and whole <= _WIDEST * side:  # the shape around the picture too
        marks, paint = shape.laid(whole, frame.scale, frame.offset + before, MOST_LAID)
        seen = np.s_[after : after + side, before : before + side]
        marks, paint = marks[seen], paint[seen]
        pixels = np.full((side, side, 3), _PAPER, np.uint8)
        pixels[marks] = np.round(paint[marks] * 255) if paint.shape[2] else _INK
        return Image.fromarray(pixels)
    base = shape._base if not by_measure else np.log(map_shares(shape))[:, None]
    mix = 1.0 if by_measure else float(shape.mix)
    automaton, fine = shape._endless_automaton, (1 + 1e-9) / frame.scale
    ends = corners(shape.box)
    try:
        products, lengths, colours = walk(
            shape.maps, automaton, ends, DEEPEST, fine, base, mix, MOST_FINE
        )
    except ShapeError as error:
        remedy = "choose a smaller side, or show a larger part of the shape"
        raise ShapeError(error.found, error.expected, remedy) from None
    middle = shape.box.mean(axis=0)
    at = frame.to_pixels(np.einsum("kij,j->ki", products[:, :, :2], middle) + products[:, :, 2])
    inside = ((at >= 0) & (at < frame.side)).all(axis=1)
    columns, rows = np.floor(at[inside]).astype(np.int64).T
    flat = (frame.side - 1 - rows) * frame.side + columns
    pixels = np.full((frame.side**2, 3), _PAPER, np.uint8)
    if by_measure:
        logs = colours[inside, 0] * lengths[inside]
        weights = np.bincount(flat, np.exp(logs), frame.side**2)
        lit = weights > 0
        pixels[lit] = _ramped(weights[lit])
    elif base.shape[1]:
        pixels[flat] = np.round(colours[inside] * 255)  # the last of several pieces in a pixel
    else:
        pixels[flat] = _INK
    return Image.fromarray(pixels.reshape(frame.side, frame.side, 3))


def map_shares(shape: Shape) -> np.ndarray:
    """Return the share of each map in the measure, as the chaos game of `Shape.chaos`."""
    areas = np.abs(determinants(shape.maps[:, :, :2]))
    shares = np.maximum(areas / max(areas.sum(), 1e-300), 0.01)
    return shares / shares.sum()


def _ramped(weights: np.ndarray) -> np.ndarray:
    """Colour positive ``weights``, on a scale of logarithms over a factor of 1000."""
    at = np.maximum(0.0, 1 + np.log10(weights / weights.max()) / 3) * (len(_RAMP) - 1)
    k = np.minimum(len(_RAMP) - 2, np.floor(at).astype(np.int64))
    share = (at - k)[:, None]
    return np.round((1 - share) * _RAMP[k] + share * _RAMP[k + 1])


def _draw_curve(curve: Curve, frame: Frame, level: int | None) -> Image.Image:
    image = Image.new("RGB", (frame.side, frame.side), _PAPER)
    pen = ImageDraw.Draw(image)
    lines = [curve.line(curve_depth(curve))] if level is None else curve.polygons(
        min(level, curve_depth(curve))
    )  # fmt: skip
    for line in lines:
        placed = frame.to_pixels(line)
        placed[:, 1] = frame.side - placed[:, 1]
        pen.line([tuple(point) for point in placed.tolist()], fill=_INK, width=2)
    return image


def curve_depth(curve: Curve) -> int:
    """Return the greatest depth with at most `CURVE_POINTS` parts."""
    depth = 1
    while len(curve) ** (depth + 1) <= CURVE_POINTS:
        depth += 1
    return depth


def segment_line(shape: Shape, most: int) -> np.ndarray:
    """Return the points of a wire form whose arcs follow each other, of at most ``most`` arcs."""
    depth = 0
    while len(shape) ** (depth + 1) <= most and len(shape) > 1:
        depth += 1
    segment = Primitive.polyline([(0, 0), (1, 0)])
    ends = replace(shape, primitive=segment).pieces(depth).points
    return np.vstack([ends[:, 0], ends[-1:, 1]])
