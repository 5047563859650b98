"""What the house promises of its rooms, held against the syntax tree of every file."""

import ast
import functools
import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "evocity"
MODULES = sorted(PACKAGE.rglob("*.py"))
OTHERS = sorted(path for room in ("tests", "benchmarks") for path in (ROOT / room).rglob("*.py"))

# Which room may import which; docs/architecture.md draws it.
BELOW_ALL = {
    "errors",
    "plugins",
    "files",
    "accelerate",
    "bounded_toml",
    "child_process",
    "html_display",
    "lazy_imports",
    "columns",
    "parquet_child",
    "parquet_rows",
    "sealed_parquet",
    "section",
}
CORE = {"views", "citymap", "condensation", "genome", "isometries", "pavement"}
FORMING = CORE | {"coding", "shapes", "kinds"}
BREEDING = FORMING | {"operators", "fitness", "store", "io", "pictures"}
SEARCHING = BREEDING | {"selection", "recipe", "evaluation", "search"}
MAY_IMPORT = {
    "errors": set(),
    "lazy_imports": set(),
    "columns": set(),
    "plugins": set(),
    "files": set(),
    "accelerate": set(),
    "bounded_toml": set(),
    "child_process": set(),
    "parquet_child": {"child_process", "errors", "parquet_rows"},
    "parquet_rows": set(),
    "sealed_parquet": {"parquet_child"},
    "html_display": set(),
    "section": {"errors"},
    "data": set(),
    "templates": set(),
    "views": set(),
    "citymap": {"views"},
    "isometries": set(),
    "pavement": set(),
    "condensation": {"citymap", "pavement"},
    "genome": {"citymap", "condensation", "isometries", "pavement"},
    "towns": {"citymap"},
    "pictures": {"citymap", "pavement"},
    "formats": set(),
    "io": {"views", "citymap", "condensation", "formats", "pictures"},
    "scene": {"views", "citymap", "formats", "io", "pictures"},
    "coding": CORE,
    "operators": FORMING,
    "growth": FORMING | {"operators"},
    "fitness": FORMING,
    "kinds": CORE | {"coding", "formats", "shapes"},
    "store": FORMING,
    "selection": CORE | {"kinds", "fitness", "store"},
    "recipe": BREEDING | {"selection"},
    "evaluation": BREEDING | {"selection", "recipe"},
    "search": BREEDING | {"selection", "recipe", "evaluation"},
    "viewer": set(),
    "shapes": {"formats"},
    "analysis": SEARCHING | {"scene", "viewer"},
    "notebook": SEARCHING | {"scene", "viewer", "analysis", "templates"},
    "plot": SEARCHING | {"scene", "analysis"},
    "report": SEARCHING | {"scene", "viewer", "analysis", "plot", "templates"},
    "studio": SEARCHING | {"scene", "viewer", "analysis", "growth", "shapes"},
    "cli": SEARCHING | {"growth", "towns", "scene", "analysis", "report", "shapes", "studio"},
    "__init__": set(),
    "__main__": {"cli"},
}
ROOMS = set(MAY_IMPORT) - {"__init__", "__main__"}

# Libraries that one file alone may know.
KEPT_APART = {
    frozenset({"deap"}): "selection/backends/",
    frozenset({"moocore"}): "selection/backends/",
    frozenset({"nlopt"}): "",
    frozenset({"dask", "distributed"}): "evaluation/cluster/",
    frozenset({"uvicorn"}): "studio/",
}

# What of numpy.random is not, and does not draw from, the global state.
STATELESS = {"Generator", "SeedSequence", "BitGenerator", "PCG64", "Philox", "default_rng"}
# What seeds the global state for a library, and gives it back.
SEEDED = {"random", "seed", "getstate", "setstate", "get_state", "set_state"}
# What numpy hands to BLAS, whose threads wait for each other on a busy machine.
BLAS = {"dot", "matmul", "inner", "vdot", "tensordot", "linalg", "cov", "corrcoef", "polyfit"}
EXECUTING = {"pickle", "cPickle", "dill", "cloudpickle", "joblib", "shelve", "marshal"}


@functools.cache
def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"), str(path))


