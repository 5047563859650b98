"""Scores and chosen births as files: tables for other programs, a zip with all of each."""

import csv
import math
import os
import shutil
import tempfile
import zipfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np

from evocity.analysis.births import Told
from evocity.analysis.individual import Individual
from evocity.errors import RunError, check_word
from evocity.files import whole_file

FORMS = ("plain", "design-explorer")
# Of each birth in a zip.
_FILES = ("map.tif", "picture.png", "genome.parquet", "scene.glb")
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


def write_zip(individuals: Sequence[Individual], path: str | os.PathLike) -> None:
    """All of these births in one zip: of each a folder with its map as GeoTIFF, a picture, its
    genome, its scene; their scores in ``scores.csv``; and whom to thank.

    Raises `RunError` where it cannot be written; nothing is left half-written.
    """
    path = Path(path)
    if path.suffix.lower() != ".zip":
        raise RunError(f"{path.name} for several births", "a name that ends in .zip", "add .zip")
    if not individuals:
        raise RunError("no births to save", "one at least", "name some, for example run.front()")
    told, individuals = individuals[0].told, list(dict.fromkeys(individuals))
    with (
        _written(path) as temporary,
        tempfile.TemporaryDirectory() as folder,
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive,
    ):
        for one in individuals:
            for name in _FILES:
                file = Path(folder) / name
                one.save(file)
                archive.write(file, f"{one.id}/{name}")
        ids = np.array([one.id for one in individuals])
        write_csv(told, ids, Path(folder) / "scores.csv")
        archive.write(Path(folder) / "scores.csv", "scores.csv")
        thanks = told.run.header.attribution.replace("; ", "\n")
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


__all__ = ["FORMS", "write_csv", "write_zip"]
