"""README and docs name what exists, and what they show works."""

import dataclasses
import functools
import itertools
import re
import runpy
import shlex
import tomllib
from pathlib import Path

import click
import pytest
from codes import uniformly

import evocity
from evocity import cli, io, operators, search
from evocity.fitness import measures
from evocity.genome import FIELDS, NUCLEOTIDES
from evocity.io.heights import RULES
from evocity.pavement import read_sides
from evocity.recipe import recipe as recipes
from evocity.recipe.islands import IslandSection
from evocity.recipe.measures import FitnessEntry
from evocity.recipe.mixture import OperatorEntry
from evocity.recipe.sections import CourseSection, Parent
from evocity.selection.algorithms import algorithms
from evocity.store import STATUSES

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
MARKDOWN = [
    *PAGES,
    *(ROOT / name for name in ("CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md")),
    *sorted((ROOT / "docs" / "changes").glob("*.md")),
    ROOT / "benchmarks" / "README.md",
    *sorted((ROOT / "evocity" / "data").rglob("*.md")),
]
OWN_MEASURES = [m for m in measures() if m.origin == "evocity"]


def text_of(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def blocks(page: Path, language: str) -> list[str]:
    """Fenced code blocks of one language."""
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text("utf-8"), re.M | re.S)


def rows(text: str) -> list[list[str]]:
    """Cells of all table rows but the headings' underlines; a \\| within a cell stays one."""
    lines = [line for line in text.splitlines() if line.startswith("|")]
    cells = [[c.strip() for c in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines]
    return [row for row in cells if not set("".join(row)) <= set("-: ")]


def commands() -> dict[tuple[str, ...], click.Command]:
    found = {}
    for name, command in cli.main.commands.items():
        if isinstance(command, click.Group):
            found |= {(name, inner): one for inner, one in command.commands.items()}
        else:
            found[name,] = command
    return found


def shell_lines() -> list[str]:
    return [line for page in PAGES for block in blocks(page, "sh") for line in block.splitlines()]


# -- everything there is has its words --------------------------------------------------------


def test_pages_show_every_command():
    shown = {tuple(shlex.split(line)[1:3]) for line in shell_lines() if line.startswith("evocity")}
    missing = [c for c in commands() if not any(line[: len(c)] == c for line in shown)]
    assert not missing


def test_measures_page_is_what_the_docstrings_say():
    reference = runpy.run_path(str(ROOT / "docs" / "reference.py"))
    text = text_of("docs/measures.md")
    assert reference["page"](text, OWN_MEASURES) == text, "run python docs/reference.py"
    headings = re.findall(r"^## (\w+)$", text.split(reference["BEGIN"])[1], re.M)
    assert headings == list(dict.fromkeys(m.name.partition(".")[0] for m in OWN_MEASURES))
    for measure in OWN_MEASURES:
        entry = reference["entry"](measure)
        for part in ("Formula", "Unit", "Range", "Empty map", "Source"):
            assert f"- **{part}**: " in entry, measure.name
        assert ">>> " in entry


def test_fitness_page_names_every_view_of_a_map():
    text = text_of("docs/fitness.md")
    views = {
        name
        for name, kind in vars(evocity.CityMap).items()
        if isinstance(kind, functools.cached_property)
    }
    told = {row[0].strip("`") for row in rows(text) if row[0].strip("`") in views}
    assert told == views


@pytest.mark.parametrize("name", ["noon_sun.py", "noon-sun.toml"])
def test_fitness_page_shows_the_files_of_its_example(name):
    (shown,) = re.findall(
        rf"<!-- the same as runs/{name} -->\n```\w+\n(.*?)```", text_of("docs/fitness.md"), re.S
    )
    assert shown == text_of(f"runs/{name}")


def test_operators_page_tells_every_parameter_and_its_default():
    text = text_of("docs/operators.md")
    sections = dict(re.findall(r"^## (\w+)\n(.*?)(?=^## |\Z)", text, re.M | re.S))
    assert set(sections) == set(operators.OPERATORS)
    for name, section in sections.items():
        parameters = section.split("\n### ")[0]  # measurements may follow
        told = {row[0].strip("`"): row[1].strip("`") for row in rows(parameters)[1:]}
        fields = dataclasses.fields(operators.OPERATORS[name])
        assert told == {field.name: repr(field.default) for field in fields}, name


def test_kinds_page_tells_every_operator_and_measure_of_forms():
    text = text_of("docs/kinds.md")
    told = {row[0].strip("`") for row in rows(text)}
    assert {
        one.name for one in measures(None) if one.of != "city" and one.origin == "evocity"
    } <= told
    for name, kind in operators.OF_FORMS.items():
        (line,) = re.findall(rf"^- `{name}` (.*?)(?=^- |^$)", text, re.M | re.S)
        own = {one.name for one in dataclasses.fields(kind)} - {"tries"}
        assert all(f"`{one}" in line for one in own), name


@pytest.mark.parametrize("section", [*recipes.Recipe.model_fields])
def test_recipe_page_tells_every_key_and_its_default(section):
    models = {
        "parents": Parent,
        "fitness": FitnessEntry,
        "operators": OperatorEntry,
        "islands": IslandSection,
        "curves": CourseSection,
    }
    model = models.get(section) or recipes.Recipe.model_fields[section].annotation
    text = text_of("docs/recipe.md")
    (part,) = re.findall(rf"^## `\[+{section}\]+`.*?\n(.*?)(?=^## |\Z)", text, re.M | re.S)
    told = {row[0].strip("`"): row for row in rows(part)[1:] if row[0].startswith("`")}
    fields = {one.alias or key: one for key, one in model.model_fields.items()}
    if section == "search":  # those of all algorithms stand in one table
        fields |= {
            key: one
            for kind in algorithms().values()
            for key, one in kind.Keys.model_fields.items()
        }
    assert set(told) == set(fields)
    for key, field in fields.items():
        if field.is_required():
            assert told[key][2] == "required", key
        elif field.default is not None:
            value = tomllib.loads(f"v = {told[key][2].strip('`')}")["v"]
            assert (read_sides(value) if key == "block" else value) == field.default, key


def test_pages_name_formats_rules_columns_and_districts():
    maps, run = text_of("docs/maps.md"), text_of("docs/run-folder.md")
    read = {suffix for row in rows(maps) for suffix in re.findall(r"`(\.[\w.]+)`", row[0])}
    assert read == set(io.READERS)
    assert [row[0].strip("`") for row in rows(maps) if row[0].strip("`") in RULES] == list(RULES)
    assert all(f"`{suffix}`" in maps for suffix in io.WRITERS)
    assert all(f"`{status}`" in run for status in STATUSES)
    assert all(f"`{name}`" in run for name in FIELDS)
    readme = {row[0].strip("`"): row[1] for row in rows(text_of("README.md")) if len(row) == 3}
    for name in io.cities():
        assert readme[name] == io.attribution_of(name)


def test_links_within_the_project_lead_somewhere():
    for page in MARKDOWN:
        for target, anchor in re.findall(r"\]\(([^)#:]*)(?:#([^)]*))?\)", page.read_text("utf-8")):
            found = page.parent / target if target else page
            assert found.exists(), f"{page.name}: {target}"
            assert not anchor or anchor in anchors(found), f"{page.name}: {target}#{anchor}"


def anchors(page: Path) -> set[str]:
    """Anchors of a page's headings, as renderers of Markdown make them."""
    headings = re.findall(r"^#+ (.+)$", page.read_text("utf-8"), re.M)
    plain = (re.sub(r"[^\w\- ]", "", heading.lower()) for heading in headings)
    return {heading.replace(" ", "-") for heading in plain}


def test_pages_name_targets_of_make_that_exist():
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text("utf-8"), re.M))
    pages = [ROOT / "CONTRIBUTING.md", *PAGES]
    named = {
        one for page in pages for one in re.findall(r"`make\s([a-z-]+)", page.read_text("utf-8"))
    }
    assert {"test", "test-slow"} <= named
    assert named <= targets


