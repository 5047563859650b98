"""Usage of domain blocks and pixels by a code, and filters by usage."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evocity.condensation import Condensation, merged
from evocity.errors import GenomeError, check_word, is_number, setting
from evocity.genome import Genome

#: The counts that `low_pass` and `high_pass` compare with f_c: attributes of `Usage`.
COUNTS = ("pixels", "domains", "ranges")


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


def low_pass(genome: Genome, f_c: float, *, count: str = "pixels") -> Genome:
    """Lower to ground all pixels that the genome copies more often than the cut frequency f_c.

    A condensation keeps the lowered pixels at ground in every iteration, so the attractor changes.
    A range block becomes flat, at its height β, if the filter lowers its domain block. A high f_c
    removes few details, and a low f_c removes nearly all details (Marsault 2002 §5.5, 2005 §2.4).

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

    Returns
    -------
    Genome : genome with unchanged lifs and a condensation of ground; decode this genome for the
        filtered map. The filtered genome also keeps the condensation of the given genome. If no
        pixel has a count above f_c, the result is the unchanged genome.

    Raises
    ------
    GenomeError : f_c is not a number from 0 upwards, or the parameter ``count`` has an unknown
        value.
    """
    return _lay_ground(genome, "low_pass", f_c, count)


def high_pass(genome: Genome, f_c: float, *, count: str = "pixels") -> Genome:
    """Lower to ground all pixels that the genome copies less often than the cut frequency f_c.

    The filter `high_pass` is the counterpart of `low_pass`; Marsault 2002 §5.5 compares both
    filters. Pixels that the genome copies f_c times or more stay unchanged. A range block becomes
    flat if the filter lowers its domain block. If `low_pass` and `high_pass` have equal arguments
    ``count`` and f_c, each pixel survives at least one of the two filters. If you apply `low_pass`
    and `high_pass` one after the other, a band of frequencies remains.

    Parameters
    ----------
    f_c : cut frequency, a number of copies, 0 or more. The value f_c = 0 changes nothing, f_c = 1
        keeps all pixels that are copied, and infinity lowers the whole map to ground.
    count : name of the pixel count that the filter compares with f_c: "pixels", "domains" or
        "ranges", as in `low_pass`. With ``count`` = "ranges", uniform range blocks have the count
        0, so the filter lowers them first.

    Returns
    -------
    Genome : filtered genome, with unchanged lifs and a condensation of ground, as from `low_pass`.
        If no pixel has a count below f_c, the result is the unchanged genome.

    Raises
    ------
    GenomeError : f_c is not a number from 0 upwards, or the parameter ``count`` has an unknown
        value.
    """
    return _lay_ground(genome, "high_pass", f_c, count)


def _lay_ground(genome: Genome, name: str, f_c: float, count: str) -> Genome:
    """Lay ground where the filter called ``name`` demands it."""
    if not is_number(f_c) or not f_c >= 0:
        raise GenomeError(
            setting("f_c", f_c), "calls, 0 or more", "give for example 10, see usage(genome)"
        )
    check_word("count", count, COUNTS, "leave it out for pixels", GenomeError)
    calls = getattr(usage(genome), count)
    bare = calls > f_c if name == "low_pass" else calls < f_c
    if not bare.any():
        return genome
    ground = Condensation(np.zeros(bare.shape, np.float32), bare)
    made = {**genome.made, name: {"f_c": float(f_c), "count": count}}
    return genome.replace(condensation=merged([genome.condensation, ground]), made=made)
