"""Draws the pictures of docs/papers.md that stand beside the papers' figures.

Run it with the Python that has evocity installed: python docs/sheets/papers.py [NAME]...
The names are those of the pictures in docs/images/papers, without their suffix.
"""

import sys
from collections.abc import Callable

import numpy as np
from _sheet import IMAGES, contact_sheet, save
from PIL import Image, ImageDraw
from shapes import reeds

import evocity
from evocity import CityMap, Genome
from evocity.coding import autosimilarity_maps
from evocity.operators import make
from evocity.pictures.colours import INK, PAPER
from evocity.pictures.picture import render, render_classes
from evocity.shapes import (
    Curve,
    Primitive,
    Shape,
    coloured_as,
    known,
    motif_picture,
    palette,
    picture_of,
    position_colours,
    tinted,
    wire,
)
from evocity.towns import chessboard_town, concentric_town, substitution_town

SIDE = 220
LYON, MONTPELLIER, NEW_YORK = "lyon-1er", "montpellier-pas-du-loup", "new-york-west-village"
#: Six base colours, as in figure 7 of Tosan and others: each of 16 squares has one.
SIX = np.array([[0.75, 0.2, 0.15], [0.95, 0.75, 0.25], [0.2, 0.45, 0.3],
                [0.15, 0.3, 0.55], [0.95, 0.93, 0.85], [0.45, 0.2, 0.4]])  # fmt: skip


def flat(city: CityMap) -> Image.Image:
    return fitted(render(city, highest=40, legend=False))


def solid(city: CityMap) -> Image.Image:
    scene = evocity.scene(city)
    return fitted(scene.picture(width=2 * SIDE, tilt=42, highest=40, legend=False))


