"""The collage map W of a genome, whose fixed point is the decoded map."""

import copy
from functools import cached_property

import numpy as np

from evocity import isometries
from evocity.coding._kernels import (
    box_means,
    gather_table,
    iterate,
    lay_blocks,
    order_walks,
    scatter,
    shared_extents,
    shrink_blocks,
    spread_blocks,
    spread_means,
    walks,
)
from evocity.coding.fixed_point import SKY, FixedPoint, fixed_point
from evocity.coding.zoom import legal_zoom, zoomed_corner, zoomed_pavement
from evocity.errors import GenomeError, setting
from evocity.genome import Genome
from evocity.pavement import Pavement

_NOWHERE = np.empty(0, np.int64)


class CollageMap:
    """Collage operator W of a genome: W(I) = ∪ ω_i(I) turns a map I into another map by the lifs
    ω_i.

    The definition of W follows Marsault 2002 §2.3. After each application of W, the condensation's
    pixels get back their fixed heights. With a fractal zoom z, range blocks have the side zB, and
    maps are z times as large. The side zB of every range block must be a whole number of pixels, 2
    or more (`legal_zoom`); otherwise the constructor raises `GenomeError`. If a domain block covers
    only a part of a pixel, this pixel counts in proportion to the covered part. With a zoom, the
    borders of the condensation are rounded to whole pixels. The operator W computes with numbers of
    the type ``dtype``, float32 or float64.
    """

    def __init__(self, genome: Genome, zoom: float = 1, dtype: type = np.float32):
        pavement = genome.pavement
        if abs(legal_zoom(pavement, zoom) - zoom) > 1e-9:
            raise GenomeError(
                f"{setting('zoom', zoom)} does not fit range blocks of {pavement.finest} px",
                f"a zoom that turns {pavement.finest} px into a whole number of pixels, 2 or more",
                f"use a zoom that is a multiple of 1/{pavement.finest}, from 2/{pavement.finest} "
                "up",
            )
        self.pavement = zoomed_pavement(pavement, zoom)
        self._few = max(len(pavement) / 8, 1)
        # A box mean of the whole map serves all lifs of one extent, at the cost of some hundreds of
        # blocks. Each serves at least an eighth of the lifs, so there are at most 8.
        if zoom == 1:
            self._order(genome, dtype)
        else:
            self._order_zoomed(genome, zoom, dtype)
        layer = genome.condensation
        self._layer = None if layer is None else layer.resampled(*self.shape)
        self._covered = None if self._layer is None else np.flatnonzero(self._layer.mask)
        self._recode(genome.sigma, genome.beta)

    def _order(self, genome: Genome, dtype: type) -> None:
        pavement, count = self.pavement, len(self.pavement)
        tall, wide, layer, which, bare = np.empty((5, count), np.int64)
        rare, walk = np.empty((7, count), np.int32), np.empty((count, 5), np.int64)
        kinds, few, used = order_walks(
            genome.dy, genome.dx, genome.y, genome.x, genome.iso,
            pavement.side, *pavement.corners, self._few, *self.shape, isometries.AFFINE,
            tall, wide, layer, which, bare, rare, walk,
        )  # fmt: skip
        self._kinds, self._extents = [(int(t), int(w)) for t, w in kinds], kinds
        self._rare = [(None, tuple(rare[:, :few]))]
        self._rare_table = rare[:, :few]
        self._layers = np.empty((max(len(kinds) + (few > 0), 1), *self.shape), dtype)
        self._which, self._bare, self._walk = which[:used], bare[: count - used], walk[:used]

    def _order_zoomed(self, genome: Genome, zoom: float, dtype: type) -> None:
        pavement = genome.pavement
        side = self.pavement.side
        top, left = self.pavement.corners
        y, down = zoomed_corner(genome.y, zoom)
        x, across = zoomed_corner(genome.x, zoom)
        tall, wide, layer = np.empty((3, len(pavement)), np.int64)
        few, within = self._few, down.any() or across.any()
        kinds = shared_extents(genome.dy, genome.dx, pavement.side, few, tall, wide, layer)
        if within:  # lifs of one kind share the extent and the fractions of a pixel
            kinds, layer = _common_kinds([tall, wide, down, across], ~genome.uniform, few)
        self._kinds = [(int(t), int(w), *shift) for t, w, *shift in kinds]
        self._extents = None
        # domain blocks of rare extents shrink singly, each at its range block's place
        (rare,) = np.nonzero((layer < 0) & ~genome.uniform)
        corners = (top[rare], left[rare], y[rare], x[rare])
        self._rare = [(None, (*corners, tall[rare], wide[rare], side[rare]))]
        if within:
            self._rare = _fractional_parts(self.pavement, *self._rare[0][1], down, across, rare)
        layer[rare] = len(self._kinds)
        y[rare], x[rare], tall[rare], wide[rare] = top[rare], left[rare], 1, 1
        count = len(self._kinds) + (rare.size > 0)
        self._layers = np.zeros((max(count, 1), *self.shape), dtype)
        reads = (y, x, tall, wide, layer, genome.iso)
        (which,) = np.nonzero(layer >= 0)
        self._which = which[np.argsort(side[which].astype(np.int16), kind="stable")]
        self._walk = np.empty((which.size, 5), np.int64)
        walks(self._which, top, left, side, *reads, isometries.AFFINE, *self.shape, self._walk)

    @property
    def shape(self) -> tuple[int, int]:
        return self.pavement.height, self.pavement.width

    @property
    def kept(self) -> np.ndarray | None:
        """Mask of the pixels that the condensation fixes, bool ``(H, W)``; None without a
        condensation."""
        return None if self._layer is None else self._layer.mask

    @property
    def flat_start(self) -> np.ndarray:
        """Result of applying W to bare ground: each range block has its height β, and the pixels of
        the condensation keep their heights."""
        return self._flat.copy()

    def _condense(self, heights: np.ndarray) -> np.ndarray:
        """Lay the condensation in ``heights``."""
        if self._covered is not None and self._layer is not None:
            heights.ravel()[self._covered] = self._layer.heights.ravel()[self._covered]
        return heights

    def recoded(self, sigma: np.ndarray, beta: np.ndarray) -> "CollageMap":
        """Return a copy of W with the same domain blocks, but with the given arrays ``(n,)`` of σ
        and β. Lifs without a domain block must have σ = 0."""
        other = copy.copy(self)
        other._recode(sigma, beta)
        return other

    def _recode(self, sigma: np.ndarray, beta: np.ndarray) -> None:
        kind = self._layers.dtype
        self._sigma, self._beta = np.asarray(sigma, kind), np.asarray(beta, kind)
        self._slopes, self._offsets = self._sigma[self._which], self._beta[self._which]
        self._bare_map: np.ndarray | None = None  # filled at the first use
        self._steep: np.ndarray | None = None  # σ of each of `sources`, filled at the first use

    @property
    def _flat(self) -> np.ndarray:
        if self._bare_map is None:
            self._bare_map = self._condense(self.pavement.raster(self._beta))
        return self._bare_map

    def fixed_point(self, start: np.ndarray, *, tolerance: float, most: int = 500) -> FixedPoint:
        """Iterate W from ``start`` (H, W), of the type of W, as `coding.fixed_point` does."""
        if self._extents is None:
            return fixed_point(
                self.lay, start, tolerance=tolerance, most=most, repeat=self.lay_again
            )
        kind, covered, kept = self._layers.dtype.type, _NOWHERE, np.empty(0, self._layers.dtype)
        if self._covered is not None and self._layer is not None:
            covered = self._covered
            kept = self._layer.heights.ravel()[covered].astype(kind, copy=False)
        before, values = np.empty(self.shape, kind), start.astype(kind, order="C")
        steps, converged, diverged = iterate(
            before, values, self._extents, self._rare_table, self._layers, self._walk,
            self._slopes, self._offsets, self._bare, *self.pavement.corners, self.pavement.side,
            self._beta, covered, kept, kind(tolerance), kind(SKY), most,
        )  # fmt: skip
        if steps % 2:
            before, values = values, before
        return FixedPoint(values, before, steps, converged, diverged)

    def __call__(self, heights: np.ndarray) -> np.ndarray:
        """Apply W once to ``(H, W)`` heights of W's own type."""
        target = np.empty(self.shape, self._layers.dtype)
        self.lay(heights, target)
        return target

    def lay(self, heights: np.ndarray, target: np.ndarray) -> None:
        """Apply the operator W once to the array ``heights``, and write the result into the array
        ``target``. The arrays ``heights`` and ``target`` are ``(H, W)``, in C order, and have the
        ``dtype`` of W."""
        target[:] = self._flat
        self.lay_again(heights, target)

    def lay_again(self, heights: np.ndarray, target: np.ndarray) -> None:
        """Apply W to ``heights``, and update only those pixels of ``target`` that depend on
        ``heights``; before this call, the method `lay` must have filled ``target``."""
        for extent, layer in zip(self._kinds, self._layers, strict=False):
            box_means(heights, extent[0], extent[1], layer)
            _shift(layer, *extent[2:])
        self._shrink_rare(heights)
        layers, columns = self._layers.ravel(), self.shape[1]
        lay_blocks(layers, self._walk, self._slopes, self._offsets, columns, target.ravel())
        self._condense(target)

    def transposed(self, values: np.ndarray) -> np.ndarray:
        """Apply the transposed operator Wᵀ once to the array ``values``, ``(H, W)``, of the
        ``dtype`` of W. Wᵀ is the adjoint of the linear part of W: ⟨W(a) − W(0), b⟩ = ⟨a, Wᵀ(b)⟩ for
        all maps a and b."""
        pixels, places = self.sources
        if self._steep is None:
            steep = self.pavement.raster(self._sigma).ravel()
            if self._covered is not None:  # W lays the condensation there, so Wᵀ takes nothing
                steep[self._covered] = 0
            self._steep = steep[pixels]
        scatter(values.ravel(), pixels, places, self._steep, self._layers.ravel())
        target = np.zeros(self.shape, self._layers.dtype)
        for extent, layer in zip(self._kinds, self._layers, strict=False):
            _shift_back(layer, *extent[2:])
            spread_means(layer, extent[0], extent[1], target)
        for share, rare in self._rare:
            layer = self._layers[-1]
            spread_blocks(layer if share is None else share * layer, *rare, target)
        return target

    @cached_property
    def sources(self) -> tuple[np.ndarray, np.ndarray]:
        """The pixels of range blocks with a domain block, int32 ``(m,)``, rising, and the place in
        the layers of each one's source. `transposed` skips all other pixels. A `recoded` copy
        shares them after the first access here."""
        table = np.full(self.shape[0] * self.shape[1], -1, np.int32)
        gather_table(self._walk, self.shape[1], table)
        pixels = np.flatnonzero(table >= 0).astype(np.int32)
        return pixels, table[pixels]

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


