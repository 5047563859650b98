"""Names that a stranger would not search for are barred: modules, functions, classes, fields."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "evocity"
MODULES = sorted(PACKAGE.rglob("*.py"))

BARRED_MODULES = {
    *("again", "anew", "apart", "asked", "behind", "beside", "coming", "found", "given", "had"),
    *("one", "others", "own", "seen", "such", "told", "wanted", "whose"),
}
BARRED = {"told", "found", "one", "had", "asked", "wanted", "again", "anew", "behind"}
#: Public names and JSON keys of today, which stay.
ALLOWED = {
    "errors.py": {"found"},  # of every `EvocityError`
    "fitness/check/faults.py": {"found"},  # the same, in the JSON of `evocity fitness check`
    "fitness/composition.py": {"Wanted", "wanted"},  # `evocity.fitness.Wanted`
    "analysis/goals.py": {"wanted"},  # `aim.wanted`, in notebooks
    "analysis/run.py": {"told"},  # `run.told`, the former name of `run.columns`
    "viewer/table.py": {"wanted"},  # a key of the page's JSON
}


def modules_at_fault(paths: list[Path]) -> list[str]:
    return [
        path.as_posix()
        for path in paths
        if (path.parent.name if path.stem == "__init__" else path.stem) in BARRED_MODULES
    ]


def names_of(tree: ast.Module) -> Iterator[str]:
    """Functions, classes, and fields: those of class bodies, and those set on an object."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name
        if isinstance(node, ast.ClassDef):
            for part in node.body:
                if isinstance(part, ast.AnnAssign) and isinstance(part.target, ast.Name):
                    yield part.target.id
        if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            yield node.attr


def names_at_fault(tree: ast.Module) -> set[str]:
    return {name for name in names_of(tree) if name.strip("_").lower() in BARRED}


def test_modules_are_named_by_nouns_of_the_field():
    assert modules_at_fault([path.relative_to(PACKAGE) for path in MODULES]) == []


def test_functions_and_fields_say_what_they_are():
    faults = {
        path.relative_to(PACKAGE).as_posix(): names_at_fault(ast.parse(path.read_text("utf-8")))
        for path in MODULES
    }
    assert {name: names for name, names in faults.items() if names} == ALLOWED


@pytest.mark.parametrize(
    "text",
    [
        "def told(): ...",
        "class Again: ...",
        "class A:\n    found: int",
        "class A:\n    def __init__(self):\n        self._asked = 1",
        "class A:\n    def one(self): ...",
    ],
)
def test_names_that_say_nothing_are_noticed(text):
    assert names_at_fault(ast.parse(text))


def test_modules_that_say_nothing_are_noticed():
    paths = [Path("store/again.py"), Path("store/log.py"), Path("own/__init__.py")]
    assert modules_at_fault(paths) == ["store/again.py", "own/__init__.py"]
