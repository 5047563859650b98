"""The page of the papers: what its rows name exists, and no section or figure is without a row."""

import dataclasses
import inspect
import re
import shlex
from functools import reduce
from pathlib import Path

import click
import numpy as np
import pytest
from codes import uniformly
from test_docs import ROOT, commands, rows, text_of
from towns import draw_town

import evocity
from evocity import CityMap
from evocity.coding import decode
from evocity.fitness.curves import read_dark
from evocity.operators import OPERATORS, make
from evocity.scene import picture_outline
from evocity.shapes import (
    Curve,
    Detailed,
    Language,
    Pieces,
    Primitive,
    Shape,
    fit_curve,
    resampled,
    rms_of,
)
from evocity.views.streets import StreetGraph

CLASSES = {
    kind.__name__: kind
    for kind in (CityMap, Curve, Detailed, evocity.Genome, Language, Pieces, Primitive, Shape)
} | {"StreetGraph": StreetGraph}
COLUMNS = ("where", "in evocity", "what differs, and why", "compared by")
SECTIONS = {
    "2002": "2.1 2.2 2.3 3.1 3.2 3.3 3.4 3.5 4.1 4.2 4.3 4.4 5.1 5.2 5.3 5.4 5.5 5.6 6.1 6.2",
    "2005": "1.1 1.2 1.3 2.1 2.2 2.3 2.4 3.1 3.2 3.3 4.1 4.2",
    "Tosan": "1 2.1 2.2 2.3 3.1 3.2 4.1 4.2 4.3 5.1 5.2 5.3 6",
    "Hnaidi": "2 3.1 3.2 3.3 4.1 4.2 5",
}
FIGURES = {"2002": 14, "2005": 13, "Tosan": 11, "Hnaidi": 9}


def tables() -> list[tuple[str, list[str]]]:
    """List the rows of five cells with their paper: "Marsault", "Tosan" or "Hnaidi"."""
    parts = re.split(r"^## ", text_of("docs/papers.md"), flags=re.M)
    papers = {"Shapes and colours": "Tosan", "Curves and surfaces": "Hnaidi"}
    found = []
    for part in parts:
        paper = papers.get(part.partition("\n")[0], "Marsault")
        whole = [row for row in rows(part) if len(row) == 5]
        assert all(tuple(row[1:]) == COLUMNS for row in whole[:1])
        found += [(paper, row) for row in whole[1:]]
    return found


TABLES = tables()
IDS = [row[0][:40] for _, row in TABLES]


def spans(text: str) -> list[str]:
    return [one.replace("\\|", "|") for one in re.findall(r"`([^`]+)`", text)]


def named(words: str) -> object | None:
    """Find what a Python name with dots stands for; None if it stands for nothing."""
    first, *rest = words.split(".")
    if first == "evocity":
        try:
            return reduce(getattr, rest, evocity) if hasattr(evocity, rest[0]) else imported(rest)
        except AttributeError:
            return imported(rest)
    kind = CLASSES.get(first)
    if kind is None or not rest:
        return kind
    fields = {*inspect.signature(kind).parameters, *getattr(kind, "__annotations__", {})}
    return rest[0] if rest[0] in fields else getattr(kind, rest[0], None)


def imported(rest: list[str]) -> object | None:
    module = None
    for count in range(len(rest), 0, -1):
        try:
            module = __import__(".".join(["evocity", *rest[:count]]), fromlist=["_"])
        except ModuleNotFoundError:
            continue
        return reduce(lambda one, name: getattr(one, name, None), rest[count:], module)
    return module


def options_of(command: click.Command) -> dict[str, click.Parameter | None]:
    found: dict[str, click.Parameter | None] = {"-h": None, "--help": None}
    for parameter in command.params:
        found |= dict.fromkeys([*parameter.opts, *parameter.secondary_opts], parameter)
    return found


def command_fault(words: list[str]) -> str | None:
    """Say which option, or which value of an option, a command does not have."""
    for name, command in commands().items():
        if tuple(words[: len(name)]) != name:
            continue
        options = options_of(command)
        for word, value in zip(words, [*words[1:], "-"], strict=True):
            if word.startswith("-") and word not in options:
                return f"no option {word}"
            parameter = options.get(word)
            if isinstance(parameter, click.Option) and not value.startswith("-"):
                with click.Context(command) as context:
                    parameter.type.convert(value, parameter, context)
        return None
    return "no such command"


