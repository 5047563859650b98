"""The canary: a tiny individual whose evaluation shows whether a worker still computes as before.

A measure or an operator may change more of its process than `ProcessState` restores, for example
evocity's own functions. Then the canary's digest differs from that of the worker's start, and the
main process does the worker's last births again elsewhere.
"""

import copy
import time
from hashlib import blake2b
from types import SimpleNamespace
from typing import Any

import numpy as np

from evocity import fitness
from evocity.citymap import CityMap
from evocity.coding.decoding_cache import cached_maps, forget
from evocity.evaluation.evaluator import Evaluator
from evocity.fitness.part import own_name
from evocity.genome import Genome, packed
from evocity.kinds import CurveForm, Kind, ShapeForm, Site
from evocity.pavement import Pavement

#: The name of its city, and the side of its map: at least so many pixels, and range blocks.
_NAME, _PIXELS, _BLOCKS = "canary", 16, 4
_METRES = 2.0
#: A measure that every canary takes.
_ALWAYS = "gsi"


class Canary:
    """The canary of an ``evaluator`` with range blocks of these ``sides``: its map takes every
    measure of evocity's own that the evaluator has. ``expected`` is the digest at the start, ""
    if two evaluations differ at once; ``seconds`` is the time of one."""

    def __init__(self, evaluator: Evaluator, sides: int | tuple[int, int]):
        kind = evaluator.header.chromosome
        self._kind, self._fabric = kind, _make_fabric(sides)
        own = {
            own_name(name): measure
            for name, measure in evaluator.measures.items()
            if measure.origin == "evocity" and measure.of in kind.subjects
        }
        if "city" in kind.subjects:
            own.setdefault(_ALWAYS, fitness.get(_ALWAYS))
        self._evaluator = copy.copy(evaluator)
        self._evaluator.measures = own
        header: Any = SimpleNamespace(
            chromosome=kind, measures=(), recorded=tuple(own), thumbnails=None
        )
        self._evaluator.header = header
        self._evaluator.within, self._evaluator.bounds = {}, frozenset()
        self._evaluator.sources = (_make_source(self._fabric),)
        compared = [one.reference.cities for one in own.values() if one.reference is not None]
        self._shared = [*(evaluator.sources or ()), *(city for some in compared for city in some)]
        first = self.digest()
        start = time.perf_counter()
        self.expected = first if self.digest() == first else ""
        self.seconds = time.perf_counter() - start

    def digest(self) -> str:
        """Evaluate the canary; return a digest of all results. It never raises."""
        try:
            return self._digest()
        except BaseException as error:
            return f"raises {type(error).__name__}"

    def _digest(self) -> str:
        genome = _make_genome(self._kind, self._fabric)
        forget(self._fabric)
        outcome = self._evaluator.evaluate(genome)
        values = {name: value.hex() for name, value in sorted(outcome.values.items())}
        state = blake2b(repr((outcome.status, outcome.error, values)).encode(), digest_size=16)
        state.update(b"" if outcome.look is None else outcome.look.tobytes())
        city = self._kind.express(genome).city
        state.update(b"" if city is None else city.heights.tobytes())
        # a measure that made an array writeable may have written into it, and maps are shared
        writeable = sum(map(_count_writeable, [*self._shared, *cached_maps()]))
        state.update(f"{writeable} writeable".encode())
        return state.hexdigest()


def _count_writeable(city: CityMap) -> int:
    """Count the writeable arrays of a map and of its computed views, which are read-only."""
    views = [name for name in vars(city) if name == "heights" or hasattr(CityMap, name)]
    parts = [vars(city)[name] for name in views]
    parts += [inner for part in parts for inner in getattr(part, "__dict__", {}).values()]
    return sum(part.flags.writeable for part in parts if isinstance(part, np.ndarray))


def _make_fabric(sides: int | tuple[int, int]) -> Genome:
    """Make a small code by hand: every second range block shrinks a domain block."""
    block = sides if isinstance(sides, int) else sides[0]
    side = -(-max(_PIXELS, _BLOCKS * block) // block) * block
    pavement = Pavement(side, side, block)
    number = np.arange(len(pavement))
    coded = number % 2 == 1
    top, left = pavement.corners
    most = side - 2 * block
    return Genome(
        pavement,
        sigma=np.where(coded, 0.25 + 0.25 * (number % 3), 0),
        beta=np.where(number % 4 < 3, 6.0 + 3.0 * (number % 5), 0.0),
        x=np.where(coded, np.minimum(left, most), 0),
        y=np.where(coded, np.minimum(top, most), 0),
        dx=np.where(coded, 2 * block, 0),
        dy=np.where(coded, 2 * block, 0),
        iso=np.where(coded, number % 8, 0),
        parent=np.zeros(len(pavement), np.uint8),
        source=packed(top, left),
        metres_per_pixel=_METRES,
        cities=(_NAME,),
        settle=True,
    )


def _make_source(fabric: Genome) -> CityMap:
    """Make the map that stands for the source city of the canary."""
    heights = fabric.pavement.raster(np.abs(fabric.beta))
    return CityMap(heights, _METRES, name=_NAME)


def _make_genome(kind: Kind, fabric: Genome) -> Any:
    """Make a new genome of a ``kind``, whose map is not yet computed."""
    window: dict[str, Any] = {
        "pixels": fabric.pavement.width,
        "metres_per_pixel": _METRES,
        "name": _NAME,
    }
    side = fabric.pavement.width * _METRES
    if kind.name == "shape":
        corners = np.array([[0.1, 0.1], [0.5, 0.1], [0.3, 0.5]])
        maps = [np.column_stack([0.4 * np.eye(2), corner]) for corner in corners]
        return ShapeForm(maps=np.array(maps), **window)
    if kind.name == "fabric":
        return fabric
    from evocity.shapes import Curve

    ends = np.array([[0.1, 0.3], [0.4, 0.7], [0.9, 0.5]]) * side
    curve = Curve.bezier(ends)
    course = CurveForm(points=curve.points, maps=curve.maps, breadth=4.0, lay=3.0, **window)
    return course if kind.name == "curve" else Site.of(fabric, (course,))
