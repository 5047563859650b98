"""`Page`: all that a face of a run shows, made once from a `Run`, as plain values."""

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from evocity.analysis.arguments import ids_of_any
from evocity.analysis.births import label, source_births
from evocity.analysis.page.births import COMPROMISE, axes_of, describe_grid, grid_of, table_of
from evocity.analysis.page.curves import curves_of
from evocity.analysis.page.shortlist import cards_of, plain, shortlist_of
from evocity.analysis.page.summary import summary_of
from evocity.analysis.page.tables import settings_of, tables_of
from evocity.columns import lists_of
from evocity.errors import EvocityError, near_miss, spell
from evocity.pictures import city_colours

if TYPE_CHECKING:
    from evocity.analysis.shortlist import Shortlist
    from evocity.viewer.sheet import Sheet

#: The number of the form of `Page.document`.
SCHEMA = 1
#: The parts of `Page.document` besides the births.
PARTS = ("aims", "keep", "curves", "parents", "tables", "settings", "summary", "lineage")


class Page:
    """All that a face of a `Run` shows: births as columns, aims, births to keep, curves, parents,
    tables, pictures on request. ``of`` chooses births; by default the page has all births. The
    commands of the page name the run ``folder``.

    Report, notebook and studio render the page, and compute no numbers and no reasons themselves.
    """

    def __init__(self, run: Any, of: object = None, folder: str = "RUN"):
        from evocity.analysis.thumbnails import Thumbnails  # which draws

        self.run, self._folder, births = run, folder, run.columns
        self._grid, self._island = grid_of(run)
        ids = births.ids if of is None else np.unique(ids_of_any(of, births))
        #: Births as columns, and small pictures of them.
        self.table = table_of(run, ids, self._grid)
        self.thumbnails = Thumbnails(births)

    # -- births ------------------------------------------------------------------------------

    def axes(self, measures: Sequence[str] | None = None) -> list[dict]:
        """Return the first axes: these ``measures``, or those with a goal or bounds."""
        return axes_of(self.run, self.table, measures)

    @property
    def order(self) -> str:
        """Name of the column that sorts the births first: the compromise, where the run records its
        goals, otherwise the first axis."""
        axes = self.axes()
        if COMPROMISE in {column.name for column in self.table.columns}:
            return COMPROMISE
        return axes[0]["name"] if axes else "id"

    @cached_property
    def about(self) -> dict:
        """Facts about all births together, besides the columns."""
        header = self.run.header
        return {
            "grid": describe_grid(self._grid, self._island),
            "title": f"run {self.run.name}",
            "credit": header.attribution,
            "highest": self.thumbnails.highest,
            "thumbnails": self.thumbnails.logged,
            "ratio": header.width / header.height,
            "cities": list(header.cities),
            "axes": self.axes(),
            "order": {"name": self.order, "reversed": False},
        } | self.table.about

    def sheet(self, ids: list[int], side: int) -> "Sheet":
        """Return pictures of the births ``ids`` side by side, at most ``side`` px along each."""
        from evocity.viewer.sheet import Sheet

        return Sheet.of(*self.thumbnails.of(ids, side))

    # -- parts -------------------------------------------------------------------------------

    @cached_property
    def aims(self) -> list[dict]:
        """The logged measures: goal, bounds, meaning, range of values in the archive, and values of
        the parents' own genomes."""
        births = self.run.columns
        archive = births.rows(self.run.archive.ids if births.has_known_goals else [])
        parents = [birth.values for birth in source_births(self.run)]
        listed = []
        for aim in births.logged:
            known = births.value(aim.name)[archive]
            known = known[np.isfinite(known)]
            keys = ("unit", "sign", "wanted", "goal", "target", "bounds", "meaning", "sought")
            listed.append(
                {"name": label(aim.name), "title": aim.title}
                | {key: getattr(aim, key) for key in keys}
                | {"archive": [float(known.min()), float(known.max())] if known.size else None}
                | {"parents": [plain(values.get(aim.name)) for values in parents]}
            )
        return listed

    @cached_property
    def shortlist(self) -> "Shortlist":
        """The births to keep, as `Run.keep` returns them; empty where the run has no archive."""
        return shortlist_of(self.run)

    @cached_property
    def keep(self) -> list[dict]:
        """The births to keep, the best first, with reasons, shares of cities and commands. In a run
        without an archive, these are the best births of the last generation."""
        return cards_of(self.run, self.shortlist, self._folder)

    @cached_property
    def curves(self) -> list[dict]:
        """Values by generation, see `evocity.analysis.page.curves`."""
        return curves_of(self.run)

    @cached_property
    def parents(self) -> list[dict]:
        """The source cities: name, credit, colour, and the values of their own genomes."""
        births = self.run.columns
        values = {birth.id: birth.values for birth in source_births(self.run)}
        colours = city_colours([source.name for source in births.sources])
        return [
            {
                "name": source.name,
                "credit": source.city.attribution,
                "colour": colour,
                "values": {
                    label(aim.name): plain(values[place].get(aim.name))
                    for aim in births.logged
                    if place in values
                },
            }
            for place, (source, colour) in enumerate(zip(births.sources, colours, strict=True))
        ]

    @cached_property
    def tables(self) -> list[dict]:
        """Tables of births and generations, see `evocity.analysis.page.tables`."""
        return tables_of(self.run)

    @cached_property
    def settings(self) -> list[dict]:
        """Tables of measures, starts and ends, replaced values and provenance."""
        return settings_of(self.run)

    @cached_property
    def summary(self) -> dict:
        """Cities, state and figures of the run."""
        return summary_of(self.run)

    @cached_property
    def lineage(self) -> dict:
        """The parents of all births: ``ids``, ``generations``, the ``counts`` of parents of each
        birth, and all ``parents`` one birth after the other."""
        births = self.run.columns
        counts, parents = lists_of(births.parents)
        listed = {"ids": births.ids, "generations": births.generation}
        listed |= {"counts": counts, "parents": parents}
        return {name: np.asarray(values).tolist() for name, values in listed.items()}

    def part(self, name: object) -> Any:
        """Return one of `PARTS`. Raises `EvocityError` for another name."""
        if name not in PARTS:
            raise EvocityError(
                f"the page has no part {spell(name)}",
                f"one of {', '.join(PARTS)}",
                near_miss(str(name), PARTS) or "choose one of these parts",
            )
        return getattr(self, str(name))

    @property
    def document(self) -> dict:
        """The page as one JSON object, without the births' values and pictures."""
        return {"schema": SCHEMA, "about": self.about} | {name: self.part(name) for name in PARTS}