@pytest.fixture(scope="module", autouse=True)
def _trees_of_all():
    """Parse every file before the first test, which would bear it for all."""
    for path in MODULES + OTHERS:
        nodes_of(tree_of(path))


def room_of(path: Path) -> str:
    first = path.relative_to(PACKAGE).parts[0]
    return first.removesuffix(".py")


@functools.cache
def nodes_of(tree: ast.Module) -> list[ast.AST]:
    return list(ast.walk(tree))


@functools.cache
def imported(tree: ast.Module) -> list[str]:
    """Dotted names of all imports, lazy ones too; ``from a import b`` gives ``a.b``."""
    found: list[str] = []
    for node in nodes_of(tree):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            found += [f"{'.' * node.level}{node.module or ''}.{a.name}" for a in node.names]
    return found


def dynamic(tree: ast.Module) -> Iterator[str]:
    """Names of modules that ``import_module("…")`` loads."""
    for node in nodes_of(tree):
        called = dotted(node.func) if isinstance(node, ast.Call) else ""
        if called.split(".")[-1] in ("import_module", "__import__"):
            yield from (one.value for one in node.args[:1] if isinstance(one, ast.Constant))


def module_of(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def needed(tree: ast.Module, modules: set[str]) -> set[str]:
    """Those of ``modules`` that a module imports, at any place in its text."""
    found = set()
    for name in [*imported(tree), *dynamic(tree)]:
        short = name.rpartition(".")[0]
        found |= {next((known for known in (name, short) if known in modules), "")}
    return found - {""}


def circle(imports: dict[str, set[str]]) -> list[str]:
    """Modules, each of which imports the next and the last the first; none if there is none."""
    done: set[str] = set()

    def follow(module: str, path: list[str]) -> list[str]:
        if module in path:
            return path[path.index(module) :]
        if module in done:
            return []
        for other in sorted(imports.get(module, ())):
            if found := follow(other, [*path, module]):
                return found
        done.add(module)
        return []

    return next(filter(None, (follow(module, []) for module in sorted(imports))), [])


def libraries(tree: ast.Module) -> set[str]:
    return {name.split(".")[0] for name in imported(tree)}


def dotted(node: ast.AST) -> str:
    """``a.b.c`` of nested attributes; "" if it does not begin with a name."""
    if isinstance(node, ast.Name):
        return node.id
    base = dotted(node.value) if isinstance(node, ast.Attribute) else ""
    return f"{base}.{node.attr}" if base else ""


def upward(tree: ast.Module, room: str) -> list[str]:
    """Imports that ``room`` may not have."""
    allowed = MAY_IMPORT[room] | BELOW_ALL | {room}
    faults = [name for name in imported(tree) if name.startswith(".")]
    for name in imported(tree):
        parts = name.split(".")
        if parts[0] != "evocity":
            continue
        if parts[1:2] == ["__version__"]:
            continue
        if len(parts) == 1 or parts[1] not in ROOMS:  # the façade, which may load any room
            faults += [name] if room not in ("cli", "__main__") else []
        elif parts[1] not in allowed:
            faults.append(name)
    return faults


def global_randomness(tree: ast.Module) -> list[str]:
    """Uses of a random state that nobody handed down."""
    faults = [name for name in imported(tree) if name.split(".")[0] == "random"]
    faults += [
        name
        for name in imported(tree)
        if name.startswith("numpy.random.") and name.split(".")[2] not in STATELESS
    ]
    for node in nodes_of(tree):
        name = dotted(node)
        if name.startswith(("np.random.", "numpy.random.")) and name.split(".")[2] not in STATELESS:
            faults.append(name)
        seedless = isinstance(node, ast.Call) and not node.args and not node.keywords
        if seedless and dotted(node.func).endswith("default_rng"):
            faults.append("default_rng() without a seed")
    return faults


def executing(tree: ast.Module) -> list[str]:
    """What runs data as code: eval and exec, and whatever unpickles."""
    faults = sorted(libraries(tree) & EXECUTING)
    for node in nodes_of(tree):
        if isinstance(node, ast.Call):
            if isinstance(node.func, ast.Name) and node.func.id in ("eval", "exec", "compile"):
                faults.append(node.func.id)
            for keyword in node.keywords:
                safe = isinstance(keyword.value, ast.Constant) and keyword.value.value is False
                if keyword.arg == "allow_pickle" and not safe:
                    faults.append("allow_pickle")
    return faults


def blas(tree: ast.Module) -> list[str]:
    """Calls of BLAS: products of matrices, and what of numpy makes some."""
    faults = []
    for node in nodes_of(tree):
        if isinstance(node, ast.BinOp | ast.AugAssign) and isinstance(node.op, ast.MatMult):
            faults.append("@")
        elif isinstance(node, ast.Attribute) and set(dotted(node).split(".")[1:]) & BLAS:
            faults.append(dotted(node))
        elif isinstance(node, ast.keyword) and node.arg == "optimize":
            faults.append("einsum by matrix products")
    return faults + [name for name in imported(tree) if set(name.split(".")[1:]) & BLAS]


def named(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def at_fault(paths, faults_of) -> dict[str, object]:
    """Name of each file that has faults, with what ``faults_of`` says of it."""
    return {named(path): found for path in paths if (found := faults_of(path))}


def test_every_room_has_its_place():
    assert {room_of(path) for path in MODULES} <= set(MAY_IMPORT)


def test_no_two_rooms_import_each_other():
    above = {room: set(below) for room, below in MAY_IMPORT.items()}
    while above:
        lowest = [room for room, below in above.items() if not below & set(above)]
        assert lowest, f"a circle among {sorted(above)}"
        for room in lowest:
            del above[room]


def test_imports_point_one_way():
    assert at_fault(MODULES, lambda path: upward(tree_of(path), room_of(path))) == {}


# Rooms of `search/`, each above those before it; docs/architecture.md draws them.
SEARCH_ROOMS = ("record", "preparation", "breeding", "steering", "resume", "calibration")


def search_room(name: str) -> int:
    """The floor of a module of `search/` by its dotted ``name``; the loop is on top."""
    parts = name.split(".")
    room = parts[2] if len(parts) > 2 else ""
    return SEARCH_ROOMS.index(room) if room in SEARCH_ROOMS else len(SEARCH_ROOMS)


def test_rooms_of_search_import_one_way():
    def faults(path):
        floor = search_room(module_of(path))
        names = [name for name in imported(tree_of(path)) if name.startswith("evocity.search.")]
        return [name for name in names if search_room(name) > floor]

    rooms = {
        path.name for path in (PACKAGE / "search").iterdir() if (path / "__init__.py").exists()
    }
    assert rooms == set(SEARCH_ROOMS)
    assert at_fault([path for path in MODULES if room_of(path) == "search"], faults) == {}


def test_folders_can_be_looked_over():
    folders = {path.parent for path in MODULES}
    assert len([folder for folder in folders if folder.parent == PACKAGE]) <= 28
    files = {folder: sum(path.is_file() for path in folder.iterdir()) for folder in folders}
    assert {named(folder): count for folder, count in files.items() if count > 40} == {}
    assert files[PACKAGE / "search"] <= 20


def test_contents_of_rooms_name_every_module():
    faults = {}
    for path in [path for path in MODULES if path.name == "__init__.py"]:
        text = ast.get_docstring(tree_of(path)) or ""
        lists = "".join(re.findall(r"^- .*(?:\n  .*)*", text, re.M))
        parts = {part.stem for part in path.parent.glob("*.py")} - {"__init__", "_kernels"}
        parts |= {part.parent.name for part in path.parent.glob("*/__init__.py")}
        heads = re.findall(r"^- ((?:`\w+`(?:, )?)+)", text, re.M)
        named_parts = {name for head in heads for name in re.findall(r"`(\w+)`", head)}
        if named_parts and named_parts <= parts:  # a list of modules, and not of names
            unnamed = parts - set(re.findall(r"`(\w+)`", lists))
            if unnamed:
                faults[named(path)] = sorted(unnamed)
    assert faults == {}


def test_no_modules_import_each_other():
    modules = {module_of(path) for path in MODULES}
    assert circle({module_of(path): needed(tree_of(path), modules) for path in MODULES}) == []


@pytest.mark.parametrize(
    ("texts", "found"),
    [
        ({"a": "import b", "b": "def late():\n    from a import x"}, ["a", "b"]),
        ({"a": "from a import b", "a.b": "import a.b.c", "a.b.c": "from a import b"}, 2),
        ({"a": "import b", "b": "import importlib\nimportlib.import_module('a')"}, ["a", "b"]),
        ({"a": "import b, c", "b": "import c, os", "c": "import a_b"}, []),
    ],
)
def test_circles_are_found(texts, found):
    met = circle({name: needed(ast.parse(text), set(texts)) for name, text in texts.items()})
    assert met == found or len(met) == found


def test_modules_are_of_one_size():
    """Kernels that must share a file apart."""
    lengths = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in MODULES}
    assert at_fault(MODULES, lambda p: lengths[p] > 450 and p.name != "_kernels.py") == {}


def test_starlette_stays_in_studio_which_commands_load_when_they_are_called():
    users = {room_of(path) for path in MODULES if libraries(tree_of(path)) & {"starlette"}}
    assert users == {"studio"}
    command = tree_of(PACKAGE / "cli" / "studio.py")
    above = [node for node in command.body if isinstance(node, ast.Import | ast.ImportFrom)]
    assert not any("evocity.studio" in (getattr(node, "module", "") or "") for node in above)
    others = [path for path in MODULES if room_of(path) not in ("studio", "cli")]
    assert (
        at_fault(others, lambda p: [n for n in imported(tree_of(p)) if "evocity.studio" in n]) == {}
    )


def test_numba_stays_in_the_kernels():
    # which kernels are compiled already, and whether one is being compiled
    asking = PACKAGE / "evaluation" / "compilation.py", PACKAGE / "cli" / "shared" / "terminal.py"

    def faults(path):
        tree = tree_of(path)
        found = sorted(libraries(tree) & {"numba", "llvmlite"})
        if path.name != "_kernels.py" and path not in asking:
            found += [name for name in imported(tree) if name.startswith("evocity.accelerate")]
        return found

    assert at_fault([one for one in MODULES if room_of(one) != "accelerate"], faults) == {}


@pytest.mark.parametrize(
    ("kept", "room"), KEPT_APART.items(), ids=["deap", "moocore", "nlopt", "dask", "uvicorn"]
)
def test_one_file_knows_the_library(kept, room):
    users = [path for path in MODULES if libraries(tree_of(path)) & kept]
    assert len(users) <= 1
    assert all(path.relative_to(PACKAGE).as_posix().startswith(room) for path in users)


def test_nothing_draws_from_a_global_state():
    seeded = (  # and given back
        PACKAGE / "selection" / "backends" / "deap.py",
        ROOT / "tests" / "search" / "test_search_algorithms.py",
        ROOT / "tests" / "search" / "test_search_cma.py",
        ROOT / "tests" / "search" / "test_search_toolbox.py",
        ROOT / "benchmarks" / "_power_methods.py",
    )

    def faults(path):
        found = global_randomness(tree_of(path))
        return [name for name in found if path not in seeded or name.split(".")[-1] not in SEEDED]

    assert at_fault(MODULES + OTHERS, faults) == {}


def test_data_is_never_executed():
    own = {"evocity/fitness/registry.py": ["compile", "exec"]}  # a user's own measures are code
    assert at_fault(MODULES, lambda path: executing(tree_of(path))) == own


def opening(tree: ast.Module) -> list[str]:
    """What opens, makes or removes files by a path."""
    faults = [name for name in imported(tree) if name.startswith("evocity.files")]
    for node in nodes_of(tree):
        if isinstance(node, ast.Call):
            name = dotted(node.func)
            path = isinstance(node.func, ast.Attribute) and node.func.attr in BY_PATH
            if path or name in OPENING:
                faults.append(name)
    return faults


#: Methods of paths, and functions.
BY_PATH = {"write_text", "read_text", "touch", "unlink", "symlink_to", "hardlink_to"}
OPENING = {"open", "os.open", "os.replace", "os.rename", "os.remove", "os.unlink", "os.mkdir"}


def test_one_file_opens_the_files_of_a_run():
    users = at_fault(
        [path for path in MODULES if room_of(path) == "store"],
        lambda path: opening(tree_of(path)),
    )
    assert list(users) == ["evocity/store/run_directory.py"]


def test_a_birth_calls_no_blas():
    # with workers=0 it would take threads, and its last bits depend on how many
    paths = [
        path
        for place in ("fitness", "views", "operators", "coding/matching")
        for path in (PACKAGE / place).rglob("*.py")
        if path.name != "residual.py"  # maps of autosimilarity, which no birth asks for
    ]
    assert len(paths) > 100
    assert at_fault(paths, lambda path: blas(tree_of(path))) == {}


def test_the_package_names_its_nouns_in_few_lines():
    assert len((PACKAGE / "__init__.py").read_text(encoding="utf-8").splitlines()) < 40


@pytest.mark.parametrize(
    ("check", "text"),
    [
        (lambda tree: upward(tree, "coding"), "from evocity.search import Search"),
        (lambda tree: upward(tree, "coding"), "def late():\n    import evocity.store.run_log"),
        (lambda tree: upward(tree, "io"), "from evocity import genome"),
        (lambda tree: upward(tree, "fitness"), "from evocity import read_map"),
        (lambda tree: upward(tree, "store"), "import evocity"),
        (lambda tree: upward(tree, "io"), "from . import bundled"),
        (global_randomness, "import random"),
        (global_randomness, "from random import choice"),
        (global_randomness, "import numpy as np\nnp.random.seed(1)"),
        (global_randomness, "import numpy as np\nnp.random.normal(size=3)"),
        (global_randomness, "from numpy.random import rand"),
        (global_randomness, "import numpy as np\nrng = np.random.default_rng()"),
        (blas, "a @ b"),
        (blas, "a @= b"),
        (blas, "import numpy as np\nnp.linalg.norm(a)"),
        (blas, "a.dot(b)"),
        (blas, "from numpy import dot"),
        (blas, "import numpy as np\nnp.einsum('i,i', a, b, optimize=True)"),
        (opening, "open(path)"),
        (opening, "import os\nos.replace(a, b)"),
        (opening, "path.write_text('')"),
        (opening, "from evocity.files import whole_file"),
        (executing, "import pickle"),
        (executing, "from joblib import load"),
        (executing, "eval('1')"),
        (executing, "import numpy as np\nnp.load('a.npy', allow_pickle=True)"),
    ],
)
def test_these_checks_find_what_they_look_for(check, text):
    assert check(ast.parse(text)) != []


@pytest.mark.parametrize(
    ("check", "text"),
    [
        (lambda tree: upward(tree, "store"), "from evocity import __version__"),
        (lambda tree: upward(tree, "search"), "from evocity import fitness, io"),
        (lambda tree: upward(tree, "cli"), "import evocity"),
        (global_randomness, "import numpy as np\nrng = np.random.default_rng(7)"),
        (blas, "import numpy as np\n@cache\ndef a(b):\n    return np.einsum('i,i', b, b)"),
        (executing, "import re\nre.compile('a')"),
    ],
)
def test_these_checks_let_pass_what_is_right(check, text):
    assert check(ast.parse(text)) == []


def test_what_is_imported_is_declared():
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    names = {re.match(r"[A-Za-z0-9-]+", line)[0].lower() for line in declared["dependencies"]}
    modules = {"pil": "pillow", "pydantic_core": "pydantic", "tomli_w": "tomli-w"}
    modules["skimage"] = "scikit-image"
    used = {name.lower() for path in MODULES for name in libraries(tree_of(path))}
    used -= {name.lower() for name in sys.stdlib_module_names} | {"evocity", ""}
    for extra in ("cluster", "studio"):
        names |= {re.match(r"[a-z]+", line)[0] for line in declared["optional-dependencies"][extra]}
    names -= {"cryptography"}  # Dask makes certificates by it
    extra = {re.match(r"[a-z]+", line)[0] for line in declared["optional-dependencies"]["notebook"]}
    names |= used & extra  # names for type checkers; only lazy_imports.py loads them
    assert {modules.get(name, name) for name in used} == names  # and nothing for nothing