def test_picture_is_small():
    assert (ROOT / "docs" / "images" / "bred-city.png").stat().st_size < 400_000


# -- what is shown works ----------------------------------------------------------------------


def test_shell_lines_use_commands_and_options_that_exist():
    checked = 0
    for line in shell_lines():
        words = shlex.split(line)
        if words[:1] == ["make"]:
            assert re.search(rf"^{words[1]}:", text_of("Makefile"), re.M), line
        elif words[:1] == ["evocity"]:
            command, rest = click_command(words[1:])
            with command.make_context(command.name, rest, resilient_parsing=True):
                pass
            command.make_parser(click.Context(command)).parse_args(list(rest))
            checked += 1
        elif "dask" in words:
            check_dask(words[words.index("dask") + 1 :])
        else:
            assert words[:1] in (["duckdb"], ["export"], ["jupyter"], ["mkdir"], ["pip"]), line
    assert checked > 10


def check_dask(words: list[str]) -> None:
    """Raises for options that ``dask scheduler`` or ``dask worker`` do not know."""
    module = pytest.importorskip(f"distributed.cli.dask_{words[0]}")
    rest = list(itertools.takewhile(lambda word: not word.endswith(";"), words[1:]))
    rest += [word.rstrip(";") for word in words[len(rest) + 1 :][:1]]
    module.main.make_parser(click.Context(module.main)).parse_args(rest)


