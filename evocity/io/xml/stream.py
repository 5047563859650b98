"""Elements of an XML file, one after the other, within bounds: no document type, so no entities and
no references to other files; not deeper than `DEEPEST`."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.parsers import expat

from evocity.errors import MapError, format_bytes

Element = ElementTree.Element

#: Bytes of an XML file, at most, and the depth of its elements.
MOST_BYTES, DEEPEST = 500_000_000, 200

_CHUNK = 1 << 20


class _RootReachedError(Exception):
    pass


def elements(path: Path) -> Iterator[tuple[str, Element, list[Element]]]:
    """Yield ``("start" or "end", element, ancestors)`` for each element of the file at ``path``.

    The caller may clear an element at its end. Raises `MapError` for a file that is too large, or
    has a document type; `ElementTree.ParseError` and ValueError for other faults.
    """
    size = path.stat().st_size
    if size > MOST_BYTES:
        raise MapError(
            f"{path.name} has {format_bytes(size)} of XML",
            f"at most {format_bytes(MOST_BYTES)}",
            "cut the file to the district and its surroundings, or convert it to GeoPackage with "
            "ogr2ogr",
        )
    with open(path, "rb") as file:
        _check_head(path, file.read(_CHUNK))
        file.seek(0)
        parser: Any = ElementTree.XMLPullParser(("start", "end"))
        above: list[Element] = []
        while True:
            content = file.read(_CHUNK)
            if content:
                parser.feed(content)
            else:
                parser.close()
            for event, element in parser.read_events():
                if event == "start":
                    yield "start", element, above
                    above.append(element)
                    if len(above) > DEEPEST:
                        raise ValueError(f"elements more than {DEEPEST} deep")
                else:
                    above.pop()
                    yield "end", element, above
            if not content:
                return


def local_name(element: Element) -> str:
    """Return the name of an ``element`` without its namespace."""
    tag = element.tag
    return tag.rpartition("}")[2] if isinstance(tag, str) else ""


@contextmanager
def xml_errors(path: Path, kind: str) -> Iterator[None]:
    """Turn the errors of a damaged file of a ``kind`` at ``path`` into a `MapError`."""
    try:
        yield
    except (
        *(ElementTree.ParseError, expat.ExpatError, LookupError),
        *(ValueError, TypeError, OverflowError, AttributeError, OSError),
    ) as error:
        raise MapError(
            f"{path.name} cannot be read as {kind}: {str(error)[:200] or type(error).__name__}",
            f"a complete {kind} file",
            "download or export the file again; it may be cut off or damaged",
        ) from error


def _check_head(path: Path, head: bytes) -> None:
    """Raise `MapError` for a document type, which may declare entities or name other files."""

    def refuse(*_) -> None:
        raise MapError(
            f"{path.name} has a document type (<!DOCTYPE …>)",
            "XML without a document type, which may expand without end or name other files",
            "remove the line <!DOCTYPE …>, or export the file again",
        )

    def stop(*_) -> None:
        raise _RootReachedError

    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler = stop
    try:
        parser.Parse(head, False)
    except _RootReachedError:
        return
    raise ValueError("no element in its first megabyte")
