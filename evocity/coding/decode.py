"""Genome -> CityMap: the attractor of its collage map W."""

import copy
from dataclasses import dataclass

import numpy as np

from evocity import isometries
from evocity.citymap import MAX_PIXELS, MAX_SIDE, CityMap
from evocity.coding._kernels import (
    box_means,
    gather,
    gather_table,
    moved,
    scatter,
    shrink_blocks,
    spread_blocks,
    spread_means,
)
from evocity.errors import GenomeError
from evocity.genome import Genome
from evocity.pavement import Pavement

#: Heights beyond this are taken as proof of divergence, metres.
_SKY = 1e7


@dataclass(frozen=True, eq=False)
class Decoding:
    """An attractor, and how it was reached.

    city : the decoded map; traces below ground are cut at 0.
    attractor : float32 ``(H, W)``, the fixed point of W itself, metres.
    iterations : how often W was applied.
    converged : whether the last step changed no pixel by more than the tolerance.
    change : largest change of a pixel in the last step, metres.
    blamed : lifs (indices) whose blocks still changed, those with \\|σ\\| ≥ 1 first, the
        largest change first among them; empty once converged.
    """

    city: CityMap
    attractor: np.ndarray
    iterations: int
    converged: bool
    change: float
    blamed: np.ndarray


class CollageMap:
    """W of a genome, ready to be applied: W(I) = ∪ ω_i(I) (Marsault 2002 §2.3), and its
    condensation where that covers.

    With ``zoom`` z the blocks have side zB and zD, so W works on maps z times as large. Domain
    blocks that then begin within a pixel take their share of it; the condensation is rounded to
    whole pixels. W is computed in ``dtype``, float32 or float64.
    """

    def __init__(self, genome: Genome, zoom: float = 1, dtype: type = np.float32):
        block = _zoomed_block(genome.pavement, zoom)
        pavement = genome.pavement
        self.pavement = pavement
        if block != pavement.block:
            self.pavement = Pavement(pavement.rows * block, pavement.columns * block, block)
        tall, wide = genome.dy // pavement.block, genome.dx // pavement.block
        top, left = self.pavement.corners
        y, down = _zoomed(genome.y, zoom)
        x, across = _zoomed(genome.x, zoom)
        extents = [tall, wide]
        if down.any() or across.any():
            extents += [down, across]
        self._kinds, layer = _common_shrinkings(extents, ~genome.uniform)
        # domain blocks of rare extents are shrunk one by one, each at its range block's place
        (rare,) = np.nonzero((layer < 0) & ~genome.uniform)
        corners = (top[rare], left[rare], y[rare], x[rare])
        self._rare = [(None, (*corners, tall[rare], wide[rare], block))]
        if len(extents) > 2:
            self._rare = _within_pixels(self.pavement, *self._rare[0][1], down, across, rare)
        layer[rare] = len(self._kinds)
        y[rare], x[rare], tall[rare], wide[rare] = top[rare], left[rare], 1, 1
        count = len(self._kinds) + (rare.size > 0)
        self._layers = np.zeros((max(count, 1), *self.shape), dtype)
        self._table = np.empty(self.shape, np.int32)
        gather_table(
            top, left, y, x, tall, wide, layer, genome.iso,
            *np.divmod(isometries.sources(block), block), block, self._table,
        )  # fmt: skip
        layer = genome.condensation
        self._kept = None if layer is None else layer.resampled(*self.shape)
        self._recode(genome.sigma, genome.beta)

    @property
    def shape(self) -> tuple[int, int]:
        return self.pavement.height, self.pavement.width

    @property
    def flat_start(self) -> np.ndarray:
        """The β of every block, and what is condensed: what W makes of bare ground."""
        return self._beta.copy()

    def recoded(self, sigma: np.ndarray, beta: np.ndarray) -> "CollageMap":
        """W of the same domain blocks with other σ and β, one a lifs; σ of uniform lifs is 0."""
        other = copy.copy(self)
        other._recode(sigma, beta)
        return other

    def _recode(self, sigma: np.ndarray, beta: np.ndarray) -> None:
        self._sigma = self.pavement.raster(np.asarray(sigma, self._layers.dtype))
        self._beta = self.pavement.raster(np.asarray(beta, self._layers.dtype))
        if self._kept is not None:  # σ = 0 and β = C: W lays C there, and Wᵀ takes nothing thence
            self._sigma[self._kept.mask] = 0
            self._beta[self._kept.mask] = self._kept.heights[self._kept.mask]

    def __call__(self, heights: np.ndarray) -> np.ndarray:
        """W applied once to ``(H, W)`` heights of W's own type."""
        target = np.empty(self.shape, self._layers.dtype)
        self.lay(heights, target)
        return target

    def lay(self, heights: np.ndarray, target: np.ndarray) -> None:
        """W applied once to ``heights``, in ``target``: both ``(H, W)`` and of W's own type."""
        for (tall, wide, *shift), layer in zip(self._kinds, self._layers, strict=False):
            box_means(heights, tall, wide, layer)
            _shift(layer, *shift)
        self._shrink_rare(heights)
        gather(
            self._layers.ravel(),
            self._table.ravel(),
            self._sigma.ravel(),
            self._beta.ravel(),
            target.ravel(),
        )

    def transposed(self, values: np.ndarray) -> np.ndarray:
        """Wᵀ applied once to ``(H, W)`` values of W's own type: the adjoint of W without its β,
        ⟨W(a) − W(0), b⟩ = ⟨a, Wᵀ(b)⟩."""
        scatter(values.ravel(), self._table.ravel(), self._sigma.ravel(), self._layers.ravel())
        target = np.zeros(self.shape, self._layers.dtype)
        for (tall, wide, *shift), layer in zip(self._kinds, self._layers, strict=False):
            _shift_back(layer, *shift)
            spread_means(layer, tall, wide, target)
        for share, rare in self._rare:
            layer = self._layers[-1]
            spread_blocks(layer if share is None else share * layer, *rare, target)
        return target

    def _shrink_rare(self, heights: np.ndarray) -> None:
        layer = self._layers[-1]
        if self._rare[0][0] is None:
            if self._rare[0][1][0].size:
                shrink_blocks(heights, *self._rare[0][1], layer)
            return
        if len(self._layers) > len(self._kinds):
            layer[:] = 0
        part = np.zeros_like(layer)
        for share, rare in self._rare:
            shrink_blocks(heights, *rare, part)
            if rare[0].size:
                layer += share * part