def click_command(words: list[str]) -> tuple[click.Command, list[str]]:
    for name, command in commands().items():
        if tuple(words[: len(name)]) == name:
            return command, words[len(name) :]
    raise AssertionError(f"no command {words}")


@pytest.mark.slow_cases(
    "README.md",
    "analysis.md",
    "autosimilarity.md",
    "gallery.md",
    "maps.md",
    "nights.md",
    "operators.md",
    "pictures.md",
    "plots.md",
    "python.md",
    "run-folder.md",
    "scenes.md",
    "shapes.md",
)
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_python_blocks_run(page, tmp_path, monkeypatch, request):
    monkeypatch.chdir(tmp_path)
    found = blocks(page, "python")
    if page.name in ("run-folder.md", "analysis.md", "plots.md"):
        names = {"folder": str(request.getfixturevalue("small_run"))}
        names["large"] = str(ROOT / "tests" / "old" / "run-10")
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    else:
        names = {}
    bred = {"README.md": "demo", "nights.md": "night"}  # the runs that these pages read
    if page.name in bred:
        (tmp_path / "runs").mkdir()
        (tmp_path / "runs" / bred[page.name]).symlink_to(request.getfixturevalue("small_run"))
    for number, block in enumerate(found):
        if "@evocity.fitness" in block:  # a file of the user's own, as the text says
            (name,) = re.findall(r"@evocity.fitness.*\ndef (\w+)", block)
            (tmp_path / f"{name}.py").write_text(block, encoding="utf-8")
            for data in re.findall(r'data="([^"]+)"', block):
                (tmp_path / data).write_text("9.0", encoding="utf-8")
            lyon = evocity.read_map("lyon-1er", pixels=64)
            code = uniformly(lyon).genome
            for measure in evocity.fitness.load_file(tmp_path / f"{name}.py"):
                assert measure(lyon, genome=code, parents=[code], reference=lyon) >= 0
        else:
            exec(compile(block, f"{page.name}, block {number + 1}", "exec"), names)


def test_values_told_of_lyon_are_true():
    lyon = evocity.read_map("lyon-1er")
    (told,) = re.findall(r"^lyon\.height_rules  # (.*)$", text_of("docs/maps.md"), re.M)
    assert told == repr(lyon.height_rules)


@pytest.mark.parametrize("name", ["lyon-1er", "cape-town-salt-river"])
def test_values_told_of_maps_and_codes_are_true(name):
    (told,) = [row[1] for row in rows(text_of("docs/measures.md")) if row[0] == name]
    city = evocity.read_map(name)
    codes = evocity.encode(city).genome, uniformly(city).genome
    found = [evocity.fitness.gsi(one) for one in (city, *(evocity.decode(g).city for g in codes))]
    assert [float(number) for number in told.split(" / ")] == pytest.approx(found, abs=6e-4)