def _common_kinds(
    terms: list[np.ndarray], able: np.ndarray, least: float
) -> tuple[np.ndarray, np.ndarray]:
    """List the combinations of ``terms`` that at least ``least`` of the ``able`` lifs share, a row
    each; and for each lifs the number of its combination, or −1."""
    kinds, which = np.unique(np.stack(terms), axis=1, return_inverse=True)
    (common,) = np.nonzero(np.bincount(which[able], minlength=kinds.shape[1]) >= least)
    place = np.full(kinds.shape[1], -1, np.int64)
    place[common] = np.arange(common.size)
    return kinds[:, common].T, np.where(able, place[which], -1)


def _shift(layer: np.ndarray, down: float = 0, across: float = 0) -> None:
    """Shift means of cells by fractions of a pixel, in place: pixels at rims count by area."""
    if down:
        layer[:-1] += down * (layer[1:] - layer[:-1])
    if across:
        layer[:, :-1] += across * (layer[:, 1:] - layer[:, :-1])


def _shift_back(layer: np.ndarray, down: float = 0, across: float = 0) -> None:
    """Apply the adjoint of `_shift`."""
    if across:
        moved = across * layer[:, :-1]
        layer[:, :-1] -= moved
        layer[:, 1:] += moved
    if down:
        moved = down * layer[:-1]
        layer[:-1] -= moved
        layer[1:] += moved


def _fractional_parts(pavement: Pavement, top, left, y, x, tall, wide, side, down, across, rare):
    """Replace domain blocks of the ``rare`` lifs that begin within a pixel by the four at whole
    pixels around: (share of each pixel, arguments of `shrink_blocks`) of each of the four."""
    parts = []
    for a in (0, 1):
        for b in (0, 1):
            weight = np.zeros(len(pavement), np.float32)
            weight[rare] = ((1 - down, down)[a] * (1 - across, across)[b])[rare]
            v = np.minimum(y + a, pavement.height - tall * side)
            u = np.minimum(x + b, pavement.width - wide * side)
            parts.append((pavement.raster(weight), (top, left, v, u, tall, wide, side)))
    return parts
