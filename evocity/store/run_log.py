"""`RunLog`: a run folder, read only."""

import json
import os
from collections.abc import Callable, Sequence
from functools import cached_property
from pathlib import Path
from typing import ClassVar

import numpy as np
import pyarrow as pa

from evocity.citymap import CityMap
from evocity.columns import array_of, column_of, lists_of
from evocity.condensation import Condensation
from evocity.errors import RunError, near_miss
from evocity.genome import Genome, RoofTable
from evocity.store.checksums import check_digests
from evocity.store.events import TURNS, read_events
from evocity.store.layout import BIRTHS, MEMBERSHIP, Folder
from evocity.store.log import LogFiles, readable
from evocity.store.omitted_genomes import completed
from evocity.store.provenance import check_parts, read_provenance
from evocity.store.run_directory import RunDirectory
from evocity.store.schema import Birth, Header, births_of, check_version
from evocity.store.sources import Source, read_condensation, read_maps, read_masks, read_sources
from evocity.store.unverified import unverified_parts


class RunLog:
    """A run folder, read only. All methods raise `RunError` on damage. It cannot breed genomes that
    the log leaves out; `evocity.open_run` can.

    Attributes: ``path``; ``provenance``, the record of the start; ``header``, what all births share
    (`Header`).
    """

    # a subclass may breed genomes again
    _rebreed: ClassVar[Callable[..., Genome] | None] = None

    def __init__(self, path: str | os.PathLike):
        self.path = Path(path)
        self._folder = Folder(self.path)
        if not self._directory.exists(self._folder.provenance):
            inside = self.path.glob("*/provenance.json") if os.path.isdir(self.path) else ()
            within = sorted(str(path.parent) for path in inside)
            beside = [path.parent for path in self.path.parent.glob("*/provenance.json")]
            near = near_miss(self.path.name, [path.name for path in beside])
            raise RunError(
                f"no run at {self.path}" + (f", but {len(within)} within it" if within else ""),
                "a folder written by `evocity run`, with provenance.json in it",
                f"choose one of them, for example {within[-1]}"
                if within
                else near or "check the name, or start a run: evocity run RECIPE --out FOLDER",
            )
        with readable(self._folder.provenance):
            self.provenance: dict = read_provenance(self._directory, self._folder.provenance)
            check_parts(self.provenance)
            check_version(self.provenance["schema_version"], self.path)
            self.header = Header.from_json(json.dumps(self.provenance["header"]), self.path)
        self._folder = Folder(self.path, self.header.recipe_hash)
        self._log = LogFiles(self._folder, self.header, self.provenance)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({str(self.path)!r}, {len(self.generations)} generations)"

    @property
    def _directory(self) -> RunDirectory:
        return self._folder.directory

    @property
    def name(self) -> str:
        """The name of its folder."""
        return self.path.resolve().name

    @cached_property
    def recipe_text(self) -> str:
        """The recipe, as given."""
        with readable(self._folder.recipe):
            return self._directory.read(self._folder.recipe).decode()

    def earlier_recipe(self, number: int) -> str | None:
        """Return the recipe before its ``number``-th replacement, from 1; None without one."""
        path = self.path / f"recipe-{number}.toml"
        if not self._directory.exists(path):
            return None
        with readable(path):
            return self._directory.read(path).decode()

    @cached_property
    def condensation(self) -> Condensation | None:
        """The heights locked in every genome of the run; None if there are none."""
        if self.header.locked is None:
            return None
        with readable(self._folder.locked):
            return read_condensation(self._directory, self.header.locked)

    def take_over_checks(self, earlier: "RunLog") -> None:
        """Take over which files of the log an ``earlier`` object of this run has checked, so that a
        program which looks often does not read them each time. Changed files are checked."""
        if earlier.header == self.header:
            self._log.take_over(earlier._log)

    @property
    def written(self) -> range:
        """Numbers of the written generations, damaged ones too: 0…g."""
        return self._log.written

    @property
    def generations(self) -> range:
        """Numbers of the whole generations: 0…g, without the damaged files at the end, see
        `damaged`."""
        return self._log.generations

    @property
    def damaged(self) -> tuple[Path, ...]:
        """The damaged files at the end of births and membership, and all that follow them."""
        return self._log.damaged

    @property
    def missing(self) -> tuple[Path, ...]:
        """Files that are missing though later generations are there; a run in progress may seem to
        lack one for a moment."""
        return self._log.missing

    def births(
        self, generation: int | None = None, columns: Sequence[str] | None = None
    ) -> pa.Table:
        """Return the births of one generation, or of all, as an Arrow table.

        ``columns``: names in order; all columns of the log by default. Raises `RunError` for an
        unknown column, and for a generation that is not whole.
        """
        if columns is None:
            return self._log.table(BIRTHS, generation, None)
        columns = self._known(columns)
        return self._log.table(BIRTHS, generation, columns).select(columns)

    def members(self, generation: int | None = None) -> pa.Table:
        """Return the living of one generation, or of all: generation, slot (0 is the best), id,
        rank, and the algorithm's values, named by ``header.marks``. In a run with islands also
        ``island``: slots and ranks are those of the island, and an individual has a row for each of
        its islands."""
        return self._log.table(MEMBERSHIP, generation, None)

    def individuals(
        self, ids: Sequence[int], rebred: bool = True, stones: bool = True
    ) -> list[Birth]:
        """Return the births with these ``ids``, with genomes, in the order given. Genomes that the
        log leaves out are bred again, unless ``rebred`` is false. Without ``stones`` a genome lacks
        its cities' stones: it decodes to the same map, and is read in two thirds of the time."""
        self._log.check_ids(ids)
        births = self._logged(ids, stones)
        if rebred and any(one.left_out for one in births.values()):
            with readable(self.path):
                births = completed(self, births, self._logged, self._rebreed)
        return [births[identifier] for identifier in ids]

    def thumbnails(self, ids: Sequence[int]) -> dict[int, CityMap]:
        """Return the logged small maps of the births ``ids``, by id, see
        `evocity.store.Thumbnails`; no genome is read or decoded. Logs of maps of up to 128 px a
        side, and of older releases, have none. Raises `RunError` for an id of no birth."""
        header, maps = self.header, {}
        self._log.check_ids(ids)
        if header.thumbnails is None:
            return maps
        of = header.height, header.width, header.metres_per_pixel
        for table in self._log.rows_of(ids, ["id", "thumbnail"]):
            with readable(self.path):
                for row in table.to_pylist():
                    if row["thumbnail"] is not None:
                        maps[row["id"]] = header.thumbnails.unpacked(row["thumbnail"], *of)
        return maps

    def _logged(self, ids: Sequence[int], stones: bool = True) -> dict[int, Birth]:
        """The births with these ``ids`` as logged; a log that leaves genomes out is read with
        ``stones``, since other genomes are bred from them."""
        left = ["thumbnail"]
        if not stones and self.header.genomes == "all":
            left += self.header.chromosome.ancestry_columns
        columns = [name for name in self._log.columns if name not in left]
        logged: dict[int, Birth] = {}
        for table in self._log.rows_of(ids, columns):
            with readable(self.path):
                births = births_of(table, self.header, self.condensation)
            logged |= {birth.id: birth for birth in births}
        return logged

    def genome(self, identifier: int) -> Genome:
        """Return the genome of one individual, with the roofs of the source cities. Raises
        `RunError` if it was never bred."""
        genome = self.individuals([identifier])[0].genome
        if genome is None:
            raise RunError(
                f"{self.path}: individual {identifier} has no genome: its breeding failed",
                "an individual whose breeding succeeded",
                "choose an individual with a value in the births' column `genome`",
            )
        return self.with_roofs(genome)

    def with_roofs(self, genome: Genome) -> Genome:
        """Return a ``genome`` of the run with the roofs of the source cities; genomes of other
        kinds than fabric stay unchanged."""
        if not isinstance(genome, Genome) or not self._roofs:
            return genome
        return genome.replace(roofs={k: v for k, v in self._roofs.items() if k in genome.cities})

    @cached_property
    def _roofs(self) -> dict[str, RoofTable]:
        """The roofs of the source cities; none in a folder whose sources are damaged."""
        try:
            sources = self.sources()
        except RunError:
            return {}
        roofs = {source.name: source.roofs for source in sources}
        return {name: table for name, table in roofs.items() if table is not None}

    def parents(self, births: Sequence[Birth]) -> list[tuple[Genome, ...]]:
        """Return the parents' genomes of each of ``births``, in the order of its ``parents``; a
        founder is its own parent. Each birth has a genome.

        Raises `RunError` if a parent is not among the run's births, or has no genome.
        """
        ids = sorted({one for birth in births for one in birth.parents})
        genomes = {one.id: one.genome for one in self.individuals(ids)}
        for identifier, genome in genomes.items():
            if genome is None:
                raise RunError(
                    f"{self.path}: individual {identifier}, a parent of others, has no genome",
                    "a genome for each parent of a birth",
                    "restore the folder from a backup",
                )
        return [tuple(genomes[one] for one in b.parents) or (b.genome,) for b in births]

    def ancestors(self, identifier: int, columns: Sequence[str] | None = None) -> pa.Table:
        """Return the ancestors of one individual, the oldest first and itself last, as an Arrow
        table. Raises `RunError` if it was never born, or for an unknown column.

        ``columns``: generation, id, parents, operator, status and the measures by default.
        """
        measures = [f"fitness.{name}" for name in self.header.columns]
        own = ["generation", "id", "parents", "operator", "status", *measures]
        columns = own if columns is None else self._known(columns)
        births = self.births(columns=list(dict.fromkeys(["id", "parents", *columns])))
        self._log.check_ids([identifier])
        with readable(self.path):
            kept = ancestry(births, int(identifier))
        if kept is None:
            raise RunError(
                f"{self.path} has no individual {identifier!r}",
                f"the id of a birth in the generations 0…{len(self.generations) - 1}",
                self._log.where_ids_are,
            )
        births = births.filter(column_of(kept))
        if (np.diff(array_of(births["id"])) < 0).any():  # nearly never
            births = births.sort_by("id")
        return births.select(columns)

    def sources(self) -> list[Source]:
        """Return the source cities, maps and genomes."""
        kind = self.header.chromosome
        return self._read("sources", lambda *place: read_sources(*place, kind), False)

    def references(self) -> list[CityMap]:
        """Return the maps of the reference cities of measures, other than the sources."""
        return self._read("references", read_maps)

    def parts(self) -> list[np.ndarray]:
        """Return the parts of the map that measures take, bool ``(H, W)`` each, in the order of
        ``provenance["within"]``; none in most runs."""
        shape = self.header.height, self.header.width
        return self._read("within", lambda *place: read_masks(*place, shape))

    def events(self) -> list[dict]:
        """Return the events of the run, oldest first; each has ``time`` and ``event``. Raises
        `RunError` if one was changed, or is missing though a generation came after it."""
        sealed = self._log.chain  # the run may go on
        with readable(self._folder.events):
            return read_events(self._directory, sealed)

    def history(self) -> list[dict]:
        """Return a summary per generation: births and failures so far, hypervolume, best, …"""
        return [{"generation": g} | about for g, about in self._log.summaries().items()]

    def status(self) -> dict:
        """Return the present state of the run, in plain JSON values.

        Keys: generation (the last whole one; None before the first), births, failures, hypervolume,
        best (measure -> value), algorithm (its figures of all the living, named by
        ``header.figures``), islands (name -> living, feasible, and by the island's own goals
        hypervolume, best and algorithm), evaluations_per_second, finished, stopped (why it ended
        early, in words; None while it goes on, and where it was killed).
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

    def unverified(self) -> list[str]:
        """Describe the parts of the run that have no checksums, since an older release wrote
        them."""
        with readable(self.path):
            return unverified_parts(self._folder, self.provenance)

    def _read(
        self, place: str, read: Callable[[RunDirectory, str], list], optional: bool = True
    ) -> list:
        if optional and not self._directory.exists(place):
            return []
        with readable(self.path / place):
            check_digests(self._directory, place, dict(self.provenance.get("files", {})))
            return read(self._directory, place)

    def _known(self, columns: Sequence[str]) -> list[str]:
        known = self._log.columns
        if isinstance(columns, str):
            raise RunError(
                f"{self.path}: columns = {columns!r} is a text",
                "a list of column names",
                f"write columns=[{columns!r}]",
            )
        strange = [name for name in columns if name not in known]
        if strange:
            raise RunError(
                f"{self.path}: births have no column {', '.join(map(repr, strange))}",
                f"columns among {', '.join(known)}",
                _suggestion(str(strange[0]), known) or "choose from these columns",
            )
        return list(columns)


def _suggestion(name: str, known: Sequence[str]) -> str:
    measure = f"fitness.{name}"
    return f"did you mean {measure}?" if measure in known else near_miss(name, known)


def ancestry(births: pa.Table, identifier: int) -> np.ndarray | None:
    """Return which rows of ``births``, with columns ``id`` and ``parents``, are the individual
    ``identifier`` or its ancestors, bool ``(n,)``; None if it is not among them.

    Parents that are not among the births are skipped. Of several rows of one id the last has the
    parents, and all are marked.
    """
    ids = array_of(births["id"]).astype(np.int64, copy=False)
    order = np.argsort(ids, kind="stable")
    ordered = ids[order]
    counts, parents = lists_of(births["parents"])
    starts = np.concatenate([[0], np.cumsum(counts)])

    def rows_of(sought: np.ndarray) -> np.ndarray:
        """The last row of each id, -1 for none."""
        at = np.searchsorted(ordered, sought, side="right") - 1
        return np.where((at >= 0) & (ordered[at] == sought), order[at], -1)

    if not len(ids) or not ordered[0] <= identifier <= ordered[-1]:
        return None
    if (own := int(rows_of(np.array([identifier]))[0])) < 0:
        return None
    parents = rows_of(parents)
    marked, turn = np.zeros(len(ids), bool), np.empty(len(ids), np.int64)
    marked[own] = True
    further = np.array([own])
    while len(further):
        lengths = counts[further]
        within = np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)
        above = parents[np.repeat(starts[further], lengths) + within]
        above = above[(above >= 0) & ~marked[above]]
        marked[above], turn[above] = True, np.arange(len(above))
        further = above[turn[above] == np.arange(len(above))]  # each once
    return np.isin(ids, ids[marked])
