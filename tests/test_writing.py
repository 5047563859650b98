"""Users' texts are in plain English: docs/writing.md has the rules, and examples of each.

`faults` takes any text of prose, and `barred_names` the names of functions, fields and modules. So
the same rules can hold docstrings, help and pages.
"""

import json
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from tests.user_texts import SOURCES

ROOT = Path(__file__).parent.parent
#: Pages that a user reads. `docs/writing.md` is one too: its examples stand in tables.
PAGES = [
    ROOT / "README.md",
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "notebooks").glob("*.ipynb")),
]
#: Most words in a sentence of a page.
LONGEST = 30

#: Barred patterns: the rule of docs/writing.md, the pattern, and the remedy.
BARRED = (
    (1, r"^(?:What|Who|Whose|Whom|Whoever|Of|Such)\b", "begin with the subject"),
    (
        1,
        r"^(?:Told|Found|Given|Asked|Kept|Drawn|Meant|Bred|Left|Missed|Refused)(?: \w+)? "
        r"(?:is|are)\b",
        "begin with the subject",
    ),
    (
        3,
        r"\b(?:is|are|was|were|be|been|being)(?: \w+)? (?:told|had|laid)\b",
        "say what does it: prints, keeps, places",
    ),
    (4, r"\banew\b", "again"),
    (4, r"(?<!there )\b(?:is|are|was|were) (?-i:none)\b", "is not a"),
    (
        4,
        r"(?<!there )\b(?:is|are|was|were) no "
        r"(?!longer\b|more\b|less\b|better\b|worse\b|\w+er than\b)",
        "is not a",
    ),
    (4, r"\balone\b", "only"),
    (4, r"\bone's\b", "your own"),
    (4, r"\bso (?:many|much|few)(?: \w+){1,3} as\b", "as many as"),
    (4, r"\b(?:and|or|of|by|with|only|for|to|are|is) such as\b", "name the thing"),
)
#: Names that say nothing to a stranger (rule 5).
VAGUE = {"told", "found", "one", "had", "asked", "wanted"}

#: A page or a source of texts, the words that may stand there, and why.
EXCEPTIONS: tuple[tuple[str, str, str], ...] = (
    ("help", 'The column "alone"', "the name of a column that `fitness bench` prints"),
    ("help", '"alone" and "shared"', "the names of two JSON keys of `fitness bench`"),
)

#: A full stop after these ends no sentence.
_ABBREVIATIONS = re.compile(r"\b(?:al|e\.g|i\.e|cf|vs|Fig|[A-Z])\.(?=\s)")
_ENDS = re.compile(r"(?<=[.?!])[\"')*_]*\s+(?=[\"'(*_]*(?:[A-ZÀ-Þ0-9α-ωµΩ]|evocity\b))")


def text_of(page: Path) -> str:
    """Return the Markdown of a page, for a notebook that of its cells."""
    text = page.read_text("utf-8")
    if page.suffix != ".ipynb":
        return text
    cells = json.loads(text)["cells"]
    return "\n\n".join("".join(c["source"]) for c in cells if c["cell_type"] == "markdown")


def paragraphs(text: str) -> Iterator[str]:
    """Yield the prose of a Markdown text: paragraphs and items of lists, as plain words.

    It skips blocks of code, tables, headings, pictures, comments, and parts that scripts write.
    """
    text = re.sub(
        r"<!-- what follows is written by .*?<!-- end of what .*? -->", "", text, flags=re.S
    )
    text = re.sub(r"<!--.*?-->", "", text, flags=re.S)
    text = re.sub(r"^( *)(```|~~~).*?^\1\2[^\n]*$", "\n", text, flags=re.M | re.S)
    text = re.sub(r"^(?: *\||#|!\[).*$", "\n", text, flags=re.M)
    for part in re.split(r"\n\s*\n|\n(?= *(?:[-*]|\d+\.) )", text):
        part = re.sub(r"^ *(?:[-*]|\d+\.) +", "", part.strip())
        if part:
            yield plain(part)


