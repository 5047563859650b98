"""Scores and chosen births as files: CSV, a zip with all files of each, a contact sheet."""

import csv
import math
import os
import shutil
import tempfile
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np

from evocity.analysis.births import Births
from evocity.analysis.individual import Individual
from evocity.analysis.shortlist import ShortlistEntry
from evocity.analysis.thumbnails import highest_of
from evocity.errors import RunError, check_word, keyword, reason_of, setting
from evocity.files import whole_file
from evocity.pictures.sheet import columns_for, sheet_of

FORMS = ("plain", "design-explorer")
# Files of each birth in a zip.
_FILES = ("map.tif", "footprints.gpkg", "picture.png", "genome.parquet", "scene.glb")
# Those with coordinates that may be converted, and the style of the map.
_PLACED, _STYLE = ("map.tif", "footprints.gpkg", "scene.glb"), "map.qml"
# Maps on one sheet, at most.
MOST = 400
# Spreadsheets take a text with one of these first letters for a formula.
_FORMULA = ("=", "+", "-", "@", "\t", "\r")


def write_csv(
    births: Births, ids: np.ndarray, path: str | os.PathLike, form: str = "plain"
) -> None:
    """Write the scores of the births ``ids`` as CSV, see `Run.to_csv`."""
    path = Path(path)
    check_word("form", form, FORMS, error=RunError)
    rows = births.rows(ids)
    if form == "plain":
        names = births.columns
        columns = [births.column(name)[rows] for name in ["id", *(n for n in names if n != "id")]]
        heads = ["id", *(n for n in names if n != "id")]
        with written_file(path) as temporary:
            _write(temporary, heads, zip(*(one.tolist() for one in columns), strict=True))
        return
    pictures = path.with_name(f"{path.stem}-pictures")
    if os.path.lexists(pictures):
        raise RunError(
            f"the folder {pictures} exists already",
            "no folder of this name, because evocity creates it for the pictures of the table",
            "choose another name for the table, or delete the folder",
        )
    individuals = [Individual(births, one) for one in ids.tolist()]
    with ExitStack() as undo:
        with (
            written_file(path) as temporary,
            tempfile.TemporaryDirectory(dir=path.parent) as hidden,
        ):
            made = Path(hidden) / "pictures"
            made.mkdir()
            for one in individuals:
                one.save(made / f"{one.id}.png")
            _write(temporary, *_explored(births, individuals, pictures.name))
            made.rename(pictures)
            undo.callback(shutil.rmtree, pictures, ignore_errors=True)
        undo.pop_all()  # the table is written: keep its pictures


def _explored(
    births: Births, individuals: Sequence[Individual], pictures: str
) -> tuple[list[str], Iterator[list]]:
    """Heads and rows for Design Explorer: inputs, outputs, a picture."""
    cities, measures = births.run.header.cities, births.run.header.columns
    heads = ["in:id", "in:generation", "in:operator", *(f"in:{city}" for city in cities)]
    heads += [*(f"out:{name}" for name in measures), "img"]

    def row(one: Individual) -> list:
        shares, scores = one.ancestry(), one.scores
        values = [one.id, one.generation, one.operator, *(shares.get(c, 0.0) for c in cities)]
        return [*values, *(scores.get(m, math.nan) for m in measures), f"{pictures}/{one.id}.png"]

    return heads, map(row, individuals)


def write_several(
    individuals: Sequence[Individual],
    path: str | os.PathLike,
    at: str | None = None,
    roles: Mapping[int, str] | None = None,
    crs: str | None = None,
) -> None:
    """Write births into one file, see `Run.save`. ``roles``: id -> why it is kept."""
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in (".zip", ".png"):
        raise RunError(
            f"a file named {path.name} cannot hold several births",
            "a file name that ends in .zip, or in .png for a contact sheet",
            "change the suffix, or write a single birth, for example with "
            "run[97].save('birth.gpkg')",
        )
    if not individuals:
        raise RunError(
            "the choice contains no births to save",
            "at least one birth",
            "choose births, for example run.front()",
        )
    each = list(dict.fromkeys(individuals))
    if suffix == ".zip":
        _write_zip(each, path, at, crs)
    else:
        _write_sheet(each, path, at or crs, roles or {}, "crs" if at is None else "at")


