"""How things show themselves in a notebook: what they are is known here by nobody."""

from importlib import import_module

_ROOM = "evocity.displays"  # above all that is shown, so it is loaded when something is


class Displayed:
    """Shown by notebooks as `evocity.displays.html_of` tells it."""

    def _repr_html_(self) -> str:
        return import_module(_ROOM).html_of(self)


__all__ = ["Displayed"]
