"""The site of the documentation: what lies in it, where links lead, that it stands alone."""

import importlib
import inspect
import re
import runpy
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from markdown_it import MarkdownIt
from PIL import Image
from test_docs import ROOT, anchors, rows, text_of

import evocity
from evocity.genome import FIELDS
from evocity.operators import OPERATORS
from evocity.selection.algorithms import algorithms
from evocity.store import STATUSES

SITE = ROOT / "docs" / "site"
BUILT = ROOT / "build" / "docs" / "site"
# What a page loads by itself; a link that a reader follows may lead anywhere.
LOADED = re.compile(
    r"""<(?:script|img|iframe|source|video|audio|embed)\b[^>]*?\ssrc=["']?(?:https?:)?//[^"'>]*"""
    r"""|<link\b(?![^>]*rel=["']?canonical)[^>]*?\shref=["']?(?:https?:)?//[^"'>]*"""
    r"""|@import\s*["'(][^;]*//[^;]*|url\(["']?(?:https?:)?//[^)]*""",
    re.I,
)


@pytest.fixture(scope="module")
def site() -> Iterator[SimpleNamespace]:
    """What `docs/site/build.py` names."""
    pytest.importorskip("nbclient")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(SITE))
        yield SimpleNamespace(**runpy.run_path(str(SITE / "build.py")))
    for name in ("api", "rendering"):
        sys.modules.pop(name, None)


@pytest.fixture(scope="module")
def pages(site, tmp_path_factory) -> Path:
    """The pages laid, but those of notebooks."""
    folder = tmp_path_factory.mktemp("pages")
    site.lay(folder)
    return folder


def in_menu(entry: object) -> Iterator[str]:
    if isinstance(entry, str):
        yield entry
    else:
        for one in entry.values() if isinstance(entry, dict) else entry:
            yield from in_menu(one)


def test_every_page_is_in_the_menu(site, pages):
    laid = {path.relative_to(pages).as_posix() for path in pages.rglob("*.md")}
    named = list(in_menu(site.navigation()))
    notebooks = {f"notebooks/{path.stem}.md" for path in (ROOT / "notebooks").glob("*.ipynb")}
    assert set(named) == laid | notebooks
    assert len(named) == len(set(named))
    assert {f"docs/{path.name}" for path in (ROOT / "docs").glob("*.md")} <= laid


def test_every_public_name_has_its_page(site, pages):
    for name in evocity.__all__:
        text = (pages / "api" / f"{name}.md").read_text("utf-8")
        first = (
            "" if name in ("plot", "shapes") else f"```python\n{name}("
        )  # modules that nobody calls
        assert text.startswith(f"# evocity.{name}\n\n{first}"), name
        assert f"api/{name}.md" in set(in_menu(site.navigation()))
    for room in site.api.ROOMS:
        page = pages / "api" / f"evocity.{room}.md"
        measures = {row[0].strip("`[").partition("`")[0] for row in rows(page.read_text("utf-8"))}
        headings = {line[3:] for line in page.read_text("utf-8").splitlines() if line[:3] == "## "}
        named = set(importlib.import_module(f"evocity.{room}").__all__)
        assert named <= headings | measures, room


def test_links_of_laid_pages_lead_somewhere(pages):
    checked = 0
    for page in pages.rglob("*.md"):
        text = re.sub(r"^```.*?^```", "", page.read_text("utf-8"), flags=re.M | re.S)
        for target, anchor in re.findall(r"\]\(([^)#:\s]*)(?:#([^)\s]*))?\)", text):
            found = page.parent / target if target else page
            if "notebooks" in found.parts and found.suffix == ".md":
                found = ROOT / "notebooks" / f"{found.stem}.ipynb"  # laid when it was executed
            assert found.exists(), f"{page.relative_to(pages)}: {target}"
            assert not anchor or anchor in anchors(found), f"{page.name}: {target}#{anchor}"
            checked += 1
    assert checked > 400