def roles_of(which: object) -> dict[int, str]:
    """Return id -> role of the entries of a `Shortlist`; nothing for other births."""
    several = which if isinstance(which, list | tuple) else [which]
    return {one.individual.id: one.role for one in several if isinstance(one, ShortlistEntry)}


def _write_sheet(
    individuals: Sequence[Individual],
    path: Path,
    place: str | None,
    roles: Mapping[int, str],
    option: str,
) -> None:
    """Their maps side by side with ids, ``roles`` and scores, on the run's scale of heights."""
    if place is not None:
        raise RunError(
            f"{setting(option, place)} has no effect on the contact sheet {path.name}",
            "a file name that ends in .zip",
            f"leave {keyword(option)} out, or choose a .zip file",
        )
    if len(individuals) > MOST:
        raise RunError(
            f"{len(individuals)} births are too many for one contact sheet",
            f"at most {MOST} births",
            "choose fewer births",
        )
    births = individuals[0].births
    cells = []
    for one in individuals:
        head, *scores = caption(one)
        role = [roles.get(one.id, "")] if roles else []
        cells.append((one.city, [head, *role, *scores]))
    attribution = births.run.header.attribution
    columns = columns_for(len(cells))
    note = cross_note(individuals)
    sheet = sheet_of(cells, births.run.name, highest_of(births), attribution, columns, note)
    with written_file(path) as temporary:
        sheet.save(temporary, format="PNG")


def caption(one: Individual) -> list[str]:
    """Return the lines beneath a map on a sheet: its id and all logged measures. A cross marks a
    birth that breaks bounds, and the measures of these bounds."""
    scores, lines = one.scores, [f"individual {one.id}" + ("" if one.feasible else " ×")]
    for aim in one.births.logged:
        value = scores.get(aim.name, math.nan)
        mark = "" if aim.within(np.array(value)) else " ×"
        lines.append(f"{aim.name} {value:.4g} {aim.unit}".rstrip() + mark)
    return lines


def cross_note(individuals: Iterable[Individual]) -> str:
    """Return the meaning of the cross for the foot of a sheet; empty if all births keep the
    bounds."""
    return "" if all(one.feasible for one in individuals) else "a cross marks a broken bound"


def _write_zip(
    individuals: Sequence[Individual], path: Path, at: str | None, crs: str | None
) -> None:
    """A folder per birth with its files; the table ``scores.csv``; and the attribution."""
    births = individuals[0].births
    with (
        written_file(path) as temporary,
        tempfile.TemporaryDirectory() as folder,
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive,
    ):
        for one in individuals:
            for name in _FILES:
                file = Path(folder) / name
                one.save(file, at, crs if name in _PLACED else None)
                archive.write(file, f"{one.id}/{name}")
            archive.write(Path(folder) / _STYLE, f"{one.id}/{_STYLE}")
        ids = np.array([one.id for one in individuals])
        write_csv(births, ids, Path(folder) / "scores.csv")
        archive.write(Path(folder) / "scores.csv", "scores.csv")
        credit = births.run.header.attribution.replace("; ", "\n") or "The source maps state none."
        archive.writestr("ATTRIBUTION.txt", credit + "\n")


def _write(path: Path, heads: Sequence[str], rows: Iterable[Iterable]) -> None:
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(map(_cell, heads))
        writer.writerows(map(_cell, row) for row in rows)


def _cell(value: object) -> object:
    """A value of a table: empty for no value; a text never begins like a formula."""
    if isinstance(value, float):
        return "" if math.isnan(value) else repr(value)
    if isinstance(value, str) and value.startswith(_FORMULA):
        return "'" + value
    return value


@contextmanager
def written_file(path: Path) -> Iterator[Path]:
    """Yield a temporary path, which becomes ``path``. Raises `RunError` if that fails."""
    with report_write_errors(path), whole_file(path) as temporary:
        yield temporary


@contextmanager
def report_write_errors(path: Path) -> Iterator[None]:
    """Turn errors of the operating system, while ``path`` is written, into `RunError`."""
    try:
        yield
    except OSError as error:
        raise RunError(
            f"{path} cannot be written: {reason_of(error)}",
            "a folder that you may write to, on a disk with free space",
            "free some space, or choose another folder",
        ) from error
