"""Plugins of other packages, loaded by entry points; a broken one is a warning, never fatal."""

from collections.abc import Callable
from importlib.metadata import EntryPoint, entry_points

from evocity.errors import describe_error


def load_plugins(group: str, take: Callable[[EntryPoint], None]) -> tuple[str, ...]:
    """Pass every entry point of ``group`` to ``take``; returns a text for each that raised."""
    faults = []
    for entry in entry_points(group=group):
        try:
            take(entry)
        except (Exception, SystemExit) as error:
            faults.append(
                f"plugin {entry.name} ({entry.value}) not loaded: {describe_error(error)}"
            )
    return tuple(faults)


def origin_of(entry: EntryPoint) -> str:
    """Name the package and version of an ``entry`` point; without a package, its value."""
    package = getattr(entry, "dist", None)
    return f"{package.name} {package.version}" if package else entry.value
