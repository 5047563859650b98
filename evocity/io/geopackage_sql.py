"""Bounds for what a GeoPackage computes: views, generated columns, virtual tables. SQLite follows a
recursive view without end, and GDAL sets no bound. So sqlite3 reads each once beforehand, with a
bound."""

import re
import sqlite3
import time
from pathlib import Path

from evocity.errors import MapError

#: Bounds for all views of a file: seconds, rows, bytes.
SECONDS, ROWS, BYTES = 5.0, 5_000_000, 1 << 28
# Bytes of one value, at most: Python and SQLite keep several copies of it.
_LONGEST = 1 << 26

# Deterministic functions that every SQLite has, so that GDAL reads the same values.
_FUNCTIONS = frozenset(
    """abs avg cast ceil ceiling coalesce count floor format glob group_concat hex iif ifnull instr
    length like lower ltrim max min nullif printf quote replace round row_number rtrim sign substr
    substring sum total trim typeof unicode upper""".split()  # noqa: SIM905
)
_READING = {sqlite3.SQLITE_SELECT, sqlite3.SQLITE_READ, sqlite3.SQLITE_RECURSIVE}
_COMPUTED = re.compile(r"\bGENERATED\b|\bAS\s*\(|^\s*CREATE\s+VIRTUAL\s+TABLE\b", re.I)
_INDEX = re.compile(r"^\s*CREATE\s+VIRTUAL\s+TABLE\s+.*\bUSING\s+(rtree|fts\d)\b", re.I | re.S)
# Python decodes the messages of SQLite, which may quote a schema that is not UTF-8.
_ERRORS = sqlite3.Error, UnicodeError
# Opcodes between two checks of the clock.
_OPCODES = 20_000


def check_views(path: Path) -> None:
    """Raise `MapError` if the SQLite file at ``path`` computes without end, more than the bounds,
    or by functions that not every SQLite has. The check writes nothing."""
    end = time.monotonic() + SECONDS
    trouble = ""
    try:
        # immutable: no lock, no journal beside it
        file = sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro&immutable=1", uri=True)
    except (sqlite3.Error, ValueError):
        return  # GDAL reports the error
    try:
        file.text_factory = bytes
        file.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, _LONGEST)
        file.set_progress_handler(lambda: time.monotonic() > end, _OPCODES)
        try:
            computed = [name for name, sql in _definitions(file) if _computes(sql)]
        except _ERRORS:
            return
        file.set_authorizer(_authorize)
        for name in computed:
            trouble = f"its view {name!r}"
            _read(file, name)
    except _ERRORS as error:
        if time.monotonic() > end:
            raise _view_error(path, trouble, f"takes longer than {SECONDS:g} s") from None
        raise _view_error(path, trouble, f"cannot be read ({error})") from None
    except OverflowError as error:
        raise _view_error(path, trouble, str(error)) from None
    finally:
        file.close()


def _definitions(file: sqlite3.Connection) -> list[tuple[str, str]]:
    found = file.execute("SELECT name, sql FROM sqlite_master WHERE type IN ('table', 'view')")
    return [
        (name.decode(errors="replace"), sql.decode(errors="replace"))
        for name, sql in found
        if isinstance(name, bytes) and isinstance(sql, bytes)
    ]


def _computes(sql: str) -> bool:
    if re.match(r"\s*CREATE\s+(TEMP\w*\s+)?VIEW\b", sql, re.I):
        return True
    return bool(_COMPUTED.search(sql)) and not _INDEX.match(sql)


def _read(file: sqlite3.Connection, name: str) -> None:
    """Read all of a view or table; raises OverflowError beyond the bounds."""
    quoted = name.replace('"', '""')
    size = 0
    for rows, row in enumerate(file.execute(f'SELECT * FROM "{quoted}"'), 1):
        size += sum(len(one) for one in row if isinstance(one, bytes)) + 16
        if rows > ROWS or size > BYTES:
            raise OverflowError(f"has more than {ROWS} rows or {BYTES >> 20} MiB")


def _authorize(action: int, first, second, *_) -> int:
    if action in _READING:
        return sqlite3.SQLITE_OK
    if action == sqlite3.SQLITE_FUNCTION and str(second).lower() in _FUNCTIONS:
        return sqlite3.SQLITE_OK
    return sqlite3.SQLITE_DENY


def _view_error(path: Path, what: str, found: str) -> MapError:
    return MapError(
        f"{path.name}: {what} {found}",
        "a table, or a view that SQLite computes in seconds with its standard functions",
        "export the layer as a table, for example with ogr2ogr",
    )
