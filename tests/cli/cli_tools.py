"""How the tests of the commands call them, and what every refusal has in common."""

from contextlib import nullcontext
from pathlib import Path
from unittest.mock import patch

import numpy as np
from click.testing import CliRunner, Result
from towns import draw_town

import evocity
from evocity.cli import main
from evocity.fitness import registry

#: What reading a map of `write_town` takes.
AT_2_M = ("--metres-per-pixel", "2")
#: Coding as `codes.uniformly` does: range blocks of one side, neither fitted nor settled.
PLAIN = ("--block", "4", "--no-fit", "--no-settle")


def call(*words, code: int = 0, report: bool = False) -> Result:
    """The outcome of ``evocity WORDS``, which must end with exit ``code``. Of a run that ends so,
    ``report`` is whether its page is written in full: that takes longer than a small run."""
    brief = not report and words[0] in ("run", "resume")
    # a real process forgets the measures it loaded from files when it ends; what is compiled here,
    # the tests before decide
    with (
        patch.dict(registry._from_files),
        patch("evocity.accelerate.watch_compiling", lambda told: nullcontext()),
        patch("evocity.report.write_report", _write_briefly) if brief else nullcontext(),
    ):
        result = CliRunner().invoke(main, [str(word) for word in words], prog_name="evocity")
    assert isinstance(result.exception, SystemExit | None), result.exception
    assert result.exit_code == code, result.output
    return result


def _write_briefly(run: Path) -> Path:
    page = run / "report.html"
    page.write_text("in brief")
    return page


def refused(folder: Path, *words, says: str) -> str:
    """Check that ``evocity WORDS`` is refused with one message that ``says`` so: exit code 2,
    nothing on standard output, every file of ``folder`` as it was. Returns the message."""
    before = contents(folder)
    result = call(*words, code=2)
    assert result.stdout == ""
    assert contents(folder) == before
    message = result.stderr
    assert says in message, message
    assert "Traceback" not in message, message
    assert message.count("expected:") == message.count("what to do:") == 1, message
    return message


def contents(folder: Path) -> dict[Path, bytes | None]:
    """All that is in ``folder``: files with their bytes, folders."""
    return {p: p.read_bytes() if p.is_file() else None for p in folder.rglob("*")}


def write_town(path: Path, seed: int = 1, side: int = 64) -> Path:
    """A drawn town as an NPY file."""
    np.save(path, draw_town(seed, side=side).heights)
    return path


def write_recipe(folder: Path, **replaced: str) -> Path:
    """A small recipe of two drawn towns; ``replaced``: section to the lines that replace it."""
    sections = {
        "run": 'name = "towns"\nseed = 3\npopulation = 6\ngenerations = 2',
        "map": "pixels = 32",
        "genome": "block = 4\nfit = false\nsettle = false",
        "parents": 'map = "left.npy"\n[[parents]]\nmap = "right.npy"',
        "operators": "pavement_fusion = 2\nmutation = 1",
        "fitness": 'name = "alignment"\n[[fitness]]\nname = "gsi"\ntarget = 0.35',
        "evaluation": "workers = 0",
    } | replaced
    many = ("parents", "fitness")
    lines = [f"[[{k}]]\n{v}" if k in many else f"[{k}]\n{v}" for k, v in sections.items()]
    for seed, name in enumerate(("left", "right")):
        write_town(folder / f"{name}.npy", seed + 1, side=32)
    path = folder / "towns.toml"
    path.write_text("\n".join(lines) + "\n")
    return path


def run_of_two_towns(folder: Path) -> Path:
    """Make a run: the first population of two towns that lie in two places."""
    recipe = evocity.Recipe(
        parents=["lyon-1er", "montpellier-pas-du-loup"],
        map={"pixels": 32, "metres_per_pixel": 16.0},
        fitness=["alignment"],
        run={"population": 4, "generations": 0, "name": "two"},
    )
    with evocity.Search(recipe, out=folder, workers=0) as search:
        list(search)
    return folder
