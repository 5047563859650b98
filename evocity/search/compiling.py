"""The kernels that a search needs, compiled once on a machine: before it begins, on two cores.

Two processes of this module take parts of `evocity.search.warm` in turn. What they compile is in
numba's cache then, and every later process loads it. That a part was compiled is noted beside the
cache, by all that a kernel in it depends on.
"""

import contextlib
import hashlib
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from evocity import accelerate
from evocity.coding.matching import available_cores
from evocity.fitness.part import own_name
from evocity.operators import OPERATORS
from evocity.pavement import read_sides
from evocity.search import warm
from evocity.search.recipe import Recipe

#: So many processes compile; what they wait for of each other leaves a third idle.
_PROCESSES = 2
#: Seconds between two looks at how far they are, and at most between two words about it.
_LOOK, _WORD = 0.5, 5.0
#: Sides of range blocks: one, or the finest and the largest, px.
Sides = int | tuple[int, int]


def needed(recipe: Recipe, selecting: bool = False) -> list[str]:
    """The parts of `evocity.search.warm` that the births of a ``recipe`` call, and, where it is
    the one who is ``selecting``, the search."""
    code = recipe.genome
    names = [name for name in recipe.breeding if name in OPERATORS]
    # what decodes with settled roofs knows its buildings already
    unsettled = not code.settle or bool(recipe.locked.asked)
    buildings = [warm.BUILDINGS] if "region_fusion" in names and unsettled else []
    measured = [*recipe.measures, *recipe.recorded]
    own = [one for one in measured if one.origin != "evocity"]
    return [
        warm.SEARCH,
        *([warm.EVERYWHERE] if code.reach == "all" else []),
        warm.DECODE,
        *([warm.FIT] if code.fit else []),
        *(f"operator:{name}" for name in names),
        *(f"measure:{own_name(one.name)}" for one in measured if one not in own),
        *([warm.VIEWS] if own else buildings),
        *([warm.SELECTION] if selecting else []),
    ]


def compile_once(sides: Sides, parts: Sequence[str], tell: Callable[[str], None]) -> None:
    """Compile what of ``parts`` no process has compiled yet; nothing to do but once a machine.

    ``tell`` is told how far it is. Never raises: what is not compiled now is when it is called.
    """
    folder = accelerate.cache_folder()
    if folder is None:
        return
    stamp = accelerate.stamp()  # it looks at every file of kernels
    notes = {part: folder / _note(stamp, sides, part) for part in parts}
    missing = [part for part in parts if not notes[part].is_file()]
    if missing:
        with contextlib.suppress(OSError):
            _Crew(sides, missing, notes).work(tell)


def _note(stamp: tuple, sides: Sides, part: str) -> str:
    """Name of the file that says that a ``part`` was compiled."""
    told = repr((stamp, sides, part)).encode()
    return f"evocity-{hashlib.blake2b(told, digest_size=16).hexdigest()}.compiled"


class _Crew:
    """Processes that compile ``parts``: the first from the front, the other from the back."""

    def __init__(self, sides: Sides, parts: Sequence[str], notes: dict[str, Path]):
        self._sides, self._left, self._all = sides, list(parts), len(parts)
        self._notes = notes
        self._lock = threading.Condition()
        self._searched = warm.SEARCH not in parts
        self._done = self._kernels = 0

    def work(self, tell: Callable[[str], None]) -> None:
        count = min(_PROCESSES, available_cores(), self._all)
        helpers, drivers = [], []
        try:
            for number in range(count):
                helpers.append(_started(self._sides))
                drivers.append(threading.Thread(target=self._drive, args=(helpers[-1], number)))
                drivers[-1].start()
            said, when = -1, 0.0
            while any(helper.poll() is None for helper in helpers):
                if self._kernels and (self._done != said or time.monotonic() - when > _WORD):
                    said, when = self._done, time.monotonic()
                    tell(
                        f"compiling, once on this machine: {said} of {self._all} parts, "
                        f"{self._kernels} kernels"
                    )
                with self._lock:
                    self._lock.wait(_LOOK)
        finally:
            for helper in helpers:
                helper.kill()
            for helper, driver in zip(helpers, drivers, strict=False):
                driver.join()
                with contextlib.suppress(OSError):  # what it did not read any more
                    helper.stdin.close()
                helper.stdout.close()
                helper.wait()

    def _drive(self, helper: subprocess.Popen, number: int) -> None:
        try:
            while part := self._next(from_front=number == 0):
                helper.stdin.write(f"{part}\n")
                helper.stdin.flush()
                for line in helper.stdout:
                    if line == "done\n":
                        break
                    with self._lock:
                        self._kernels += 1
                else:
                    return
                self._finished(part)
            helper.stdin.close()
        except (OSError, ValueError):
            pass  # it is gone, or was ended
        finally:
            with self._lock:  # nobody waits for what it had begun
                self._searched = True
                self._lock.notify_all()

    def _next(self, from_front: bool) -> str | None:
        """A part whose turn it is; None if none is left. Waits for the search, by which toys
        become genomes, if all others work on these."""
        with self._lock:
            while self._left:
                ready = [one for one in self._left if self._searched or not warm.on_codes(one)]
                if ready:
                    part = ready[0 if from_front else -1]
                    self._left.remove(part)
                    return part
                self._lock.wait()
            return None

    def _finished(self, part: str) -> None:
        with contextlib.suppress(OSError):
            self._notes[part].touch()
        with self._lock:
            self._done += 1
            self._searched |= part == warm.SEARCH
            self._lock.notify_all()


def _started(sides: Sides) -> subprocess.Popen:
    path = os.pathsep.join(one or os.getcwd() for one in sys.path)
    environment = {key: value for key, value in os.environ.items() if key != warm.VARIABLE}
    return subprocess.Popen(
        [sys.executable, "-m", __name__, warm.sides_told(sides)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=environment | {"PYTHONPATH": path},
        start_new_session=True,  # Ctrl-C is the search's, which ends them
    )


def _main(sides: Sides) -> None:
    """Compile the parts that standard input names, line by line; tell each kernel, and each end."""
    accelerate.on_compiled(lambda: print("kernel", flush=True))
    for line in sys.stdin:
        warm.warm_up(sides, [line.strip()])
        print("done", flush=True)


if __name__ == "__main__":
    _main(read_sides(sys.argv[1]))
