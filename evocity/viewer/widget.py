"""The page as a widget of Jupyter."""

from collections.abc import Callable
from typing import Any

import anywidget
import traitlets

from evocity.errors import EvocityError
from evocity.viewer.joined import module, text
from evocity.viewer.sheet import MOST, SIDES, Sheet
from evocity.viewer.table import Table


class Widget(anywidget.AnyWidget):
    """Births as gallery and parallel coordinates. What is chosen, brushed and ordered is the same
    in Python and on the page."""

    _esm = module()
    _css = text("viewer.css")

    about = traitlets.Dict().tag(sync=True)
    births = traitlets.Bytes().tag(sync=True)
    #: Ids of those that are chosen, in the order in which they were.
    chosen = traitlets.List(traitlets.Int()).tag(sync=True)
    brushes = traitlets.Dict().tag(sync=True)
    #: ``name`` of the column, and whether it is ``reversed``.
    order = traitlets.Dict().tag(sync=True)
    #: From left to right, each ``name`` and whether it is ``turned``.
    axes = traitlets.List(traitlets.Dict()).tag(sync=True)

    def __init__(self, table: Table, told: dict, pictures: Callable[[list[int], int], Sheet], **at):
        """``told``: of the births together, besides what `table` tells; ``pictures`` of some
        births, of a side of `SIDES`; ``at``: the other traits at the beginning."""
        self._table, self._pictures = table, pictures
        super().__init__(about=told | table.about, births=table.buffer, **at)
        self.on_msg(self._asked)

    def show(self, table: Table, told: dict) -> None:
        """Other births in place of those that were shown. Who is gone is no longer chosen; brushes
        of what is gone are taken away."""
        self._table = table
        with self.hold_sync():
            self.about, self.births = told | table.about, table.buffer
            self.chosen = table.among(self.chosen)
            try:
                table.checked(self.brushes)
            except EvocityError:
                self.brushes = {}

    @traitlets.validate("chosen")
    def _known(self, proposal: Any) -> list[int]:
        return self._table.among(dict.fromkeys(proposal["value"]))

    @traitlets.validate("brushes")
    def _checked(self, proposal: Any) -> dict:
        return self._table.checked(proposal["value"])

    def _asked(self, _: object, content: object, buffers: object) -> None:
        """Answer the page, which asks for pictures: ``{"tiles": [ids], "side": px, "request":
        what it calls this}``. What is no such question is not answered."""
        if not isinstance(content, dict) or content.get("side") not in SIDES:
            return
        ids = content.get("tiles")
        if not isinstance(ids, list) or not all(type(one) is int for one in ids):
            return
        ids = self._table.among(ids[:MOST])
        try:
            sheet = self._pictures(ids, content["side"])
        except EvocityError as error:  # nobody else would be told
            sheet = Sheet.of({}, dict.fromkeys(ids, str(error)))
        about = {"request": str(content.get("request"))} | sheet.about
        self.send(about, [sheet.image])


__all__ = ["Widget"]
