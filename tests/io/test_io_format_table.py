"""Each phrase in each cell of the table of formats on docs/maps.md holds."""

import runpy
from pathlib import Path

import pytest
from format_table import CELLS, CHECKS, COLUMNS, FORMATS

from evocity.io.map_reader import READERS

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(("kind", "column", "phrase"), CELLS)
def test_a_cell_holds(tmp_path, kind, column, phrase):
    CHECKS[column][phrase](kind, tmp_path)


def test_the_page_has_the_table():
    script = runpy.run_path(str(ROOT / "docs" / "formats.py"))
    text = (ROOT / "docs" / "maps.md").read_text(encoding="utf-8")
    assert script["page"](text) == text, "run python docs/formats.py"


def test_every_phrase_and_reader_is_in_the_table():
    used = {
        (column, phrase) for kind in FORMATS for column in COLUMNS for phrase in kind.cells[column]
    }
    assert used == {(name, phrase) for name in CHECKS for phrase in CHECKS[name]}
    readers = {READERS[kind.suffix] for kind in FORMATS}
    assert {reader.content for reader in readers} >= {
        reader.content for reader in READERS.values()
    } - {"gzip", "bzip2"}