def parameters_in(row: list[str]) -> set[str]:
    """List the parameters of the operators and of the Python callables that a row names."""
    found = {"redraws"}
    for span in spans(" ".join(row)):
        if span in OPERATORS:
            found |= {field.name for field in dataclasses.fields(OPERATORS[span])}
        elif callable(what := named(span)):
            found |= set(inspect.signature(what).parameters)
    if "`CityMap.street_graph_of`" in row[2]:
        found |= set(inspect.signature(evocity.views.streets.street_graph).parameters)
    if "`CityMap.walled`" in row[2]:
        found |= set(inspect.signature(evocity.views.walls.walls_of).parameters)
    return found


def fault_of(span: str, row: list[str]) -> str | None:
    if span.startswith("evocity "):
        return command_fault(shlex.split(span)[1:])
    if span.startswith("-"):
        every = {word for command in commands().values() for word in options_of(command)}
        unknown = {word for word in span.split() if word.startswith("-")} - every
        return f"no options {unknown}" if unknown else None
    if "/" in span:
        path, _, test = span.partition("::")
        if not (ROOT / path).is_file():
            return "no such file"
        there = not test or re.search(rf"^def {test}\(", text_of(path), re.M)
        return None if there else "no such test"
    if span in OPERATORS or named(span) is not None or span in parameters_in(row):
        return None
    return "no operator, Python name or parameter"


@pytest.mark.parametrize(("paper", "row"), TABLES, ids=IDS)
def test_what_a_row_names_exists(paper, row):
    _, where, here, difference, compared = row
    assert all(row[:4]), "a cell is empty"
    faults = {span: fault for span in spans(" ".join(row)) if (fault := fault_of(span, row))}
    assert not faults
    if here == "left out":
        assert len(difference) > 30, "a reason"
    else:
        assert spans(here) or "](" in here or "operators" in here
        assert any("/" in span for span in spans(compared)), "a script"
    if paper == "Marsault":
        assert re.fullmatch(r"(?:200[25] [^;]+(?:; )?)+", where)


def test_no_row_stands_twice():
    assert len({(paper, row[0]) for paper, row in TABLES}) == len(TABLES)


def places(kind: str) -> dict[str, set[str]]:
    """List the sections (``kind`` "§") or figures ("fig") that the page names, for each paper."""
    found = {paper: set() for paper in SECTIONS}
    listed = [
        part if paper == "Marsault" else f"{paper} {part}"
        for paper, row in TABLES
        for part in row[1].split("; ")
    ]
    pictures = text_of("docs/papers.md").split("## Pictures beside")[1].split("## Beyond")[0]
    for bold in re.findall(r"\*\*([^*]+)\*\*", pictures):
        paper = "Tosan"
        for part in bold.split("; "):
            paper = next((one for one in SECTIONS if one in part), paper)
            listed.append(part if paper in part else f"{paper} {part}")
    for part in listed:
        paper, _, rest = part.partition(" ")
        if kind == "§":
            found[paper] |= set(re.findall(r"§([\d.]*\d)", rest))
        else:
            for numbers in re.findall(r"[Ff]igs?\. ([\d, to]+)", rest):
                found[paper] |= set(re.findall(r"\d+", numbers))
                for first, last in re.findall(r"(\d+) to (\d+)", numbers):
                    found[paper] |= set(map(str, range(int(first), int(last) + 1)))
    return found


def test_every_section_has_a_row():
    told = places("§")
    for paper, sections in SECTIONS.items():
        assert set(sections.split()) <= told[paper], paper


def test_every_figure_has_a_row():
    told = places("fig")
    for paper, count in FIGURES.items():
        assert {str(number) for number in range(1, count + 1)} <= told[paper], paper


def test_pictures_are_those_of_their_script():
    shown = set(re.findall(r"images/papers/(\w+)\.png", text_of("docs/papers.md")))
    folder = ROOT / "docs" / "images" / "papers"
    assert {path.stem for path in folder.iterdir()} == shown
    script = Path(ROOT / "docs" / "sheets" / "papers.py").read_text("utf-8")
    assert all(re.search(rf"^def {name}\(", script, re.M) for name in shown)
    assert all((folder / f"{name}.png").stat().st_size < 100_000 for name in shown)


