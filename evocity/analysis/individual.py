"""`Individual`: one birth of a run, with its scores, map, parents, pictures and files."""

import os
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evocity.analysis.births import Births
from evocity.analysis.fabric_genomes import built_shares, fabric_of
from evocity.citymap import CityMap
from evocity.errors import MapError, RunError, keyword, setting
from evocity.genome import Genome
from evocity.html_display import Displayed
from evocity.store import Birth

if TYPE_CHECKING:
    import pyarrow as pa
    from PIL import Image

    from evocity.scene import Scene

# Rooms that draw and write are loaded only by the methods that need them.


class Individual(Displayed):
    """Birth of a run; ``run[97]`` makes it.

    The columns of births are quick to read. The attributes ``genome``, ``made`` and ``parents``
    read the log, and ``city`` decodes the genome. Each value is computed once and kept.
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
        state = f"{self.operator}, generation {self.generation}, {self.status}"
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
        """Operator that bred the individual; ``source`` for a source city."""
        return str(self.births.operator[self._row])

    @property
    def island(self) -> str | None:
        """Island on which the individual was born; None in a run without islands."""
        return str(self.births.island[self._row]) if self.run.header.islands else None

    @property
    def status(self) -> str:
        """Status at the end of the birth, see `evocity.store.STATUSES`."""
        return str(self.births.status[self._row])

    @property
    def seconds(self) -> float:
        """Seconds that one worker spent on the birth."""
        return float(self.births.seconds[self._row])

    @property
    def feasible(self) -> bool:
        """True if the individual was measured and keeps all constraints."""
        return bool(self.births.feasible[self._row])

    @property
    def alive(self) -> bool:
        """True if the individual is alive in the last generation."""
        return bool(self.births.alive[self._row])

    @property
    def lived(self) -> int:
        """Number of generations in which the individual lived."""
        return int(self.births.lived[self._row])

    @property
    def scores(self) -> dict[str, float]:
        """Mapping from each measure to its value, without missing values. Measures with a goal or
        bounds come first."""
        names, values = self.run.header.columns, self.births.values[self._row]
        return {n: float(v) for n, v in zip(names, values, strict=True) if not np.isnan(v)}

    @property
    def losses(self) -> dict[str, float]:
        """Mapping from each goal to the loss of the individual; lower is better. Raises `RunError`
        if the goals are unknown, or if the individual has no scores."""
        births = self.births
        if not births.ok[self._row]:
            raise RunError(
                f"{self} was not measured",
                "a birth with status ok, and a value of each goal",
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
        """Take the row of the log and the map from a caller that has already read and decoded
        them."""
        vars(self).update(birth=birth, city=city.replace(city.heights, name=self._title))

    @property
    def error(self) -> str | None:
        """Reason why the birth failed. If it did not fail, the reason why a recorded measure has no
        value."""
        return self.birth.error

    @property
    def made(self) -> Mapping:
        """Parameters and results that the operator recorded."""
        return self.birth.made

    @property
    def parents(self) -> list["Individual"]:
        """Parents of the individual; empty for a source city."""
        return [Individual(self.births, one) for one in self.birth.parents]

    @cached_property
    def genome(self) -> Genome:
        """Its genome. Raises `RunError` if it was never bred."""
        if self.birth.genome is None:
            return self.run.genome(self.id)  # bred again, or raises
        return self.birth.genome

    @cached_property
    def city(self) -> CityMap:
        """Its decoded map, named after it. Raises `RunError` if its genome has no map."""
        expressed = self.run.header.chromosome.express(self.genome)
        if expressed.city is None:
            raise RunError(
                f"{self}: {expressed.problem}",
                "a genome that decodes to a map",
                "choose another birth: run.where(\"status == 'ok'\")",
            )
        return expressed.city.replace(expressed.city.heights, name=self._title)

    @property
    def _title(self) -> str:
        return f"{self.run.name}, individual {self.id}"

    def ancestry(self, built: bool = False) -> dict[str, float]:
        """Compute the share of the map that comes from each source city, with open ground. The
        result is a mapping; its shares add up to 1.

        built : whether to count only built ground. The result is then empty if nothing is built,
            and a genome without a map raises `RunError`.
        """
        fabric = fabric_of(self.run.header, self.genome, "the ancestry")
        shares = built_shares(fabric, self.city) if built else fabric.shares
        pairs = zip(fabric.cities, shares, strict=True)
        return {city: float(share) for city, share in pairs if share > 0}

    @property
    def ground(self) -> str | None:
        """Source city that most of the map comes from, which suits the argument ``at`` of `save`.
        None if all source cities lie in one place, or if none lies on Earth."""
        from evocity.analysis.georeference import ground_of

        if self.run.header.crs is not None or not self.run.header.chromosome.ancestry_columns:
            return None
        return ground_of(self.ancestry(), self.births.sources)

    def ancestors(self) -> "pa.Table":
        """Return all ancestors as an Arrow table, the oldest first, see `Run.ancestors`."""
        return self.run.ancestors(self.id)

    # -- pictures and files ------------------------------------------------------------------

    def picture(self, zoom: float | None = None, highest: float | None = None) -> "Image.Image":
        """Draw the map with legend and attribution.

        The factor ``zoom`` multiplies the pixels along each side before decoding. The colours end
        at ``highest`` metres.
        """
        from evocity.coding import decode
        from evocity.pictures import render

        city = self.city
        if zoom is not None and self.run.header.kind != "fabric":
            raise RunError(
                f"{setting('zoom', zoom)} does not fit a {self.run.header.kind}",
                "a fabric, which decodes at any size",
                f"leave {keyword('zoom')} out",
            )
        if zoom is not None:
            city = decode(self.genome, zoom=zoom).city
            city = city.replace(city.heights, name=f"{self._title}, zoom {zoom:g}")
        return render(city, highest=highest)

    def ancestry_picture(self) -> "Image.Image":
        """Draw a map of the source cities. It shows which cities each range block comes from, and
        which cities its fabric was copied from before."""
        from evocity.coding.ancestry import ancestry
        from evocity.pictures import Shares, render_shares

        genome = fabric_of(self.run.header, self.genome, "the ancestry")
        title = "whose stones these are"
        return render_shares(Shares(self.city, ancestry(genome), genome.cities, title))

    def scene(self, **how: Any) -> "Scene":
        """Make a scene of the map in three dimensions, with the scores. The arguments ``how`` are
        those of `evocity.scene`."""
        from evocity.scene import scene

        return scene(self.city, **({"measures": self.scores} | how))

    def save(self, path: str | os.PathLike, at: str | None = None) -> None:
        """Write the individual to a file; the suffix of ``path`` chooses the format.

        ``.parquet`` holds the genome. ``.tif`` and ``.npy`` hold heights, ``.gpkg`` and
        ``.geojson`` footprints. ``.png`` is a picture. ``.city.json``, ``.glb``, ``.obj``, ``.wrl``
        and ``.x3d`` hold a scene.

        at : name of a source city. The map is placed at this city's place on Earth, in its
            reference system. By default the map lies where all source cities lie. If they lie in
            several places, the file has no place on Earth.

        Raises `EvocityError` for an unknown suffix, and the errors of writing. After an error no
        file remains.
        """
        from evocity import io
        from evocity.analysis.georeference import place_of
        from evocity.scene import SUFFIXES, scene, suffix_of

        path = Path(path)
        suffix = path.suffix.lower()
        place = {} if at is None else place_of(self.run, at)
        if suffix == ".parquet":
            self.genome.replace(**place).write(path)
        elif suffix in io.WRITERS:
            io.write_map(self.city.replace(self.city.heights, **place), path)
        elif suffix_of(path) is not None:
            city = self.city.replace(self.city.heights, **place)
            scene(city, measures=self.scores).write(path)
        else:
            known = dict.fromkeys([".parquet", *io.WRITERS, *SUFFIXES])
            raise MapError(
                f"{path.name}: no birth is written as {suffix or 'a file without a suffix'}",
                f"a name that ends in {', '.join(known)}",
                "choose .gpkg or .tif for GIS, .glb for Blender and browsers, .png for a picture",
            )
