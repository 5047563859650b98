"""Texts that users read, from where they stand: pages, docstrings, help, errors, web pages.

`python tests/user_texts.py` prints 60 sentences, drawn by the count of commits or by ``--seed``.
"""

import argparse
import ast
import html
import importlib
import inspect
import keyword
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import click
import numpy as np

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "evocity"
#: Errors whose parts are: what arrived, what was expected, what to do.
_ERROR = re.compile(r"\w*Error$|^fault$")
_SENTENCE = re.compile(r"(?<=[.!?])\s+(?=[^a-z\s]|evocity\b)")
_SECTION = re.compile(r"^(\w[\w ]*)\n-{3,}\n", re.M)


def plain(text: str) -> str:
    """``text`` without marks of Markdown; code keeps a backtick on each side."""
    text = re.sub(r"!\[[^\]]*\]\([^)]*\)", "", text)
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.S)
    return re.sub(r"`+", "`", re.sub(r"\*+", "", text))


def sentences(text: str) -> list[str]:
    """The sentences of a paragraph."""
    text = " ".join(text.split())
    return [part.strip() for part in _SENTENCE.split(text) if part.strip()]


def paragraphs(markdown: str) -> Iterator[str]:
    """Paragraphs and items of lists; no code, table, heading or picture."""
    text = re.sub(r"^( *)```.*?^\1```$", "", markdown, flags=re.M | re.S)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.S)
    for block in re.split(r"\n\s*\n", text):
        lines = [line for line in block.splitlines() if not re.match(r"\s*(\||#|!\[|---)", line)]
        for item in re.split(r"\n(?=\s*(?:[-*]|\d+\.) )", "\n".join(lines)):
            if prose := plain(re.sub(r"^\s*(?:[-*]|\d+\.) ", "", item)).strip():
                yield prose


def pages() -> Iterator[tuple[str, str]]:
    """README and guides."""
    for path in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]:
        for paragraph in paragraphs(path.read_text(encoding="utf-8")):
            yield path.name, paragraph


def prose(docstring: str) -> Iterator[str]:
    """Paragraphs of a docstring, without examples and headings of its sections."""
    text = re.sub(
        r"^\s*(>>>|\.\.\.).*(\n(?!\s*\n).*)*", "", inspect.cleandoc(docstring), flags=re.M
    )
    for block in re.split(r"\n\s*\n|\n(?=- |\w+(?:, \w+)* : )", _SECTION.sub("", text)):
        if block.strip():
            yield plain(re.sub(r"^- ", "", block.strip()))


def docstrings() -> Iterator[tuple[str, str]]:
    """Docstrings of public names and of their public methods."""
    import evocity

    sys.path.insert(0, str(ROOT / "docs" / "site"))
    rooms = importlib.import_module("api").ROOMS
    seen = set()
    for room in ("", *rooms):
        module = importlib.import_module(f"evocity.{room}") if room else evocity
        for name in module.__all__:
            thing = getattr(module, name)
            members = [(name, thing)]
            if inspect.isclass(thing):
                members += [(f"{name}.{key}", value) for key, value in vars(thing).items()]
            for label, member in members:
                text = inspect.getdoc(member) if label == name else _own_docstring(member)
                if label.split(".")[-1].startswith("_") or not text or text in seen:
                    continue
                constant = not callable(member) and not hasattr(type(member), "__get__")
                if inspect.ismodule(member) or constant or not _is_ours(member):
                    continue
                seen.add(text)
                for paragraph in prose(text):
                    yield f"{room}.{label}", paragraph


def _own_docstring(member: object) -> str | None:
    inner = getattr(member, "__func__", getattr(member, "fget", member))
    return inspect.getdoc(inner) if inspect.isfunction(inner) else None


def _is_ours(member: object) -> bool:
    inner = getattr(member, "__func__", getattr(member, "fget", member))
    return str(getattr(inner, "__module__", "evocity")).startswith("evocity")


def helps() -> Iterator[tuple[str, str]]:
    """``--help`` of every command, and of every option."""
    from evocity.cli import main

    def walk(command: click.Command, name: str) -> Iterator[tuple[str, str]]:
        for paragraph in prose((command.help or "").replace("\b", "")):
            yield name, paragraph
        for option in command.params:
            if text := getattr(option, "help", None):
                yield f"{name} {option.opts[0]}", plain(text)
        for key, inner in getattr(command, "commands", {}).items():
            yield from walk(inner, f"{name} {key}")

    yield from walk(main, "evocity")


