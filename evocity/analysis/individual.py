"""`Individual`: one birth of a run, with all that can be asked of it."""

import os
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evocity.analysis.births import Told
from evocity.analysis.fabrics import built_shares, fabric_of
from evocity.citymap import CityMap
from evocity.displayed import Displayed
from evocity.errors import MapError, RunError, keyword, setting
from evocity.genome import Genome
from evocity.store import Birth

if TYPE_CHECKING:
    import pyarrow as pa
    from PIL import Image

    from evocity.scene import Scene

# Rooms that draw and write are loaded by the methods that do: who reads numbers waits for none.


class Individual(Displayed):
    """A birth of a run; ``run[97]`` makes it.

    What the births' columns tell costs nothing; ``genome``, ``made`` and ``parents`` read the log,
    ``city`` decodes. Whatever is asked for is kept.
    """

    def __init__(self, told: Told, identifier: int):
        """One of those that are ``told``. Raises `RunError` if there is no such birth."""
        self.told, self.run, self.id = told, told.run, identifier
        if told.read_already:
            told.rows([identifier])
        else:  # one is sooner found than all are read
            _ = self.birth
        self.id = int(identifier)

    def __repr__(self) -> str:
        told = f"{self.operator}, generation {self.generation}, {self.status}"
        return f"Individual({self.id} of {str(self.run.path)!r}: {told})"

    def __eq__(self, other: object) -> bool:
        """The same birth of the same run folder."""
        return isinstance(other, Individual) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)

    @property
    def _key(self) -> tuple[Path, int]:
        return self.run.path.resolve(), self.id

    # -- what the columns tell ---------------------------------------------------------------

    @cached_property
    def _row(self) -> int:
        return int(self.told.rows([self.id])[0])

    @property
    def generation(self) -> int:
        """When it was born; 0 is the first population."""
        return int(self.told.generation[self._row])

    @property
    def operator(self) -> str:
        """By what it was bred; ``source`` if it is a source city."""
        return str(self.told.operator[self._row])

    @property
    def island(self) -> str | None:
        """Where it was born; None in a run without islands."""
        return str(self.told.island[self._row]) if self.run.header.islands else None

    @property
    def status(self) -> str:
        """How its birth ended, see `evocity.store.STATUSES`."""
        return str(self.told.status[self._row])

    @property
    def seconds(self) -> float:
        """What it took one worker."""
        return float(self.told.seconds[self._row])

    @property
    def feasible(self) -> bool:
        """Whether it was measured and keeps all constraints."""
        return bool(self.told.feasible[self._row])

    @property
    def alive(self) -> bool:
        """Whether it lives in the last generation."""
        return bool(self.told.alive[self._row])

    @property
    def lived(self) -> int:
        """In how many generations it lived."""
        return int(self.told.lived[self._row])

    @property
    def scores(self) -> dict[str, float]:
        """Measure -> value, as far as it has one; the wanted ones first, then the recorded."""
        names, values = self.run.header.columns, self.told.values[self._row]
        return {n: float(v) for n, v in zip(names, values, strict=True) if not np.isnan(v)}

    @property
    def losses(self) -> dict[str, float]:
        """Goal -> loss, lower is better. Raises `RunError` where the run does not tell what it
        wanted, or the birth was not measured."""
        told = self.told
        if not told.ok[self._row]:
            raise RunError(
                f"{self} was not measured",
                "a birth with status ok, and a value of each goal",
                "choose another: run.where(\"status == 'ok'\")",
            )
        pairs = zip(told.goals, told.losses[self._row], strict=True)
        return {goal: float(loss) for goal, loss in pairs}

    # -- what the log tells ------------------------------------------------------------------

    @cached_property
    def birth(self) -> Birth:
        """Its row of the log."""
        return self.run.individuals([self.id], rebred=False)[0]

    def is_known(self, birth: Birth, city: CityMap) -> None:
        """Take its row of the log, and its map, from who has read and decoded them already."""
        vars(self).update(birth=birth, city=city.replace(city.heights, name=self._title))

    @property
    def error(self) -> str | None:
        """Why it failed; of one that did not, why a recorded measure has no value."""
        return self.birth.error

    @property
    def made(self) -> Mapping:
        """What its operator recorded: parameters, what it reached."""
        return self.birth.made

    @property
    def parents(self) -> list["Individual"]:
        """Those it was bred from; none of a source city."""
        return [Individual(self.told, one) for one in self.birth.parents]

    @cached_property
    def genome(self) -> Genome:
        """Raises `RunError` if it was never bred."""
        if self.birth.genome is None:
            return self.run.genome(self.id)  # bred again; or it says so
        return self.birth.genome

    @cached_property
    def city(self) -> CityMap:
        """Its decoded map, called after it. Raises `RunError` if its genome stands for none."""
        expressed = self.run.header.chromosome.express(self.genome)
        if expressed.city is None:
            raise RunError(
                f"{self}: {expressed.problem}",
                "a genome that stands for a map",
                "choose another: run.where(\"status == 'ok'\")",
            )
        return expressed.city.replace(expressed.city.heights, name=self._title)

    @property
    def _title(self) -> str:
        return f"{self.run.path.resolve().name}, individual {self.id}"

    def ancestry(self, built: bool = False) -> dict[str, float]:
        """Source city -> share of the map that is its stone, open ground too; together 1.

        built : of what is built alone; empty where nothing is. Raises `RunError` then for a genome
            that stands for no map.
        """
        fabric = fabric_of(self.run.header, self.genome, "the ancestry")
        shares = built_shares(fabric, self.city) if built else fabric.shares
        told = zip(fabric.cities, shares, strict=True)
        return {city: float(share) for city, share in told if share > 0}

    @property
    def ground(self) -> str | None:
        """The source city on whose ground it is laid best, for ``at`` of `save`: the one that most
        of its stones are from. None where all source cities lie in one place, and it with them, or
        none lies on Earth."""
        from evocity.analysis.placing import ground_of

        if self.run.header.crs is not None or not self.run.header.chromosome.stones:
            return None
        return ground_of(self.ancestry(), self.told.sources)

    def ancestors(self) -> "pa.Table":
        """All births it descends from, the oldest first and its own last, see `Run.ancestors`."""
        return self.run.ancestors(self.id)

    # -- pictures and files ------------------------------------------------------------------

    def picture(self, zoom: float | None = None, highest: float | None = None) -> "Image.Image":
        """Its map as a picture with legend and attribution; decoded at a ``zoom`` if one is given,
        with that many times as many pixels. ``highest``: metres at which the colours end."""
        from evocity.coding import decode
        from evocity.pictures import render

        city = self.city
        if zoom is not None and self.run.header.kind != "fabric":
            raise RunError(
                f"{setting('zoom', zoom)} of a {self.run.header.kind}",
                "a fabric, which decodes at any size",
                f"leave {keyword('zoom')} out",
            )
        if zoom is not None:
            city = decode(self.genome, zoom=zoom).city
            city = city.replace(city.heights, name=f"{self._title}, zoom {zoom:g}")
        return render(city, highest=highest)

    def ancestry_picture(self) -> "Image.Image":
        """Which city each stone of its map comes from, and what that was made of came from, as a
        picture."""
        from evocity.coding.ancestry import ancestry
        from evocity.pictures import Shares, render_shares

        genome = fabric_of(self.run.header, self.genome, "the ancestry")
        title = "whose stones these are"
        return render_shares(Shares(self.city, ancestry(genome), genome.cities, title))

    def scene(self, **how: Any) -> "Scene":
        """It in three dimensions, with its scores; ``how`` as `evocity.scene` has it."""
        from evocity.scene import scene

        return scene(self.city, **({"measures": self.scores} | how))

    def save(self, path: str | os.PathLike, at: str | None = None) -> None:
        """Write it; the suffix of ``path`` chooses what: ``.parquet`` its genome; ``.tif`` and
        ``.npy`` heights; ``.gpkg`` and ``.geojson`` footprints; ``.png`` a picture; ``.city.json``,
        ``.glb``, ``.obj``, ``.wrl`` and ``.x3d`` a scene.

        at : a source city, on whose ground it is laid, in its reference system. Else it lies where
            all source cities lie, and nowhere on Earth if they lie in several places.

        Raises `EvocityError` for another suffix, and what writing raises; nothing is left
        half-written.
        """
        from evocity import io
        from evocity.analysis.placing import place_of
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
                f"{path.name}: nothing is written as {suffix or 'a file without a suffix'}",
                f"a name that ends in {', '.join(known)}",
                "choose .gpkg or .tif for GIS, .glb for Blender and browsers, .png for a picture",
            )


__all__ = ["Individual"]
