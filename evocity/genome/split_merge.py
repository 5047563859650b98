"""Splits and merges of lifs that keep the decoded map, and genomes laid from pieces of others.

A lifs, seen on a square part of its range block, is a lifs over the part of the domain block that
the isometry brings there. So a range block can be split, and four that continue each other merged
(ours; Marsault 2002 §6.1, 2005 §4.1-4.2 leave partitions that follow the city open).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.errors import GenomeError, check_number
from evocity.genome._kernels import lay_pieces, merge_siblings, order_squares, part_places
from evocity.genome.genome import Genome, checked, derived, descended, sides_text
from evocity.genome.nucleotides import DOMAIN, FIELDS
from evocity.isometries import AFFINE, COMPOSITION, INVERSE
from evocity.pavement import Pavement
from evocity.pavement.pavement import divided, joined_squares

#: The fields that a part of a lifs copies: all but the places of domain block and origin.
_CARRIED = tuple(name for name in FIELDS if name not in (*DOMAIN, "source"))


def split(genome: Genome, side: int, where: np.ndarray | None = None) -> Genome:
    """Split every range block larger than ``side`` px into four, and repeat until no block is
    larger than ``side``. Splitting does not change the decoded map.

    Splitting a range block also splits its domain block. After splitting, a part of a domain block
    may lie farther from its range block than the search allowed by ``reach``.

    Parameters
    ----------
    side : largest side that remains, px, 2 or more.
    where : mask of pixels, bool ``(H, W)``; only range blocks that contain a true pixel are split.
        If ``where`` is None, all range blocks larger than `side` are split.

    Raises
    ------
    GenomeError : halving gives an odd side or a side below 2 px, or the mask ``where`` differs from
        the map in size.
    """
    p = genome.pavement
    expected, remedy = "a whole number of pixels, 2 or more", "choose a side, for example 2"
    check_number("side", side, 2, np.inf, expected, GenomeError, remedy, whole=True)
    if where is not None and (np.shape(where) != (p.height, p.width)):
        raise GenomeError(
            f"the array in the parameter 'where' has the shape {np.shape(where)}",
            f"an array of booleans of the shape ({p.height}, {p.width}), one per pixel of the map",
            "give a mask of the map's size, or leave the parameter 'where' out",
        )
    where = np.ones((p.height, p.width), bool) if where is None else np.asarray(where, bool)
    pavement, lifs = divided(p, where, int(side))
    if isinstance(pavement, int):
        raise GenomeError(
            f"range blocks of {pavement} px cannot be split into blocks of {side} px",
            f"range blocks whose sides give {side} px by repeated halving",
            "choose a side that the range blocks reach by repeated halving",
        )
    if pavement is p:
        return genome
    return _taken(genome, pavement, lifs)


def refined(genome: Genome, pavement: Pavement) -> Genome:
    """Split a genome's range blocks into the smaller range blocks of ``pavement``; the decoded map
    stays the same. Raises `GenomeError` unless each range block of the pavement lies inside a range
    block of the genome."""
    p = genome.pavement
    if pavement == p:
        return genome
    fits = (p.height, p.width) == (pavement.height, pavement.width)
    if fits:
        top, left = pavement.corners
        lifs = p.index[top, left]
        down, along = top - p.corners[0][lifs], left - p.corners[1][lifs]
        fits = (np.maximum(down, along) + pavement.side <= p.side[lifs]).all()
    if not fits:
        raise GenomeError(
            f"{pavement!r} does not fit a genome with {p!r}",
            "a pavement (tiling by range blocks) that subdivides the genome's range blocks",
            "make the pavement with evocity.pavement.common_refinement",
        )
    return _taken(genome, pavement, lifs)


def _taken(genome: Genome, pavement: Pavement, lifs: np.ndarray) -> Genome:
    """Make the genome whose range blocks are parts of the ``lifs`` of another."""
    down, along = (
        corner - whole[lifs]
        for corner, whole in zip(pavement.corners, genome.pavement.corners, strict=True)
    )
    return derived(genome, pavement=pavement, **_part(genome, lifs, down, along, pavement.side))


def merged(genome: Genome, most: int | None = None) -> Genome:
    """Merge four lifs into one wherever the decoded map stays the same.

    Four range blocks become one block of twice the side if their domain blocks form one square. The
    places of the four range blocks in the source city must form one square. Merging repeats until
    no four range blocks can merge.

    most : largest side of a merged range block, px; None means the largest side in the genome. The
        corner of a merged range block lies at a multiple of the block's side, as in a quadtree.
    """
    p = genome.pavement
    most = p.coarsest if most is None else int(most)
    if p.finest * 2 > most:
        return genome
    side, alive = p.side.copy(), np.ones(len(p), bool)
    bits = [getattr(genome, name).view(np.int32) for name in ("sigma", "beta", "part")]
    changed = {name: getattr(genome, name).copy() for name in (*DOMAIN, "source")}
    domain = [changed[name] for name in DOMAIN]
    if not merge_siblings(
        *p.corners, side, p.index, most, *bits, genome.parent, genome.other, *domain, genome.iso,
        changed["source"], genome.turn, AFFINE, alive,
    ):  # fmt: skip
        return genome
    columns = {name: getattr(genome, name)[alive] for name in _CARRIED}
    columns |= {name: values[alive] for name, values in changed.items()}
    top, left = (corner[alive] for corner in p.corners)
    return derived(
        genome, pavement=joined_squares(p.height, p.width, top, left, side[alive]), **columns
    )


@dataclass(frozen=True, eq=False)
class Pieces:
    """Grid of cells for a new genome; each cell copies a cell of an existing genome by an isometry.

    cell : side of a cell, px.
    whose : number of the genome that each cell comes from, ``(R, C)`` for R rows and C columns of
        cells.
    row, column : row and column of each copied cell in the existing genome, ``(R, C)``.
    iso : number of the isometry that turns or mirrors each copied cell, ``(R, C)``.
    """

    cell: int
    whose: np.ndarray
    row: np.ndarray
    column: np.ndarray
    iso: np.ndarray

    @classmethod
    def in_place(cls, whose: np.ndarray, cell: int) -> "Pieces":
        """Make a grid in which each cell copies the cell at the same row and column; ``whose``
        ``(R, C)`` is the number of the genome for each cell."""
        row, column = np.indices(np.shape(whose))
        return cls(cell, np.asarray(whose), row, column, np.zeros(np.shape(whose), np.uint8))


@dataclass(frozen=True, eq=False)
class Layout:
    """A genome laid from `Pieces`, and for each lifs its genome and its number in that, ``(n,)``
    each."""

    genome: Genome
    whose: np.ndarray
    lifs: np.ndarray


def laid(genomes: Sequence[Genome], pieces: Pieces, *, carried: bool = False) -> Layout:
    """Make a genome from the cells in ``pieces``, which come from several ``genomes``. The range
    blocks of the new genome are the largest squares that copy a part of a single lifs. A range
    block of an existing genome is split only if a border between two copied cells crosses the
    block.

    By default, a domain block keeps its place on the map; only the isometry of the lifs that reads
    the domain block changes. If ``carried`` is true, a domain block moves and turns together with
    its range block. A domain block that would extend beyond the map is shifted into the map.

    The new map has the size of the grid of cells. The function `descended` lists the fields that
    the new genome inherits, apart from its lifs. Raises `GenomeError` if repeated halving of range
    blocks gives no edges along the borders between cells.
    """
    cell, (rows, columns) = pieces.cell, pieces.whose.shape
    height, width = rows * cell, columns * cell
    pavements = [genome.pavement for genome in genomes]
    starts = np.cumsum([0, *map(len, pavements)])
    top, left = map(np.concatenate, zip(*(p.corners for p in pavements), strict=True))
    side = np.concatenate([p.side for p in pavements])
    index = np.zeros(
        (len(pavements), *np.max([p.index.shape for p in pavements], axis=0)), np.int32
    )
    for numbers, p in zip(index, pavements, strict=True):
        numbers[: p.height, : p.width] = p.index
    grids = [
        np.ascontiguousarray(grid, np.int64)
        for grid in (pieces.whose, pieces.row, pieces.column, pieces.iso)
    ]
    root = max(p.coarsest for p in pavements)
    room = 2 * max(map(len, pavements)) * max(1, height * width // index[0].size) + 1024
    while True:
        squares = np.empty((8, room), np.int64)
        count = lay_pieces(
            *grids, cell, root, height, width, starts, index, top, left, side, AFFINE, squares
        )
        if count <= room:
            break
        room = count
    if count < 0:
        raise GenomeError(
            "range blocks of " + " and ".join(map(sides_text, pavements)) + " px in one map",
            "sides that halve to one another, 4 and 2, not 6 and 4, each at a multiple of itself",
            "encode the maps with the same sides",
        )
    found, squares = squares, np.empty((8, count), np.int64)
    drawn = np.empty((height, width), np.int32)
    order_squares(found, squares, drawn)
    pavement = _reuse_pavement(squares[:3].astype(np.int32), drawn, pavements)
    whose, lifs, iso = squares[3], squares[4], squares[7].astype(np.uint8)
    pointers, common = descended(genomes)
    columns = {}
    for g, (genome, pointer) in enumerate(zip(genomes, pointers, strict=True)):
        (mine,) = np.nonzero(whose == g)
        if not mine.size:
            continue
        part = _part(genome, lifs[mine], *squares[[5, 6, 2]][:, mine])
        part |= {name: values[lifs[mine]] for name, values in pointer.items()}
        for name, values in part.items():
            columns.setdefault(name, np.zeros(count, values.dtype))[mine] = values
    if iso.any() or carried:
        columns |= _turn_columns(columns, squares, pavement, pavements, iso, carried)
    changes = {"pavement": pavement, **columns, **common}
    if common["cities"] == genomes[0].cities:
        roofs = common["roofs"]
        changes["roofs"] = {city: roofs[city] for city in common["cities"] if city in roofs}
        child = checked(derived(genomes[0], **changes))  # these arrays are new
    else:
        child = genomes[0].replace(**changes)
    return Layout(child, whose, lifs)


def _reuse_pavement(squares: np.ndarray, index: np.ndarray, known: Sequence[Pavement]) -> Pavement:
    """Return the pavement of the ``squares``, int32 ``(3, n)``: top, left, side, with this
    ``index``; an equal one of the ``known`` before a new one."""
    for p in known:
        if (p.height, p.width) == index.shape and np.array_equal(p.side, squares[2]):
            return p
    top, left, side = (row.copy() for row in squares)
    return Pavement._of_squares(top, left, side, index)


def _part(genome: Genome, lifs, down, along, side) -> dict[str, np.ndarray]:
    """Compute the fields of lifs for the squares of ``side`` px at (down, along) in the range
    blocks ``lifs``; they lay what the whole range blocks lay there."""
    fields = {name: getattr(genome, name)[lifs] for name in _CARRIED}
    places = {"source": np.empty(lifs.size, np.int32)}
    places |= {name: np.empty(lifs.size, np.int16) for name in ("y", "x", "dy", "dx")}
    whole = [getattr(genome, name) for name in ("iso", "turn", *places)]
    part_places(lifs, down, along, side, genome.pavement.side, *whole, AFFINE, *places.values())
    return fields | places


def _turn_columns(columns, squares, pavement: Pavement, pavements, iso, carried: bool) -> dict:
    """Compute the ``columns`` that change where pieces turn, or carry their domain blocks."""
    has = columns["dx"] > 0
    turned = {"turn": COMPOSITION[iso, columns["turn"]]}  # first the piece's own turn, then iso
    composed = COMPOSITION[iso, columns["iso"]]
    if not carried:
        return turned | {"iso": np.where(has, composed, columns["iso"])}
    whose, lifs, side = squares[3], squares[4], squares[2]
    a = AFFINE[iso].T
    starts = np.cumsum([0, *map(len, pavements)])
    own = [np.concatenate([p.corners[k] for p in pavements])[starts[whose] + lifs] for k in (0, 1)]
    # from the source's pixel that the target's north-west one shows, to the domain's two ends
    from_y, from_x = (own[k] + squares[5 + k] + a[k] * (side - 1) for k in (0, 1))
    tall, wide = columns["dy"].astype(np.int64), columns["dx"].astype(np.int64)
    near_y, near_x = columns["y"] - from_y, columns["x"] - from_x
    far_y, far_x = near_y + tall - 1, near_x + wide - 1
    y = squares[0] + np.minimum(near_y * a[2] + near_x * a[3], far_y * a[2] + far_x * a[3])
    x = squares[1] + np.minimum(near_y * a[4] + near_x * a[5], far_y * a[4] + far_x * a[5])
    swapped = a[2] == 0
    # on a map that is not square, an extent may fit along one side only
    dy = np.minimum(np.where(swapped, wide, tall), pavement.height)
    dx = np.minimum(np.where(swapped, tall, wide), pavement.width)
    turned["iso"] = np.where(has, COMPOSITION[composed, INVERSE[iso]], 0)
    for name, corner, extent, end in (("y", y, dy, pavement.height), ("x", x, dx, pavement.width)):
        turned[name] = np.where(has, np.clip(corner, 0, end - extent), 0).astype(np.int16)
    return turned | {"dy": dy.astype(np.int16), "dx": dx.astype(np.int16)}