def errors() -> Iterator[tuple[str, str]]:
    """Messages of errors, their three parts; ``{name}`` stands for the value of a name."""
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.Call):
                continue
            name = getattr(node.func, "id", getattr(node.func, "attr", ""))
            parts = [_shown(argument) for argument in node.args]
            if _ERROR.match(name) and len(parts) >= 2 and all(parts):
                labels = ("", "expected: ", "what to do: ")
                shown = (f"{a}{b}" for a, b in zip(labels, parts, strict=False))
                yield f"{path.relative_to(PACKAGE)}:{node.lineno}", "; ".join(shown)


def _shown(node: ast.AST) -> str:
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(
            _value(ast.unparse(part.value))
            if isinstance(part, ast.FormattedValue)
            else _shown(part)
            for part in node.values
        )
    return ""


def _value(expression: str) -> str:
    """A value in a sentence: the last name that its expression has outside of quotes."""
    names = [
        name
        for name in re.findall(r"[A-Za-z_]{2,}", re.sub(r"'[^']*'|\"[^\"]*\"|\|.*", "", expression))
        if not keyword.iskeyword(name)
    ]
    return f"{{{names[-1].strip('_')}}}" if names else "…"


def web_pages() -> Iterator[tuple[str, str]]:
    """Texts of the report's, the notebook's and studio's pages."""
    for path in sorted(PACKAGE.rglob("*.html")):
        text = path.read_text(encoding="utf-8")
        text = re.sub(r"<(script|style)\b.*?</\1>|\{#.*?#\}|\{%.*?%\}", "\n", text, flags=re.S)
        text = re.sub(r"\{\{(.*?)\}\}", lambda value: _value(value[1]), text, flags=re.S)
        texts = re.split(r"</?(?:p|li|td|th|h\d|div|dt|dd|label|button|figcaption)\b[^>]*>", text)
        texts += re.findall(r"\b(?:title|aria-label|placeholder|alt)=\"([^\"]+)\"", text)
        for piece in texts:
            words = html.unescape(re.sub(r"<[^>]*>", " ", piece))
            if len(re.findall(r"[A-Za-z]{2,}", words)) >= 3:
                yield path.relative_to(PACKAGE).as_posix(), " ".join(words.split())
    for path in sorted(PACKAGE.rglob("page/*.js")):
        for line in path.read_text(encoding="utf-8").splitlines():
            if line.lstrip().startswith(("//", "*", "/*", "import ")):
                continue
            for piece in re.findall(r"\"((?:[^\"\\]|\\.)+)\"|`([^`]+)`", line):
                words = re.sub(r"\$\{([^}]*)\}", lambda value: _value(value[1]), "".join(piece))
                if (
                    re.match(r"[\w{…][^<>;=/]*$", words)
                    and len(re.findall(r"[A-Za-z]{2,}", words)) >= 3
                ):
                    yield path.relative_to(PACKAGE).as_posix(), words


SOURCES = {
    "page": pages, "docstring": docstrings, "help": helps, "error": errors, "web page": web_pages,
}  # fmt: skip


def draw(seed: int, count: int = 60) -> list[tuple[str, str, str]]:
    """``count`` different sentences (source, place, sentence), an equal share of each source."""
    rng = np.random.default_rng(seed)
    drawn = []
    for index, (source, texts) in enumerate(SOURCES.items()):
        pool = sorted(
            {
                (place, sentence)
                for place, text in texts()
                for sentence in ([text] if source == "error" else sentences(text))
                if len(sentence.split()) >= 4
            }
        )
        share = (count + index) // len(SOURCES)
        drawn += [(source, *pool[k]) for k in rng.choice(len(pool), share, replace=False)]
    return drawn


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int)
    seed = parser.parse_args().seed
    if seed is None:
        command = ["git", "-C", str(ROOT), "rev-list", "--count", "HEAD"]
        seed = int(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    print(f"seed {seed}")
    for number, (source, place, sentence) in enumerate(draw(seed), 1):
        print(f"{number}. [{source}, {place}] {sentence}")