def decode(
    genome: Genome,
    *,
    zoom: float = 1,
    tolerance: float = 0.01,
    start: np.ndarray | None = None,
    max_iterations: int = 500,
) -> Decoding:
    """Iterate W from any start until no pixel changes by more than ``tolerance`` metres.

    What the genome's condensation covers has its heights exactly, in every iteration.

    Parameters
    ----------
    zoom : fractal zoom z (Marsault 2005 §2.4): z > 1 creates detail, z < 1 simplifies;
        zB must be a whole number of pixels, 1 or more.
    tolerance : metres.
    start : float ``(zH, zW)`` heights to start from; the attractor does not depend on it.
    max_iterations : after these the decoding is returned as not converged.

    Raises
    ------
    GenomeError : the code diverges (possible only where some \\|σ\\| ≥ 1; the message says
        which lifs), or the zoom does not suit the block.
    """
    if not isinstance(genome, Genome):
        raise GenomeError(
            f"a {type(genome).__name__} to decode",
            "a Genome",
            "encode a map first: evocity.encode(city).genome, or evocity.read_genome(path)",
        )
    if not (tolerance > 0 and max_iterations >= 1):
        raise GenomeError(
            f"tolerance = {tolerance}, max_iterations = {max_iterations}",
            "a tolerance above 0 m, and at least 1 iteration",
            "leave them out for 0.01 m and 500",
        )
    collage = CollageMap(genome, zoom)
    heights = collage.flat_start if start is None else np.array(start, np.float32, order="C")
    if heights.shape != collage.shape:
        raise GenomeError(
            f"a start of shape {heights.shape}",
            f"{collage.shape}, the size of the decoded map",
            "leave start out, or give it that shape",
        )
    if not np.abs(heights).max() < _SKY:
        raise GenomeError(
            f"a start of heights {heights.min():.3g}…{heights.max():.3g} m",
            f"finite heights, below {_SKY:g} m",
            "leave start out, or start from such heights",
        )
    before = np.empty_like(heights)
    limits = np.float32(tolerance), np.float32(_SKY)
    iterations, unsettled = 0, heights.size
    while unsettled and iterations < max_iterations:
        before, heights = heights, before
        collage.lay(before, heights)
        iterations += 1
        unsettled, lost = moved(before.ravel(), heights.ravel(), *limits)
        if lost:
            _diverged(genome, collage, np.abs(heights - before), iterations)
    steps = np.abs(heights - before)
    blamed = np.empty(0, np.intp)
    if unsettled:
        blamed = _blame(genome, collage, steps, tolerance)
    city = CityMap(
        np.maximum(heights, 0),
        genome.metres_per_pixel * genome.pavement.block / collage.pavement.block,
        name=" × ".join(genome.cities),
        attribution=genome.attribution,
        origin=genome.origin,
        crs=genome.crs,
    )
    return Decoding(city, heights, iterations, not unsettled, float(steps.max()), blamed)


