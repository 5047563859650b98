"""The filter desk of a birth: interpolation with a second birth, filters by calls, and zoom; and
the maps of its autosimilarity."""

from dataclasses import dataclass, field
from functools import partial
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from evocity.analysis.individual import Individual, fabric_of
from evocity.coding import autosimilarity_maps, decode, high_pass, low_pass
from evocity.coding.usage import usage
from evocity.errors import RunError
from evocity.genome import Genome
from evocity.operators import Interpolation, make
from evocity.pictures.picture import values_end
from evocity.studio.background_job import BackgroundJob, Cache, JobSlot
from evocity.studio.birth_details import coloured_field, framed_heights
from evocity.studio.children import Child
from evocity.studio.kept_children import write_children
from evocity.studio.request_fields import Body, Id
from evocity.studio.run_watcher import Moment, RunWatcher

#: Births and mixtures that stay in memory, and pixels of a filtered map; at most.
MOST_KEPT, MOST_PIXELS = 12, 1 << 24
#: The seed of interpolations, so that the same sliders give the same map.
SEED = 0
#: Maps of `evocity.coding.AutosimilarityMaps`: the name for the page, and the unit.
FIELDS = {
    "mean": ("mean error µ̃", ""),
    "least": ("least error µ_min", ""),
    "domain": ("best side D of domain blocks", "px"),
}

_Calls = Annotated[float, Field(ge=0, le=1e9)]


class FilterRequest(Body):
    """The sliders of the desk. ``share``: λ, the share of the birth ``id`` in a mixture with the
    birth ``beside``. ``low`` and ``high``: f_c of the low-pass and of the high-pass filter."""

    id: Id
    beside: Id | None = None
    share: Annotated[float, Field(ge=0, le=1)] = 1.0
    low: _Calls | None = None
    high: _Calls = 0.0
    count: Literal["pixels", "domains", "ranges"] = "pixels"
    zoom: Annotated[float, Field(ge=0.25, le=2)] = 1.0


class FilterKeepRequest(FilterRequest):
    """A request to save the filtered genome; the ``picks`` join the recipe as parents."""

    picks: Annotated[tuple[Id, ...], Field(max_length=16)] = ()


@dataclass
class FilterDesk:
    """The filtered maps of the births of one run."""

    watcher: RunWatcher
    _cache: Cache = field(default_factory=lambda: Cache(MOST_KEPT))

    def genome(self, request: FilterRequest) -> tuple[Genome, int]:
        """Return the genome that the sliders describe, and the most calls before the filters."""
        births = [request.id]
        if request.beside is not None and request.beside != request.id and request.share < 1:
            births.append(request.beside)
        with self.watcher.reading:
            moment = self.watcher.moment
            parents = [
                self._cache.get((moment.fingerprint, n), partial(_fabric, moment, n))
                for n in births
            ]
        genome = parents[0]
        if len(parents) > 1:
            key = (moment.fingerprint, *births, request.share)
            genome = self._cache.get(key, lambda: _mixed(parents, request.share))
        most = int(getattr(usage(genome), request.count).max())
        if request.high:  # 0 changes nothing, and counting the calls takes a tenth of the time
            genome = high_pass(genome, request.high, count=request.count)
        if request.low is not None:
            genome = low_pass(genome, request.low, count=request.count)
        return genome, most

    def heights(self, request: FilterRequest) -> tuple[dict, bytes]:
        """Return the filtered map: rows, columns, metres per pixel, and the ``most`` calls;
        heights as float32."""
        genome, most = self.genome(request)
        pavement = genome.pavement
        pixels = int(pavement.height * pavement.width * request.zoom**2)
        if pixels > MOST_PIXELS:
            raise RunError(
                f"the filtered map has {pixels} pixels at the zoom {request.zoom:g}",
                f"at most {MOST_PIXELS} pixels",
                "move the zoom slider to a lower value",
            )
        about, content = framed_heights(decode(genome, zoom=request.zoom).city)
        return about | {"most": most}, content

    def keep(self, request: FilterKeepRequest, is_own: bool) -> dict:
        """Write the filtered genome and a recipe, as `write_children` does for bred children."""
        genome, _ = self.genome(request)
        parents = tuple(n for n in (request.id, request.beside) if n is not None)
        parameters = request.model_dump(exclude={"id", "beside", "picks"})
        child = Child(0, make("interpolation"), parents, parameters, genome=genome)
        with self.watcher.reading:
            return write_children(self.watcher.moment.run, [child], request.picks, is_own, SEED)


