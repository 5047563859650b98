"""`View`: a run's births as a Jupyter widget, with selection and filter in Python."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from evocity.analysis.arguments import ids_of_any
from evocity.analysis.births import unknown
from evocity.analysis.individual import Individual
from evocity.errors import RunError
from evocity.html_display import Displayed
from evocity.lazy_imports import library
from evocity.viewer.table import Brushes, Table

if TYPE_CHECKING:
    import pandas as pd

    from evocity.analysis.page import Page


class View(Displayed):
    """View of the births of a run: a gallery and parallel coordinates that share one filter. The
    method `Run.view` makes a view.

    A notebook shows the view as a widget, or as a picture if the notebook has no widgets. A change
    of the view in Python appears in the widget, and a change in the widget appears in Python.
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

        #: The `Run` of the births.
        self.run = run
        self._of = of
        #: The `Page` that the view renders.
        self.page = self._read_page()
        axes = self.page.axes(measures)
        #: The widget itself, to combine it with others, or to observe changes:
        #: ``view.widget.observe(function, "chosen")``.
        self.widget: Widget = Widget(
            self.page, axes=axes, order=self._order_of(order or self.page.order)
        )

    def _read_page(self) -> "Page":
        from evocity.analysis.page import Page  # which draws

        return Page(self.run, self._of, str(self.run.path))

    @property
    def table(self) -> Table:
        """Births as columns."""
        return self.page.table

    # -- settings ----------------------------------------------------------------------------

    @property
    def selected(self) -> list[Individual]:
        """Selected births, in the order of selection. To change the selection, set the attribute to
        ids, individuals, a data frame or a condition. Selecting a birth that the view does not
        contain raises `RunError`."""
        return [Individual(self.run.columns, one) for one in self.widget.chosen]

    @selected.setter
    def selected(self, which: object) -> None:
        ids = ids_of_any([] if which is None else which, self.run.columns)
        gone = ids[~np.isin(ids, self.table.ids)]
        if len(gone):
            raise RunError(
                f"{self.run.path}: the view does not show individual {gone[0]}",
                "individuals that the view shows",
                "make a view that contains the individual, with run.view(of=…)",
            )
        self.widget.chosen = ids.tolist()

    @property
    def brushes(self) -> dict[str, list]:
        """Filter of the view, as a mapping from each column to ranges of numbers or to words. For a
        column of numbers, give ranges, as in ``{"fsi": [(1, 2)]}``. For a column of words, give the
        words to keep, as in ``{"operator": ["mutation"]}``. A birth passes the filter if its value
        in each filtered column lies in a given range or equals a given word. The value ``{}``
        removes the filter."""
        return dict(self.widget.brushes)

    @brushes.setter
    def brushes(self, brushes: Brushes) -> None:
        self.widget.brushes = self.table.check_brushes(brushes)

    @property
    def filtered(self) -> "pd.DataFrame":
        """Data frame of the births that pass the filter, in the order of the gallery, with the
        columns of `Run.scores`."""
        return self.run.frame(self.run.columns.rows(self.filtered_ids))

    @property
    def filtered_ids(self) -> np.ndarray:
        """Ids of the births that pass the filter, as an int64 array in the order of the gallery."""
        rows = self.table.row_order(self.widget.order["name"], self.widget.order["reversed"])
        return self.table.ids[rows[self.table.matches(self.widget.brushes)[rows]]]

    @property
    def order(self) -> str:
        """Name of the column that sorts the gallery. A column with a goal puts the best births
        first; a column without a goal sorts from the lowest value, or alphabetically. The sign
        ``-`` before the name reverses the order."""
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
        """Read the run again, and keep the present selection and filter. Return this view."""
        self.run.refresh()
        self.page = self._read_page()
        self.widget.show(self.page)
        return self

    # -- display -----------------------------------------------------------------------------

    def __repr__(self) -> str:
        shown, chosen = len(self.filtered_ids), len(self.widget.chosen)
        return (
            f"View({shown} of {len(self.table)} births of {str(self.run.path)!r}, {chosen} chosen)"
        )

    def _repr_mimebundle_(self, include: object = None, exclude: object = None) -> dict:
        """The widget, and a picture where there are no widgets."""
        bundle = self.widget._repr_mimebundle_()
        data = dict(bundle[0] if isinstance(bundle, tuple) else bundle or {})
        return data | {"text/plain": repr(self), "text/html": self._repr_html_()}
