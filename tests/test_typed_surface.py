"""Checkers of types know the public surface: its stub, its annotations, a user's file."""

import ast
import functools
import importlib
import inspect
import runpy
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from excused_modules import excused_modules, modules_of, mypy_errors

import evocity

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "evocity"
SURFACE = Path(__file__).with_name("typed_surface.py")

# The rooms that users import from.
ROOMS = runpy.run_path(str(ROOT / "docs" / "site" / "api.py"))["ROOMS"]

# The list of excused modules is never longer; lower this when it shrinks.
MOST_EXCUSED = 212

# What a wrong use is, and what mypy says of it.
WRONG = {
    "evocity.read_map(3)": "[arg-type]",
    "evocity.decode(evocity.read_map('lyon-1er'))": "[arg-type]",
    "evocity.fitness.gsi(evocity.cities())": "[arg-type]",
    "evocity.fitness.gsy": "[attr-defined]",
    "evocity.fitness(gaol='max')": "[call-overload]",
    "evocity.opern_run('runs/first')": "[attr-defined]",
    "evocity.read_map('lyon-1er').hights": "[attr-defined]",
}


def stub() -> ast.Module:
    return ast.parse((PACKAGE / "__init__.pyi").read_text(encoding="utf-8"))


def test_the_stub_names_what_the_package_names():
    (named,) = [
        ast.literal_eval(node.value)
        for node in stub().body
        if isinstance(node, ast.Assign) and node.targets[0].id == "__all__"
    ]
    assert sorted(named) == sorted(evocity.__all__)
    taken = set()
    for node in stub().body:
        if isinstance(node, ast.ImportFrom) and node.module.startswith("evocity."):
            home = importlib.import_module(node.module)
            for alias in node.names:
                assert getattr(home, alias.name) is getattr(evocity, alias.name), alias.name
                taken.add(alias.name)
    assert taken | {"fitness", "plot", "scene", "shapes"} == set(named)


@pytest.mark.parametrize("room", ["fitness", "scene"])
def test_the_stub_names_what_a_module_that_is_called_names(room):
    (found,) = [node for node in stub().body if getattr(node, "name", "") == f"_{room.title()}"]
    told = [ast.unparse(node) for node in found.body if isinstance(node, ast.Assign)]
    module = importlib.import_module(f"evocity.{room}")
    right = [
        f"{name} = staticmethod(_{room}.{name})"
        if inspect.isroutine(getattr(module, name)) or hasattr(getattr(module, name), "cache_info")
        else f"{name} = _{room}.{name}"
        for name in module.__all__
    ]
    assert [line for line in told if not line.startswith("__call__")] == right


def routines(label: str, thing: object) -> Iterator[tuple[str, Callable]]:
    """Functions and public methods, properties among them, of a public name."""
    if inspect.isfunction(thing):
        yield label, thing
    elif inspect.isclass(thing):
        for name, member in vars(thing).items():
            if not name.startswith("_") or name in ("__init__", "__call__", "__exit__"):
                if isinstance(member, classmethod | staticmethod):
                    member = member.__func__
                elif isinstance(member, property):
                    member = member.fget
                elif isinstance(member, functools.cached_property):
                    member = member.func
                if inspect.isfunction(member) and member.__module__.startswith("evocity."):
                    yield f"{label}.{name}", member


def lacking(function: Callable) -> list[str]:
    """Parameters without a type, and "return" where that has none."""
    signature = inspect.signature(function)
    found = [
        name
        for name, one in signature.parameters.items()
        if one.annotation is one.empty and name not in ("self", "cls") and name[0] != "_"
    ]
    untold = signature.return_annotation is signature.empty and function.__name__ != "__init__"
    return found + ["return"] * untold


@pytest.mark.parametrize("room", ROOMS)
def test_public_names_have_types(room):
    module = importlib.import_module(f"evocity.{room}")
    found = {
        label: lacking(function)
        for name in module.__all__
        for label, function in routines(name, getattr(module, name))
    }
    assert {label: untyped for label, untyped in found.items() if untyped} == {}
    assert set(evocity._ROOMS) <= {*ROOMS, "errors", "recipe.reader", "store"}


def test_the_surface_uses_every_name():
    used = {
        node.attr
        for node in ast.walk(ast.parse(SURFACE.read_text(encoding="utf-8")))
        if isinstance(node, ast.Attribute) and getattr(node.value, "id", "") == "evocity"
    }
    assert used == set(evocity.__all__)
    assert (PACKAGE / "py.typed").exists()


@pytest.fixture(scope="module")
def checked(tmp_path_factory) -> SimpleNamespace:
    """One run of mypy over the package, the surface and a file of wrong uses: its errors."""
    pytest.importorskip("mypy")
    folder = tmp_path_factory.mktemp("mypy")
    wrong = folder / "wrong.py"
    wrong.write_text("import evocity\n" + "\n".join(WRONG) + "\n", encoding="utf-8")
    errors = mypy_errors(wrong, cache=folder / "cache")
    return SimpleNamespace(wrong=str(wrong), errors=errors)


@pytest.mark.slow
def test_mypy_accepts_right_uses_and_no_wrong_one(checked):
    apart = [line for line in checked.errors if not line.startswith(("evocity/", checked.wrong))]
    assert apart == []
    said = {
        int(line.removeprefix(f"{checked.wrong}:").split(":")[0]): line
        for line in checked.errors
        if line.startswith(checked.wrong)
    }
    for number, (use, fault) in enumerate(WRONG.items(), 2):
        assert fault in said.get(number, ""), f"{use}: {said.get(number)}"


@pytest.mark.slow
def test_mypy_accepts_all_modules_but_those_excused(checked):
    """The list of excused modules only shrinks; `tests/excused_modules.py` keeps it."""
    faulty, excused = modules_of(checked.errors), set(excused_modules())
    apart = [line for line in checked.errors if line.partition(":")[0] in faulty - excused]
    assert apart == [], "mend these modules"
    assert excused - faulty == set(), "run python tests/excused_modules.py, which takes these off"


def test_excused_modules_are_sorted_and_exist():
    listed = excused_modules()
    assert listed == sorted(set(listed))
    assert [module for module in listed if not (ROOT / module).exists()] == []
    assert len(listed) <= MOST_EXCUSED
