"""What other packages add, by entry points. What is broken in them is told, never fatal."""

from collections.abc import Callable
from importlib.metadata import EntryPoint, entry_points

from evocity.errors import told


def load_plugins(group: str, take: Callable[[EntryPoint], None]) -> tuple[str, ...]:
    """Hand every entry point of ``group`` to ``take``, which loads it.

    Returns one text for each of which ``take`` raised, whatever it raised.
    """
    faults = []
    for entry in entry_points(group=group):
        try:
            take(entry)
        except (Exception, SystemExit) as error:
            faults.append(f"plugin {entry.name} ({entry.value}) not loaded: {told(error)}")
    return tuple(faults)


def origin_of(entry: EntryPoint) -> str:
    """Whose ``entry`` it is: package and version, if it is known of one, else what it names."""
    package = getattr(entry, "dist", None)
    return f"{package.name} {package.version}" if package else entry.value
