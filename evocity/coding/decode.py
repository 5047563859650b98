"""Decoder of genomes: iterates the collage map W to its attractor, a city."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np

from evocity.citymap import BUILT_ABOVE, CityMap
from evocity.coding.collage_map import CollageMap
from evocity.coding.fixed_point import SKY
from evocity.coding.zoom import (
    area_means,
    legal_zoom,
    most_common,
)
from evocity.errors import GenomeError, setting
from evocity.genome import VOID, Genome
from evocity.genome.checks import is_settling
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
    end = collage.fixed_point(heights, tolerance=tolerance, most=max_iterations)
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
