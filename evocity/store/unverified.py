"""Parts of a run without checksums, which older releases wrote: nothing shows whether they are
unchanged."""

from evocity.store.checksums import SEAL, footer_value
from evocity.store.event_chain import check_chain
from evocity.store.events import EVENTS
from evocity.store.label import read_label
from evocity.store.layout import BIRTHS, MEMBERSHIP, Folder
from evocity.store.provenance import is_sealed

_KEPT = ("sources", "references", "within")


def unverified_parts(folder: Folder, provenance: dict) -> list[str]:
    """Describe the parts of the run in a ``folder`` that cannot be verified. Raises OSError,
    ValueError, `RunError`."""
    directory, parts = folder.directory, []
    if not is_sealed(directory.read(folder.provenance)):
        parts.append(folder.provenance.name)
    content = directory.read(folder.events)
    if content and not check_chain(content, folder.events).chained:
        parts.append(EVENTS)
    digests = provenance.get("files", {})
    for place in _KEPT:
        names = directory.entries(place) if directory.exists(place) else {}
        lacking = [name for name in names if f"{place}/{name}" not in digests]
        parts += [_spell(place, lacking)] if lacking else []
    for kind in (BIRTHS, MEMBERSHIP):
        lacking = []
        for piece in folder.pieces(kind):
            with directory.open(piece.path) as file:
                if read_label(file) is None or footer_value(file, SEAL) is None:
                    lacking.append(piece.path.name)
        parts += [_spell(kind, lacking)] if lacking else []
    return parts


def _spell(place: str, names: list[str]) -> str:
    more = f" and {len(names) - 1} more files" if len(names) > 2 else ""
    more = f" and {names[1]}" if len(names) == 2 else more
    return f"{place}/{names[0]}{more}"