def _common_shrinkings(
    extents: list[np.ndarray], able: np.ndarray
) -> tuple[list[tuple[float, ...]], np.ndarray]:
    """The extents, in range blocks (and fractions of a pixel at which domain blocks begin, if
    given), that many of the ``able`` lifs share, and for each lifs which of them is its own, −1
    for none.

    One box mean of the whole map serves all lifs of one extent, but costs as much as some
    hundreds of blocks; with an eighth of the lifs at least, there are at most 8 of them.
    """
    layer = np.full(able.size, -1, np.int64)
    if len(extents) == 2:  # small whole numbers: counted, not sorted
        tall, wide = (extent[able] for extent in extents)
        most = int(wide.max(initial=0)) + 1
        which = tall.astype(np.int64) * most + wide
        counts = np.bincount(which)
        kinds = np.stack(np.divmod(np.arange(counts.size), most))
    else:
        kinds, which, counts = np.unique(
            np.stack([extent[able] for extent in extents]),
            axis=1,
            return_inverse=True,
            return_counts=True,
        )
    (common,) = np.nonzero(counts >= max(able.size / 8, 1))
    place = np.full(counts.size, -1, np.int64)
    place[common] = np.arange(common.size)
    layer[able] = place[which]
    return [(int(t), int(w), *shift) for t, w, *shift in kinds[:, common].T], layer


def _shift(layer: np.ndarray, down: float = 0, across: float = 0) -> None:
    """Means of cells that begin within a pixel, from means of those that begin with one: so the
    pixels at their rims count by area. In place."""
    if down:
        layer[:-1] += down * (layer[1:] - layer[:-1])
    if across:
        layer[:, :-1] += across * (layer[:, 1:] - layer[:, :-1])


def _shift_back(layer: np.ndarray, down: float = 0, across: float = 0) -> None:
    """Adjoint of `_shift`."""
    if across:
        moved = across * layer[:, :-1]
        layer[:, :-1] -= moved
        layer[:, 1:] += moved
    if down:
        moved = down * layer[:-1]
        layer[:-1] -= moved
        layer[1:] += moved


def _within_pixels(pavement: Pavement, top, left, y, x, tall, wide, block, down, across, rare):
    """(share of each pixel, arguments of `shrink_blocks`) of the four whole-pixel domain blocks
    around one that begins within a pixel, for the ``rare`` lifs."""
    parts = []
    for a in (0, 1):
        for b in (0, 1):
            weight = np.zeros(len(pavement), np.float32)
            weight[rare] = ((1 - down, down)[a] * (1 - across, across)[b])[rare]
            v = np.minimum(y + a, pavement.height - tall * block)
            u = np.minimum(x + b, pavement.width - wide * block)
            parts.append((pavement.raster(weight), (top, left, v, u, tall, wide, block)))
    return parts


def _zoomed_block(pavement: Pavement, zoom: float) -> int:
    block = round(pavement.block * zoom) if 0 < zoom < np.inf else 0
    if block < 2 or abs(block - pavement.block * zoom) > 1e-9:
        raise GenomeError(
            f"zoom = {zoom} for range blocks of {pavement.block} px",
            f"a zoom that makes a whole number of pixels, 2 or more, of {pavement.block}",
            f"use a multiple of 1/{pavement.block}, from 2/{pavement.block} up",
        )
    height, width = pavement.rows * block, pavement.columns * block
    if max(height, width) > MAX_SIDE or height * width > MAX_PIXELS:
        raise GenomeError(
            f"zoom = {zoom}: a map of {height} × {width} px",
            f"sides up to {MAX_SIDE} px, {MAX_PIXELS // 10**6} million pixels in all",
            "choose a smaller zoom",
        )
    return block


def _zoomed(corner: np.ndarray, zoom: float) -> tuple[np.ndarray, np.ndarray]:
    """Whole pixels, int32, and the fraction left, 0…1, of ``corner`` on the zoomed map."""
    if zoom == 1:
        return corner.astype(np.int32), np.zeros(corner.size)
    exact = corner * zoom
    whole = np.floor(exact + 1e-9)
    return whole.astype(np.int32), np.maximum(np.round(exact - whole, 9), 0)


def _blame(genome: Genome, collage: CollageMap, steps: np.ndarray, tolerance: float) -> np.ndarray:
    worst = np.nan_to_num(collage.pavement.blocks(steps), nan=np.inf).max(axis=(1, 2))
    order = np.lexsort((-worst, np.abs(genome.sigma) < 1))
    return order[worst[order] > tolerance]


def _diverged(genome: Genome, collage: CollageMap, steps: np.ndarray, iterations: int) -> None:
    blamed = _blame(genome, collage, steps, 0.0)
    listed = ", ".join(f"{i} (σ = {genome.sigma[i]:.2f})" for i in blamed[:5])
    raise GenomeError(
        f"decoding diverges: after {iterations} steps a pixel moved by {np.nanmax(steps):.3g} m; "
        f"to blame: lifs {listed}{', …' if len(blamed) > 5 else ''}",
        "a contractive code, |σ| < 1 but for few lifs",
        "encode with sigma_max below 1, or lower σ of these lifs",
    )