# -- claims of the papers that no other script compares ------------------------------------------


def off(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.sqrt(np.mean((one - other) ** 2)))


def test_interpolation_is_nearly_that_of_images():
    """Marsault 2005 §2.2: "we get in fact the same as basic image interpolation"."""
    parents = [uniformly(draw_town(seed)).genome for seed in (1, 2)]
    maps = [decode(parent).city.heights for parent in parents]
    for share in (0.35, 0.5):
        child = make("interpolation", share=share)(parents, np.random.default_rng(1))
        mixture = share * maps[0] + (1 - share) * maps[1]
        assert off(decode(child).city.heights, mixture) < 0.2 * off(*maps)


@pytest.mark.parametrize("name", ["lyon-1er", "new-york-west-village"])
def test_enlarged_images_give_no_better_skeleton(name):
    """Marsault 2005 §3.3 enlarges four times; without pruning, dead ends multiply."""
    city = evocity.read_map(name, pixels=128)
    heights = np.kron(city.heights, np.ones((4, 4), np.float32))
    larger = CityMap(heights, city.metres_per_pixel / 4)
    ends, lengths = [], []
    for one in (city, larger):
        whole = one.street_graph_of(spurs=0.0, least_width=0.0)
        ends.append(int(((whole.degree == 1) & ~whole.at_frame).sum()))
        lengths.append(float(one.street_graph.length.sum()))
    assert ends[1] > 1.3 * ends[0]
    assert lengths[1] == pytest.approx(lengths[0], rel=0.1)


@pytest.fixture(scope="module")
def leaves() -> list[tuple[np.ndarray, Detailed]]:
    """The borders of two leaves, and their fits with eight levels of details."""
    found = []
    for name, reach in (("leaf.png", 1.5), ("toothed-leaf.png", 0.0)):
        dark = read_dark((ROOT / "runs" / name).read_bytes(), name)
        border = resampled(picture_outline(dark, reach), 769)
        found.append((border, fit_curve(border, depth=8, starts=1)))
    return found


def length_of(leaf: Detailed) -> float:
    return float(np.hypot(*np.diff(leaf.line(), axis=0).T).sum())


def test_leaves_come_back_from_an_eighth_of_their_numbers(leaves):
    """Hnaidi and others, figures 5 and 6: four points, two matrices, three levels omitted."""
    for (border, leaf), told in zip(leaves, (0.88, 0.81), strict=True):
        assert leaf.line() == pytest.approx(border, abs=1e-6)
        assert leaf.curve.maps.shape == (2, 4, 4)
        assert rms_of(leaf, 3) == pytest.approx(told, abs=0.02)
        assert rms_of(leaf, 3) < 0.004 * np.ptp(border, axis=0).max()


@pytest.mark.slow
def test_a_leaf_without_details_takes_more_numbers(leaves):
    """§5: "fewer parameters than a fractal model without details". 97 points of two coordinates and
    15 numbers of the maps against 13 control points and 276 numbers of the maps."""
    for (border, leaf), told in zip(leaves, (2.9, 1.2), strict=True):
        plain = fit_curve(border, points=13, depth=6, drawn=None, starts=1, rounds=25)
        assert rms_of(plain, plain.depth) == pytest.approx(told, rel=0.1)
        assert rms_of(plain, plain.depth) > 1.3 * rms_of(leaf, 3)


@pytest.mark.filterwarnings("ignore:.*cross")
def test_leaves_take_the_texture_of_each_other(leaves):
    """Figures 7 and 8: by the model of either curve; figure 9: texture doubled and reduced."""
    fern, toothed = (leaf for _, leaf in leaves)
    for like in (fern, toothed):
        rough, smooth = fern.recoded(like), toothed.recoded(like)
        taken = smooth.transferred(rough, 5)
        assert all(map(np.array_equal, taken.details[3:], rough.details[3:]))
        assert all(map(np.array_equal, taken.details[:3], smooth.details[:3]))
        assert length_of(taken) > 1.3 * length_of(smooth)
    for leaf in (fern, toothed):
        doubled = length_of(leaf.amplified(2.0, range(3, 8)))
        assert length_of(leaf.amplified(0.5, range(3, 8))) < length_of(leaf) < doubled
