"""Elements of an XML file, one after the other, within bounds: no document type, so no entities and
no references to other files; not deeper than `DEEPEST`, and at most `MOST_ELEMENTS` in memory."""

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
#: Elements in memory at a time, about.
MOST_ELEMENTS = 3_000_000

_CHUNK = 1 << 20


class _RootReachedError(Exception):
    pass


def elements(path: Path) -> Iterator[tuple[str, Element, list[Element]]]:
    """Yield ``("start" or "end", element, ancestors)`` for each element of the file at ``path``.

    The caller may clear an element at its end, or remove it. Raises `MapError` for a file that is
    too large, has a document type, or has too many elements that the caller keeps;
    `ElementTree.ParseError` and ValueError for other faults.
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
        count, due = 0, MOST_ELEMENTS
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
                    count += 1
                    if count > due:
                        due = count + _room(path, above[0])
                    if len(above) > DEEPEST:
                        raise ValueError(f"elements more than {DEEPEST} deep")
                else:
                    above.pop()
                    yield "end", element, above
            if not content:
                return


def _room(path: Path, root: Element) -> int:
    """Return how many elements may follow before the next count of those below ``root``. Raises
    `MapError` for too many."""
    kept = sum(1 for _ in root.iter())
    if kept > MOST_ELEMENTS:
        raise MapError(
            f"{path.name} has more than {MOST_ELEMENTS} XML elements in one feature, or outside "
            "all features",
            "an XML file of many features, each of a few elements",
            "convert the file to GeoPackage with ogr2ogr",
        )
    return max(MOST_ELEMENTS - kept, MOST_ELEMENTS // 4)


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
