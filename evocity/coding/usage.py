"""Usage of domain blocks and pixels by a code, and filters by usage."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evocity.coding.decode import CollageMap
from evocity.coding.decoding_cache import decoded
from evocity.condensation import Condensation, merged
from evocity.errors import GenomeError, check_word, is_number, setting
from evocity.genome import Genome

#: The counts that `low_pass` and `high_pass` compare with f_c: attributes of `Usage`.
COUNTS = ("pixels", "domains", "ranges")
#: The parts of a map that `low_pass` and `high_pass` filter.
PARTS = ("pixels", "blocks", "buildings")
#: Pixels that move by more when buildings vanish keep their heights, metres.
_MOVED = 0.01
#: Range blocks become flat if more than this share of their domain block is flat.
_MOSTLY = 0.5


@dataclass(frozen=True, eq=False)
class Usage:
    """Counts of copies in a genome: each lifs copies (calls) all pixels of a domain block (Marsault
    2002 §5.5).

    genome : code of n lifs on ``(H, W)`` pixels.
    domain_blocks : different domain blocks of the genome, int32 ``(k, 4)``, the most copied block
        first. The columns of ``domain_blocks`` are y, x, dy and dx, px.
    domain_calls : number of lifs that copy each domain block in ``domain_blocks``, int32 ``(k,)``.
    calls : for each lifs, the number of lifs with the same domain block, itself included, int32
        ``(n,)``. A lifs without a domain block has the number 0 in ``calls``.

    The attributes ``pixels``, ``domains`` and ``ranges`` are maps of counts, int32 ``(H, W)`` each.
    """

    genome: Genome
    domain_blocks: np.ndarray
    domain_calls: np.ndarray
    calls: np.ndarray

    @cached_property
    def pixels(self) -> np.ndarray:
        """Number of lifs whose domain blocks contain each pixel."""
        p = self.genome.pavement
        y, x, dy, dx = self.domain_blocks.T
        steps = np.zeros((p.height + 1, p.width + 1), np.int64)
        for row, column, sign in ((y, x, 1), (y, x + dx, -1), (y + dy, x, -1), (y + dy, x + dx, 1)):
            np.add.at(steps, (row, column), sign * self.domain_calls)
        return steps.cumsum(0).cumsum(1)[:-1, :-1].astype(np.int32)

    @cached_property
    def domains(self) -> np.ndarray:
        """Number of calls of the most called domain block that contains each pixel."""
        p = self.genome.pavement
        most = np.zeros((p.height, p.width), np.int32)
        places = zip(self.domain_blocks[::-1], self.domain_calls[::-1], strict=True)
        for (y, x, dy, dx), calls in places:  # rising: the most called stays
            most[y : y + dy, x : x + dx] = calls
        return most

    @cached_property
    def ranges(self) -> np.ndarray:
        """Number of lifs that call the domain block of each pixel's range block."""
        return self.genome.pavement.raster(self.calls)


def usage(genome: Genome) -> Usage:
    """Count how many lifs of a genome copy each domain block, and each pixel.

    In genomes from a search of the whole map, most lifs copy one of a few domain blocks. Pixels of
    a condensation count like all other pixels. The count takes about 3 ms for 256 × 256 px and
    range blocks of 4 px; the attribute `Usage.domains` takes another 3 ms.
    """
    called = np.flatnonzero(~genome.uniform)
    corners = [getattr(genome, name)[called].astype(np.int32) for name in ("y", "x", "dy", "dx")]
    blocks, which, counts = np.unique(
        np.column_stack(corners), axis=0, return_inverse=True, return_counts=True
    )
    order = np.argsort(-counts, kind="stable")
    calls = np.zeros(len(genome), np.int32)
    calls[called] = counts[which.ravel()]
    return Usage(genome, blocks[order], counts[order].astype(np.int32), calls)


def low_pass(genome: Genome, f_c: float, *, count: str = "pixels", part: str = "pixels") -> Genome:
    """Filter the parts of a map that the genome copies more often than the cut frequency f_c.

    A high f_c removes few details, and a low f_c removes nearly all details (Marsault 2002 §5.5,
    2005 §2.4).

    Parameters
    ----------
    f_c : cut frequency, a number of copies, 0 or more; infinity changes nothing. The papers show
        results for f_c = 1, 10 and 100.
    count : name of the pixel count that the filter compares with f_c: "pixels", "domains" or
        "ranges"; the maps of `Usage` have the same names. With "pixels", the count of a pixel is
        the number of lifs that copy this pixel (Marsault 2002). With "domains", the count of a
        pixel is that of its most copied domain block: the number of lifs that copy this block. With
        "ranges", the count of a pixel is the number of lifs that copy the domain block of the
        pixel's range block (Marsault 2005). With ``count`` = "ranges" and f_c = 0, the filter keeps
        only uniform range blocks.
    part : the parts that are filtered as wholes, by the mean count of their pixels.
        "pixels" lowers pixels to ground (Marsault 2002). A condensation keeps them at ground in
        every iteration, so range blocks that copy these pixels become flat, at their height β.
        "blocks" makes range blocks flat, and the attractor changes (Marsault 2005, with ``count``
        = "ranges"). A range block takes the decoded height of the building, or of the ground, that
        has most of its pixels. A range block whose domain block is flat by more than half becomes
        flat, too, because no detail is left to copy. Walls follow range blocks then, which
        simplifies buildings and leaves no crumbs.
        "buildings" lowers whole built components to ground. All other buildings keep their
        heights.

    Returns
    -------
    Genome : filtered genome; decode it for the filtered map. With "pixels" and "buildings", it has
        unchanged lifs and a condensation, which also holds the condensation of the given genome. If
        no part has a count above f_c, the result is the unchanged genome.

    Raises
    ------
    GenomeError : f_c is not a number from 0 upwards, or one of the parameters ``count`` and
        ``part`` has an unknown value.
    """
    return _filter(genome, "low_pass", f_c, count, part)


