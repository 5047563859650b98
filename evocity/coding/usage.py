"""How often a code calls each domain block and each pixel, and the filters made of that."""

from dataclasses import dataclass
from functools import cached_property
from numbers import Real

import numpy as np

from evocity.condensation import Condensation, merged
from evocity.errors import GenomeError, check_word, setting
from evocity.genome import Genome

#: What `low_pass` and `high_pass` may compare with f_c: attributes of `Usage`.
COUNTS = ("pixels", "domains", "ranges")


@dataclass(frozen=True, eq=False)
class Usage:
    """How often the lifs of a genome call the domain blocks of its map (Marsault 2002 §5.5).

    genome : the code that was looked at; n lifs on ``(H, W)`` pixels.
    domain_blocks : int32 ``(k, 4)``, each domain block once: y, x, dy, dx, px; the most called
        first.
    domain_calls : int32 ``(k,)``, how many lifs call each of them.
    calls : int32 ``(n,)``, how many lifs call the domain block of each lifs, itself among them;
        0 without a domain.

    The same by pixels, int32 ``(H, W)`` each: `pixels`, `domains`, `ranges`.
    """

    genome: Genome
    domain_blocks: np.ndarray
    domain_calls: np.ndarray
    calls: np.ndarray

    @cached_property
    def pixels(self) -> np.ndarray:
        """How many lifs call each pixel: whose domain block holds it."""
        p = self.genome.pavement
        y, x, dy, dx = self.domain_blocks.T
        steps = np.zeros((p.height + 1, p.width + 1), np.int64)
        for row, column, sign in ((y, x, 1), (y, x + dx, -1), (y + dy, x, -1), (y + dy, x + dx, 1)):
            np.add.at(steps, (row, column), sign * self.domain_calls)
        return steps.cumsum(0).cumsum(1)[:-1, :-1].astype(np.int32)

    @cached_property
    def domains(self) -> np.ndarray:
        """How many lifs call the most called of the domain blocks that hold each pixel."""
        p = self.genome.pavement
        most = np.zeros((p.height, p.width), np.int32)
        places = zip(self.domain_blocks[::-1], self.domain_calls[::-1], strict=True)
        for (y, x, dy, dx), calls in places:  # the least called first, the others over it
            most[y : y + dy, x : x + dx] = calls
        return most

    @cached_property
    def ranges(self) -> np.ndarray:
        """How many lifs call the domain block that each pixel's range block is made of."""
        return self.genome.pavement.raster(self.calls)


def usage(genome: Genome) -> Usage:
    """Count how often each domain block of a genome is called, and each pixel.

    A few of them serve most lifs, where domain blocks were searched for over the whole map. What
    a condensation keeps is called like any other pixel. About 3 ms at 256², B = 4, and 3 more
    for `Usage.domains`.
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
    """Lay ground where the code calls more often than the cut frequency ``f_c``.

    The ground is condensed: it stays in every iteration, so the attractor is another one: range
    blocks made of pixels laid bare become flat, at their β. High f_c take away few details, low
    ones nearly all (Marsault 2002 §5.5, 2005 §2.4).

    Parameters
    ----------
    f_c : calls, 0 or more; infinity changes nothing. The papers show 1, 10 and 100.
    count : what is compared with it, a pixel at a time, see `Usage`: ``"pixels"``, how often it
        is called (2002); ``"domains"``, how often the most called domain block that holds it is;
        ``"ranges"``, how often the domain block is that its range block is made of (2005), of
        which 0 leaves the uniform range blocks alone.

    Returns
    -------
    Genome : the same lifs with a condensation of ground; `evocity.decode` finds the filtered map.
        What ``genome`` keeps by a condensation of its own stays. The same genome where nothing
        is called more often.

    Raises
    ------
    GenomeError : f_c is no number of 0 or more, or there is no such count.
    """
    return _filtered(genome, "low_pass", f_c, count)


def high_pass(genome: Genome, f_c: float, *, count: str = "pixels") -> Genome:
    """Lay ground where the code calls less often than the cut frequency ``f_c``.

    The counterpart of `low_pass` (Marsault 2002 §5.5 compares the two): what is called ``f_c``
    times or more stays, and what is made of the rest becomes flat. Called with ``count`` and
    ``f_c`` alike, each pixel outlives one of the two filters at least. One after the other
    they leave a band of frequencies.

    Parameters
    ----------
    f_c : calls, 0 or more; 0 changes nothing, 1 leaves what is called at all, infinity lays
        ground everywhere.
    count : as in `low_pass`. By ``"ranges"``, the uniform range blocks, which call nothing, go
        first.

    Returns
    -------
    Genome : as in `low_pass`. The same genome where nothing is called less often.

    Raises
    ------
    GenomeError : f_c is no number of 0 or more, or there is no such count.
    """
    return _filtered(genome, "high_pass", f_c, count)


def _filtered(genome: Genome, name: str, f_c: float, count: str) -> Genome:
    """``genome`` with ground where the filter called ``name`` lays it."""
    number = isinstance(f_c, Real) and not isinstance(f_c, bool)
    if not number or not f_c >= 0:
        raise GenomeError(
            setting("f_c", f_c), "calls, 0 or more", "give for example 10; see usage(genome)"
        )
    check_word("count", count, COUNTS, "leave it out for pixels", GenomeError)
    calls = getattr(usage(genome), count)
    bare = calls > f_c if name == "low_pass" else calls < f_c
    if not bare.any():
        return genome
    ground = Condensation(np.zeros(bare.shape, np.float32), bare)
    made = {**genome.made, name: {"f_c": float(f_c), "count": count}}
    return genome.replace(condensation=merged([genome.condensation, ground]), made=made)


__all__ = ["COUNTS", "Usage", "high_pass", "low_pass", "usage"]
