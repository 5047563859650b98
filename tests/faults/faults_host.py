"""A process that has everything loaded and forks another for each run, so that many can be killed.

It reads one JSON document a line from its standard input. A ``recipe`` (path) or None to resume,
``out``, ``workers``, ``die`` (a number: kill the run at so many-th deed in its folder) or None: a
run, of which it answers the process id. ``wait``, such an id: answered with the run's exit code,
once it ended: 0, or 3 after a `RunError`, whose text goes to the file ``told``, a dash and the id.
"""

import json
import os
import signal
import sys
from pathlib import Path


def main() -> None:
    from evocity.evaluation.kernel_warmup import BUILDINGS, DECODE, SEARCH, warm_up
    from evocity.search import Search, read_recipe  # noqa: F401

    operators = ("pavement_fusion", "lambda_crossover", "mutation")
    warm_up(4, [SEARCH, DECODE, BUILDINGS, *(f"operator:{name}" for name in operators)])
    print("ready", flush=True)
    for line in sys.stdin:
        asked = json.loads(line)
        if "wait" in asked:
            print(os.waitstatus_to_exitcode(os.waitpid(asked["wait"], 0)[1]), flush=True)
            continue
        child = os.fork()
        if child == 0:
            os._exit(_run(**asked))
        print(child, flush=True)


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
        Path(f"{told}-{os.getpid()}").write_text(str(error))
        return 3
    return 0


def _die_at(deed: int, out: str) -> None:
    """Have this process killed just before its ``deed``-th deed on files beside or in ``out``."""
    place, left = str(Path(out).parent), deed

    def watch(event: str, given: tuple) -> None:
        nonlocal left
        if event not in ("open", "os.rename", "os.remove", "os.mkdir", "os.truncate", "os.rmdir"):
            return
        named = os.fspath(given[0]) if isinstance(given[0], str | os.PathLike) else ""
        by_descriptor = event.startswith("os.") and named and not os.path.isabs(named)
        if named.startswith(place) or by_descriptor:
            left -= 1
            if left < 0:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(watch)


if __name__ == "__main__":
    main()
