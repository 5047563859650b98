"""Axonometric pictures of scenes, with shadows, by a z-buffer."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw

from evocity.citymap import CityMap
from evocity.errors import MapError, check_number, check_word, setting
from evocity.formats import Group
from evocity.formats.solids import ROOF
from evocity.pictures.colours import FAINT, INK, PAPER, ramp, scale_end
from evocity.pictures.legend import Key, draw_legend, draw_with_scale, font, text_size, wrap_text
from evocity.scene._kernels import fill, light, outlined, painted

#: The colour of walls where roofs have the colours of their heights, sRGB.
_WALLS = np.array([228, 221, 210], float)
#: The side of the square of samples whose mean is a pixel.
_FINER = 2
#: Samples in memory at once: large pictures are drawn in bands.
_AT_ONCE = 1 << 23
#: Side of the shadow map, px.
_SUN_SIDE = 2048
#: Light in the shade, relative to a roof in the sun; the most on a wall that faces the sun; and the
#: factor of edges.
_AMBIENT, _MOST, _EDGE = 0.62, 1.08, 0.62
#: Free share of the width at each side.
_MARGIN = 0.03
#: What the colours of surfaces show.
_COLOURS = ("heights", "classes")
#: The greatest side of a picture, px.
_LARGEST = 8192


def draw_scene(
    city: CityMap,
    groups: Sequence[Group],
    *,
    width: int = 900,
    azimuth: float = 25.0,
    tilt: float = 40.0,
    sun: tuple[float, float] = (250.0, 40.0),
    shadows: bool = True,
    colours: str = "heights",
    highest: float | None = None,
    legend: bool = True,
) -> Image.Image:
    """Draw `Scene.picture` of the ``groups`` of a ``city``'s scene."""
    _check("width", width, 16, _LARGEST)
    _check("azimuth", azimuth)
    _check("tilt", tilt, 1, 90)
    check_word("colours", colours, _COLOURS, error=MapError)
    if not (isinstance(sun, Sequence) and len(sun) == 2):
        raise MapError(
            setting("sun", sun), "two numbers: azimuth and height, degrees", "such as (250, 40)"
        )
    _check("sun", sun[0])
    _check("sun", sun[1], 1, 90)
    end = _end(city, highest)
    surfaces = _surfaces(groups, colours, end)
    towards, sunwards = _directions(azimuth, tilt), _directions(sun[0] + 180, sun[1])
    view = _view(surfaces.corners, towards, int(width))
    cast = _shadow_map(surfaces, sunwards) if shadows else None
    shown, covered = _paint(surfaces.of(surfaces.normals @ towards[2] > 1e-9), view, sunwards, cast)
    fabric = Image.fromarray(shown)
    if not legend:
        return fabric
    fabric, covered = _add_north(fabric, covered, towards)
    text = f"sun from {sun[0] % 360:.0f}°, {sun[1]:.0f}° high; seen towards {azimuth % 360:.0f}°"
    fabric = _add_caption(fabric, covered, text)
    metres = city.metres_per_pixel * view.scale
    if colours == "heights":
        return draw_with_scale(city, fabric, city.name, end, metres)
    entries = [
        (
            tuple(round(255 * c) for c in group.colour),
            f"{group.name}: {len(group)}" if group.heights.any() else group.name,
        )
        for group in groups
        if len(group)
    ]
    return draw_legend(city, fabric, city.name, Key(entries), metres)


def _end(city: CityMap, highest: float | None) -> float:
    if highest is not None:
        _check("highest", highest, 1e-3, 1e6)
    return scale_end(city) if highest is None else float(highest)


def _check(name: str, value: float, low: float = -math.inf, high: float = math.inf) -> None:
    expected = f"a number from {low:g} to {high:g}" if math.isfinite(low) else "degrees"
    check_number(name, value, low, high, expected, MapError)


def _directions(azimuth: float, tilt: float) -> np.ndarray:
    """Return unit vectors in rows: right, up, and towards a viewer who looks along ``azimuth``,
    degrees clockwise from north, from ``tilt`` degrees above the horizon; x to the east, y to the
    north, z up."""
    a, t = math.radians(azimuth % 360), math.radians(tilt)
    ahead = np.array([math.sin(a), math.cos(a), 0.0])
    right = np.array([math.cos(a), -math.sin(a), 0.0])
    up = math.cos(t) * np.array([0.0, 0, 1]) + math.sin(t) * ahead
    return np.stack([right, up, math.sin(t) * np.array([0.0, 0, 1]) - math.cos(t) * ahead])


@dataclass(frozen=True, eq=False)
class _Surfaces:
    """Triangles: corners (t, 3, 3), normals (t, 3), number of the plane of each (t,), and colours
    (t, 3), 0…255."""

    corners: np.ndarray
    normals: np.ndarray
    plane: np.ndarray
    colours: np.ndarray

    def of(self, some: np.ndarray) -> "_Surfaces":
        """Select the triangles ``some``, bool (t,)."""
        return _Surfaces(
            self.corners[some], self.normals[some], self.plane[some], self.colours[some]
        )


