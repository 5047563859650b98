"""Modules of the package that mypy still refuses: a list that may only shrink.

``python tests/excused_modules.py`` runs mypy and prints the errors of all modules that the list
does not excuse. It takes modules off the list that are gone or have no error. With ``--rewrite``,
after modules were moved or renamed, it writes the whole list again.
"""

import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).parent.parent
LIST = Path(__file__).with_name("excused_modules.txt")


def excused_modules() -> list[str]:
    """Read the list: paths from the root of the repository, one a line."""
    return LIST.read_text(encoding="utf-8").split()


def mypy_errors(*more: Path, cache: Path | None = None) -> list[str]:
    """Run mypy over the package and ``more`` files; return its lines of errors.

    A process of its own runs it, for mypy changes the limit of recursion. ``pyproject.toml`` has
    the settings.
    """
    options = ["--no-error-summary", "--no-pretty", "--no-color-output"]
    options += [f"--cache-dir={cache}"] if cache else []
    files = ["evocity", "tests/typed_surface.py", *map(str, more)]
    call = [sys.executable, "-m", "mypy", *options, *files]
    done = subprocess.run(call, cwd=ROOT, capture_output=True, text=True, timeout=280)
    if done.stderr or done.returncode > 1:
        raise RuntimeError(done.stderr or done.stdout)
    return [line for line in done.stdout.splitlines() if ": error: " in line]


def modules_of(errors: Iterable[str]) -> set[str]:
    """Return the modules of the package that the ``errors`` name."""
    paths = {Path(line.partition(":")[0]).as_posix() for line in errors}
    return {path for path in paths if path.startswith("evocity/")}


def write(modules: Iterable[str]) -> None:
    LIST.write_text("".join(f"{module}\n" for module in sorted(modules)), encoding="utf-8")


def main(arguments: list[str]) -> int:
    errors = mypy_errors()
    faulty, excused = modules_of(errors), set(excused_modules()) if LIST.exists() else set()
    if "--rewrite" in arguments:
        excused = faulty
    unexcused = [line for line in errors if line.partition(":")[0] in faulty - excused]
    print(*unexcused, sep="\n", end="\n" * bool(unexcused))
    write(excused & faulty)
    print(f"{len(excused & faulty)} modules excused, {len(faulty - excused)} to mend")
    return min(len(unexcused), 1)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