def _fabric(moment: Moment, identifier: int) -> Genome:
    genome = Individual(moment.run.columns, identifier).genome
    return fabric_of(moment.run.header, genome, "the filter desk")


def _mixed(parents: list[Genome], share: float) -> Genome:
    return Interpolation(share=share)(parents, np.random.default_rng(SEED))


# -- autosimilarity -------------------------------------------------------------------------------


class FieldRequest(Body):
    """A request for autosimilarity: range blocks of side ``block``, domain blocks of several
    sides."""

    ids: Annotated[tuple[Id, ...], Field(min_length=1, max_length=2)]
    block: Annotated[int, Field(title="side B", description="2 to 16 px", ge=2, le=16)] = 8
    domains: Annotated[
        tuple[Annotated[int, Field(ge=3, le=64)], ...],
        Field(title="sides D", description="1 to 8 sides in px", min_length=1, max_length=8),
    ] = (16,)
    normalise: Literal["heights", "variance"] = "heights"


class FieldPicture(FieldRequest):
    """A request for the map of the birth at a ``place`` in `ids`."""

    place: Literal[0, 1]
    measure: Literal["mean", "least", "domain"]


class Autosimilarity:
    """The search for µ̃, µ_min and D of births of one run, one search at a time."""

    def __init__(self, watcher: RunWatcher):
        self._watcher, self._slot = watcher, JobSlot()
        self._cache = Cache(MOST_KEPT)
        self.stop = self._slot.stop

    def begin(self, request: FieldRequest) -> dict:
        """Begin the search, or go on with it; return its state."""
        with self._watcher.reading:
            moment = self._watcher.moment
            cities = {n: Individual(moment.run.columns, n).city for n in request.ids}
        settings = self._settings(request)

        def search(job: BackgroundJob) -> dict:
            maps = {}
            for place, (n, city) in enumerate(cities.items()):

                def progress(done: float, total: int, place: int = place) -> None:
                    job.progress(int(place * total + done), len(cities) * int(total))

                maps[n] = self._cache.get(
                    (*settings, n),
                    partial(
                        autosimilarity_maps,
                        city,
                        block=request.block,
                        domains=request.domains,
                        normalise=request.normalise,
                        progress=progress,
                    ),
                )
            return maps

        return self._slot.begin((*settings, request.ids), search)

    def _settings(self, request: FieldRequest) -> tuple:
        fingerprint = self._watcher.moment.fingerprint
        return fingerprint, request.block, request.domains, request.normalise

    def picture(self, request: FieldPicture) -> tuple[dict, bytes]:
        """Return the map of one birth as PNG, with the ``end`` of the colours that all births of
        the request share, and the ``curve`` from D to the mean µ."""
        key = (*self._settings(request), request.ids)
        maps = self._slot.result(key, "the maps of autosimilarity")
        values = {n: getattr(one, request.measure) for n, one in maps.items()}
        end = max(values_end(one[~np.isnan(one)]) for one in values.values())
        shown = request.ids[min(request.place, len(request.ids) - 1)]
        known = values[shown][~np.isnan(values[shown])]
        title, unit = FIELDS[request.measure]
        about = {
            "title": title,
            "unit": unit,
            "end": end,
            "mean": float(known.mean(dtype=float)) if known.size else None,
            "most": float(known.max()) if known.size else None,
            "known": known.size / values[shown].size,
            "curve": [
                [int(extent), None if mean != mean else float(mean)]
                for extent, mean in maps[shown].curve.items()
            ],
        }
        return about, coloured_field(values[shown], end)
