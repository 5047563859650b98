"""The page as a widget of Jupyter."""

from typing import Any, Protocol

import anywidget
import traitlets

from evocity.errors import EvocityError
from evocity.viewer.module_bundle import module, text
from evocity.viewer.sheet import MOST, SIDES, Sheet
from evocity.viewer.table import Table


class Source(Protocol):
    """The births, facts, pictures and parts that a widget shows: `evocity.analysis.page.Page`."""

    table: Table

    @property
    def about(self) -> dict: ...

    def sheet(self, ids: list[int], side: int) -> Sheet: ...

    def part(self, name: object) -> Any: ...


class Widget(anywidget.AnyWidget):
    """Births as gallery and parallel coordinates, with traits that Python and the page share."""

    _esm = module()
    _css = text("viewer.css")

    about = traitlets.Dict().tag(sync=True)
    births = traitlets.Bytes().tag(sync=True)
    #: Ids of the chosen births, in the order of choice.
    chosen = traitlets.List(traitlets.Int()).tag(sync=True)
    brushes = traitlets.Dict().tag(sync=True)
    #: The ``name`` of the column, and whether the order is ``reversed``.
    order = traitlets.Dict().tag(sync=True)
    #: From left to right, each ``name`` and whether the axis is ``turned``.
    axes = traitlets.List(traitlets.Dict()).tag(sync=True)

    def __init__(self, page: Source, **at: Any):
        """``page``: the births; ``at``: initial traits."""
        self._page = page
        super().__init__(about=page.about, births=page.table.buffer, **at)
        self.on_msg(self._answer)

    def show(self, page: Source) -> None:
        """Replace the births; choices and brushes that do not fit them are removed."""
        self._page, table = page, page.table
        with self.hold_sync():
            self.about, self.births = page.about, table.buffer
            self.chosen = table.known_ids(self.chosen)
            try:
                table.check_brushes(self.brushes)
            except EvocityError:
                self.brushes = {}

    @traitlets.validate("chosen")
    def _check_chosen(self, proposal: Any) -> list[int]:
        return self._page.table.known_ids(dict.fromkeys(proposal["value"]))

    @traitlets.validate("brushes")
    def _check_brushes(self, proposal: Any) -> dict:
        return self._page.table.check_brushes(proposal["value"])

    def _answer(self, _: object, content: object, buffers: object) -> None:
        """Answer a request of the page for pictures, ``{"tiles": [ids], "side": px}``, or for a
        part of the document, ``{"part": name}``; each has a name, ``"request"``."""
        if not isinstance(content, dict):
            return
        about: dict = {"request": str(content.get("request"))}
        if "part" in content:
            try:
                self.send(about | {"value": self._page.part(content["part"])}, [])
            except EvocityError as error:
                self.send(about | {"error": str(error)}, [])
            return
        ids = content.get("tiles")
        if content.get("side") not in SIDES or not isinstance(ids, list):
            return
        if not all(type(n) is int for n in ids):
            return
        ids = self._page.table.known_ids(ids[:MOST])
        try:
            sheet = self._page.sheet(ids, content["side"])
        except EvocityError as error:  # the page shows the reason
            sheet = Sheet.of({}, dict.fromkeys(ids, str(error)))
        self.send(about | sheet.about, [sheet.image])
