"""`Individual`: one birth of a run, with its scores, map, parents, pictures and files."""

import os
import shlex
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evocity.analysis.births import Births
from evocity.citymap import CityMap
from evocity.errors import MapError, RunError, keyword, plain_text, setting, spell
from evocity.genome import Genome, building_roofs
from evocity.html_display import Displayed
from evocity.store import Birth, Header, RunLog, Source

if TYPE_CHECKING:
    import pyarrow as pa
    from PIL import Image

    from evocity.scene import Scene

#: A source city with a smaller share of the buildings has few of them.
SCARCE = 0.1

# Rooms that draw and write are loaded only by the methods that need them.


class Individual(Displayed):
    """Birth of a run; the expression ``run[97]`` returns the individual with the id 97.

    The scores and the other columns of an individual are quick to read. The attributes ``genome``,
    ``made`` and ``parents`` come from the log; the attribute ``city`` is the decoded genome. An
    individual computes each attribute only once, and remembers the value.
    """

    def __init__(self, births: Births, identifier: int):
        """One of the ``births`` of a run. Raises `RunError` if there is no such birth."""
        self.births, self.run, self.id = births, births.run, identifier
        if births.is_read:
            births.rows([identifier])
        else:  # one birth is read faster than all
            _ = self.birth
        self.id = int(identifier)

    def __repr__(self) -> str:
        state = f"{plain_text(self.operator)}, generation {self.generation}, {self.status}"
        return f"Individual({self.id} of {str(self.run.path)!r}: {state})"

    def __eq__(self, other: object) -> bool:
        """Whether both are the same birth of the same run folder."""
        return isinstance(other, Individual) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)

    @property
    def _key(self) -> tuple[Path, int]:
        return self.run.path.resolve(), self.id

    # -- columns -----------------------------------------------------------------------------

    @cached_property
    def _row(self) -> int:
        return int(self.births.rows([self.id])[0])

    @property
    def generation(self) -> int:
        """Generation in which the individual was born; 0 is the first population."""
        return int(self.births.generation[self._row])

    @property
    def operator(self) -> str:
        """Name of the operator that bred the individual; the name is ``source`` for a source
        city."""
        return str(self.births.operator[self._row])

    @property
    def island(self) -> str | None:
        """Name of the island on which the individual was born; None in a run without islands."""
        return str(self.births.island[self._row]) if self.run.header.islands else None

    @property
    def status(self) -> str:
        """Status of the birth when it ended, for example ``ok`` (see `evocity.store.STATUSES`)."""
        return str(self.births.status[self._row])

    @property
    def seconds(self) -> float:
        """Seconds that one worker spent on the birth."""
        return float(self.births.seconds[self._row])

    @property
    def feasible(self) -> bool:
        """True if the individual has values for its measures and keeps all constraints."""
        return bool(self.births.feasible[self._row])

    @property
    def alive(self) -> bool:
        """Whether the individual is alive in the last generation."""
        return bool(self.births.alive[self._row])

    @property
    def lived(self) -> int:
        """Number of generations in which the individual was alive."""
        return int(self.births.lived[self._row])

    @property
    def scores(self) -> dict[str, float]:
        """Mapping from measures to their values, without missing values. Measures with a goal or
        bounds come first."""
        names, values = self.run.header.columns, self.births.values[self._row]
        return {n: float(v) for n, v in zip(names, values, strict=True) if not np.isnan(v)}

    @property
    def losses(self) -> dict[str, float]:
        """Mapping from each goal to the individual's loss for that goal; a lower loss is better.
        Raises `RunError` if the goals are unknown, or if the individual has no scores."""
        births = self.births
        if not births.ok[self._row]:
            raise RunError(
                f"{self} lacks a value for at least one goal of the run",
                "a birth that has the status 'ok' and a value for each goal",
                "choose another birth: run.where(\"status == 'ok'\")",
            )
        pairs = zip(births.goals, births.losses[self._row], strict=True)
        return {goal: float(loss) for goal, loss in pairs}

    # -- the log -----------------------------------------------------------------------------

    @cached_property
    def birth(self) -> Birth:
        """Its row of the log."""
        return self.run.individuals([self.id], rebred=False)[0]

    def is_known(self, birth: Birth, city: CityMap) -> None:
        """Set the individual's row of the log and its decoded map, if the caller already has
        both."""
        vars(self).update(birth=birth, city=city.replace(city.heights, name=self._title))

    @property
    def error(self) -> str | None:
        """Reason why the birth failed. For a birth that did not fail, the attribute gives the
        reason why a recorded measure has no value."""
        return self.birth.error

    @property
    def made(self) -> Mapping:
        """Parameters and results that the operator recorded when it bred the individual."""
        return self.birth.made

    @property
    def parents(self) -> list["Individual"]:
        """Parents of the individual, as individuals; a source city has no parents."""
        return [Individual(self.births, one) for one in self.birth.parents]

    @cached_property
    def genome(self) -> Genome:
        """Its genome. Raises `RunError` if it was never bred."""
        if self.birth.genome is None:
            return self.run.genome(self.id)  # bred again, or raises
        return self.run.with_roofs(self.birth.genome)

    @cached_property
    def city(self) -> CityMap:
        """Its decoded map, named after it. Raises `RunError` if its genome has no map."""
        expressed = self.run.header.chromosome.express(self.genome)
        if expressed.city is None:
            raise RunError(
                f"{self} has no map: {expressed.problem}",
                "a genome that decodes to a map",
                "choose another birth: run.where(\"status == 'ok'\")",
            )
        return expressed.city.replace(expressed.city.heights, name=self._title)

    @property
    def _title(self) -> str:
        return f"{self.run.name}, individual {self.id}"

    def ancestry(self, built: bool = False) -> dict[str, float]:
        """Compute the share of the map that comes from each source city, including open ground.
        Return a mapping from each city to its share; the shares add up to 1.

        built : whether only ground with buildings counts, without locked pixels. If only built
            ground counts, a map without such buildings gives an empty mapping, and a genome without
            a map raises `RunError`.
        """
        fabric = fabric_of(self.run.header, self.genome, "the ancestry")
        shares = built_shares(self.run.header, fabric, self.city) if built else fabric.shares
        pairs = zip(fabric.cities, shares, strict=True)
        return {city: float(share) for city, share in pairs if share > 0}

    @property
    def ground(self) -> str | None:
        """Name of the source city that supplied the largest share of the map. The argument ``at``
        of the method `save` accepts the name of a source city. The name is None if all source
        cities have the same place on Earth, or if no source city has a place on Earth."""

        if self.run.header.crs is not None or not self.run.header.chromosome.ancestry_columns:
            return None
        return ground_of(self.ancestry(), self.births.sources)

    def ancestors(self) -> "pa.Table":
        """Return all ancestors as an Arrow table with the oldest ancestors first (see
        `Run.ancestors`)."""
        return self.run.ancestors(self.id)

    # -- pictures and files ------------------------------------------------------------------

    def picture(self, zoom: float | None = None, highest: float | None = None) -> "Image.Image":
        """Draw the map as a picture with legend and attribution.

        The argument ``zoom`` multiplies the number of pixels along each side of the decoded map.
        The argument ``highest`` is the height in metres at the end of the colour scale.
        """
        from evocity.coding import decode
        from evocity.pictures import render

        city = self.city
        if zoom is not None and self.run.header.kind != "fabric":
            raise RunError(
                f"{setting('zoom', zoom)} does not work for a {self.run.header.kind}",
                "the genome of a city fabric, because only city fabrics decode at any zoom",
                f"leave {keyword('zoom')} out",
            )
        if zoom is not None:
            city = decode(self.genome, zoom=zoom).city
            city = city.replace(city.heights, name=f"{self._title}, zoom {zoom:g}")
        return render(city, highest=highest)

    def ancestry_picture(self) -> "Image.Image":
        """Draw the individual's map in the colours of its source cities, one colour for each city.
        The picture shows from which source cities each range block comes, directly or through
        earlier generations."""
        from evocity.coding.ancestry import ancestry
        from evocity.pictures import Shares, render_shares

        genome = fabric_of(self.run.header, self.genome, "the ancestry")
        title = "whose stones these are"
        return render_shares(Shares(self.city, ancestry(genome), genome.cities, title))

    def scene(self, **how: Any) -> "Scene":
        """Make a scene of the map in three dimensions, with the scores of the individual. The
        method takes the same keyword arguments as `evocity.scene`."""
        from evocity.scene import scene

        return scene(self.city, **(self._scene_facts | how))

    @property
    def _scene_facts(self) -> dict[str, Any]:
        """Scores, and of each building of a fabric its source city and its roof."""
        return {"measures": self.scores, **facts_of_buildings(self.city, self.genome)}

    def save(self, path: str | os.PathLike, at: str | None = None, crs: str | None = None) -> None:
        """Write the individual to a file. The suffix of ``path`` determines the format.

        A ``.parquet`` file contains the genome. A file with the suffix ``.tif`` or ``.npy``
        contains heights. A file with the suffix ``.gpkg``, ``.fgb``, ``.geoparquet`` or
        ``.geojson`` contains footprints. A ``.png`` file contains a picture. A file with another
        suffix of `evocity.scene.SUFFIXES`, such as ``.city.json`` or ``.glb``, contains a
        three-dimensional scene.

        at : name of a source city. The file gets the place on Earth and the coordinate reference
            system of the source city that `at` names. By default, the file gets the place on Earth
            that all source cities have in common. If the source cities have different places, the
            file gets no place on Earth.
        crs : reference system of a map, of footprints or of a scene, such as ``"EPSG:2154"``. By
            default, the file gets the reference system of its place.

        Raises `EvocityError` for an unknown suffix, and the errors of the writing function if
        writing fails. After an error, no incomplete file remains.
        """
        from evocity import io
        from evocity.scene import SUFFIXES, scene, suffix_of

        path = Path(path)
        suffix = path.suffix.lower()
        place = {} if at is None else place_of(self.run, at)
        if suffix == ".parquet":
            _refuse_crs(path, crs)
            self.genome.replace(**place).write(path)
        elif suffix in io.WRITERS:
            io.write_map(self.city.replace(self.city.heights, **place), path, crs=crs)
        elif suffix_of(path) is not None:
            city = self.city.replace(self.city.heights, **place)
            scene(city, **self._scene_facts).write(path, crs=crs)
        else:
            known = dict.fromkeys([".parquet", *io.WRITERS, *SUFFIXES])
            raise MapError(
                f"{path.name}: evocity cannot write {suffix or 'suffixless'} files",
                f"a file name that ends in {', '.join(known)}",
                "choose .gpkg or .tif for GIS, .glb for Blender and browsers, .png for a picture",
            )


