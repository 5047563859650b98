"""`View`: a run's births on one page, in a notebook; what is chosen there, in Python."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from evocity.analysis.asked import ids_of_any
from evocity.analysis.births import unknown
from evocity.analysis.extras import library
from evocity.analysis.individual import Individual
from evocity.analysis.viewed import Viewed
from evocity.displayed import Displayed
from evocity.errors import RunError
from evocity.viewer.table import Brushes, Table

if TYPE_CHECKING:
    import pandas as pd

    from evocity.analysis.thumbnails import Thumbnails
    from evocity.viewer.sheet import Sheet


class View(Displayed):
    """Births of a run as a gallery and parallel coordinates with one filter; made by `Run.view`.

    A notebook shows it as a widget, and where widgets do not live as a picture. What is set here is
    seen there at once, and the other way round.
    """

    def __init__(
        self,
        run: Any,
        of: object = None,
        measures: Sequence[str] | None = None,
        order: str | None = None,
    ):
        library("anywidget", "a view of a run")
        from evocity.viewer.widget import Widget

        #: The `Run`, which makes its views and so cannot be known here.
        self.run = run
        self._of = of
        self._viewed = Viewed(run, of)
        axes = self._viewed.axes(measures)
        order = order or (axes[0]["name"] if axes else "id")
        #: The widget itself, to lay it beside others, or to be told of changes:
        #: ``view.widget.observe(function, "chosen")``.
        self.widget: Widget = Widget(
            self.table, self._viewed.about, self._sheet, axes=axes, order=self._order_of(order)
        )

    @property
    def table(self) -> Table:
        """The births as columns."""
        return self._viewed.table

    @property
    def thumbnails(self) -> "Thumbnails":
        """Small pictures of them."""
        return self._viewed.thumbnails

    def _sheet(self, ids: list[int], side: int) -> "Sheet":
        return self._viewed.sheet(ids, side)

    # -- what is set -------------------------------------------------------------------------

    @property
    def selected(self) -> list[Individual]:
        """Those that are chosen, in the order in which they were. Set by ids, individuals, a
        frame, or a condition; `RunError` for one that is not shown."""
        return [Individual(self.run.told, one) for one in self.widget.chosen]

    @selected.setter
    def selected(self, which: object) -> None:
        ids = ids_of_any([] if which is None else which, self.run.told)
        gone = ids[~np.isin(ids, self.table.ids)]
        if len(gone):
            raise RunError(
                f"{self.run.path}: individual {gone[0]} is not among those that the view shows",
                "some of them",
                "view others: run.view(of=…)",
            )
        self.widget.chosen = ids.tolist()

    @property
    def brushes(self) -> dict[str, list]:
        """The filter: of a column the spans, ``{"fsi": [(1, 2)]}``, or the words,
        ``{"operator": ["mutation"]}``, that let births pass. Set alike, ``{}`` for none."""
        return dict(self.widget.brushes)

    @brushes.setter
    def brushes(self, brushes: Brushes) -> None:
        self.widget.brushes = self.table.checked(brushes)

    @property
    def filtered(self) -> "pd.DataFrame":
        """The `Run.scores` of those that pass the filter, in the gallery's order."""
        return self.run.frame(self.run.told.rows(self.filtered_ids))

    @property
    def filtered_ids(self) -> np.ndarray:
        """Int64: ids of those that pass the filter, in the gallery's order."""
        rows = self.table.ordered(self.widget.order["name"], self.widget.order["reversed"])
        return self.table.ids[rows[self.table.passing(self.widget.brushes)[rows]]]

    @property
    def order(self) -> str:
        """The column by which the gallery is in order, ``-`` before it where the order is turned:
        best first, lowest first, or by the alphabet."""
        return "-" * self.widget.order["reversed"] + self.widget.order["name"]

    @order.setter
    def order(self, name: str) -> None:
        self.widget.order = self._order_of(name)

    def _order_of(self, name: str) -> dict:
        names = [one.name for one in self.table.columns]
        if name not in names and name.removeprefix("-") not in names:
            raise unknown(name, names, str(self.run.path))
        is_turned = name not in names
        return {"name": name.removeprefix("-") if is_turned else name, "reversed": is_turned}

    def refresh(self) -> "View":
        """Look at the run anew, see `Run.refresh`; what is chosen and brushed stays. Returns the
        view itself."""
        self.run.refresh()
        self._viewed = Viewed(self.run, self._of)
        self.widget.show(self.table, self._viewed.about)
        return self

    # -- shown -------------------------------------------------------------------------------

    def __repr__(self) -> str:
        shown, chosen = len(self.filtered_ids), len(self.widget.chosen)
        return (
            f"View({shown} of {len(self.table)} births of {str(self.run.path)!r}, {chosen} chosen)"
        )

    def _repr_mimebundle_(self, include: object = None, exclude: object = None) -> dict:
        """The widget, and for where there is none a picture."""
        bundle = self.widget._repr_mimebundle_()
        data = dict(bundle[0] if isinstance(bundle, tuple) else bundle or {})
        return data | {"text/plain": repr(self), "text/html": self._repr_html_()}


__all__ = ["View"]