@dataclass(frozen=True, eq=False)
class _View:
    """The view of a picture.

    towards : as of `_directions`. scale : px a metre. shape : height and width, px.
    matrix, shift : from metres to samples, x to the right and y down, and metres to the viewer.
    """

    towards: np.ndarray
    scale: float
    shape: tuple[int, int]
    matrix: np.ndarray
    shift: np.ndarray


@dataclass(frozen=True, eq=False)
class _ShadowMap:
    """The view from the sun: ``seen``, metres towards it of the nearest surface; ``matrix`` and
    ``shift``, as of a `_View`; ``texel``, metres a pixel."""

    seen: np.ndarray
    matrix: np.ndarray
    shift: np.ndarray
    texel: float


def _view(corners: np.ndarray, towards: np.ndarray, width: int) -> _View:
    flat = corners.reshape(-1, 3) @ towards[:2].T
    low, high = flat.min(axis=0), flat.max(axis=0)
    wide, tall = high - low
    scale = width * (1 - 2 * _MARGIN) / max(wide, 1e-9)
    scale = min(scale, _LARGEST * (1 - 2 * _MARGIN) / max(tall, 1e-9))
    margin = width * _MARGIN
    height = min(_LARGEST, max(16, round(tall * scale + 2 * margin)))
    left, top = (width - wide * scale) / 2, (height - tall * scale) / 2
    fine = scale * _FINER
    return _View(
        towards=towards,
        scale=scale,
        shape=(height, width),
        matrix=np.diag([fine, -fine, 1.0]) @ towards,
        shift=np.array([left * _FINER - low[0] * fine, top * _FINER + high[1] * fine, 0.0]),
    )


def _shadow_map(surfaces: _Surfaces, sunwards: np.ndarray) -> _ShadowMap:
    flat = surfaces.corners.reshape(-1, 3) @ sunwards[:2].T
    low, high = flat.min(axis=0), flat.max(axis=0)
    texel = float((high - low).max()) / (_SUN_SIDE - 2)
    matrix = np.diag([1 / texel, -1 / texel, 1.0]) @ sunwards
    shift = np.array([1 - low[0] / texel, 1 + high[1] / texel, 0.0])
    wide, deep = np.ceil((high - low) / texel).astype(int) + 2
    seen = np.full((deep, wide), -np.inf, np.float32)
    towards = surfaces.normals @ sunwards[2] > 1e-9
    placed = surfaces.corners[towards] @ matrix.T + shift
    fill(placed, 0, seen, np.full(seen.shape, -1, np.int32))
    return _ShadowMap(seen, matrix, shift, texel)