def plain(part: str) -> str:
    """Return a paragraph without marks: inline code becomes one word, a link its text."""
    part = re.sub(r"``?[^`]+``?", "Code", part)
    part = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", part)
    part = re.sub(r"<[^>\s][^>]*>", "", part)
    part = re.sub(r"\*\*|__", "", part)
    return re.sub(r"\s+", " ", part).strip()


def sentences(text: str) -> Iterator[str]:
    """Yield the sentences of a Markdown text."""
    for part in paragraphs(text):
        part = _ABBREVIATIONS.sub(lambda found: found[0].replace(".", "\u2024"), part)
        yield from (one.replace("\u2024", ".") for one in _ENDS.split(part))


def words(sentence: str) -> int:
    return len(re.findall(r"[^\W_][\w'’.,×°²³-]*", sentence))


def faults(text: str, longest: int | None = LONGEST) -> list[str]:
    """List the faults of a text, a line each: the rule, the remedy, and the sentence.

    `longest` is the most words of a sentence, None without a limit: help lists keys of JSON.
    """
    found = []
    for sentence in sentences(text):
        asks = sentence.endswith("?")
        for rule, pattern, remedy in BARRED:
            if not (asks and rule == 1) and (hit := re.search(pattern, sentence, _case(rule))):
                found.append(f"rule {rule}, “{hit[0]}”: {remedy}: {sentence}")
        if longest and (count := words(sentence)) > longest:
            found.append(f"rule 10, {count} words, {longest} at most: {sentence}")
    return found


def _case(rule: int) -> re.RegexFlag:
    return re.NOFLAG if rule == 1 else re.IGNORECASE


def barred_names(names: Iterable[str]) -> list[str]:
    """List the names that are in `VAGUE`, with or without an underscore before them."""
    return sorted(name for name in names if name.lstrip("_") in VAGUE)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_pages_are_in_plain_english(page):
    found = faults(text_of(page))
    assert not found, f"{page.name}: {len(found)} faults\n" + "\n".join(found)


@pytest.mark.parametrize("source", [name for name in SOURCES if name != "page"])
def test_texts_of_the_program_are_in_plain_english(source):
    excepted = {words: False for name, words, _ in EXCEPTIONS if name == source}
    found = []
    for place, text in SOURCES[source]():
        for fragment in excepted:
            excepted[fragment] |= fragment in text
            text = text.replace(fragment, "")
        found += [f"{place}: {fault}" for fault in faults(text, longest=None)]
    assert not found, f"{source}: {len(found)} faults\n" + "\n".join(found)
    assert all(excepted.values()), f"no such words any more: {excepted}"


def test_readme_is_short():
    text = text_of(ROOT / "README.md")
    assert len(text.splitlines()) <= 220
    assert len(text.split()) <= 1800


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("What is locked stays as it is.", 1),
        ("Of each number it prints the share.", 1),
        ("Who wants to know gives it an observer.", 1),
        ("Such runs go on.", 1),
        ("It runs. Told are the values.", 1),
        ("- **Goal**: kept.\n- Such as these are refused.", 1),
        ("The value is told on standard error.", 3),
        ("Files are then had again.", 3),
        ("The report is written anew.", 4),
        ("A line that is none ends the program.", 4),
        ("A list is no range.", 4),
        ("The report alone is written.", 4),
        ("A measure of one's own needs a file.", 4),
        ("It keeps so many births as it can.", 4),
        ("It keeps the best and such as differ.", 4),
        (" ".join(["word"] * 31) + ".", 10),
    ],
)
def test_a_fault_is_seen(text, rule):
    assert [one.split(",")[0] for one in faults(text)] == [f"rule {rule}"]


@pytest.mark.parametrize(
    "text",
    [
        "What does it cost?",
        "There is no row for it. The value is no longer there, and it is no more than 3.",
        "Maps such as `lyon.tif` open in QGIS.",
        "```sh\nWhat is told anew\n```",
        "| What | is told alone |\n|---|---|\n| Of | none |",
        "`one's own` and ![a b](c.png) it stands.",
        "It follows Deb et al. (2002), and X. Marsault. " + " ".join(["word"] * 20) + ".",
    ],
)
def test_plain_english_passes(text):
    assert not faults(text)


def test_vague_names_are_seen():
    assert barred_names(["read_map", "told", "_found", "found_at"]) == ["_found", "told"]
