"""The project's own pages: release, changelog, citation, contributing, the first change."""

import doctest
import re
from pathlib import Path

import numpy as np
import pytest

import evocity
from evocity.citymap import CityMap
from evocity.fitness import Undefined
from evocity.fitness.registry import fitness

ROOT = Path(__file__).parent.parent
#: Bytes of CONTRIBUTING.md, at most, and lines of a release in CHANGELOG.md.
MOST_BYTES, LINES = 8000, 10


def text_of(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def releases() -> list[tuple[str, str, str]]:
    """Return version, date and text of each release in the changelog, the newest first."""
    return re.findall(
        r"^## \[(\d+\.\d+\.\d+)\] - (\d{4}-\d\d-\d\d)\n(.*?)(?=^## |\Z)",
        text_of("CHANGELOG.md"),
        re.M | re.S,
    )


def test_the_changelog_begins_with_this_release():
    version, date, _ = releases()[0]
    assert version == evocity.__version__
    citation = text_of("CITATION.cff")
    assert re.search(rf"^version: {version}$", citation, re.M)
    assert re.search(rf"^date-released: {date}$", citation, re.M)


def test_a_release_has_ten_lines_and_a_page_of_all_entries():
    for version, date, text in releases():
        assert len(re.findall(r"^- ", text, re.M)) <= LINES, version
        page = f"docs/changes/{version.rpartition('.')[0]}.md"
        assert f"({page})" in text
        assert f"Version {version} is of {date}." in re.sub(r"\s+", " ", text_of(page))


def test_contributing_is_short():
    assert len(text_of("CONTRIBUTING.md").encode()) <= MOST_BYTES


#: The pages that promise something, and the parts of them whose rows or items are promises.
PROMISES = {
    "SECURITY.md": [r"(?s)\n- \*\*No file is code.*?(?=\n### )"],
    "docs/run-folder.md": [r"(?s)\n1\. \*\*The same seed.*"],
    "docs/nights.md": [r"(?s)\n\| a measure raises.*?(?=\n\n)", r"(?s)\n\| Same seed.*?(?=\n\n)"],
    "docs/studio.md": [],
    "docs/fitness.md": [],
}
_NAMED = re.compile(r"`(tests/[\w/.]+)`")


@pytest.mark.parametrize(
    "page",
    [*PROMISES, *sorted({f"docs/{one.name}" for one in ROOT.glob("docs/*.md")} - {*PROMISES})],
)
def test_tests_that_a_page_names_exist(page):
    named = _NAMED.findall(text_of(page))
    assert named or page not in PROMISES
    assert [name for name in named if not (ROOT / name).exists()] == []


@pytest.mark.parametrize("page", PROMISES)
def test_each_promise_names_a_test(page):
    for part in PROMISES[page]:
        promises = re.split(r"\n(?=- |\d+\. |\| )", re.search(part, text_of(page))[0])[1:]
        assert len(promises) > 5
        for promise in promises:
            files = [ROOT / name for name in _NAMED.findall(promise)]
            assert files, f"no test shows: {promise}"
            assert all("def test_" in one.read_text("utf-8") for one in files), promise


def hunks() -> list[tuple[str, list[str]]]:
    """Return file and lines of each hunk in the diffs of docs/first-change.md."""
    found = []
    for block in re.findall(r"^```diff\n(.*?)^```", text_of("docs/first-change.md"), re.M | re.S):
        for name, body in re.findall(r"^\+\+\+ b/(\S+)\n(.*?)(?=^--- a/|\Z)", block, re.M | re.S):
            parts = re.split(r"^@@\n", body, flags=re.M)[1:]
            found += [(name, part.splitlines()) for part in parts]
    return found


def test_the_first_change_fits_the_files_it_changes():
    checked = hunks()
    assert len(checked) == 7
    for name, lines in checked:
        there = "\n".join(line[1:] for line in lines if not line.startswith("+"))
        assert there in text_of(name), f"{name} has no lines\n{there}"


@pytest.mark.parametrize("name", sorted({name for name, _ in hunks()}))
def test_the_first_change_compiles(name):
    text = text_of(name)
    for at, lines in hunks():
        before = "\n".join(line[1:] for line in lines if not line.startswith("+"))
        after = "\n".join(line[1:] for line in lines if not line.startswith("-"))
        if at == name:
            text = text.replace(before, after, 1) if before else f"{text}\n\n{after}\n"
    compile(text, name, "exec")


def test_the_measure_of_the_first_change_has_the_values_of_its_page():
    (added,) = [lines for name, lines in hunks() if name == "evocity/fitness/roofs.py"]
    code = "\n".join(line[1:] for line in added if line.startswith("+"))
    names = {"np": np, "CityMap": CityMap, "Undefined": Undefined, "fitness": fitness}
    exec(compile(code, "roofs.py", "exec"), names)
    tall_share = names["tall_share"]
    example = doctest.DocTestParser().get_doctest(tall_share.__doc__, names, "example", None, 0)
    assert doctest.DocTestRunner().run(example) == (0, 2)
    assert tall_share(evocity.read_map("lyon-1er")) == pytest.approx(0.94, abs=0.005)
    assert tall_share(evocity.read_map("cape-town-salt-river")) == 0
