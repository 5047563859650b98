"""HTML in notebooks for classes of lower rooms, rendered by `evocity.notebook`."""

from importlib import import_module

_ROOM = "evocity.notebook"  # a higher room: loaded when a notebook displays something


class Displayed:
    """A class whose objects notebooks display by `evocity.notebook.html_of`."""

    def _repr_html_(self) -> str:
        return import_module(_ROOM).html_of(self)
