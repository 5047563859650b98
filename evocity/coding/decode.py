"""Decoder of genomes: iterates the collage map W to its attractor, a city."""

import copy
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np

from evocity import isometries
from evocity.citymap import BUILT_ABOVE, CityMap
from evocity.coding._kernels import (
    box_means,
    gather_table,
    lay_blocks,
    scatter,
    shared_extents,
    shrink_blocks,
    spread_blocks,
    spread_means,
    walks,
)
from evocity.coding.fixed_point import SKY, fixed_point
from evocity.coding.zoom import (
    area_means,
    legal_zoom,
    most_common,
    zoomed_corner,
    zoomed_pavement,
)
from evocity.errors import GenomeError, setting
from evocity.genome import VOID, Genome
from evocity.genome.checks import is_settling
from evocity.pavement import Pavement
from evocity.views.buildings.segmentation import settled_roofs, settled_zones


@dataclass(frozen=True, eq=False)
class Decoding:
    """Attractor of a genome, and a report on the iteration that computed it.

    city : decoded map, with 0 in place of negative heights, and with flat roofs if the decoding
        makes roofs flat. The first access to ``city`` computes the map.
    attractor : fixed point of the collage operator W, metres, float32 ``(H, W)``, read-only. If the
        sides of range blocks at the zoom are not whole numbers of pixels, the heights are area
        means of a fixed point at a larger zoom.
    iterations : number of applications of the collage operator W.
    converged : whether the last iteration changed every pixel by at most the tolerance.
    change : largest change of a pixel in the last iteration, metres.
    blamed : indices of the lifs whose range blocks still changed in the last step of a decoding
        that did not converge. Lifs with \\|σ\\| ≥ 1 come first; all other lifs follow, with the
        largest change first. The array ``blamed`` is empty if the decoding converged.
    """

    attractor: np.ndarray
    iterations: int
    converged: bool
    change: float
    blamed: np.ndarray
    _make_city: Callable[[], CityMap] = field(repr=False)

    @cached_property
    def city(self) -> CityMap:
        return self._make_city()


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
        side = self.pavement.side
        top, left = self.pavement.corners
        y, down = zoomed_corner(genome.y, zoom)
        x, across = zoomed_corner(genome.x, zoom)
        # A box mean of the whole map serves all lifs of one extent, at the cost of some hundreds of
        # blocks. Each serves at least an eighth of the lifs, so there are at most 8.
        tall, wide, layer = np.empty((3, len(pavement)), np.int64)
        few, within = max(len(pavement) / 8, 1), zoom != 1 and (down.any() or across.any())
        kinds = shared_extents(genome.dy, genome.dx, pavement.side, few, tall, wide, layer)
        if within:  # lifs of one kind share the extent and the fractions of a pixel
            kinds, layer = _common_kinds([tall, wide, down, across], ~genome.uniform, few)
        self._kinds = [(int(t), int(w), *shift) for t, w, *shift in kinds]
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
        layer = genome.condensation
        self._layer = None if layer is None else layer.resampled(*self.shape)
        self._covered = None if self._layer is None else np.flatnonzero(self._layer.mask)
        self._recode(genome.sigma, genome.beta)

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
        if self._covered is not None:
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
        self._sigma, beta = np.asarray(sigma, kind), np.asarray(beta, kind)
        self._slopes, self._offsets = self._sigma[self._which], beta[self._which]
        self._flat = self._condense(self.pavement.raster(beta))
        self._steep: np.ndarray | None = None  # σ of each of `sources`, filled at the first use

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
        for (tall, wide, *shift), layer in zip(self._kinds, self._layers, strict=False):
            box_means(heights, tall, wide, layer)
            _shift(layer, *shift)
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
        for (tall, wide, *shift), layer in zip(self._kinds, self._layers, strict=False):
            _shift_back(layer, *shift)
            spread_means(layer, tall, wide, target)
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


