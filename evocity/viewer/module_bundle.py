"""The bundle of the page's modules: one ES module for hosts that load a single file.

The views of the page are the files of `page/views`, and the files that other packages name by entry
points of the group ``evocity.views``.
"""

import json
import re
from functools import cache
from importlib.metadata import EntryPoint
from importlib.util import find_spec
from pathlib import Path

from evocity.errors import EvocityError
from evocity.plugins import load_plugins

PAGE = Path(__file__).parent / "page"
#: The modules, each after those that it imports, the views before the frame.
MODULES = ("elements", "births", "density", "tiles", "tabs", "axis", "gallery", "viewer")

_IMPORT = re.compile(r'^import \{[^}]*\} from "\.{1,2}/(\w+)\.js";\n', re.M)
_NAME, _VIEW = re.compile(r"[a-z][a-z0-9_]*"), "export const view ="


def views() -> dict[str, str]:
    """Return the text of each view, by name: those of this package, then those of entry points. An
    entry point ``NAME = "package"`` names the file ``NAME.js`` in the folder of the package."""
    return _loaded()[0]


def view_faults() -> tuple[str, ...]:
    """Return a text for each entry point whose view cannot be loaded."""
    return _loaded()[1]


@cache
def _loaded() -> tuple[dict[str, str], tuple[str, ...]]:
    own = {path.stem: path.read_text("utf-8") for path in sorted((PAGE / "views").glob("*.js"))}

    def take(entry: EntryPoint) -> None:
        if not _NAME.fullmatch(entry.name) or entry.name in own:
            raise EvocityError(
                f"the entry point {entry.name!r} of {entry.value} cannot name a view",
                "lower-case letters, digits and _, and no name of another view",
                "rename the entry point and its file",
            )
        spec = find_spec(entry.value)
        folders = (spec.submodule_search_locations if spec else None) or []
        text = (Path(next(iter(folders))) / f"{entry.name}.js").read_text("utf-8")
        left = re.search(
            r"^ *(import|export)\b.*", _IMPORT.sub("", text).replace(_VIEW, "", 1), re.M
        )
        if left or _VIEW not in text:
            raise EvocityError(
                f"{entry.name}.js " + (f"has the line {left[0][:60]!r}" if left else "has no view"),
                'imports on one line each from "../NAME.js", and one export: export const view = …',
                "join the lines of an import, and move other modules into the file",
            )
        own[entry.name] = text

    return own, load_plugins("evocity.views", take)


@cache
def module() -> str:
    """Return all modules of the page as one; its default export has `render`."""
    parts = [_IMPORT.sub("", text(f"{name}.js")) for name in MODULES[:-1]]
    parts.append(f"const VIEWS = [], FAULTS = {json.dumps(view_faults())};")
    for one in views().values():  # a block for each: two views may use the same names
        own = _IMPORT.sub("", one).replace(_VIEW, "const view =", 1)
        parts.append(f"{{\n{own}\nVIEWS.push(view);\n}}")
    parts += ["VIEWS.sort((a, b) => a.place - b.place);", _IMPORT.sub("", text("viewer.js"))]
    return "\n".join(parts)


@cache
def views_module() -> str:
    """Return the module `views.js`, for hosts that load each file by itself."""
    names = list(views())
    lines = [f'import {{ view as view{k} }} from "./views/{n}.js";' for k, n in enumerate(names)]
    listed = ", ".join(f"view{k}" for k in range(len(names)))
    sort = ".sort((a, b) => a.place - b.place)"
    faults = f"export const FAULTS = {json.dumps(view_faults())};"
    return "\n".join([*lines, f"export const VIEWS = [{listed}]{sort};", faults, ""])


@cache
def files() -> dict[str, str]:
    """Return the text of each file of the page by its path, the views of other packages too."""
    own = {path.name: path.read_text("utf-8") for path in sorted(PAGE.glob("*.*"))}
    return own | {"views.js": views_module()} | {f"views/{n}.js": t for n, t in views().items()}


def text(file: str) -> str:
    """Return the text of one file of the page."""
    return files()[file]