@pytest.mark.parametrize(
    ("place", "name"), [("Lyon", "lyon-1er"), ("Cape Town", "cape-town-salt-river")]
)
def test_values_told_of_sun_and_daylight_are_true(place, name):
    table = rows(text_of("docs/measures.md"))
    (head,) = [row for row in table if row[1:2] == ["`winter_sun`, h"]]
    (told,) = [row[1:] for row in table if row[0] == place and len(row) == len(head)]
    names = [one.partition(",")[0].strip("`").lower() for one in head[1:]]
    city = evocity.read_map(name)
    found = [evocity.fitness.get(one)(city) for one in names]
    for one, value in zip(told, found, strict=True):
        assert float(one) == pytest.approx(value, abs=0.51 if value > 100 else 6e-3)


@pytest.mark.parametrize("name", ["lyon-1er", "montpellier-pas-du-loup"])
def test_values_told_of_types_are_true(name):
    table = rows(text_of("docs/measures.md"))
    (head,) = [row for row in table if row[0] == "share of the built ground"]
    told = {row[0].strip("`"): row[head.index(name)] for row in table if len(row) == len(head)}
    found = evocity.fitness.building_types(evocity.read_map(name))
    assert {kind: float(told[kind]) for kind in found} == pytest.approx(found, abs=6e-3)


def test_the_table_of_types_that_is_shown_is_one():
    (shown,) = [b for b in blocks(ROOT / "docs" / "measures.md", "toml") if "[[type]]" in b]
    table = evocity.fitness.TypeTable.of(shown)
    assert table.names == ("house", "walk_up", "with_lift")
    assert table.shares == pytest.approx([0.2, 0.7, 0.1])


def test_recipes_that_pages_name_exist():
    lines = [line for line in shell_lines() if "--fitness" not in line]  # tables of types
    named = {word for line in lines for word in shlex.split(line) if ".toml" in word}
    written = {line[-1] for line in map(shlex.split, shell_lines()) if "recipe" in line}
    assert written == {"night.toml"}  # by `evocity recipe new`
    named -= written
    assert named
    for name in named:
        path = ROOT / name
        search.read_recipe(path if path.exists() else ROOT / "runs" / name)


@pytest.fixture(scope="session")
def small_run(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("docs")
    text = """
    run = { name = "small", population = 4, generations = 1 }
    map = { pixels = 64 }
    parents = [{ map = "lyon-1er" }, { map = "new-york-west-village" }]
    fitness = [{ name = "gsi", target = 0.4 }, { name = "alignment" }]
    """
    (folder / "small.toml").write_text(text, encoding="utf-8")
    recipe = search.read_recipe(folder / "small.toml")
    with search.Search(recipe, out=folder / "run", workers=0) as breeding:
        for _ in breeding:
            pass
    return folder / "run"


def test_whole_recipes_can_be_read(tmp_path):
    first, quarter, papers, *_ = blocks(ROOT / "docs" / "recipe.md", "toml")
    for name in ("here.osm.pbf", "quarter.geojson"):  # files of the reader's own
        (tmp_path / name).touch()
    read = []
    for number, text in enumerate((first, quarter, papers)):
        (tmp_path / f"{number}.toml").write_text(text, encoding="utf-8")
        read.append(search.read_recipe(tmp_path / f"{number}.toml"))
    assert [m.name for m in read[0].measures] == ["alignment", "salingaros_buildings", "integrity"]
    assert Path(read[1].locked.footprints).name == "quarter.geojson"
    assert [m.name for m in read[2].measures][-2:] == ["gsi", "mean_height"]
    assert read[2].operator("pavement_fusion").side_max == 96.0


def test_births_columns_are_those_told(small_run):
    part = text_of("docs/run-folder.md").split("## Births")[1].split("## Reading")[0]
    told = [name for row in rows(part)[1:] for name in re.findall(r"`([^`]+)`", row[0])]
    columns = evocity.open_run(small_run).births().column_names
    plain = [name for name in columns if not name.startswith("fitness.")]
    assert [name for name in told if name != "fitness.<name>"] == plain
    assert set(NUCLEOTIDES) < set(told)


def test_run_folder_holds_what_is_told(small_run):
    table, *_ = text_of("docs/run-folder.md").split("## Births")
    told = {row[0].strip("`").split("/")[0] for row in rows(table)[1:]}
    told -= {
        "report.html",
        "recipe-1.toml",
        "fitness",
        "references",
        "within",
        "commands.jsonl",
        "picks.json",
    }  # this run has none
    assert {path.name for path in small_run.iterdir()} == told