def decode(
    genome: Genome,
    *,
    settle: bool | str | None = None,
    zoom: float = 1,
    tolerance: float = 0.01,
    start: np.ndarray | None = None,
    max_iterations: int = 500,
) -> Decoding:
    """Decode a genome to a map: iterate the collage operator W until no pixel changes by more than
    ``tolerance`` metres.

    The condensation keeps its exact heights in every iteration of the decoding.

    Parameters
    ----------
    settle : whether to make the roofs of the decoded map flat. With flat roofs, each building takes
        its median height, and ground becomes 0. Gaps, and jumps in height, separate one building
        from the next (`evocity.views.buildings.settled`). With ``settle="roofs"``, each roof takes
        its own median height, so that steps from .5 m on stay, and so do gaps of one pixel. Flat
        roofs do not change the heights of the condensation. With ``settle=False``, the result is
        the raw attractor, as in the papers, with fractal roofs. By default, the genome's field
        ``settle`` decides; `evocity.encode` sets this field to True.
    zoom : fractal zoom z, a number above 0 (Marsault 2005 §2.4). A zoom above 1 creates detail, and
        a zoom below 1 removes detail. The map is decoded directly at the zoom z if zB is a whole
        number of pixels, 2 or more, for the side B of every range block. If the zoom does not suit
        the genome, the map is decoded at the next larger suitable zoom, and reduced by area means.
        With flat roofs, a reduced pixel takes the most frequent height of its area instead of the
        mean.
    tolerance : largest change of a pixel's height, metres, at which the iteration stops.
    start : initial heights of the iteration at the zoom z, float ``(zH, zW)``; None starts from
        flat range blocks. The attractor does not depend on the initial heights.
    max_iterations : largest number of iterations. A decoding that needs ``max_iterations``
        iterations has not converged.

    Raises
    ------
    GenomeError : the decoding diverges, or the genome cannot be decoded at this ``zoom``. Decoding
        can diverge only if some lifs have \\|σ\\| ≥ 1; the error lists these lifs.
    """
    if not isinstance(genome, Genome):
        raise GenomeError(
            f"an object of the class {type(genome).__name__} cannot be decoded",
            "an object of the class Genome",
            "encode a map first: evocity.encode(city).genome, or evocity.read_genome(path)",
        )
    if not (tolerance > 0 and max_iterations >= 1):
        raise GenomeError(
            f"tolerance = {tolerance} or max_iterations = {max_iterations} is out of range",
            "a tolerance above 0 m, and at least 1 iteration",
            "leave out both parameters to use 0.01 m and 500 iterations",
        )
    settle = genome.settle if settle is None else settle
    if not is_settling(settle):
        raise GenomeError(
            setting("settle", settle),
            "True, False or 'roofs'",
            "leave the parameter 'settle' out to use the genome's own value",
        )
    legal = legal_zoom(genome.pavement, zoom)
    collage = CollageMap(genome, legal)
    heights = collage.flat_start if start is None else np.array(start, np.float32, order="C")
    if heights.shape != collage.shape:
        raise GenomeError(
            f"the array in the parameter 'start' has the shape {heights.shape}",
            f"an array of the shape {collage.shape}, like the decoded map",
            "leave the parameter 'start' out, or pass an array of this shape",
        )
    within = np.abs(heights).max() < SKY
    if start is None and not within:
        worst = int(np.argmax(np.abs(np.nan_to_num(genome.beta, nan=np.inf))))
        raise GenomeError(
            f"the height β = {genome.beta[worst]:.3g} m in lifs {worst} (code of one range "
            "block) is too large",
            f"heights below {SKY:g} m",
            "correct the height β of this lifs, or encode the map again",
        )
    if not within:
        raise GenomeError(
            f"heights in the array 'start' go from {heights.min():.3g} to {heights.max():.3g} m",
            f"finite heights below {SKY:g} m",
            "leave the parameter 'start' out, or pass heights in this range",
        )
    end = fixed_point(
        collage.lay, heights, tolerance=tolerance, most=max_iterations, repeat=collage.lay_again
    )
    if end.diverged:
        _raise_divergence(genome, collage, end.moves, end.steps)
    blamed = np.empty(0, np.intp)
    if not end.converged:
        blamed = _blame(genome, collage, end.moves, tolerance)
    pixel = genome.metres_per_pixel / zoom
    shown, kept = end.values, collage.kept
    heights = shown
    if legal - zoom > 1e-9:
        step, fine, fine_kept = legal / zoom, heights, kept
        shown = heights = area_means(heights, step)
        kept = None if kept is None else area_means(kept, step) > 0
        if settle:  # means of roofs and ground would be new roofs
            fine = np.maximum(fine, 0)
            roofs, _ = _settled(fine, pixel / step, settle, fine_kept)
            whole = most_common(roofs, step)
            shown = whole if kept is None else np.where(kept, heights, whole)
    heights.setflags(write=False)  # the city is computed from it later
    name = " × ".join(city for city in genome.cities if city != VOID) or VOID
    about = {"name": name, "attribution": genome.attribution}
    about |= {"origin": genome.origin, "crs": genome.crs}
    make = partial(_city, shown, pixel, settle, kept, **about)
    return Decoding(heights, end.steps, end.converged, end.change, blamed, make)


def _city(heights: np.ndarray, pixel: float, settle: bool | str, kept, **about) -> CityMap:
    roofs = np.maximum(heights, 0)
    if not settle:
        return CityMap(roofs, pixel, **about)
    roofs, labels = _settled(roofs, pixel, settle, kept)
    city = CityMap(roofs, pixel, **about)
    if kept is None and labels is not None:  # then the map would compute the same labels
        labels.setflags(write=False)
        vars(city)["building_labels"] = labels
    return city


def _settled(
    heights: np.ndarray, pixel: float, settle: bool | str, kept: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray | None]:
    """Make roofs flat; with the labels of buildings, if these are known."""
    if settle == "roofs":
        return settled_roofs(heights, heights > BUILT_ABOVE, pixel, kept), None
    return settled_zones(heights, heights > BUILT_ABOVE, pixel, kept)


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


def _blame(genome: Genome, collage: CollageMap, steps: np.ndarray, tolerance: float) -> np.ndarray:
    worst = collage.pavement.maxima(np.nan_to_num(steps, nan=np.inf))
    order = np.lexsort((-worst, np.abs(genome.sigma) < 1))
    return order[worst[order] > tolerance]


def _raise_divergence(genome: Genome, collage: CollageMap, steps: np.ndarray, iterations: int):
    blamed = _blame(genome, collage, steps, 0.0)
    listed = ", ".join(f"{i} (σ = {genome.sigma[i]:.2f})" for i in blamed[:5])
    raise GenomeError(
        f"decoding diverges: in iteration {iterations} a pixel changed by {np.nanmax(steps):.3g} "
        f"m, and the cause lies in lifs {listed}{', …' if len(blamed) > 5 else ''}",
        "a contractive code: nearly all lifs (codes of one range block) have a contrast |σ| < 1",
        "encode the map with 'sigma_max' below 1, or lower the contrast σ of these lifs",
    )