def facts_of_buildings(city: CityMap, genome: Any) -> dict[str, Any]:
    """Return options of `evocity.scene`: of each building of a fabric its source city and its roof,
    as its source cities give it."""
    from evocity.fitness.heredity import building_sources

    if not isinstance(genome, Genome):
        return {}
    named, given = building_sources(city, genome), building_roofs(city, genome)
    return {"sources": named, "given_roofs": given}


def _refuse_crs(path: Path, crs: str | None) -> None:
    """Raise `MapError` for a reference system of a genome, which keeps that of its source."""
    if crs is not None:
        raise MapError(
            f"{path.name}: a genome cannot be converted to {spell(crs)}",
            "a map, footprints or a scene",
            f"choose .tif, .gpkg or .glb, or leave {keyword('crs')} out",
        )


def place_of(run: RunLog, name: str) -> dict[str, object]:
    """Return ``origin`` and ``crs`` of the source city ``name``. Raises `RunError` without a
    place."""
    cities = {source.name: source.city for source in run.sources()}
    placed = [one for one, city in cities.items() if city.crs is not None]
    if name not in placed:
        fault = "lies nowhere on Earth" if name in cities else "is not a source city"
        raise RunError(
            f"{run.path}: at = {spell(name)}, which {fault}",
            f"one of {', '.join(placed)}" if placed else "a source city that lies on Earth",
            "choose one of these" if placed else "leave it out: .gpkg takes local metres",
        )
    return {"origin": cities[name].origin, "crs": cities[name].crs}


