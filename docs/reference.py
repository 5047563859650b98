"""Writes the reference of measures in docs/measures.md from their docstrings.

Run it with the Python that has evocity installed, after a measure was added or changed:
python docs/reference.py. The tests hold the page against it.
"""

import re
from pathlib import Path

from evocity.fitness import Measure, measures

PAGE = Path(__file__).parent / "measures.md"
BEGIN = "<!-- what follows is written by docs/reference.py from the docstrings -->\n"
END = "<!-- end of what docs/reference.py writes -->\n"

#: How a docstring's parts are set off.
_PARTS = re.compile(r"(?:^|(?<=\. )|(?<=\n))(Formula|Unit|Range|Empty map|Source):", re.M)


def packaged() -> list[Measure]:
    """The measures of the package, by name."""
    return [one for one in measures() if one.origin == "evocity"]


def reference(found: list[Measure]) -> str:
    """The table of measures and an entry for each, in Markdown."""
    lines = ["| measure | goal | unit | range | what it says |", "|---|---|---|---|---|"]
    entries: dict[str, str] = {}
    for one in found:
        low, high = (bound(value) for value in one.range)
        place = one.name.partition(".")[0]
        first = place not in entries  # the numbers of one function stand in one entry
        lines.append(
            f"| [`{one.name}`](#{place}) | {one.goal or 'a target'} | {one.unit or '–'} "
            f"| {low}…{high} | {one.summary if first else f'see `{place}`'} |"
        )
        if first:
            entries[place] = entry(one)
    return "\n".join(lines) + "\n" + "".join(f"\n{one}" for one in entries.values())


def entry(measure: Measure) -> str:
    """Heading, text, parts as a list, and the example."""
    text, _, example = measure.doc.replace("\\|", "|").partition("\n>>> ")
    pieces = _PARTS.split(text.strip())
    told = [f"## {measure.name.partition('.')[0]}\n\n{pieces[0].strip()}\n"]
    for name, part in zip(pieces[1::2], pieces[2::2], strict=True):
        body = re.sub(r"\s*\n\s*", " ", part.strip())
        told.append(f"- **{name}**: {body}")
    needs = [need for need in measure.needs if need != "reference"]
    if needs:
        words = {"genome": "its genome", "sources": "the maps of its source cities"}
        *some, last = ["the city", *(words[need] for need in needs)]
        told.append(f"- **Arguments**: {', '.join(some)} and {last}.")
    if "reference" in measure.needs:
        told.append("- **Arguments**: the city, and a reference: the cities to compare with.")
    told[0] += "" if len(told) == 1 else "\n" + told.pop(1)
    if example:
        told.append(f"\n```pycon\n>>> {example.strip()}\n```")
    return "\n".join(told) + "\n"


def bound(value: float) -> str:
    if abs(value) == float("inf"):
        return "∞" if value > 0 else "−∞"
    return f"{value:g}"


def page(text: str, found: list[Measure]) -> str:
    """Write the reference of the page ``text`` again."""
    head, rest = text.split(BEGIN)
    return head + BEGIN + "\n" + reference(found) + "\n" + END + rest.split(END)[1]


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8"), packaged()), encoding="utf-8")