def fitted(picture: Image.Image) -> Image.Image:
    """Fit a picture into a square of `SIDE` px; whole pixels of small pictures grow first."""
    larger = max(1, round(2 * SIDE / max(picture.size)))
    small = picture.convert("RGB").resize((picture.width * larger, picture.height * larger), 0)
    small.thumbnail((SIDE, SIDE))
    square = Image.new("RGB", (SIDE, SIDE), PAPER)
    square.paste(small, ((SIDE - small.width) // 2, (SIDE - small.height) // 2))
    return square


def drawn(shape: Shape, **more) -> Image.Image:
    return fitted(picture_of(shape, side=2 * SIDE, **more))


def thanks(*names: str) -> list[str]:
    return [f"{name}: {evocity.io.attribution_of(name)}" for name in names]


def coded(city: CityMap, block: int) -> Genome:
    return evocity.encode(city, block=block, reach=None).genome


# -- Marsault 2002 and 2005 -------------------------------------------------------------------


def substitution() -> Image.Image:
    row = [
        ("original" if n == 1 else f"iteration {n - 1}", flat(substitution_town(iterations=n)))
        for n in (1, 2, 3, 4)
    ]
    return contact_sheet([row])


def autosimilarity() -> Image.Image:
    city = evocity.read_map(LYON, pixels=128)
    row = [("part of Lyon", flat(city))]
    for block in (5, 7, 8):
        values = autosimilarity_maps(city, block=block, domains=[20]).least
        grey = np.round(255 * np.clip(values / 0.02, 0, 1)).astype(np.uint8)
        row.append((f"µ, B = {block}, D = 20", fitted(Image.fromarray(grey).resize((256, 256)))))
    return contact_sheet([row], thanks=thanks(LYON), text=13)


def interpolation() -> Image.Image:
    names = (LYON, MONTPELLIER)
    parents = [coded(evocity.read_map(name, pixels=128), 4) for name in names]
    row = []
    for share in (0.15, 0.35, 0.5, 0.75):
        child = make("interpolation", share=share)(parents, np.random.default_rng(1))
        row.append((f"λ = {share:.2f}", solid(evocity.decode(child).city)))
    return contact_sheet([row], thanks=thanks(*names))


def asymmetric() -> Image.Image:
    towns = [
        make_town(128, rng=np.random.default_rng(7))
        for make_town in (concentric_town, chessboard_town)
    ]
    rows = [[("town A", solid(towns[0])), ("town B", solid(towns[1]))]]
    for block in (4, 8):
        parents = [coded(town, block) for town in towns]
        for names, pair in (("A mod B", parents), ("B mod A", parents[::-1])):
            child = make("asymmetric_fusion")(pair, np.random.default_rng(1))
            title = f"{names}, B = {block}, D = {2 * block}"
            rows[-1].append((title, solid(evocity.decode(child).city)))
    return contact_sheet([rows[0][:3], rows[0][3:]])


def pavement() -> Image.Image:
    names = (NEW_YORK, MONTPELLIER)
    cities = [evocity.read_map(name, pixels=128) for name in names]
    parents = [evocity.encode(city).genome for city in cities]
    fuse = make("pavement_fusion", side_min=16, side_max=64, fill=0.5)
    child = fuse(parents, np.random.default_rng(7))
    pictures = [*cities, evocity.decode(child).city]
    titles = ("first city", "second city", "their fusion")
    row = [(title, solid(city)) for title, city in zip(titles, pictures, strict=True)]
    return contact_sheet([row], thanks=thanks(*names))


def zoom() -> Image.Image:
    """Two buildings of a raw attractor, with fractal roofs."""
    city = evocity.read_map(MONTPELLIER, pixels=48)
    code = evocity.encode(city, block=4, reach=None).genome
    row = []
    for z in (1, 2, 4):
        heights = evocity.decode(code, zoom=z, settle=False).city.heights
        part = CityMap(heights[: 16 * z, 20 * z : 36 * z], city.metres_per_pixel / z)
        row.append((f"zoom {z}", fitted(render(part, highest=14, legend=False))))
    return contact_sheet([row], thanks=thanks(MONTPELLIER))


def classes() -> Image.Image:
    """A drawn garden at half a metre a pixel, by heights and by classes."""
    heights = np.zeros((120, 120), np.float32)
    y, x = np.mgrid[:120, :120]
    for top, left, tall, wide, metres in (
        *((8, 8, 24, 40, 7.0), (8, 60, 30, 24, 6.0), (90, 10, 8, 10, 2.6)),
        *((60, 100, 2, 2, 5.0), (80, 100, 2, 2, 5.0), (50, 20, 3, 8, 0.9), (100, 60, 14, 40, 0.3)),
    ):
        heights[top : top + tall, left : left + wide] = metres
    for middle, radius, metres in (((70, 55), 10, 1.0), ((45, 75), 5, 8.0), ((75, 25), 6, 9.0)):
        heights[np.hypot(y - middle[0], x - middle[1]) <= radius] = metres
    city = CityMap(heights, 0.5, name="a drawn garden")
    row = [("heights", fitted(render(city, highest=10, legend=False)))]
    row.append(("classes", fitted(render_classes(city, legend=False))))
    return contact_sheet([row])


def outlines() -> Image.Image:
    """One building of a raw attractor: its pixels, their outline, and its straight walls."""
    code = evocity.encode(evocity.read_map(MONTPELLIER, pixels=128)).genome
    city = evocity.decode(code).city
    number = int(np.argmax(city.buildings.area)) + 1
    rows, columns = np.nonzero(city.buildings.labels == number)
    top, left = rows.min() - 2, columns.min() - 2
    factor = SIDE / (max(np.ptp(rows), np.ptp(columns)) + 5)
    pixel = city.metres_per_pixel
    west, north = city.origin

    def outlined(polygon, filled: bool) -> Image.Image:
        picture = Image.new("RGB", (SIDE, SIDE), PAPER)
        brush = ImageDraw.Draw(picture)
        for inner, ring in enumerate((polygon.exterior, *polygon.interiors)):
            points = [
                (((x - west) / pixel - left) * factor, ((north - y) / pixel - top) * factor)
                for x, y in ring.coords
            ]
            brush.polygon(points, INK if filled and not inner else PAPER, INK)
        return picture

    raw = city.outline[number - 1]
    walls = city.walled(detail=0.0, relative=0.05).polygons[number - 1]
    count = len(walls.exterior.coords) - 1
    row = [
        ("a building of pixels", outlined(raw, True)),
        (f"outline, {len(raw.exterior.coords) - 1} corners", outlined(raw, False)),
        (f"tolerance 1/20, {count} corners", outlined(walls, False)),
    ]
    return contact_sheet([row], thanks=thanks(MONTPELLIER))


def streets() -> Image.Image:
    city = evocity.read_map(NEW_YORK, pixels=160)
    graph = city.street_graph
    factor = SIDE / 160
    lines = flat(city)
    brush = ImageDraw.Draw(lines)
    pixel = city.metres_per_pixel
    left, top = city.origin
    for edge in graph.edges:
        x, y = np.array(edge.coords).T
        points = np.column_stack([(x - left) / pixel * factor, (top - y) / pixel * factor])
        brush.line([tuple(point) for point in points], (176, 64, 63), 2)
    widths = np.nan_to_num(np.asarray(graph.width_map, float))
    grey = np.round(255 * np.clip(widths / 40, 0, 1)).astype(np.uint8)
    row = [
        ("the map", flat(city)),
        ("open skeleton", lines),
        ("widths, 0 to 40 m", fitted(Image.fromarray(grey).resize((320, 320), 0))),
    ]
    return contact_sheet([row], thanks=thanks(NEW_YORK))


# -- Tosan and others 2005 --------------------------------------------------------------------


def frames() -> Image.Image:
    nine = [((x / 3, y / 3), (1 / 3, 0), (0, 1 / 3)) for x in range(3) for y in range(3)]
    shape = Shape.from_frames([frame for k, frame in enumerate(nine) if k != 4], primitive="square")
    return contact_sheet([[(f"T^{n} K", drawn(shape, depth=n)) for n in (1, 2, 3)]])


def wires() -> Image.Image:
    rows = []
    for title, lift in (("a wire form", 0.3), ("one point moved", 0.45)):
        points = [(0, 0), (0.35, 0), (0.35 + lift / 3, lift), (0.65, 0), (1, 0)]
        shape = wire(points)
        box = np.array([[-0.1, -0.35], [1.1, 0.85]])
        rows.append([(f"{title}, n = {n}", drawn(shape, depth=n, box=box)) for n in (1, 2, 6)])
    return contact_sheet(rows)


def sixteen() -> Shape:
    numbers = np.array([[0, 1, 4, 2], [3, 5, 1, 0], [4, 2, 3, 1], [5, 0, 2, 4]])
    return palette(SIX[numbers])


def spread(turn: float, size: float) -> Shape:
    maps = []
    for i in range(4):
        for j in range(4):
            c, s = size * np.cos(turn * (i - j)), size * np.sin(turn * (i - j))
            maps.append([[c, -s, i / 4 + s / 2], [s, c, j / 4 - s / 2]])
    return coloured_as(Shape(maps, "square"), sixteen())


def palettes() -> Image.Image:
    pieces = [(f"palette, n = {n}", drawn(sixteen(), depth=n)) for n in (1, 2, 3)]
    white = [("n = 1, from white", drawn(tinted(sixteen(), (1, 1, 1), 1), depth=1))]
    return contact_sheet([pieces + white])


def compositions() -> Image.Image:
    row = [
        ("sketch", drawn(sixteen(), depth=1)),
        ("composition 1", drawn(spread(0.25, 0.34), depth=2)),
        ("composition 2", drawn(spread(-0.6, 0.4), depth=2)),
    ]
    return contact_sheet([row])


def motifs() -> Image.Image:
    at = np.linspace(0, 2 * np.pi, 25)[:-1]
    disc = Primitive.polygon(0.5 + 0.45 * np.column_stack([np.cos(at), np.sin(at)]))
    three = [[[0.55, 0, x], [0, 0.55, y]] for x, y in ((0, 0), (0.45, 0), (0.22, 0.45))]
    mixed = motif_picture(Shape(three, colours=SIX[:3]), [disc, "square", disc], 3, 2 * SIDE)
    row = [
        ("discs", drawn(Shape(three, disc, None, SIX[:3]), depth=3)),
        ("squares", drawn(Shape(three, "square", None, SIX[[3, 1, 2]]), depth=3)),
        ("discs and squares", fitted(mixed)),
        ("blades", drawn(reeds(), depth=3)),
    ]
    return contact_sheet([row])


def positions() -> Image.Image:
    """Menger's sponge in parallel projection: three visible faces of each cube."""
    shape = known("menger")
    pieces = shape.pieces(2)
    middles = pieces.maps[:, :, :3] @ np.full(3, 0.5) + pieces.maps[:, :, 3]
    colours = position_colours(shape, middles)
    picture = Image.new("RGB", (2 * SIDE, 2 * SIDE), PAPER)
    brush, size = ImageDraw.Draw(picture), pieces.maps[0, 0, 0]
    scale = 0.95 * SIDE

    def place(x: float, y: float, z: float) -> tuple[float, float]:
        return SIDE + scale * 0.87 * (x - y), SIDE - scale * (0.5 * (2 - x - y) + z - 1)

    for k in np.argsort(middles @ np.array([1.0, 1.0, 1.0]), kind="stable"):
        x, y, z = middles[k] - size / 2
        a, b, c = x + size, y + size, z + size
        sides = (
            (1.0, [(x, y, c), (a, y, c), (a, b, c), (x, b, c)]),
            (0.8, [(a, y, z), (a, b, z), (a, b, c), (a, y, c)]),
            (0.6, [(x, b, z), (a, b, z), (a, b, c), (x, b, c)]),
        )
        for light, corners in sides:
            colour = tuple(np.round(255 * light * colours[k]).astype(int))
            brush.polygon([place(*corner) for corner in corners], colour)
    return contact_sheet([[("red x, green y, blue z", fitted(picture))]])


# -- Hnaidi and others ------------------------------------------------------------------------


def projected() -> Image.Image:
    turned = []
    for turn, size, x, y in (
        (0.5, 0.55, 0.1, 0),
        (-0.4, 0.5, 0.5, 0.3),
        (0, 0.45, 0, 0.5),
        (0.9, 0.4, 0.7, 0),
    ):
        c, s = size * np.cos(turn), size * np.sin(turn)
        turned.append([[c, -s, x], [s, c, y]])
    rough = Curve(
        [(0, 0), (15, 40), (45, 45), (60, 0)],
        [
            [[1, 0.5, 0.2, 0.1], [0, 0.6, 0.5, 0.3], [0, -0.1, 0.4, 0.5], [0, 0, -0.1, 0.1]],
            [[0.1, -0.1, 0, 0], [0.3, 0.4, -0.1, 0], [0.5, 0.5, 0.6, 0], [0.1, 0.2, 0.5, 1]],
        ],
    )
    picture = Image.new("RGB", (SIDE, SIDE), PAPER)
    brush = ImageDraw.Draw(picture)
    for points, colour, width in ((rough.points, (176, 64, 63), 1), (rough.line(depth=9), INK, 2)):
        at = [(20 + 3 * x, 190 - 3 * y) for x, y in points]
        brush.line(at, colour, width)
    row = [("four affine maps", drawn(Shape(turned))), ("four control points, two maps", picture)]
    return contact_sheet([row], text=13)


PICTURES: dict[str, Callable[[], Image.Image]] = {
    one.__name__: one
    for one in (
        *(substitution, autosimilarity, interpolation, asymmetric, pavement, zoom, classes),
        *(outlines, streets, frames, wires, palettes, compositions, motifs, positions, projected),
    )
}


def main(names: list[str]) -> None:
    (IMAGES / "papers").mkdir(exist_ok=True)
    for name in names or PICTURES:
        save(PICTURES[name](), f"papers/{name}.png", colours=64)


if __name__ == "__main__":
    main(sys.argv[1:])