def ground_of(shares: Mapping[str, float], sources: Sequence[Source]) -> str | None:
    """Return the source city on Earth with the largest of the ``shares`` (city -> 0…1)."""
    placed = [one.name for one in sources if one.city.crs is not None and shares.get(one.name)]
    return max(placed, key=lambda name: shares[name], default=None)


def command_for_gis(run: str, identifier: int, ground: str | None) -> str:
    """Return the shell command that writes an individual as footprints."""
    at = "" if ground is None else f" --at {shlex.quote(ground)}"
    return f"evocity decode {shlex.quote(run)} --id {identifier}{at} -o {identifier}.gpkg"


def command_for_blender(run: str, identifier: int) -> str:
    """Return the shell command that writes an individual as a scene."""
    return f"evocity scene {shlex.quote(run)} --id {identifier} -o {identifier}.glb"


# Births whose genomes are held at a time.
_AT_A_TIME = 256


def fabric_of(header: Header, genome: Any, what: str) -> Genome:
    """Return the fabric in a ``genome``. Raises `RunError`, which names ``what`` needs it."""
    fabric = header.chromosome.fabric(genome)
    if fabric is None:
        raise RunError(
            f"{what} needs source cities, but a genome of the kind '{header.kind}' has no cities",
            "a run that breeds genomes with source cities: city fabrics or sites",
            "use the picture, the measures and the pedigree of the birth instead",
        )
    return fabric


