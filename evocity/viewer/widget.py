"""The page as a widget of Jupyter."""

from collections.abc import Callable
from typing import Any

import anywidget
import traitlets

from evocity.errors import EvocityError
from evocity.viewer.module_bundle import module, text
from evocity.viewer.sheet import MOST, SIDES, Sheet
from evocity.viewer.table import Table


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

    def __init__(
        self, table: Table, about: dict, pictures: Callable[[list[int], int], Sheet], **at
    ):
        """``pictures`` returns those of some births, of a side of `SIDES`; ``at``: initial
        traits."""
        self._table, self._pictures = table, pictures
        super().__init__(about=about | table.about, births=table.buffer, **at)
        self.on_msg(self._answer)

    def show(self, table: Table, about: dict) -> None:
        """Replace the births; choices and brushes that do not fit them are removed."""
        self._table = table
        with self.hold_sync():
            self.about, self.births = about | table.about, table.buffer
            self.chosen = table.known_ids(self.chosen)
            try:
                table.check_brushes(self.brushes)
            except EvocityError:
                self.brushes = {}

    @traitlets.validate("chosen")
    def _check_chosen(self, proposal: Any) -> list[int]:
        return self._table.known_ids(dict.fromkeys(proposal["value"]))

    @traitlets.validate("brushes")
    def _check_brushes(self, proposal: Any) -> dict:
        return self._table.check_brushes(proposal["value"])

    def _answer(self, _: object, content: object, buffers: object) -> None:
        """Answer a request for pictures: ``{"tiles": [ids], "side": px, "request": its name}``."""
        if not isinstance(content, dict) or content.get("side") not in SIDES:
            return
        ids = content.get("tiles")
        if not isinstance(ids, list) or not all(type(n) is int for n in ids):
            return
        ids = self._table.known_ids(ids[:MOST])
        try:
            sheet = self._pictures(ids, content["side"])
        except EvocityError as error:  # the page shows the reason
            sheet = Sheet.of({}, dict.fromkeys(ids, str(error)))
        about = {"request": str(content.get("request"))} | sheet.about
        self.send(about, [sheet.image])
