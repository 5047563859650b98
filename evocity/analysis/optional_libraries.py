"""Optional libraries for tables and graphs, loaded on first use."""

from importlib import import_module
from types import ModuleType

from evocity.errors import EvocityError


def library(name: str, what: str, extra: str = "notebook") -> ModuleType:
    """Import the library ``name``, which ``what`` needs. Raises `EvocityError` where it is not
    installed, and names the ``extra`` that installs it."""
    try:
        return import_module(name)
    except ImportError:
        raise EvocityError(
            f"{what} needs {name}, which is not installed",
            f"evocity with its extra {extra}",
            f"pip install 'evocity[{extra}]'",
        ) from None
