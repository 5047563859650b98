"""A scene as a picture: axonometric, with shadows, by a z-buffer of our own."""

import math
from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw

from evocity.citymap import CityMap
from evocity.errors import MapError, keyword, setting
from evocity.formats import Group
from evocity.formats.solids import ROOF
from evocity.pictures.picture import (
    FAINT,
    INK,
    PAPER,
    drawn_with_key,
    font,
    on_sheet,
    ramp,
    scale_end,
)
from evocity.scene._kernels import fill, light, outlined

#: What walls are drawn in where roofs have the colours of their heights, sRGB.
_WALLS = np.array([236, 230, 220], float)
#: Each pixel of a picture is the mean of so many, squared.
_FINER = 2
#: Side of the picture seen from the sun, px.
_SUN_SIDE = 2048
#: Light where the sun does not reach, and how dark edges are.
_AMBIENT, _EDGE = 0.58, 0.62
#: Share of the width that is left free at each side.
_MARGIN = 0.03
#: No side of a picture is larger, px.
_LARGEST = 8192


def drawn(
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
    """As `Scene.picture`, of the ``groups`` of a ``city``'s scene."""
    _check("width", width, 16, _LARGEST)
    _check("azimuth", azimuth, -math.inf, math.inf)
    _check("tilt", tilt, 1, 90)
    if colours not in ("heights", "classes"):
        raise MapError(f"colours = {colours!r}", "'heights' or 'classes'", "choose one of them")
    _check("sun", sun[0], -math.inf, math.inf)
    _check("sun", sun[1], 1, 90)
    end = scale_end(city) if highest is None else float(highest)
    corners, normals, plane, colour = _surfaces(groups, colours, end)
    towards = _directions(azimuth, tilt)
    flat = corners.reshape(-1, 3) @ towards.T
    low, high = flat[:, :2].min(axis=0), flat[:, :2].max(axis=0)
    scale = width * (1 - 2 * _MARGIN) / max(high[0] - low[0], 1e-9)
    scale = min(scale, _LARGEST * (1 - 2 * _MARGIN) / max(high[1] - low[1], 1e-9))
    margin = width * _MARGIN
    height = max(16, round((high[1] - low[1]) * scale + 2 * margin))
    fine = scale * _FINER
    # world → picture: x right, y down, z towards the viewer
    view = np.diag([fine, -fine, 1.0]) @ towards
    free = (width - (high[0] - low[0]) * scale) / 2
    shift = np.array([(free - low[0] * scale) * _FINER, (margin + high[1] * scale) * _FINER, 0.0])
    facing = normals @ towards[2] > 1e-9
    shape = (height * _FINER, width * _FINER)
    depth, surface = np.full(shape, -np.inf, np.float32), np.full(shape, -1, np.int32)
    fill(corners[facing] @ view.T + shift, depth, surface)
    from_sun = _directions(sun[0] + 180, sun[1])
    steep = np.clip(normals @ from_sun[2], 0, 1)
    lit = np.ones(shape, bool)
    if shadows:
        lit = _lit(corners, normals, depth, surface, (view, shift), from_sun, facing)
    edge = np.zeros(shape, bool)
    outlined(depth, surface, plane[facing], 1.5 / scale, edge)
    strength = _AMBIENT + (1 - _AMBIENT) * 1.15 * steep * 0.9
    shade = _AMBIENT * (0.88 + 0.12 * np.clip(normals @ towards[2], 0, 1))
    bright = np.where(lit, strength[facing][surface], shade[facing][surface]).astype(np.float32)
    bright[edge] *= _EDGE
    painted = colour[facing].astype(np.float32)[surface] * bright[..., None]
    painted[surface < 0] = PAPER
    painted = painted.reshape(height, _FINER, width, _FINER, 3).mean(axis=(1, 3))
    fabric = Image.fromarray(np.clip(np.round(painted), 0, 255).astype(np.uint8))
    if not legend:
        return fabric
    _draw_north(fabric, towards)
    told = f"sun from {sun[0] % 360:.0f}°, {sun[1]:.0f}° high; seen towards {azimuth % 360:.0f}°"
    small = font(max(11, width // 75))
    ImageDraw.Draw(fabric).text((width - 8, height - 8), told, FAINT, small, "rb")
    if colours == "heights":
        return on_sheet(city, fabric, city.name, end, city.metres_per_pixel * scale)
    entries = [
        (tuple(round(255 * c) for c in group.colour), f"{group.name}: {len(group)}")
        for group in groups
        if len(group)
    ]
    return drawn_with_key(city, fabric, city.name, entries, city.metres_per_pixel * scale)


def _check(name: str, value: float, low: float, high: float) -> None:
    if not (isinstance(value, int | float | np.number) and low <= value <= high) or (
        not math.isfinite(value)
    ):
        raise MapError(
            setting(name, value),
            f"a number from {low:g} to {high:g}" if math.isfinite(low) else "degrees",
            f"correct {keyword(name)}, or leave it out",
        )


def _directions(azimuth: float, tilt: float) -> np.ndarray:
    """Rows: to the right, up, and towards who looks along ``azimuth``, degrees clockwise from
    north, down from ``tilt`` degrees above the horizon; x to the east, y to the north, z up."""
    a, t = math.radians(azimuth % 360), math.radians(tilt)
    ahead = np.array([math.sin(a), math.cos(a), 0.0])
    right = np.array([math.cos(a), -math.sin(a), 0.0])
    up = math.cos(t) * np.array([0.0, 0, 1]) + math.sin(t) * ahead
    return np.stack([right, up, math.sin(t) * np.array([0.0, 0, 1]) - math.cos(t) * ahead])


def _surfaces(
    groups: Sequence[Group], colours: str, highest: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """All triangles: corners (t, 3, 3), normals (t, 3), which plane of which solid each is of, and
    their colours (t, 3), 0…255."""
    corners, normals, owners, painted = [], [], [], []
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
        owners.append(mesh.owner.astype(np.int64) + solids)
        painted.append(own)
        solids += len(group)
    normal, owner = np.concatenate(normals), np.concatenate(owners)
    turned = np.round(normal * 16).astype(np.int64) + 16
    key = ((owner * 64 + turned[:, 0]) * 64 + turned[:, 1]) * 64 + turned[:, 2]
    _, plane = np.unique(key, return_inverse=True)
    return np.concatenate(corners), normal, plane.astype(np.int32), np.concatenate(painted)


def _lit(corners, normals, depth, surface, placed, from_sun, facing) -> np.ndarray:
    """Bool ``(H, W)``: where the sun reaches."""
    view, shift = placed
    flat = corners.reshape(-1, 3) @ from_sun.T
    low, high = flat[:, :2].min(axis=0), flat[:, :2].max(axis=0)
    texel = float((high - low).max()) / (_SUN_SIDE - 2)
    to_sun = np.diag([1 / texel, -1 / texel, 1.0]) @ from_sun
    moved = np.array([1 - low[0] / texel, 1 + high[1] / texel, 0.0])
    shape = (math.ceil((high[1] - low[1]) / texel) + 2, math.ceil((high[0] - low[0]) / texel) + 2)
    seen = np.full(shape, -np.inf, np.float32)
    towards = normals @ from_sun[2] > 1e-9
    fill(corners[towards] @ to_sun.T + moved, seen, np.full(shape, -1, np.int32))
    back = np.linalg.inv(view)
    onto = np.column_stack([to_sun @ back, moved - to_sun @ back @ shift])
    steep = np.clip(normals[facing] @ from_sun[2], 0.02, 1)
    # what one pixel from the sun covers of a slope lies at many depths
    bias = texel * (0.2 + 1.5 * np.sqrt(1 - steep**2) / steep)
    lit = np.empty(surface.shape, bool)
    light(depth, surface, onto, seen, bias, lit)
    return lit


def _draw_north(fabric: Image.Image, towards: np.ndarray) -> None:
    """An arrow that points north, as it lies on the ground."""
    size = max(14, fabric.width // 30)
    draw = ImageDraw.Draw(fabric)
    way = np.array([towards[0, 1], -towards[1, 1]])
    side = np.array([towards[0, 0], -towards[1, 0]]) * 0.35
    middle = np.array([2.0 * size, 2.0 * size])
    tip, foot = middle + way * size, middle - way * size
    draw.polygon([tuple(tip), tuple(foot + side * size), tuple(middle - way * size * 0.5)], INK)
    draw.polygon(
        [tuple(tip), tuple(foot - side * size), tuple(middle - way * size * 0.5)], PAPER, INK
    )
    draw.text(tuple(tip + way * size * 0.7), "N", INK, font(size * 0.7), "mm")