def test_nothing_is_asked_of_another_host(pages):
    """As far as it can be told before the site is built; after that, the long test below."""
    settings = (SITE / "mkdocs.yml").read_text("utf-8")
    assert re.search(r"^  font: false", settings, re.M)
    assert not re.search(r"analytics|extra_javascript|https?://", settings)
    for path in [*pages.rglob("*.md"), *SITE.iterdir()]:
        if path.is_file():
            text = path.read_text("utf-8")
            assert not LOADED.findall(text), path
            assert not re.search(r"!\[[^\]]*\]\((?:https?:)?//", text), path


@pytest.mark.parametrize(
    ("text", "loads"),
    [
        ('<script src="https://unpkg.com/x"></script>', True),
        ("<img alt='' src='//else.where/a.png'>", True),
        ('<link rel="stylesheet" href="https://fonts.googleapis.com/css">', True),
        ("@import 'https://a.b/c.css';", True),
        ("src: url(https://a.b/c.woff2)", True),
        ('<a href="https://duckdb.org">DuckDB</a>', False),
        ('<script src="assets/bundle.js"></script>', False),
        ("<img src='../images/a.png'>", False),
    ],
)
def test_what_is_loaded_is_told_from_what_is_linked(text, loads):
    assert bool(LOADED.findall(text)) == loads


def test_docstrings_become_markdown(site):
    def function(city: evocity.CityMap, *, reach: int = 3) -> "evocity.Genome":
        """Does it with ``reach``.

        Parameters
        ----------
        city : any map,
            of any size.
        reach : px. Or : none.

        Raises `MapError`.

        >>> 1 + 1
        2
        """

    assert site.api.prose(inspect.getdoc(function)) == (
        "Does it with `reach`.\n\n**Parameters**\n\n- `city`: any map, of any size.\n"
        "- `reach`: px.\n- `Or`: none.\n\nRaises `MapError`.\n\n```pycon\n>>> 1 + 1\n2\n```"
    )
    told = site.api._signature("function", function)
    assert told == "function(city: CityMap, *, reach: int = 3) -> evocity.Genome".replace(
        "evocity.Genome", "Genome"
    )


def test_outputs_of_notebooks_become_markdown(site):
    v4 = pytest.importorskip("nbformat.v4")
    cell = v4.new_code_cell(
        "draw()",
        outputs=[
            v4.new_output("stream", text="one\n"),
            v4.new_output("stream", text="two\n"),
            v4.new_output("display_data", {"image/png": "aGVsbG8=", "text/plain": "<Figure>"}),
            v4.new_output(
                "execute_result", {"text/html": "<p>\n  a\n\n  b</p>", "text/plain": "a"}
            ),
            v4.new_output("execute_result", {"text/plain": "7"}),
        ],
    )
    notebook = v4.new_notebook(cells=[v4.new_markdown_cell("# Title"), cell])
    text, pictures = site.rendering.as_markdown(notebook, "first")
    assert text == (
        "# Title\n\n```python\ndraw()\n```\n\n```text\none\ntwo\n```\n\n"
        "![What the cell above draws](first-1.png)\n\n"
        '<div class="output"><p> a b</p></div>\n\n```text\n7\n```\n'
    )
    assert pictures == {"first-1.png": b"hello"}


# -- pages that are written by hand ---------------------------------------------------------------


def test_glossary_has_the_words_of_the_program():
    words = set()
    for row in rows(text_of("docs/glossary.md")):
        words |= {word.strip(" `").lower() for word in row[0].split(",")}
        words |= {word.lower() for word in re.findall(r"`([^`]+)`", row[1])}
    printed = {"cells", "coverage", "qd_score", "birth", "generation", "slot", "membership", "rank"}
    printed |= {"front", "archive", "hypervolume", "crowding", "crumbs", "slivers", "integrity"}
    printed |= {"fabric distance", "gsi", "fsi", "osr", "map", "genome", "run", "recipe", "λ", "µ"}
    missing = {*FIELDS, *STATUSES, *algorithms(), *printed} - words
    assert not missing
    head, *_ = [row for row in rows(text_of("docs/glossary.md")) if len(row) != 2] or [None]
    assert head is None, "a word and what it is"


