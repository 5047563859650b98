"""Scores and chosen births as files: tables for other programs, a zip with all of each, a contact
sheet."""

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

from evocity.analysis.births import Told
from evocity.analysis.individual import Individual
from evocity.analysis.keeping import Kept
from evocity.analysis.thumbnails import highest_of
from evocity.analysis.wanted import Aim
from evocity.errors import RunError, check_word, keyword, setting
from evocity.files import whole_file
from evocity.pictures.sheet import columns_for, sheet_of

FORMS = ("plain", "design-explorer")
# Of each birth in a zip.
_FILES = ("map.tif", "footprints.gpkg", "picture.png", "genome.parquet", "scene.glb")
# So many maps at most stand on one sheet.
MOST = 400
# What spreadsheets take for a formula.
_FORMULA = ("=", "+", "-", "@", "\t", "\r")


def write_csv(told: Told, ids: np.ndarray, path: str | os.PathLike, form: str = "plain") -> None:
    """The scores of the births ``ids`` as CSV, see `Run.to_csv`. Raises `RunError` for another
    ``form``, and where it cannot be written; nothing is left half-written."""
    path = Path(path)
    check_word("form", form, FORMS, error=RunError)
    rows = told.rows(ids)
    if form == "plain":
        names = told.columns
        columns = [told.column(name)[rows] for name in ["id", *(n for n in names if n != "id")]]
        heads = ["id", *(n for n in names if n != "id")]
        with _written(path) as temporary:
            _write(temporary, heads, zip(*(one.tolist() for one in columns), strict=True))
        return
    pictures = path.with_name(f"{path.stem}-pictures")
    if os.path.lexists(pictures):
        raise RunError(
            f"{pictures} exists already",
            "a new folder for the pictures of this table",
            "choose another name, or remove it",
        )
    individuals = [Individual(told, one) for one in ids.tolist()]
    with ExitStack() as undo:
        with _written(path) as temporary, tempfile.TemporaryDirectory(dir=path.parent) as hidden:
            made = Path(hidden) / "pictures"
            made.mkdir()
            for one in individuals:
                one.save(made / f"{one.id}.png")
            _write(temporary, *_explored(told, individuals, pictures.name))
            made.rename(pictures)
            undo.callback(shutil.rmtree, pictures, ignore_errors=True)
        undo.pop_all()  # the table stands: so do its pictures


def _explored(
    told: Told, individuals: Sequence[Individual], pictures: str
) -> tuple[list[str], Iterator[list]]:
    """Heads and rows as Design Explorer takes them: what went in, what came out, a picture."""
    cities, measures = told.run.header.cities, told.run.header.columns
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
) -> None:
    """These births in one file, see `Run.save`: all of each in a ``path`` that ends in .zip, their
    maps on a contact sheet in one that ends in .png. ``at``: see `Individual.save`. ``roles``: of
    some, by id, what they are kept for.

    Raises `RunError` for another ending, and where it cannot be written; nothing is left
    half-written.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in (".zip", ".png"):
        raise RunError(
            f"{path.name} for several births",
            "a name that ends in .zip, or in .png for a contact sheet",
            "choose one of these; run[97].save(…) writes one birth as .gpkg, .tif and others",
        )
    if not individuals:
        raise RunError("no births to save", "one at least", "name some, for example run.front()")
    each = list(dict.fromkeys(individuals))
    if suffix == ".zip":
        _write_zip(each, path, at)
    else:
        _write_sheet(each, path, at, roles or {})


def roles_of(which: object) -> dict[int, str]:
    """By id what those are kept for that `Run.keep` chose; nothing of what else names births."""
    several = which if isinstance(which, list | tuple) else [which]
    return {one.individual.id: one.role for one in several if isinstance(one, Kept)}


def _write_sheet(
    individuals: Sequence[Individual], path: Path, at: str | None, roles: Mapping[int, str]
) -> None:
    """Their maps side by side with their ids, ``roles`` and scores, on the scale of all pictures of
    the run."""
    if at is not None:
        raise RunError(
            f"{setting('at', at)} for {path.name}, a contact sheet",
            "a .zip, whose files lie somewhere",
            f"leave {keyword('at')} out",
        )
    if len(individuals) > MOST:
        raise RunError(
            f"{len(individuals)} births on one sheet", f"at most {MOST}", "choose fewer of them"
        )
    told = individuals[0].told
    cells = []
    for one in individuals:
        head, *scores = caption(one.id, told.logged, one.scores)
        role = [roles.get(one.id, "")] if roles else []
        cells.append((one.city, [head, *role, *scores]))
    attribution = told.run.header.attribution
    columns = columns_for(len(cells))
    sheet = sheet_of(cells, told.run.path.resolve().name, highest_of(told), attribution, columns)
    with _written(path) as temporary:
        sheet.save(temporary, format="PNG")


def caption(identifier: int, aims: Sequence[Aim], values: Mapping[str, float]) -> list[str]:
    """What stands beneath a map on a sheet: which individual it is, and all that was logged."""
    told = (f"{aim.name} {values.get(aim.name, math.nan):.4g} {aim.unit}".rstrip() for aim in aims)
    return [f"individual {identifier}", *told]


def _write_zip(individuals: Sequence[Individual], path: Path, at: str | None) -> None:
    """Of each a folder with its map as GeoTIFF, its footprints, a picture, its genome, its scene;
    their scores in ``scores.csv``; and whom to thank."""
    told = individuals[0].told
    with (
        _written(path) as temporary,
        tempfile.TemporaryDirectory() as folder,
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive,
    ):
        for one in individuals:
            for name in _FILES:
                file = Path(folder) / name
                one.save(file, at)
                archive.write(file, f"{one.id}/{name}")
        ids = np.array([one.id for one in individuals])
        write_csv(told, ids, Path(folder) / "scores.csv")
        archive.write(Path(folder) / "scores.csv", "scores.csv")
        thanks = told.run.header.attribution.replace("; ", "\n") or "The source maps state none."
        archive.writestr("ATTRIBUTION.txt", thanks + "\n")


def _write(path: Path, heads: Sequence[str], rows: Iterable[Iterable]) -> None:
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(map(_cell, heads))
        writer.writerows(map(_cell, row) for row in rows)


def _cell(value: object) -> object:
    """A value as a table has it: nothing for none; no text that a spreadsheet would reckon with."""
    if isinstance(value, float):
        return "" if math.isnan(value) else repr(value)
    if isinstance(value, str) and value.startswith(_FORMULA):
        return "'" + value
    return value


@contextmanager
def _written(path: Path) -> Iterator[Path]:
    """A temporary path, which becomes ``path``."""
    try:
        with whole_file(path) as temporary:
            yield temporary
    except OSError as error:
        raise RunError(
            f"{path} cannot be written: {error.strerror or error}",
            "a folder this user may write to, with room left",
            "check the folder and free space, or choose another place",
        ) from error


__all__ = ["FORMS", "MOST", "caption", "write_csv", "write_several"]