def built_shares(header: Header, fabric: Genome, city: CityMap) -> np.ndarray:
    """Return the share of each source city in what is built on ``city``, float64 ``(cities,)``;
    locked pixels count only in runs that also measured them, see `Header`."""
    built = city.built
    if fabric.condensation is not None and header.shares == "free":
        built = built & ~fabric.condensation.mask
    return fabric.shares_of(fabric.pavement.sums(built.astype(np.float32)))


def shares_of(run: RunLog, ids: np.ndarray) -> np.ndarray:
    """Return the share of each source city in the births ``ids``, float64 ``(n, cities)``, or
    NaN."""
    shares = np.full((len(ids), len(run.header.cities)), np.nan)
    order = np.argsort(ids, kind="stable")  # births of a generation lie together in the log
    for rows in np.array_split(order, len(ids) // _AT_A_TIME + 1):
        for row, birth in zip(rows, run.individuals(ids[rows].tolist()), strict=True):
            if birth.genome is not None:
                shares[row] = fabric_of(run.header, birth.genome, "the ancestry").shares
    return shares


def describe_scarce(shares: Mapping[str, float], cities: Sequence[str]) -> str:
    """Name the source ``cities`` that have under `SCARCE` of the buildings, in a sentence; empty if
    all have more, and for a single city. ``shares``: source city -> share of what is built."""
    scarce = [city for city in cities if shares.get(city, 0.0) < SCARCE]
    if not shares or not scarce or len(cities) < 2:
        return ""
    parts = [f"{share_text(shares.get(city, 0.0))} of its buildings from {city}" for city in scarce]
    return f"It has only {' and '.join(parts)}."


def share_text(share: float) -> str:
    """Return a share in words; a share between nothing and all is neither 0 % nor 100 %."""
    if 0 < share < 0.005:
        return "under 1 %"
    return "over 99 %" if 0.995 <= share < 1 else f"{100 * share:.0f} %"
