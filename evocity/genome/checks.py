"""Validation of genomes: types of the arrays, description, bounds of the nucleotides."""

import math
from collections.abc import Mapping

import numpy as np

from evocity.citymap import MOST_ATTRIBUTION, PIXEL_SIDES
from evocity.condensation import Condensation
from evocity.errors import GenomeError, is_number, spell
from evocity.genome._kernels import in_bounds
from evocity.genome.nucleotides import FIELDS, Nucleotide
from evocity.genome.roofs import RoofTable

#: The values of `Genome.settle`: raw heights, flat buildings, flat roofs.
SETTLING = (False, True, "roofs")


def owned_array(name: str, values: np.ndarray, nucleotide: Nucleotide, count: int) -> np.ndarray:
    """Do as `typed_array`, but keep an array that suits: it belongs to the genome from now on."""
    dtype, flags = nucleotide.dtype, values.flags
    if values.shape != (count,) or values.dtype != dtype or not (flags.owndata and flags.carray):
        return typed_array(name, values, nucleotide, count)
    if dtype.kind == "f":
        values += dtype.type(0)  # −0 would change the digest
    values.setflags(write=False)
    return values


def typed_array(name: str, values, nucleotide: Nucleotide, count: int) -> np.ndarray:
    """Convert ``values`` to a read-only array ``(count,)`` of the nucleotide's type. Raises
    `GenomeError` for another shape, or for values that do not fit the type."""
    array = np.asarray(values)
    if array.shape != (count,):
        raise GenomeError(
            f"the array {name} has the shape {array.shape}",
            f"an array of the shape ({count},), with one value per range block",
            "give each array as many values as the genome has range blocks",
        )
    if nucleotide.dtype.kind in "iu" and array.dtype != nucleotide.dtype:
        limits = np.iinfo(nucleotide.dtype)
        if array.dtype.kind not in "iub" or (
            array.size and (array.min() < limits.min or array.max() > limits.max)
        ):
            raise GenomeError(
                f"the {array.dtype} array {name} has values that {nucleotide.dtype} cannot hold",
                f"whole numbers from {limits.min} to {limits.max}",
                "round the values, and clip them to these limits",
            )
    ours = array.base is None and not array.flags.writeable  # else a caller may still write to it
    if array.dtype != nucleotide.dtype or not ours or not array.flags.c_contiguous:
        array = np.array(array, dtype=nucleotide.dtype, order="C")
        if array.dtype.kind == "f":
            with np.errstate(invalid="ignore"):  # a signalling NaN of a damaged file
                array += nucleotide.dtype.type(0)  # −0 would change the digest
        array.setflags(write=False)
    return array


def is_settling(value) -> bool:
    """Tell whether a ``value`` is one of `SETTLING`; 0 and 1 are not."""
    return isinstance(value, bool | str) and value in SETTLING


def check_description(genome) -> None:
    """Raise one `GenomeError` that lists every fault of a genome's description."""
    pixel, origin, layer, p = (
        genome.metres_per_pixel, genome.origin, genome.condensation, genome.pavement
    )  # fmt: skip
    low, high = PIXEL_SIDES
    faults = {
        f"metres_per_pixel = {pixel!r}": is_number(pixel) and low <= pixel <= high,
        f"sigma_max = {genome.sigma_max!r}": is_number(genome.sigma_max) and genome.sigma_max > 0,
        "cities that are not names": 0 < len(genome.cities) <= 256
        and all(isinstance(city, str) for city in genome.cities),
        f"attribution = {spell(genome.attribution)}": isinstance(genome.attribution, str)
        and len(genome.attribution) <= MOST_ATTRIBUTION,
        f"crs = {spell(genome.crs)}": genome.crs is None or isinstance(genome.crs, str),
        f"origin = {origin!r}": origin is None
        or (len(origin) == 2 and all(is_number(at) and math.isfinite(at) for at in origin)),
        f"condensation = {layer!r}": layer is None
        or (isinstance(layer, Condensation) and layer.shape == (p.height, p.width)),
        f"settle = {genome.settle!r}": is_settling(genome.settle),
        f"roofs = {spell(genome.roofs)}": isinstance(genome.roofs, Mapping)
        and all(isinstance(table, RoofTable) for table in genome.roofs.values()),
    }
    wrong = [fault for fault, right in faults.items() if not right]
    if wrong:
        raise GenomeError(
            "; ".join(wrong),
            f"a pixel size of {low:g} to {high:g} m, 1…256 names of cities, text of at most "
            f"{MOST_ATTRIBUTION} letters, (x, y) or None, a Condensation of the map's size or "
            "None, a RoofTable by city, and True, False or 'roofs' for settle",
            "correct them, or encode the map again",
        )


def check_bounds(genome) -> None:
    """Raise one `GenomeError` that counts the lifs with nucleotides out of bounds."""
    p, side = genome.pavement, genome.pavement.side
    fields = (getattr(genome, name) for name in FIELDS)
    steepest, cities = np.float32(genome.sigma_max), len(genome.cities)
    if in_bounds(p.height, p.width, side, steepest, cities, *fields):
        return
    extent = f"{p.block} above {p.block}" if p.uniform else "the range block's side above it"
    x, y, sigma, iso, part = genome.x, genome.y, genome.sigma, genome.iso, genome.part
    tall, wide = genome.dy.astype(np.int32), genome.dx.astype(np.int32)
    bare, right, bottom = wide == 0, x + wide, y + tall
    legal = (tall > side) & (wide > side) & (tall % side == 0) & (wide % side == 0)
    void = (sigma == 0) & (tall == 0) & (iso == 0) & (right == 0) & (bottom == 0)
    inside = (x >= 0) & (y >= 0) & (right <= p.width) & (bottom <= p.height)
    with np.errstate(invalid="ignore"):
        faults = {
            f"σ beyond ±{genome.sigma_max:g}": ~(np.abs(sigma) <= steepest),
            "β not finite": ~np.isfinite(genome.beta),
            "domain outside the map": ~inside,
            f"extent not a multiple of {extent}": ~bare & ~legal,
            "no domain, yet σ, x, y, dy or iso not 0": bare & ~void,
            "iso above 7": iso > 7,
            "turn above 7": genome.turn > 7,
            "parent or other not among the cities": np.maximum(genome.parent, genome.other)
            >= cities,
            "part not in 0…1": ~((part >= 0) & (part <= 1)),
            "source below 0": genome.source < 0,
        }
    wrong = [f"{np.count_nonzero(bad)} lifs: {what}" for what, bad in faults.items() if bad.any()]
    if wrong:
        raise GenomeError(
            "; ".join(wrong),
            "nucleotides within the bounds of evocity.genome.NUCLEOTIDES",
            "round and clip before building a genome",
        )
