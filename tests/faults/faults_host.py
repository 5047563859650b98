"""A process that has everything loaded and forks another for each run, so that many can be killed.

It reads one JSON document a line from its standard input: a ``recipe`` (path) or None to resume,
``out``, ``workers``, ``die`` (a number: kill the run at so many-th deed in its folder) or None. It
answers with the run's process id, and, when that ended, with its exit code on a line of its own.
A run's exit code is 0, or 3 after a `RunError`, whose text goes to ``told``.
"""

import json
import os
import signal
import sys
from pathlib import Path


def main() -> None:
    from evocity.search import Search, read_recipe  # noqa: F401
    from evocity.search.warm import BUILDINGS, DECODE, SEARCH, warm_up

    operators = ("pavement_fusion", "lambda_crossover", "mutation")
    warm_up(4, [SEARCH, DECODE, BUILDINGS, *(f"operator:{name}" for name in operators)])
    print("ready", flush=True)
    for line in sys.stdin:
        asked = json.loads(line)
        child = os.fork()
        if child == 0:
            os._exit(_run(**asked))
        print(child, flush=True)
        print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)


def _run(recipe, out, workers, die, told) -> int:
    from evocity.errors import RunError
    from evocity.search import Search, read_recipe

    null = os.open(os.devnull, os.O_RDWR)
    os.dup2(null, 0)
    os.dup2(null, 1)
    if die is not None:
        _die_at(die, out)
    try:
        if recipe is None:
            search = Search.resume(out, workers=workers)
        else:
            search = Search(read_recipe(recipe), out=out, workers=workers)
        with search:
            for _ in search:
                pass
    except RunError as error:
        Path(told).write_text(str(error))
        return 3
    return 0


def _die_at(deed: int, out: str) -> None:
    """Have this process killed just before its ``deed``-th deed on files beside or in ``out``."""
    place, left = str(Path(out).parent), deed

    def watch(event: str, given: tuple) -> None:
        nonlocal left
        if event not in ("open", "os.rename", "os.remove", "os.mkdir", "os.truncate", "os.rmdir"):
            return
        if isinstance(given[0], str | os.PathLike) and os.fspath(given[0]).startswith(place):
            left -= 1
            if left < 0:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(watch)


if __name__ == "__main__":
    main()
