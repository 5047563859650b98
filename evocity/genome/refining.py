"""Lifs split and merged without change, and genomes laid of pieces of others.

A lifs that lays a domain block of k times its range block's side is, on any square part of the
range block, a lifs over the part of the domain block that the isometry brings there. So range
blocks can be split, and merged again where four of them continue each other, in domain block and in
provenance, and decode to the same map (ours; the papers leave partitions that follow the city
open: Marsault 2002 §6.1, 2005 §4.1-4.2).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.errors import GenomeError, shown
from evocity.genome._kernels import lay_pieces, merge_siblings, part_places
from evocity.genome.descent import descended
from evocity.genome.genome import Genome
from evocity.genome.nucleotides import DOMAIN, FIELDS, packed, unpacked
from evocity.isometries import AFFINE, COMPOSITION, INVERSE
from evocity.pavement import Pavement, touched

#: Fields that a part of a lifs has from the whole: all but the places of domain block and stone.
_CARRIED = tuple(name for name in FIELDS if name not in (*DOMAIN, "source"))


def split(genome: Genome, side: int, where: np.ndarray | None = None) -> Genome:
    """The same code with every range block of more than ``side`` px split, by halves, until it has
    at most that side. It decodes to the same map.

    A domain block is split with its range block, so its corner can come to lie farther from the
    range block's than the ``reach`` the code was searched with.

    Parameters
    ----------
    side : px, 2 or more.
    where : bool ``(H, W)``; only range blocks that touch a true pixel are split. None for all.

    Raises
    ------
    GenomeError : a range block cannot be halved so far without going below 2 px or to an odd
        side; ``where`` is not of the map's size.
    """
    p = genome.pavement
    if not isinstance(side, int | np.integer) or isinstance(side, bool) or side < 2:
        raise GenomeError(f"side = {shown(side)}", "a side in px, 2 or more", "use for example 2")
    if where is not None and (np.shape(where) != (p.height, p.width)):
        raise GenomeError(
            f"where of shape {np.shape(where)}",
            f"bool ({p.height}, {p.width}), one a pixel of the map",
            "give a mask of the map's size, or leave it out",
        )
    top, left, sides = *p.corners, p.side
    where = where if where is None else np.asarray(where, bool)
    while (wide := sides > side).any():
        if where is not None:
            wide &= touched(where, top, left, sides)
            if not wide.any():
                break
        if (sides[wide] % 2).any() or (sides[wide] < 4).any():
            raise GenomeError(
                f"range blocks of {int(sides[wide].max())} px to be split to {side} px",
                "sides that halving brings to the one asked for",
                "ask for a side that the range blocks' can be halved to",
            )
        top, left, sides = _quartered(top, left, sides, wide)
    if sides.size == p.side.size:
        return genome
    order = np.argsort(top * p.width + left)
    return refined(genome, Pavement(p.height, p.width, sides[order]))


def refined(genome: Genome, pavement: Pavement) -> Genome:
    """The same code on a finer ``pavement``, each of whose range blocks lies in one of the
    genome's. Raises `GenomeError` if one does not."""
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
            f"{pavement!r} for a genome on {p!r}",
            "a refinement of the genome's own pavement",
            "see evocity.pavement.common_refinement",
        )
    return genome.replace(pavement=pavement, **_part(genome, lifs, down, along, pavement.side))


def merged(genome: Genome, most: int | None = None) -> Genome:
    """The same code with fewest lifs: four range blocks that make up one of twice the side, and
    continue each other in domain block and provenance, become that one, again and again. It
    decodes to the same map.

    ``most`` : the largest side to merge to, px; None for the genome's own coarsest. Range blocks
    are merged where their quadtree has them, at multiples of twice their side.
    """
    p = genome.pavement
    most = p.coarsest if most is None else int(most)
    if p.finest * 2 > most:
        return genome
    top, left, side = p.corners[0].copy(), p.corners[1].copy(), p.side.copy()
    row, column = unpacked(genome.source)
    numbers = np.stack(
        [*(getattr(genome, name) for name in DOMAIN), genome.iso, row, column, genome.turn]
    ).astype(np.int64)
    same = np.stack(
        [
            *(getattr(genome, name).view(np.int32) for name in ("sigma", "beta", "part")),
            genome.parent.astype(np.int32),
            genome.other.astype(np.int32),
        ]
    )
    alive = np.ones(side.size, bool)
    if not merge_siblings(top, left, side, p.index, most, same, numbers, AFFINE, alive):
        return genome
    kept = {name: getattr(genome, name)[alive] for name in _CARRIED}
    kept |= dict(zip(DOMAIN, numbers[:4, alive], strict=True))
    return genome.replace(
        pavement=Pavement(p.height, p.width, side[alive]),
        **kept,
        source=packed(*numbers[5:7, alive]),
    )


