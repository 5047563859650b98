"""Libraries that tables and graphs need, and evocity does not: loaded when they are asked for."""

from importlib import import_module
from types import ModuleType

from evocity.errors import EvocityError


def library(name: str, what: str, extra: str = "notebook") -> ModuleType:
    """The library ``name``, which ``what`` is made with. Raises `EvocityError` where it is not
    installed, and names the ``extra`` that has it."""
    try:
        return import_module(name)
    except ImportError:
        raise EvocityError(
            f"{what} needs {name}, which is not installed",
            f"evocity with its extra {extra}",
            f"pip install 'evocity[{extra}]'",
        ) from None


__all__ = ["library"]
