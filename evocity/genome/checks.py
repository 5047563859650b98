"""What a genome's parts may be; told all at once."""

import math

import numpy as np

from evocity.citymap import PIXEL_SIDES
from evocity.condensation import Condensation
from evocity.errors import GenomeError
from evocity.genome._kernels import in_bounds
from evocity.genome.nucleotides import FIELDS, Nucleotide
from evocity.pavement import Pavement


def typed(name: str, values, nucleotide: Nucleotide, count: int) -> np.ndarray:
    """``values`` as a read-only array ``(count,)`` of the nucleotide's type, or `GenomeError`."""
    array = np.asarray(values)
    if array.shape != (count,):
        raise GenomeError(
            f"{name} of shape {array.shape}",
            f"({count},), one value a range block",
            "build the arrays from the genome's own pavement",
        )
    if nucleotide.dtype.kind in "iu" and array.dtype != nucleotide.dtype:
        limits = np.iinfo(nucleotide.dtype)
        if array.dtype.kind not in "iub" or (
            array.size and (array.min() < limits.min or array.max() > limits.max)
        ):
            raise GenomeError(
                f"{name} of type {array.dtype} with values beyond {nucleotide.dtype}",
                f"whole numbers {limits.min}…{limits.max}",
                "round to legal values first",
            )
    ours = array.base is None and not array.flags.writeable  # else somebody may still write
    if array.dtype != nucleotide.dtype or not ours or not array.flags.c_contiguous:
        array = np.array(array, dtype=nucleotide.dtype, order="C")
        if array.dtype.kind == "f":
            array += nucleotide.dtype.type(0)  # no −0, which is another number to a digest
        array.setflags(write=False)
    return array


def check_description(genome) -> None:
    """Raise one `GenomeError` for all that is wrong with what describes a genome."""

    def number(value) -> bool:
        return isinstance(value, int | float | np.number) and not isinstance(value, bool)

    pixel, origin = genome.metres_per_pixel, genome.origin
    low, high = PIXEL_SIDES
    faults = {
        f"metres_per_pixel = {pixel!r}": number(pixel) and low <= pixel <= high,
        f"sigma_max = {genome.sigma_max!r}": number(genome.sigma_max) and genome.sigma_max > 0,
        "cities that are no names": 0 < len(genome.cities) <= 256
        and all(isinstance(city, str) for city in genome.cities),
        f"attribution = {genome.attribution!r}": isinstance(genome.attribution, str),
        f"crs = {genome.crs!r}": genome.crs is None or isinstance(genome.crs, str),
        f"origin = {origin!r}": origin is None
        or (len(origin) == 2 and all(number(one) and math.isfinite(one) for one in origin)),
        f"condensation = {genome.condensation!r}": genome.condensation is None
        or _fits(genome.condensation, genome.pavement),
    }
    found = [fault for fault, right in faults.items() if not right]
    if found:
        raise GenomeError(
            "; ".join(found),
            f"a pixel size of {low:g} to {high:g} m, 1…256 names of cities, text, (x, y) or None, "
            "a Condensation of the map's size or None",
            "correct them, or encode the map again",
        )


def _fits(layer, pavement: Pavement) -> bool:
    return isinstance(layer, Condensation) and layer.shape == (pavement.height, pavement.width)


def check_bounds(genome) -> None:
    """Raise one `GenomeError` that counts the lifs with nucleotides out of bounds."""
    p, side = genome.pavement, genome.pavement.side
    fields = (getattr(genome, name) for name in FIELDS)
    steepest, cities = np.float32(genome.sigma_max), len(genome.cities)
    if in_bounds(p.height, p.width, side, steepest, cities, *fields):
        return
    told = f"{p.block} above {p.block}" if p.uniform else "the range block's side above it"
    none = genome.dx == 0
    extent_x, extent_y = genome.dx.astype(np.int32), genome.dy.astype(np.int32)
    right, bottom = genome.x + extent_x, genome.y + extent_y
    with np.errstate(invalid="ignore"):
        faults = {
            f"σ beyond ±{genome.sigma_max:g}": ~(
                np.abs(genome.sigma) <= np.float32(genome.sigma_max)
            ),
            "β not finite": ~np.isfinite(genome.beta),
            "domain outside the map": (genome.x < 0)
            | (genome.y < 0)
            | (right > p.width)
            | (bottom > p.height),
            f"extent not a multiple of {told}": ~none
            & (
                (extent_x <= side)
                | (extent_y <= side)
                | (extent_x % side != 0)
                | (extent_y % side != 0)
            ),
            "no domain, yet σ, x, y, dy or iso not 0": none
            & (
                (genome.sigma != 0)
                | (extent_y != 0)
                | (genome.iso != 0)
                | (right != 0)
                | (bottom != 0)
            ),
            "iso above 7": genome.iso > 7,
            "turn above 7": genome.turn > 7,
            "parent or other not among the cities": np.maximum(genome.parent, genome.other)
            >= len(genome.cities),
            "part not in 0…1": ~((genome.part >= 0) & (genome.part <= 1)),
            "source below 0": genome.source < 0,
        }
    found = [f"{np.count_nonzero(bad)} lifs: {what}" for what, bad in faults.items() if bad.any()]
    if found:
        raise GenomeError(
            "; ".join(found),
            "nucleotides within the bounds of evocity.genome.NUCLEOTIDES",
            "round and clip before building a genome",
        )