def test_the_papers_operators_stand_beside_ours():
    told = {
        word
        for row in rows(text_of("docs/papers.md"))
        if len(row) == 5
        for word in re.findall(r"`(\w+)`", row[2])
    }
    own = {"plan_fusion", "quarter_fusion", "quarter_refill", "region_fusion", "height_scaling"}
    own |= {"lambda_field", "height_field"}  # of the papers' operators, the others
    own |= {name for name in OPERATORS if name.startswith("plan_")}
    assert set(OPERATORS) - own <= told


def test_gallery_is_what_its_script_says(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "sheets"))
    gallery = runpy.run_path(str(ROOT / "docs" / "sheets" / "gallery.py"))
    text = text_of("docs/gallery.md")
    assert gallery["page"](text) == text, "run python docs/sheets/gallery.py"
    shown = {path.name for path in (ROOT / "docs" / "images" / "gallery").iterdir()}
    assert shown == {Path(one.file).name for one in gallery["CITIES"]}
    for one in gallery["CITIES"]:
        path = ROOT / "docs" / "images" / one.file
        assert path.stat().st_size <= 60_000
        assert all(evocity.io.attribution_of(name) in text for name in one.parents)


@pytest.mark.slow
def test_a_city_of_the_gallery_is_bred_again(monkeypatch):
    """Bit for bit whenever it is bred; as it is shown, as far as a picture that lost some tells."""
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "sheets"))
    gallery = runpy.run_path(str(ROOT / "docs" / "sheets" / "gallery.py"))
    one = next(one for one in gallery["CITIES"] if one.operator == "quarter_refill")
    parent = evocity.read_map(*one.parents)
    codes = [evocity.encode(parent, threads=n, settle="roofs").genome for n in (1, 2)]
    cities = [gallery["bred"](one, [code]) for code in codes]
    assert cities[0].heights.tobytes() == cities[1].heights.tobytes()
    with Image.open(ROOT / "docs" / "images" / one.file) as file:
        shown = np.asarray(file.convert("RGB"), float)

    def differs(city) -> float:
        titled = city.replace(city.heights, name=one.title)
        drawn = gallery["render"](titled, highest=gallery["HIGHEST"], zoom=2)
        return np.abs(np.asarray(drawn.convert("RGB"), float) - shown).mean()

    assert differs(cities[0]) < 4 < 8 < differs(parent)


# -- the site itself ------------------------------------------------------------------------------


def counts(html: str) -> dict[str, int]:
    """How many lists, tables and blocks there are: one reader of Markdown may miss some."""
    return {tag: len(re.findall(rf"<{tag}[ >]", html)) for tag in ("li", "tr", "pre", "img", "h2")}


@pytest.mark.long
def test_the_site_builds_without_warnings_and_stands_alone():
    pytest.importorskip("material")
    subprocess.run([sys.executable, str(SITE / "build.py")], cwd=ROOT, check=True, timeout=280)
    built = list(BUILT.rglob("*.html"))
    for name in evocity.__all__:
        assert (BUILT / "api" / f"{name}.html") in built
    for path in [*built, *BUILT.rglob("*.css")]:
        text = path.read_text("utf-8")
        assert not LOADED.findall(text), path
        for source in re.findall(r'<img\b[^>]*\ssrc="([^":]+)"', text):
            assert (path.parent / source).exists(), f"{path}: {source}"
    for page in (BUILT.parent / "pages").rglob("*.md"):
        name = "index" if page.name == "README.md" else page.stem
        shown = BUILT / page.relative_to(BUILT.parent / "pages").with_name(f"{name}.html")
        article = shown.read_text("utf-8").split("<article")[1]
        forge = MarkdownIt("commonmark").enable("table").render(page.read_text("utf-8"))
        assert counts(article) == counts(forge), page
    pictures = [path for path in (BUILT / "notebooks").iterdir() if path.suffix == ".png"]
    assert pictures  # outputs, which git has not
