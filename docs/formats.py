"""Writes the table of formats in docs/maps.md from the parameters of its tests.

Run it with the Python that has evocity and its tests' packages installed, after a cell was changed
in tests/io/format_table.py: python docs/formats.py. The tests hold the page against it.
"""

import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "maps.md"
BEGIN = "<!-- what follows is written by docs/formats.py from tests/io/format_table.py -->\n"
END = "<!-- end of what docs/formats.py writes -->\n"


def page(text: str) -> str:
    """Write the table of the page ``text`` again."""
    sys.path.insert(0, str(ROOT / "tests" / "io"))
    from format_table import table

    head, rest = text.split(BEGIN)
    return head + BEGIN + "\n" + table() + "\n" + END + rest.split(END)[1]


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