def high_pass(genome: Genome, f_c: float, *, count: str = "pixels", part: str = "pixels") -> Genome:
    """Filter the parts of a map that the genome copies less often than the cut frequency f_c.

    The filter `high_pass` is the counterpart of `low_pass`; Marsault 2002 §5.5 compares both
    filters. Parts that the genome copies f_c times or more stay unchanged. If `low_pass` and
    `high_pass` have equal arguments, each pixel survives at least one of the two filters. If you
    apply `low_pass` and `high_pass` one after the other, a band of frequencies remains.

    Parameters
    ----------
    f_c : cut frequency, a number of copies, 0 or more. The value f_c = 0 changes nothing, f_c = 1
        keeps all pixels that are copied, and infinity lowers the whole map to ground.
    count : name of the pixel count that the filter compares with f_c: "pixels", "domains" or
        "ranges", as in `low_pass`. With ``count`` = "ranges", uniform range blocks have the count
        0, so the filter lowers them first.
    part : the parts that are filtered as wholes: "pixels", "blocks" or "buildings", as in
        `low_pass`.

    Returns
    -------
    Genome : filtered genome, as from `low_pass`. If no part has a count below f_c, the result is
        the unchanged genome.

    Raises
    ------
    GenomeError : f_c is not a number from 0 upwards, or one of the parameters ``count`` and
        ``part`` has an unknown value.
    """
    return _filter(genome, "high_pass", f_c, count, part)


def _filter(genome: Genome, name: str, f_c: float, count: str, part: str) -> Genome:
    """Apply the filter called ``name``."""
    if not is_number(f_c) or not f_c >= 0:
        raise GenomeError(
            setting("f_c", f_c), "calls, 0 or more", "give for example 10, see usage(genome)"
        )
    check_word("count", count, COUNTS, "leave it out for pixels", GenomeError)
    check_word("part", part, PARTS, "leave it out for pixels", GenomeError)
    calls = getattr(usage(genome), count)

    def passes(values: np.ndarray) -> np.ndarray:
        return values > f_c if name == "low_pass" else values < f_c

    filtered = {"pixels": _ground_pixels, "blocks": _level_blocks, "buildings": _ground_buildings}
    changed = filtered[part](genome, calls, passes)
    if changed is genome:
        return genome
    made = {"f_c": float(f_c), "count": count} | ({} if part == "pixels" else {"part": part})
    return changed.replace(made={**genome.made, name: made})


_Passes = Callable[[np.ndarray], np.ndarray]


def _ground_pixels(genome: Genome, calls: np.ndarray, passes: _Passes) -> Genome:
    """Lay ground where the counts ``calls`` (H, W) are filtered."""
    bare = passes(calls)
    if not bare.any():
        return genome
    return _condensed(genome, np.zeros(bare.shape, np.float32), bare)


def _level_blocks(genome: Genome, calls: np.ndarray, passes: _Passes) -> Genome:
    """Make range blocks flat whose mean count is filtered, at the height of what fills most of
    them, and range blocks that copy mostly these."""
    pavement = genome.pavement
    level = passes(pavement.sums(calls.astype(np.float64)) / pavement.area)
    if not level.any():
        return genome
    while True:
        sums = np.pad(pavement.raster(level.astype(np.float64)), ((1, 0), (1, 0)))
        sums = sums.cumsum(axis=0).cumsum(axis=1)
        low, high = genome.y.astype(np.int64) + genome.dy, genome.x.astype(np.int64) + genome.dx
        flat = sums[low, high] - sums[genome.y, high] - sums[low, genome.x]
        flat += sums[genome.y, genome.x]
        more = level | (flat > _MOSTLY * genome.dy.astype(np.int64) * genome.dx)
        if (more == level).all():
            break
        level = more
    city, beta = decoded(genome).city, genome.beta.copy()
    heights = np.concatenate([[0], city.buildings.height])
    for side in np.unique(pavement.side[level]).tolist():
        which = np.flatnonzero(level & (pavement.side == side))
        for lifs, square in zip(
            which, pavement.squares(city.building_labels, which, side), strict=True
        ):
            beta[lifs] = heights[np.bincount(square.ravel()).argmax()]
    without = {
        name: np.where(level, 0, getattr(genome, name)).astype(getattr(genome, name).dtype)
        for name in ("sigma", "x", "y", "dx", "dy", "iso")
    }
    return genome.replace(beta=beta, **without)


def _ground_buildings(genome: Genome, calls: np.ndarray, passes: _Passes) -> Genome:
    """Lay ground on built components whose mean count is filtered, and keep what copies them."""
    decoding = decoded(genome)
    labels = decoding.city.labels
    sizes = np.bincount(labels.ravel())
    gone = passes(np.bincount(labels.ravel(), calls.ravel()) / np.maximum(sizes, 1))
    gone[0] = False  # open ground
    if not gone.any():
        return genome
    bare, roofs = gone[labels], np.maximum(decoding.attractor, 0)
    heights = np.where(bare, 0, np.where(labels > 0, roofs, decoding.city.heights))
    moved = np.abs(CollageMap(genome)(heights) - heights) > _MOVED
    return _condensed(genome, heights, bare | moved)


def _condensed(genome: Genome, heights: np.ndarray, mask: np.ndarray) -> Genome:
    layer = Condensation(heights, mask)
    return genome.replace(condensation=merged([genome.condensation, layer]))
