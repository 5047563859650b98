"""`Run`: a run folder, read only."""

import json
import os
from collections.abc import Callable, Sequence
from functools import cached_property
from numbers import Integral
from pathlib import Path
from typing import ClassVar

import numpy as np
import pyarrow as pa

from evocity.citymap import CityMap
from evocity.columns import array_of, column_of
from evocity.condensation import Condensation
from evocity.errors import RunError, near_miss
from evocity.genome import Genome
from evocity.store.completing import completed
from evocity.store.events import TURNS, read_events
from evocity.store.layout import BIRTHS, MEMBERSHIP, Folder
from evocity.store.logged import Logged, readable
from evocity.store.parts import read_bytes, read_json
from evocity.store.pedigree import ancestry
from evocity.store.schema import (
    Birth,
    Header,
    births_of,
    check_version,
)
from evocity.store.seals import check_digests
from evocity.store.sources import Source, read_condensation, read_maps, read_masks, read_sources


def open_run(path: str | os.PathLike) -> "Run":
    """As `evocity.open_run`; genomes that its log leaves out cannot be had."""
    return Run(path)


class Run:
    """A run folder, read only; made by `evocity.open_run`. All methods raise `RunError` on damage.

    Attributes: ``path``; ``provenance``, what was recorded at the start; ``header``, what all
    births share (`Header`).
    """

    _rebreed: ClassVar[Callable[..., Genome] | None] = None  # see `evocity.search.opening`

    def __init__(self, path: str | os.PathLike):
        self.path = Path(path)
        self._folder = Folder(self.path)
        if not os.path.lexists(self._folder.provenance):
            inside = self.path.glob("*/provenance.json") if os.path.isdir(self.path) else ()
            within = sorted(str(path.parent) for path in inside)
            beside = [path.parent for path in self.path.parent.glob("*/provenance.json")]
            near = near_miss(self.path.name, [path.name for path in beside])
            raise RunError(
                f"no run at {self.path}" + (f", but {len(within)} within it" if within else ""),
                "a folder written by `evocity run`, with provenance.json in it",
                f"name one of them, for example {within[-1]}"
                if within
                else near or "check the name, or start a run: evocity run RECIPE --out FOLDER",
            )
        with readable(self._folder.provenance):
            self.provenance: dict = read_json(self._folder.provenance)
            check_version(self.provenance["schema_version"], self.path)
            self.header = Header.from_json(json.dumps(self.provenance["header"]), self.path)
        self._folder = Folder(self.path, self.header.recipe_hash)
        self._log = Logged(self._folder, self.header, self.provenance)

    def __repr__(self) -> str:
        return f"Run({str(self.path)!r}, {len(self.generations)} generations)"

    @cached_property
    def recipe_text(self) -> str:
        """The recipe, as given."""
        with readable(self._folder.recipe):
            return read_bytes(self._folder.recipe).decode()

    def earlier_recipe(self, number: int) -> str | None:
        """The recipe that the run went by before it was replaced for the ``number``-th time, from
        1; None if it never was."""
        path = self.path / f"recipe-{number}.toml"
        if not os.path.lexists(path):
            return None
        with readable(path):
            return read_bytes(path).decode()

    @cached_property
    def condensation(self) -> Condensation | None:
        """What is locked in every genome of the run, None if nothing is."""
        if self.header.locked is None:
            return None
        with readable(self._folder.locked):
            return read_condensation(self._folder.locked, self.header.locked)

    @property
    def written(self) -> range:
        """Numbers of the generations that are written down, damaged ones too: 0…g."""
        return self._log.written

    @property
    def generations(self) -> range:
        """Numbers of the generations that are whole now: 0…g. Damaged files at the end are not
        among them, see `damaged`."""
        return self._log.generations

    @property
    def damaged(self) -> tuple[Path, ...]:
        """The last files of births and membership, as far as they are damaged, and those that
        follow them."""
        return self._log.damaged

    def births(
        self, generation: int | None = None, columns: Sequence[str] | None = None
    ) -> pa.Table:
        """Births of one generation, or of all, as an Arrow table.

        ``columns``: those wanted, in their order; all those of the files if not given. Raises
        `RunError` for a name that is no column, and for a generation that is not whole.
        """
        if columns is None:
            return self._log.table(BIRTHS, generation, None)
        columns = self._known(columns)
        return self._log.table(BIRTHS, generation, columns).select(columns)

    def members(self, generation: int | None = None) -> pa.Table:
        """Who lived in one generation, or in all: generation, slot (0 is the best), id, rank, and
        what the run's algorithm tells of each, as ``header.marks`` names it. Of a run with islands
        ``island`` too: slots and ranks are those of the island, and who lives on several has a row
        of each."""
        return self._log.table(MEMBERSHIP, generation, None)

    def individuals(
        self, ids: Sequence[int], rebred: bool = True, stones: bool = True
    ) -> list[Birth]:
        """The births with these ``ids``, genomes included, in the order given. Genomes that the log
        leaves out are bred again, unless they are not to be ``rebred``. Whose ``stones`` a genome
        has need not be read: it is decoded alike, and is here in two thirds of the time."""
        self._log.check_ids(ids)
        found = self._logged(ids, stones)
        if rebred and any(one.left_out for one in found.values()):
            with readable(self.path):
                found = completed(self, found, self._logged, self._rebreed)
        return [found[identifier] for identifier in ids]

    def thumbnails(self, ids: Sequence[int]) -> dict[int, CityMap]:
        """Small maps of those of the births ``ids`` that the log has one of, by id, see
        `evocity.store.Thumbnails`: their genomes are neither read nor decoded. Logs of maps of up
        to 128 px a side have none, nor have those of releases before. Raises `RunError` for an id
        of no birth."""
        header, found = self.header, {}
        self._log.check_ids(ids)
        if header.thumbnails is None:
            return found
        of = header.height, header.width, header.metres_per_pixel
        for table in self._log.rows_of(ids, ["id", "thumbnail"]):
            with readable(self.path):
                for row in table.to_pylist():
                    if row["thumbnail"] is not None:
                        found[row["id"]] = header.thumbnails.unpacked(row["thumbnail"], *of)
        return found

    def _logged(self, ids: Sequence[int], stones: bool = True) -> dict[int, Birth]:
        """The births with these ``ids`` as the log has them; of a log that leaves genomes out with
        their ``stones`` in any case, for others are bred from them."""
        left = ["thumbnail"]
        if not stones and self.header.genomes == "all":
            left += self.header.chromosome.stones
        columns = [name for name in self._log.columns if name not in left]
        found: dict[int, Birth] = {}
        for table in self._log.rows_of(ids, columns):
            with readable(self.path):
                births = births_of(table, self.header, self.condensation)
            found |= {birth.id: birth for birth in births}
        return found

    def genome(self, identifier: int) -> Genome:
        """The genome of one individual. `RunError` if it was never bred."""
        genome = self.individuals([identifier])[0].genome
        if genome is None:
            raise RunError(
                f"{self.path}: individual {identifier} has no genome, its breeding failed",
                "an individual that was bred",
                "choose one whose `genome` is not empty",
            )
        return genome

    def parents(self, births: Sequence[Birth]) -> list[tuple[Genome, ...]]:
        """Of each of ``births`` the genomes it was bred from, in the order of its ``parents``; a
        founder, which was bred from none, is its own parent. Each has a genome.

        Raises `RunError` if a parent is not among the run's births, or has no genome.
        """
        ids = sorted({one for birth in births for one in birth.parents})
        genomes = {one.id: one.genome for one in self.individuals(ids)}
        for identifier, genome in genomes.items():
            if genome is None:
                raise RunError(
                    f"{self.path}: individual {identifier}, a parent of others, has no genome",
                    "parents that were bred",
                    "bring the folder back from a copy",
                )
        return [tuple(genomes[one] for one in b.parents) or (b.genome,) for b in births]

    def ancestors(self, identifier: int, columns: Sequence[str] | None = None) -> pa.Table:
        """The pedigree of one individual: the births it descends from, the oldest first and its
        own last, as an Arrow table. `RunError` if it was never born, or births have no such
        columns.

        ``columns``: those of the births; generation, id, parents, operator, status and the
        measures if not given.
        """
        measures = [f"fitness.{name}" for name in self.header.columns]
        own = ["generation", "id", "parents", "operator", "status", *measures]
        columns = own if columns is None else self._known(columns)
        births = self.births(columns=list(dict.fromkeys(["id", "parents", *columns])))
        whole = isinstance(identifier, Integral) and not isinstance(identifier, bool)
        with readable(self.path):
            kept = ancestry(births, int(identifier)) if whole else None
        if kept is None:
            raise RunError(
                f"{self.path}: no individual {identifier!r}",
                f"an id of a birth in generations 0…{len(self.generations) - 1}",
                self._log.where_ids_are,
            )
        births = births.filter(column_of(kept))
        if (np.diff(array_of(births["id"])) < 0).any():  # nearly never
            births = births.sort_by("id")
        return births.select(columns)

    def sources(self) -> list[Source]:
        """The source cities, maps and genomes."""
        with readable(self._folder.sources):
            self._check_digests(self._folder.sources)
            return read_sources(self._folder.sources, self.header.chromosome)

    def references(self) -> list[CityMap]:
        """The maps of the cities, other than its sources, that the run's measures compare with;
        none in runs of older releases."""
        if not self._folder.references.exists():
            return []
        with readable(self._folder.references):
            self._check_digests(self._folder.references)
            return read_maps(self._folder.references)

    def parts(self) -> list[np.ndarray]:
        """Bool ``(H, W)`` each: the parts of the map that measures are taken of, in the order of
        ``provenance["within"]``; none in most runs."""
        if not self._folder.within.exists():
            return []
        with readable(self._folder.within):
            self._check_digests(self._folder.within)
            masks = read_masks(self._folder.within)
            for mask in masks:
                if mask.shape != (self.header.height, self.header.width):
                    raise ValueError(f"a part of shape {mask.shape}")
            return masks

    def events(self) -> list[dict]:
        """What happened to the run, oldest first; each has ``time`` and ``event``."""
        with readable(self._folder.events):
            return read_events(self._folder.events)

    def history(self) -> list[dict]:
        """One summary a generation: births and failures so far, hypervolume, best, …"""
        return [{"generation": g} | about for g, about in self._log.summaries().items()]

    def status(self) -> dict:
        """Where the run is now, in plain JSON values.

        Keys: generation (the last whole one; None before the first), births, failures,
        hypervolume, best (measure -> value), algorithm (what the run's algorithm tells of all the
        living, by the names of ``header.figures``), islands (name -> living, feasible, and by the
        island's own goals hypervolume, best and algorithm), evaluations_per_second, finished,
        stopped (why it ended before, in words; None while it goes on, and where it was killed).
        """

        whole, generation, about = self.generations, None, {}
        if whole:
            generation = whole[-1]
            with readable(self.path):
                about = self._log.summaries(generation)[generation]
        last = next((e for e in reversed(self.events()) if e.get("event") in TURNS), {})
        return {
            "generation": generation,
            "births": about.get("births", 0),
            "failures": about.get("failures", 0),
            "hypervolume": about.get("hypervolume"),
            "best": about.get("best", {}),
            "algorithm": about.get("algorithm", {}),
            "islands": about.get("islands", {}),
            "evaluations_per_second": about.get("evaluations_per_second"),
            "finished": last.get("event") == "finish",
            "stopped": str(last.get("reason", "")) if last.get("event") == "stop" else None,
        }

    def _check_digests(self, place: Path) -> None:
        check_digests(self.path, place, dict(self.provenance.get("files", {})))

    def _known(self, columns: Sequence[str]) -> list[str]:
        """``columns`` of births; `RunError` if there is no such column."""
        known = self._log.columns
        if isinstance(columns, str):
            raise RunError(
                f"{self.path}: columns = {columns!r}",
                "a list of names of columns",
                f"write columns=[{columns!r}]",
            )
        strange = [name for name in columns if name not in known]
        if strange:
            raise RunError(
                f"{self.path}: births have no column {', '.join(map(repr, strange))}",
                f"some of {', '.join(known)}",
                _meant(str(strange[0]), known) or "name columns that there are",
            )
        return list(columns)


def _meant(name: str, known: Sequence[str]) -> str:
    measure = f"fitness.{name}"
    return f"did you mean {measure}?" if measure in known else near_miss(name, known)
