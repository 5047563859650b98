"""Usage of domain blocks and pixels by a code, and filters by usage."""

from dataclasses import dataclass
from functools import cached_property
from numbers import Real

import numpy as np

from evocity.condensation import Condensation, merged
from evocity.errors import GenomeError, check_word, setting
from evocity.genome import Genome

#: The counts that `low_pass` and `high_pass` compare with f_c: attributes of `Usage`.
COUNTS = ("pixels", "domains", "ranges")


@dataclass(frozen=True, eq=False)
class Usage:
    """Counts of calls: how many lifs of a genome use each domain block (Marsault 2002 §5.5).

    genome : code of n lifs on ``(H, W)`` pixels.
    domain_blocks : int32 ``(k, 4)``. Each row is a different domain block: y, x, dy, dx, px. The
        most called block comes first.
    domain_calls : number of lifs that call each of these domain blocks, int32 ``(k,)``.
    calls : number of lifs that call the same domain block as each lifs, itself included, int32
        ``(n,)``. 0 for a lifs without a domain block.

    The attributes ``pixels``, ``domains`` and ``ranges`` are maps of these counts, int32 ``(H, W)``
    each.
    """

    genome: Genome
    domain_blocks: np.ndarray
    domain_calls: np.ndarray
    calls: np.ndarray

    @cached_property
    def pixels(self) -> np.ndarray:
        """Number of lifs that call each pixel: their domain blocks contain it."""
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
        """Number of calls of the domain block of each pixel's range block."""
        return self.genome.pavement.raster(self.calls)


def usage(genome: Genome) -> Usage:
    """Count how many lifs of a genome call each domain block, and each pixel.

    After a search over the whole map, a few domain blocks serve most lifs. Pixels of a condensation
    count like all others. The count takes about 3 ms at 256², B = 4; `Usage.domains` takes 3 ms
    more.
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
    """Lower the map to ground where the code calls pixels more often than the cut frequency f_c.

    A condensation keeps this ground in every iteration, so the attractor changes. Range blocks that
    were made from lowered pixels become flat, at their β. A high f_c removes few details, and a low
    f_c nearly all (Marsault 2002 §5.5, 2005 §2.4).

    Parameters
    ----------
    f_c : cut frequency in calls, 0 or more; infinity changes nothing. The papers show 1, 10 and
        100.
    count : count of each pixel to compare, see `Usage`. "pixels" counts the calls of the pixel
        (2002). "domains" counts the calls of the most called domain block that contains the pixel.
        "ranges" counts the calls of its range block's domain block (2005); 0 then keeps only
        uniform range blocks.

    Returns
    -------
    Genome : genome with the same lifs, and a condensation of ground. `evocity.decode` gives the
        filtered map. An earlier condensation stays. If no count is higher, the same genome is
        returned.

    Raises
    ------
    GenomeError : f_c is not a number of 0 or more, or ``count`` is unknown.
    """
    return _lay_ground(genome, "low_pass", f_c, count)


def high_pass(genome: Genome, f_c: float, *, count: str = "pixels") -> Genome:
    """Lower the map to ground where the code calls pixels less often than the cut frequency f_c.

    This filter is the counterpart of `low_pass` (Marsault 2002 §5.5 compares the two). Pixels with
    f_c calls or more stay, and range blocks that were made from other pixels become flat. With
    equal ``count`` and f_c, each pixel survives at least one of the two filters. Both filters in
    sequence leave a band of frequencies.

    Parameters
    ----------
    f_c : cut frequency in calls, 0 or more. 0 changes nothing, 1 keeps all called pixels, and
        infinity lowers the whole map to ground.
    count : count of each pixel to compare, as in `low_pass`. With "ranges", uniform range blocks
        are lowered first, because they call nothing.

    Returns
    -------
    Genome : filtered genome, as in `low_pass`. If no count is lower, the same genome is returned.

    Raises
    ------
    GenomeError : f_c is not a number of 0 or more, or ``count`` is unknown.
    """
    return _lay_ground(genome, "high_pass", f_c, count)


def _lay_ground(genome: Genome, name: str, f_c: float, count: str) -> Genome:
    """Lay ground where the filter called ``name`` demands it."""
    number = isinstance(f_c, Real) and not isinstance(f_c, bool)
    if not number or not f_c >= 0:
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
