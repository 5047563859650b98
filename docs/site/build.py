"""Builds the site of the documentation: python docs/site/build.py, or `make docs`.

Pages lie in it as in the repository, so that a link works in both; a notebook becomes a page with
what it shows, and every public name gets a page. Nothing of it comes from another host.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import api
import rendering

ROOT = Path(__file__).parents[2]
BUILT = ROOT / "build" / "docs"
LINK = re.compile(r"(?<=\]\()([^)#:\s]+)(?=(?:#[^)\s]*)?\))")
PICTURE = re.compile(r"^!\[[^\]]*\]\(([^)\s]+)\)$", re.M)
_AT_ITS_SIZE = r"[\g<0>](\1)"  # a click shows it so

GUIDES = (
    *("from-gis-and-back", "to-other-programs", "commands", "python"),
    *("maps", "coding", "operators", "fitness", "measures", "recipe", "run-folder", "nights"),
    *("analysis", "studio", "plots", "pictures", "scenes", "classes", "autosimilarity", "cluster"),
    *("shapes", "kinds", "writing"),
)
WORDS = ("glossary", "papers")
PROJECT = (
    *("CONTRIBUTING.md", "docs/first-change.md", "docs/architecture.md", "docs/extending.md"),
    *("docs/testing.md", "docs/decisions.md", "SECURITY.md"),
    *("CHANGELOG.md", "docs/changes/0.3.md", "docs/changes/0.2.md"),
    *("docs/changes/0.1.md", "benchmarks/README.md"),
    *("evocity/data/cities/ATTRIBUTION.md", "evocity/data/fonts/ATTRIBUTION.md"),
)


def navigation() -> list[dict]:
    """What lies where in the menu."""
    names = sorted(path.stem for path in (ROOT / "notebooks").glob("*.ipynb"))
    rooms = [f"evocity.{room}" for room in api.ROOMS]
    return [
        {"evocity": "README.md"},
        {"Guides": [f"docs/{name}.md" for name in GUIDES]},
        {"Notebooks": [f"notebooks/{name}.md" for name in names]},
        {"Gallery": "docs/gallery.md"},
        {"Words": [f"docs/{name}.md" for name in WORDS]},
        {
            "Python": [
                "api/index.md",
                {"Names": [{name: f"api/{name}.md"} for name in api.evocity.__all__]},
                {"Rooms": [{name: f"api/{name}.md"} for name in rooms]},
            ]
        },
        {"Project": list(PROJECT)},
    ]


def lay(pages: Path) -> None:
    """Lay in ``pages`` what the site is made of: Markdown, what it links to, pages of names."""
    todo = ["README.md", *PROJECT, *(f"docs/{name}.md" for name in (*GUIDES, "gallery", *WORDS))]
    laid: set[str] = set()
    while todo:
        name = todo.pop()
        if name in laid:
            continue
        laid.add(name)
        source, target = ROOT / name, pages / name
        target.parent.mkdir(parents=True, exist_ok=True)
        if source.suffix != ".md":
            shutil.copyfile(source, target)
            continue
        text = source.read_text(encoding="utf-8")
        for link in LINK.findall(text):
            if not link.endswith(".ipynb"):
                todo.append((source.parent / link).resolve().relative_to(ROOT).as_posix())
        text = re.sub(r"^(```\w+) no-run$", r"\1", text, flags=re.M)  # a word for the tests alone
        text = PICTURE.sub(_AT_ITS_SIZE, text)
        target.write_text(LINK.sub(_page_of_notebook, text), encoding="utf-8")
    for name, text in api.pages().items():
        _write(pages / "api" / name, text.encode())
    shutil.copyfile(Path(__file__).with_name("site.css"), pages / "site.css")


def lay_notebooks(pages: Path) -> None:
    """Execute every notebook, and lay the page of each."""
    for name, text, pictures in rendering.rendered(sorted((ROOT / "notebooks").glob("*.ipynb"))):
        text = LINK.sub(_page_of_notebook, PICTURE.sub(_AT_ITS_SIZE, text))
        _write(pages / "notebooks" / f"{name}.md", text.encode())
        for file, content in pictures.items():
            _write(pages / "notebooks" / file, content)


def _page_of_notebook(link: re.Match) -> str:
    return re.sub(r"\.ipynb$", ".md", link[0])


def _write(path: Path, content: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)


def build() -> Path:
    """Build the site, with warnings as errors; its folder."""
    shutil.rmtree(BUILT, ignore_errors=True)
    lay(BUILT / "pages")
    lay_notebooks(BUILT / "pages")
    settings = {
        "INHERIT": str(Path(__file__).with_name("mkdocs.yml")),
        "docs_dir": "pages",
        "site_dir": "site",
        "nav": navigation(),
    }
    (BUILT / "mkdocs.yml").write_text(json.dumps(settings), encoding="utf-8")  # JSON is YAML
    call = [sys.executable, "-m", "mkdocs", "build", "--strict", "-f", str(BUILT / "mkdocs.yml")]
    subprocess.run(call, check=True, env=os.environ | {"NO_MKDOCS_2_WARNING": "1"})
    return BUILT / "site"


if __name__ == "__main__":
    site = build()
    print(f"wrote {site.relative_to(ROOT)}/index.html", file=sys.stderr)