@dataclass(frozen=True, eq=False)
class Pieces:
    """What stands in each cell of a grid: a cell of one of several genomes, turned or not.

    cell : side of the cells, px.
    whose : ``(R, C)``, which genome.
    row, column : ``(R, C)``, which of its cells.
    iso : ``(R, C)``, the isometry under which it is laid.
    """

    cell: int
    whose: np.ndarray
    row: np.ndarray
    column: np.ndarray
    iso: np.ndarray

    @classmethod
    def in_place(cls, whose: np.ndarray, cell: int) -> "Pieces":
        """Each cell of the genome ``whose`` (R, C) where it stands in that."""
        row, column = np.indices(np.shape(whose))
        return cls(cell, np.asarray(whose), row, column, np.zeros(np.shape(whose), np.uint8))


@dataclass(frozen=True, eq=False)
class Laid:
    """A genome laid of `Pieces`, and where its lifs come from, ``(n,)`` each: of which genome,
    which of its lifs."""

    genome: Genome
    whose: np.ndarray
    lifs: np.ndarray


def laid(genomes: Sequence[Genome], pieces: Pieces, *, carried: bool = False) -> Laid:
    """The genome that has in each cell what ``pieces`` say: the largest squares that show a part
    of one lifs of one genome each. So range blocks are split only where a border of pieces runs.

    Domain blocks stay where they lie, and an isometry is composed into the lifs'. Where
    ``carried``, a domain block keeps its place beside its range block instead, and is turned with
    it; moved inside the map if it would reach beyond.

    The map has the size of the grid of pieces. The genome lies where the first genome does, and
    has the cities, attribution, cap and settling of all. Raises `GenomeError` where range blocks
    cannot be halved to what a border asks for.
    """
    cell, (rows, columns) = pieces.cell, pieces.whose.shape
    height, width = rows * cell, columns * cell
    pavements = [genome.pavement for genome in genomes]
    starts = np.cumsum([0, *map(len, pavements)])
    top, left = (np.concatenate(each) for each in zip(*(p.corners for p in pavements), strict=True))
    side = np.concatenate([p.side for p in pavements])
    index = np.zeros(
        (len(pavements), *np.max([p.index.shape for p in pavements], axis=0)), np.int32
    )
    for one, p in zip(index, pavements, strict=True):
        one[: p.height, : p.width] = p.index
    grids = [
        np.ascontiguousarray(one, np.int64)
        for one in (pieces.whose, pieces.row, pieces.column, pieces.iso)
    ]
    root = max(p.coarsest for p in pavements)
    room = 2 * max(map(len, pavements)) * max(1, height * width // index[0].size) + 1024
    while True:
        found = np.empty((8, room), np.int64)
        count = lay_pieces(
            *grids, cell, root, height, width, starts, index, top, left, side, AFFINE, found
        )
        if count <= room:
            break
        room = count
    if count < 0:
        raise GenomeError(
            "range blocks of " + " and ".join(_told(p) for p in pavements) + " px in one map",
            "sides that halve to one another, 4 and 2, not 6 and 4, each at a multiple of itself",
            "encode the maps with the same sides",
        )
    found = found[:, :count]
    found = found[:, np.argsort(found[0] * width + found[1])]
    pavement = _paved(height, width, found[2], pavements)
    whose, lifs, iso = found[3], found[4], found[7].astype(np.uint8)
    pointers, common = descended(genomes)
    columns = {}
    for g, (genome, pointer) in enumerate(zip(genomes, pointers, strict=True)):
        (mine,) = np.nonzero(whose == g)
        if not mine.size:
            continue
        part = _part(genome, lifs[mine], found[5, mine], found[6, mine], found[2, mine])
        part |= {name: values[lifs[mine]] for name, values in pointer.items()}
        for name, values in part.items():
            columns.setdefault(name, np.zeros(count, values.dtype))[mine] = values
    if iso.any() or carried:
        columns |= _laid_turned(columns, found, pavement, pavements, iso, carried)
    child = genomes[0].replace(pavement=pavement, **columns, **common)
    return Laid(child, whose, lifs)


def _paved(height: int, width: int, side: np.ndarray, known: Sequence[Pavement]) -> Pavement:
    """The pavement of range blocks of these sides; one of the ``known`` if that is it."""
    for one in known:
        if (one.height, one.width) == (height, width) and np.array_equal(one.side, side):
            return one
    return Pavement(height, width, side)


def _part(genome: Genome, lifs, down, along, side) -> dict[str, np.ndarray]:
    """The fields of lifs that lay the squares of ``side`` px at (down, along) of the range blocks
    ``lifs``, as these lay them."""
    fields = {name: getattr(genome, name)[lifs] for name in _CARRIED}
    places = {"source": np.empty(lifs.size, np.int32)}
    places |= {name: np.empty(lifs.size, np.int16) for name in ("y", "x", "dy", "dx")}
    whole = [getattr(genome, name) for name in ("iso", "turn", *places)]
    part_places(lifs, down, along, side, genome.pavement.side, *whole, AFFINE, *places.values())
    return fields | places


def _laid_turned(columns, found, pavement: Pavement, pavements, iso, carried: bool) -> dict:
    """What of the ``columns`` changes where pieces are turned, or domain blocks are carried."""
    has = columns["dx"] > 0
    turned = {"turn": COMPOSITION[iso, columns["turn"]]}  # as the stones lay, then turned
    composed = COMPOSITION[iso, columns["iso"]]
    if not carried:
        return turned | {"iso": np.where(has, composed, columns["iso"])}
    whose, lifs, side = found[3], found[4], found[2]
    a = AFFINE[iso].T
    starts = np.cumsum([0, *map(len, pavements)])
    own = [np.concatenate([p.corners[k] for p in pavements])[starts[whose] + lifs] for k in (0, 1)]
    # from the source's pixel that the target's north-west one shows, to the domain's two ends
    from_y, from_x = (own[k] + found[5 + k] + a[k] * (side - 1) for k in (0, 1))
    tall, wide = columns["dy"].astype(np.int64), columns["dx"].astype(np.int64)
    near_y, near_x = columns["y"] - from_y, columns["x"] - from_x
    far_y, far_x = near_y + tall - 1, near_x + wide - 1
    y = found[0] + np.minimum(near_y * a[2] + near_x * a[3], far_y * a[2] + far_x * a[3])
    x = found[1] + np.minimum(near_y * a[4] + near_x * a[5], far_y * a[4] + far_x * a[5])
    swapped = a[2] == 0
    # of a map that is not square, what fits along one side may not along the other
    dy = np.minimum(np.where(swapped, wide, tall), pavement.height)
    dx = np.minimum(np.where(swapped, tall, wide), pavement.width)
    turned["iso"] = np.where(has, COMPOSITION[composed, INVERSE[iso]], 0)
    for name, corner, extent, end in (("y", y, dy, pavement.height), ("x", x, dx, pavement.width)):
        turned[name] = np.where(has, np.clip(corner, 0, end - extent), 0).astype(np.int16)
    return turned | {"dy": dy.astype(np.int16), "dx": dx.astype(np.int16)}


def _told(pavement: Pavement) -> str:
    sides = f"{pavement.finest}…{pavement.coarsest}"
    return str(pavement.block) if pavement.uniform else sides


def _quartered(top, left, side, which) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Squares with ``which`` of them (bool) cut in four."""
    half = side[which] // 2
    parts = [(top[~which], left[~which], side[~which])]
    parts += [(top[which] + a * half, left[which] + b * half, half) for a in (0, 1) for b in (0, 1)]
    return tuple(np.concatenate(column) for column in zip(*parts, strict=True))
