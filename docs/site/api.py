"""A page of Markdown for every public name: those of the package, and those of the rooms users
import from. `build.py` lays them beside the guides.
"""

import importlib
import inspect
import re
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path

import evocity
from evocity.fitness import Family, Measure

#: The rooms that users import from; what other rooms name is for each other.
ROOMS = (
    *("analysis", "citymap", "coding", "condensation", "fitness", "genome", "growth", "io"),
    *("operators", "pavement", "pictures", "plot", "report", "scene", "search", "shapes", "towns"),
)
MEASURES, OF_FORMS = "../docs/measures.md", "../docs/kinds.md"
_TITLE = re.compile(r"^(Parameters|Raises|Returns|Attributes)\n-+\n", re.M)
_ENTRY = re.compile(r"(?:^|(?<=[.;] ))(?=[\w`*][\w`*,.… ]* : )", re.M)


def pages() -> dict[str, str]:
    """Markdown by file name: ``index.md``, ``CityMap.md`` of each name, ``evocity.io.md`` of each
    room."""
    places = _places()
    found = {"index.md": _index()}
    for name in evocity.__all__:
        found[f"{name}.md"] = _linked(_page(name), places, f"{name}.md")
    for room in ROOMS:
        found[f"evocity.{room}.md"] = _linked(_room(room), places, f"evocity.{room}.md")
    return found


def _places() -> dict[str, str]:
    """Where the page of each name is; of two alike the package's own, or the first room's."""
    places = {name: f"{name}.md" for name in evocity.__all__}
    for room in ROOMS:
        module = importlib.import_module(f"evocity.{room}")
        for name in module.__all__:
            place = f"evocity.{room}.md#{name.lower()}"
            if isinstance(getattr(module, name), Measure | Family):
                place = _told_at(name, getattr(module, name))
            places.setdefault(name, place)
            places.setdefault(f"{room}.{name}", place)
    return places


def _told_at(name: str, measure: Measure | Family) -> str:
    """Where the documentation tells of a measure."""
    of = measure.of if isinstance(measure, Measure) else measure.measures[0].of
    return f"{MEASURES}#{name}" if of == "city" else f"{OF_FORMS}#measures"


def _linked(text: str, places: dict[str, str], own: str) -> str:
    """Text whose public names in backticks lead to their pages; headings and code stay."""

    def link(found: re.Match) -> str:
        name = found[1].removeprefix("evocity.")
        told = name in evocity.__all__ or re.search(r"[._A-Z]", name)  # no plain word
        place = places.get(name) if told else None
        return found[0] if place in (None, own) else f"[{found[0]}]({place})"

    lines, code = [], False
    for line in text.split("\n"):
        code ^= line.startswith("```")
        plain = code or line.startswith(("#", "    ", "|", "```"))
        lines.append(line if plain else re.sub(r"(?<![`\[])`([\w.]+)`(?![`\]])", link, line))
    return "\n".join(lines)


def _index() -> str:
    rows = [
        f"| [`{name}`]({name}.md) | {_summary(_called(getattr(evocity, name)))} |"
        for name in evocity.__all__
    ]
    rooms = [
        f"| [`evocity.{room}`](evocity.{room}.md) "
        f"| {_summary(importlib.import_module(f'evocity.{room}'))} |"
        for room in ROOMS
    ]
    return (
        "# Python\n\n"
        "Every public name has its page: arguments, results, units and errors. "
        "[evocity in Python](../docs/python.md) shows them at work.\n\n"
        "## Names of `import evocity`\n\n| name | meaning |\n|---|---|\n"
        + "\n".join(rows)
        + "\n\n## Rooms\n\nImport other names from their room, as in "
        "`from evocity.fitness import Objective`.\n\n| room | content |\n|---|---|\n"
        + "\n".join(rooms)
        + "\n"
    )


def _called(thing: object) -> object:
    """What a module that is called does, and of any other thing itself."""
    own = thing.__name__.rpartition(".")[2] if inspect.ismodule(thing) else ""
    return getattr(thing, own, thing) if own else thing


def _summary(thing: object) -> str:
    """The first sentence of a docstring, in one line."""
    first = (inspect.getdoc(thing) or "").split("\n\n")[0].replace("``", "`")
    return re.split(r"(?<=\.)\s(?=[A-Z])", " ".join(first.split()))[0].rstrip(":")


def _page(name: str) -> str:
    thing = getattr(evocity, name)
    called = _called(thing)
    plain = inspect.ismodule(called)
    told = prose(inspect.getdoc(called) or "") if plain else _described(name, called, "##")
    text = f"# evocity.{name}\n\n{told}"
    if inspect.ismodule(thing):
        text += f"\nOther names of the room are in [evocity.{name}](evocity.{name}.md).\n"
    return text


