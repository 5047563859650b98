"""Notebooks executed and as Markdown: git has them without outputs, the site shows them with."""

import base64
import os
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path

import nbclient
import nbformat

PICTURES = {"image/png": "png", "image/jpeg": "jpg", "image/svg+xml": "svg"}
# Seconds of a cell: the first may have to compile.
_LONGEST = 600
# A kernel would warn that it speaks to this machine unencrypted.
_QUIET = "--IPKernelApp.log_level=ERROR"


def executed(path: Path, folder: Path) -> nbformat.NotebookNode:
    """The notebook at ``path``, run in ``folder`` on the runs that it breeds there, or finds there
    of another notebook.

    Raises `nbclient.exceptions.CellExecutionError` if a cell fails.
    """
    notebook = nbformat.read(path, as_version=4)
    own = {"EVOCITY_RUN": None, "EVOCITY_OTHER": None, "IPYTHONDIR": str(folder)}
    before = {name: os.environ.get(name) for name in own}
    _set(own)
    try:
        where = {"metadata": {"path": str(folder)}}
        client = nbclient.NotebookClient(notebook, timeout=_LONGEST, resources=where)
        client.extra_arguments = [_QUIET]
        client.execute()
    finally:
        _set(before)
    return notebook


def _set(values: dict[str, str | None]) -> None:
    for name, value in values.items():
        if value is None:
            os.environ.pop(name, None)
        else:
            os.environ[name] = value


def as_markdown(notebook: nbformat.NotebookNode, name: str) -> tuple[str, dict[str, bytes]]:
    """A page of an executed notebook, and its pictures by file name."""
    parts, pictures = [], {}
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            parts.append(cell.source)
        elif cell.cell_type == "code" and cell.source:
            parts.append(f"```python\n{cell.source}\n```")
            printed = [one.text for one in cell.outputs if one.output_type == "stream"]
            parts += [f"```text\n{''.join(printed).rstrip()}\n```"] if printed else []
            parts += [_shown(one, name, pictures) for one in cell.outputs]
    return "\n\n".join(filter(None, parts)) + "\n", pictures


def _shown(output: nbformat.NotebookNode, name: str, pictures: dict[str, bytes]) -> str:
    """The richest form of one output that a page can hold."""
    data = output.get("data", {})  # what is printed has none
    if "text/html" in data:  # in one line: Markdown would take what is indented for code
        html = " ".join(line.strip() for line in data["text/html"].splitlines() if line.strip())
        return f'<div class="output">{html}</div>'
    for kind, suffix in PICTURES.items():
        if kind in data:
            file = f"{name}-{len(pictures) + 1}.{suffix}"
            told = data[kind]
            pictures[file] = told.encode() if suffix == "svg" else base64.b64decode(told)
            return f"![What the cell above draws]({file})"
    return f"```text\n{data['text/plain']}\n```" if "text/plain" in data else ""


def rendered(paths: Iterable[Path]) -> Iterator[tuple[str, str, dict[str, bytes]]]:
    """Name, page and pictures of each of these notebooks, executed in one folder."""
    with tempfile.TemporaryDirectory() as folder:
        for path in paths:
            yield path.stem, *as_markdown(executed(path, Path(folder)), path.stem)