def _paint(
    surfaces: _Surfaces, view: _View, sunwards: np.ndarray, cast: _ShadowMap | None
) -> tuple[np.ndarray, np.ndarray]:
    """Paint ``surfaces`` that face the viewer: uint8 ``(H, W, 3)``, and the covered pixels, bool
    ``(H, W)``."""
    height, width = view.shape
    steep = np.clip(surfaces.normals @ sunwards[2], 0, 1)
    shade, sunlit = _brightness(surfaces.normals @ view.towards[2], steep, view, sunwards)
    paints = np.empty((2, len(steep) + 1, 3))
    paints[0, :-1] = surfaces.colours * shade[:, None]
    paints[1, :-1] = surfaces.colours * sunlit[:, None]
    paints[:, -1] = PAPER
    placed = surfaces.corners @ view.matrix.T + view.shift
    if cast is not None:
        back = np.linalg.inv(view.matrix)
        turned = cast.matrix @ back
        onto = np.column_stack([turned, cast.shift - turned @ view.shift])
        # a pixel of the shadow map covers many depths of a slope
        slope = np.clip(steep, 1e-6, 1)
        bias = cast.texel * (0.2 + 0.8 * np.sqrt(1 - slope**2) / slope)
    picture, covered = np.empty((height, width, 3), np.uint8), np.empty((height, width), bool)
    rows = max(1, _AT_ONCE // (width * _FINER**2))
    for top in range(0, height, rows):
        count = min(rows, height - top)
        # a row more at each end, for edges
        first, shape = top * _FINER - 1, (count * _FINER + 2, width * _FINER)
        depth, surface = np.full(shape, -np.inf, np.float32), np.full(shape, -1, np.int32)
        fill(placed, first, depth, surface)
        lit, edge = np.ones(shape, bool), np.empty(shape, np.float32)
        if cast is not None:
            light(depth, surface, first, onto, cast.seen, bias, lit)
        outlined(depth, surface, surfaces.plane, 1.5 / view.scale, _EDGE, edge)
        own, here = slice(1, -1), slice(top, top + count)
        painted(surface[own], lit[own], edge[own], paints, picture[here], covered[here])
    return picture, covered


def _brightness(
    facing: np.ndarray, steep: np.ndarray, view: _View, sunwards: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the light of each triangle in the shade and in the sun: Lambert's law, and a little
    darker at grazing angles. ``facing`` and ``steep``: cosines to the viewer and to the sun. A roof
    in the sun has 1, so that it has the colour of the scale."""
    shade = _AMBIENT * (0.88 + 0.12 * np.clip(facing, 0, 1))
    roof = _AMBIENT * (0.88 + 0.12 * view.towards[2, 2])
    return shade, np.minimum(shade + (1 - roof) * steep / sunwards[2, 2], _MOST)


def _surfaces(groups: Sequence[Group], colours: str, highest: float) -> _Surfaces:
    corners, normals, owners, own_colours = [], [], [], []
    solids = 0
    for group in groups:
        mesh = group.mesh
        own = np.tile(np.array(group.colour) * 255, (len(mesh.triangles), 1))
        standing = group.heights[mesh.owner] > 0
        roof = standing & (mesh.part == ROOF)
        if colours == "heights":
            own[standing] = _WALLS
            own[roof] = ramp(group.heights[mesh.owner[roof]][None], highest)[0]
        else:
            own[roof] += 0.3 * (255 - own[roof])
        corners.append(mesh.points[mesh.triangles])
        normals.append(mesh.normals)
        # surfaces of one kind count as one solid: no line between them
        solid = mesh.owner if group.heights.any() else np.zeros_like(mesh.owner)
        owners.append(solid.astype(np.int64) + solids)
        own_colours.append(own)
        solids += len(group)
    normal, owner = np.concatenate(normals), np.concatenate(owners)
    turned = np.round(normal * 16).astype(np.int64) + 16
    key = ((owner * 64 + turned[:, 0]) * 64 + turned[:, 1]) * 64 + turned[:, 2]
    _, plane = np.unique(key, return_inverse=True)
    return _Surfaces(
        np.concatenate(corners), normal, plane.astype(np.int32), np.concatenate(own_colours)
    )


def triangles(
    city: CityMap, groups: Sequence[Group], colours: str, highest: float | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return `Scene.triangles` of the ``groups`` of a ``city``'s scene."""
    check_word("colours", colours, _COLOURS, error=MapError)
    found = _surfaces(groups, colours, _end(city, highest))
    shades = np.clip(np.round(found.colours), 0, 255)
    return found.corners.astype(np.float32), shades.astype(np.uint8)


def _add_north(
    fabric: Image.Image, covered: np.ndarray, towards: np.ndarray
) -> tuple[Image.Image, np.ndarray]:
    """Add an arrow that points north on the ground, in a free corner or above the drawing."""
    size = max(14, fabric.width // 30)
    way = np.array([towards[0, 1], -towards[1, 1]])
    across = np.array([towards[0, 0], -towards[1, 0]]) * 0.35
    letter = way + way / max(np.hypot(*way), 1e-9) * 0.55
    points = np.array([way, across - way, -0.5 * way, -across - way, letter]) * size
    around = np.array([[-1, -1], [1, 1]]) * 0.5 * size
    low, high = points.min(axis=0) + around[0], points.max(axis=0) + around[1]
    wide, deep = np.ceil(high - low).astype(int)
    places = [(0, 0), (fabric.width - wide, 0), (0, fabric.height - deep)]
    for left, top in places:
        if min(left, top) >= 0 and not covered[top : top + deep, left : left + wide].any():
            break
    else:
        left, top = 0, 0
        full = covered[:deep, :wide].any(axis=1)
        free = int(full.argmax()) if full.any() else len(full)
        fabric, covered = _extend(fabric, covered, deep - free, 0)
    draw = ImageDraw.Draw(fabric)
    tip, right, notch, other, letter = (tuple(one) for one in points - low + (left, top))
    draw.polygon([tip, right, notch], INK)
    draw.polygon([tip, other, notch], PAPER, INK)
    draw.text(letter, "N", INK, font(size * 0.7), "mm")
    return fabric, covered


def _add_caption(fabric: Image.Image, covered: np.ndarray, text: str) -> Image.Image:
    letters = font(text_size(fabric) * 0.85)
    step, gap = 1.25 * letters.size, math.ceil(letters.size / 2)
    lines = wrap_text(text, letters, fabric.width - 2 * gap)
    wide = math.ceil(max(letters.getlength(line) for line in lines)) + 2 * gap
    needed = math.ceil(step * len(lines)) + gap
    below = covered[:, -wide:].any(axis=1)[::-1]
    free = int(below.argmax()) if below.any() else len(below)
    fabric, _ = _extend(fabric, covered, 0, max(0, needed - free))
    draw = ImageDraw.Draw(fabric)
    for number, line in enumerate(reversed(lines)):
        low = fabric.height - gap - step * number
        draw.text((fabric.width - gap, low), line, FAINT, letters, "rb")
    return fabric


def _extend(
    fabric: Image.Image, covered: np.ndarray, above: int, below: int
) -> tuple[Image.Image, np.ndarray]:
    sheet = Image.new("RGB", (fabric.width, fabric.height + above + below), PAPER)
    sheet.paste(fabric, (0, above))
    return sheet, np.pad(covered, ((above, below), (0, 0)))