def _room(room: str) -> str:
    module = importlib.import_module(f"evocity.{room}")
    text = f"# evocity.{room}\n\n{prose(inspect.getdoc(module) or '')}\n"
    measures = {
        name: getattr(thing, "measures", [thing])[0]  # of a family the first tells of all
        for name in module.__all__
        if isinstance(thing := getattr(module, name), Measure | Family)
    }
    if measures:
        text += "\n## Measures\n\n| measure | what it says |\n|---|---|\n" + "".join(
            f"| [`{name}`]({_told_at(name, one)}) | {one.summary} |\n"
            for name, one in measures.items()
        )
    for name in module.__all__:
        thing = getattr(module, name)
        if name in evocity.__all__ and _called(getattr(evocity, name)) is thing:
            text += f"\n## {name}\n\nHas [a page of its own]({name}.md).\n"
        elif name not in measures:
            text += f"\n## {name}\n\n" + _described(name, thing, "###", module)
    return text


def _described(name: str, thing: object, heading: str, module: object = evocity) -> str:
    """Signature, docstring and members of one name."""
    if not callable(thing):
        return _constant(name, thing, module)
    text = f"```python\n{_signature(name, thing)}\n```\n\n{prose(inspect.getdoc(thing) or '')}\n"
    if inspect.isclass(thing):
        for member, kind, function in _members(thing):
            whole = f"{name}.{member}"
            shown = _signature(whole, function)
            if kind == "property":
                shown = shown.replace("() -> ", ": ")
            about = f"*{kind}*. " if kind else ""
            doc = about + prose(inspect.getdoc(function) or "")
            text += f"\n{heading} {whole}\n\n```python\n{shown}\n```\n\n{doc}\n"
    return text


def _constant(name: str, thing: object, module: object) -> str:
    """The value of what is no function, and the comment above it."""
    value = repr(thing)
    told = f"`{value}`\n" if len(value) < 200 else f"A {type(thing).__name__}.\n"
    for path in sorted(Path(module.__file__).parent.rglob("*.py")):
        found = re.search(rf"((?:^#:.*\n)+){name}\b", path.read_text("utf-8"), re.M)
        if found:
            told = re.sub(r"^#: ?", "", found[1], flags=re.M).strip() + f"\n\n{told}"
            break
    return told


def _members(kind: type) -> Iterator[tuple[str, str, object]]:
    """Public methods and properties of a class and of this package's classes below it."""
    seen = set()
    for one in inspect.getmro(kind):
        if not one.__module__.startswith("evocity."):
            continue
        for name, member in vars(one).items():
            if name.startswith("_") or name in seen:
                continue
            if isinstance(member, classmethod | staticmethod):
                found = (type(member).__name__, member.__func__)
            elif isinstance(member, cached_property):
                found = ("property", member.func)
            elif isinstance(member, property):
                found = ("property", member.fget)
            elif inspect.isfunction(member):
                found = ("", member)
            else:
                continue
            seen.add(name)
            yield name, *found


def _signature(name: str, thing: object) -> str:
    """``name(…)`` as it is declared, without the modules of types; a parameter a line if long."""
    try:
        signature = inspect.signature(thing)
    except ValueError:
        return name
    given = [one for one in signature.parameters.values() if one.name not in ("self", "cls")]
    signature = signature.replace(parameters=given)
    if inspect.isclass(thing):
        signature = signature.replace(return_annotation=signature.empty)

    def plain(text: str) -> str:
        text = re.sub(r"\b(?:[a-z_]\w*\.)+(?=[A-Za-z])", "", text)  # not of 1.5
        text = text.replace("<factory>", "…").replace("<class 'float32'>", "float32")
        return re.sub(r"(?<=[:>] )'([\w., \[\]|]+)'", r"\1", text)

    whole = f"{name}{plain(str(signature))}"
    if len(whole) <= 92 or not given:
        return whole
    parts, kinds = [], {one.kind for one in given[:1]}
    for one in given:
        if one.kind is one.KEYWORD_ONLY and not kinds & {one.KEYWORD_ONLY, one.VAR_POSITIONAL}:
            parts.append("*")
        kinds.add(one.kind)
        parts.append(plain(str(one)))
    back = signature.return_annotation
    ends = "" if back is signature.empty else plain(str(signature)[str(signature).rindex(" -> ") :])
    return f"{name}(\n" + "".join(f"    {part},\n" for part in parts) + f"){ends}"


def prose(doc: str) -> str:
    """A docstring as Markdown: titles bold, entries ``name : words`` as lists, examples fenced."""
    doc = re.sub(r"``([^`\n]+)``", r"`\1`", _TITLE.sub(r"**\1**\n\n", doc))
    paragraphs = re.split(r"\n\s*\n", doc)
    return "\n\n".join(_example(one) or _entries(one) or one for one in paragraphs)


def _example(paragraph: str) -> str:
    code = inspect.cleandoc(paragraph)
    return f"```pycon\n{code}\n```" if code.startswith(">>> ") else ""


def _entries(paragraph: str) -> str:
    """A list of the entries that a paragraph begins, each with its lines further in."""
    if not _ENTRY.match(paragraph):
        return ""
    told = []
    for entry in filter(None, _ENTRY.split(paragraph)):
        names, _, words = " ".join(entry.split()).partition(" : ")
        names = ", ".join(f"`{name}`" for name in names.replace("`", "").split(", "))
        told.append(f"- {names}: {words}")
    return "\n".join(told)
