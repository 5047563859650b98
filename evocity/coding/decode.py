"""Genome -> CityMap: the attractor of its collage map W."""

import copy
from collections.abc import Callable, Sequence
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
from evocity.pavement import Pavement
from evocity.views.buildings.settled import settled_zones


@dataclass(frozen=True, eq=False)
class Decoding:
    """An attractor, and how it was reached.

    city : the decoded map; traces below ground are cut at 0, and roofs settled if wished. Made when
        first asked for.
    attractor : float32 ``(H, W)``, read-only, the fixed point of W itself, metres; its means by
        area where the zoom lies between those that the range blocks allow.
    iterations : how often W was applied.
    converged : whether the last step changed no pixel by more than the tolerance.
    change : largest change of a pixel in the last step, metres.
    blamed : lifs (indices) whose blocks still changed, those with \\|σ\\| ≥ 1 first, the
        largest change first among them; empty once converged.
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
    """W of a genome, ready to be applied: W(I) = ∪ ω_i(I) (Marsault 2002 §2.3), and its
    condensation where that covers.

    With ``zoom`` z the blocks have side zB and zD, so W works on maps z times as large; z must
    make whole numbers of pixels, 2 or more, of all sides (`legal_zoom`), else `GenomeError`.
    Domain blocks that then begin within a pixel take their share of it; the condensation is
    rounded to whole pixels. W is computed in ``dtype``, float32 or float64.
    """

    def __init__(self, genome: Genome, zoom: float = 1, dtype: type = np.float32):
        pavement = genome.pavement
        if abs(legal_zoom(pavement, zoom) - zoom) > 1e-9:
            raise GenomeError(
                f"{setting('zoom', zoom)} for range blocks of {pavement.finest} px",
                f"a zoom that makes a whole number of pixels, 2 or more, of {pavement.finest}",
                f"use a multiple of 1/{pavement.finest}, from 2/{pavement.finest} up",
            )
        self.pavement = zoomed_pavement(pavement, zoom)
        side = self.pavement.side
        top, left = self.pavement.corners
        y, down = zoomed_corner(genome.y, zoom)
        x, across = zoomed_corner(genome.x, zoom)
        # One box mean of the whole map serves all lifs of one extent, but costs as much as some
        # hundreds of blocks; with an eighth of the lifs at least, there are at most 8 of them.
        tall, wide, layer = np.empty((3, len(pavement)), np.int64)
        few, within = max(len(pavement) / 8, 1), zoom != 1 and (down.any() or across.any())
        kinds = shared_extents(genome.dy, genome.dx, pavement.side, few, tall, wide, layer)
        if within:  # of one extent, and begun at the same fractions of a pixel
            kinds, layer = _common_kinds([tall, wide, down, across], ~genome.uniform, few)
        self._kinds = [(int(t), int(w), *shift) for t, w, *shift in kinds]
        # domain blocks of rare extents are shrunk one by one, each at its range block's place
        (rare,) = np.nonzero((layer < 0) & ~genome.uniform)
        corners = (top[rare], left[rare], y[rare], x[rare])
        self._rare = [(None, (*corners, tall[rare], wide[rare], side[rare]))]
        if within:
            self._rare = _within_pixels(self.pavement, *self._rare[0][1], down, across, rare)
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
        self._kept = None if layer is None else layer.resampled(*self.shape)
        self._held = None if self._kept is None else np.flatnonzero(self._kept.mask)
        self._recode(genome.sigma, genome.beta)

    @property
    def shape(self) -> tuple[int, int]:
        return self.pavement.height, self.pavement.width

    @property
    def kept(self) -> np.ndarray | None:
        """Bool ``(H, W)``: what is condensed; None if nothing is."""
        return None if self._kept is None else self._kept.mask

    @property
    def flat_start(self) -> np.ndarray:
        """The β of every block, and what is condensed: what W makes of bare ground."""
        return self._flat.copy()

    def _condensed(self, heights: np.ndarray) -> np.ndarray:
        """``heights``, with what is condensed laid in them."""
        if self._held is not None:
            heights.ravel()[self._held] = self._kept.heights.ravel()[self._held]
        return heights

    def recoded(self, sigma: np.ndarray, beta: np.ndarray) -> "CollageMap":
        """W of the same domain blocks with other σ and β, one a lifs; σ of uniform lifs is 0."""
        other = copy.copy(self)
        other._recode(sigma, beta)
        return other

    def _recode(self, sigma: np.ndarray, beta: np.ndarray) -> None:
        kind = self._layers.dtype
        self._sigma, beta = np.asarray(sigma, kind), np.asarray(beta, kind)
        self._slopes, self._offsets = self._sigma[self._which], beta[self._which]
        self._flat = self._condensed(self.pavement.raster(beta))
        self._steep: np.ndarray | None = None  # σ of each of `sources`, once it is asked for

    def __call__(self, heights: np.ndarray) -> np.ndarray:
        """W applied once to ``(H, W)`` heights of W's own type."""
        target = np.empty(self.shape, self._layers.dtype)
        self.lay(heights, target)
        return target

    def lay(self, heights: np.ndarray, target: np.ndarray) -> None:
        """W applied once to ``heights``, in ``target``: both ``(H, W)``, in C order and of W's own
        type."""
        target[:] = self._flat
        self.lay_again(heights, target)

    def lay_again(self, heights: np.ndarray, target: np.ndarray) -> None:
        """`lay` on a ``target`` that was laid before: only what depends on ``heights``."""
        for (tall, wide, *shift), layer in zip(self._kinds, self._layers, strict=False):
            box_means(heights, tall, wide, layer)
            _shift(layer, *shift)
        self._shrink_rare(heights)
        layers, columns = self._layers.ravel(), self.shape[1]
        lay_blocks(layers, self._walk, self._slopes, self._offsets, columns, target.ravel())
        self._condensed(target)  # whatever the lifs say

    def transposed(self, values: np.ndarray) -> np.ndarray:
        """Wᵀ applied once to ``(H, W)`` values of W's own type: the adjoint of W without its β,
        ⟨W(a) − W(0), b⟩ = ⟨a, Wᵀ(b)⟩."""
        pixels, places = self.sources
        if self._steep is None:
            steep = self.pavement.raster(self._sigma).ravel()
            if self._held is not None:  # W lays C there, so Wᵀ takes nothing thence
                steep[self._held] = 0
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
        """The pixels whose range blocks have a domain, int32 ``(m,)``, rising, and the place in the
        layers that each is made from. Others have no σ: `transposed` passes them over. Of all that
        are `recoded` from this, once they were asked for here."""
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
    settle: bool | None = None,
    zoom: float = 1,
    tolerance: float = 0.01,
    start: np.ndarray | None = None,
    max_iterations: int = 500,
) -> Decoding:
    """Iterate W from any start until no pixel changes by more than ``tolerance`` metres.

    What the genome's condensation covers has its heights exactly, in every iteration.

    Parameters
    ----------
    settle : whether each building of the map, told apart by gaps and steps of height, takes its
        median height, and what is not built lies at 0 (`evocity.views.buildings.settled`): a
        code alone never lays a roof quite flat. What is condensed stays as it is. False gives the
        papers' raw attractor, with its fractal roofs; None what the genome itself says, which is
        True for what `evocity.encode` codes unless told otherwise.
    zoom : fractal zoom z, above 0 (Marsault 2005 §2.4): z > 1 creates detail, z < 1 simplifies.
        Where zB is a whole number of pixels, 2 or more, for all range blocks, these are zoomed
        themselves; else the map is decoded at the next such zoom and its pixels are averaged by
        area, or, where roofs are settled, each takes the height that most of it has.
    tolerance : metres.
    start : float ``(zH, zW)`` heights to start from, of the zoom that is decoded; the attractor
        does not depend on it.
    max_iterations : after these the decoding is returned as not converged.

    Raises
    ------
    GenomeError : the code diverges (possible only where some \\|σ\\| ≥ 1; the message says
        which lifs), or the zoom is none.
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
    legal = legal_zoom(genome.pavement, zoom)
    collage = CollageMap(genome, legal)
    heights = collage.flat_start if start is None else np.array(start, np.float32, order="C")
    if heights.shape != collage.shape:
        raise GenomeError(
            f"a start of shape {heights.shape}",
            f"{collage.shape}, the size of the decoded map",
            "leave start out, or give it that shape",
        )
    within = np.abs(heights).max() < SKY
    if start is None and not within:
        worst = int(np.argmax(np.abs(np.nan_to_num(genome.beta, nan=np.inf))))
        raise GenomeError(
            f"β = {genome.beta[worst]:.3g} m in lifs {worst}",
            f"heights below {SKY:g} m",
            "correct the lifs: so high is no roof",
        )
    if not within:
        raise GenomeError(
            f"a start of heights {heights.min():.3g}…{heights.max():.3g} m",
            f"finite heights, below {SKY:g} m",
            "leave start out, or start from such heights",
        )
    found = fixed_point(
        collage.lay, heights, tolerance=tolerance, most=max_iterations, again=collage.lay_again
    )
    if found.lost:
        _diverged(genome, collage, found.moves, found.steps)
    blamed = np.empty(0, np.intp)
    if not found.settled:
        blamed = _blame(genome, collage, found.moves, tolerance)
    settle = genome.settle if settle is None else settle
    pixel = genome.metres_per_pixel / zoom
    own, kept = found.values, collage.kept
    heights = own
    if legal - zoom > 1e-9:
        step, fine, lasting = legal / zoom, heights, kept
        own = heights = area_means(heights, step)
        kept = None if kept is None else area_means(kept, step) > 0
        if settle:  # means of roofs and ground would be roofs of their own
            fine = np.maximum(fine, 0)
            roofs, _ = settled_zones(fine, fine > BUILT_ABOVE, pixel / step, lasting)
            whole = most_common(roofs, step)
            own = whole if kept is None else np.where(kept, heights, whole)
    heights.setflags(write=False)  # the city is made of it later
    named = {"name": _title(genome.cities), "attribution": genome.attribution}
    placed = {"origin": genome.origin, "crs": genome.crs}
    make = partial(_city, own, pixel, settle, kept, **named, **placed)
    return Decoding(heights, found.steps, found.settled, found.change, blamed, make)


def _title(cities: Sequence[str]) -> str:
    """The cities that a map is bred of; the void, bare ground, is none."""
    return " × ".join(name for name in cities if name != VOID) or VOID


def _city(heights: np.ndarray, pixel: float, settle: bool, kept, **described) -> CityMap:
    roofs = np.maximum(heights, 0)
    if not settle:
        return CityMap(roofs, pixel, **described)
    roofs, labels = settled_zones(roofs, roofs > BUILT_ABOVE, pixel, kept)
    city = CityMap(roofs, pixel, **described)
    if kept is None:  # then they are what the map would find
        labels.setflags(write=False)
        vars(city)["building_labels"] = labels
    return city


def _common_kinds(
    terms: list[np.ndarray], able: np.ndarray, least: float
) -> tuple[np.ndarray, np.ndarray]:
    """The combinations of ``terms`` that at least so many of the ``able`` lifs share, a row each,
    and for each lifs which of them is its own, −1 for none."""
    kinds, which = np.unique(np.stack(terms), axis=1, return_inverse=True)
    (common,) = np.nonzero(np.bincount(which[able], minlength=kinds.shape[1]) >= least)
    place = np.full(kinds.shape[1], -1, np.int64)
    place[common] = np.arange(common.size)
    return kinds[:, common].T, np.where(able, place[which], -1)


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


def _within_pixels(pavement: Pavement, top, left, y, x, tall, wide, side, down, across, rare):
    """(share of each pixel, arguments of `shrink_blocks`) of the four whole-pixel domain blocks
    around one that begins within a pixel, for the ``rare`` lifs."""
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


def _diverged(genome: Genome, collage: CollageMap, steps: np.ndarray, iterations: int) -> None:
    blamed = _blame(genome, collage, steps, 0.0)
    listed = ", ".join(f"{i} (σ = {genome.sigma[i]:.2f})" for i in blamed[:5])
    raise GenomeError(
        f"decoding diverges: after {iterations} steps a pixel moved by {np.nanmax(steps):.3g} m; "
        f"to blame: lifs {listed}{', …' if len(blamed) > 5 else ''}",
        "a contractive code, |σ| < 1 but for few lifs",
        "encode with sigma_max below 1, or lower σ of these lifs",
    )
