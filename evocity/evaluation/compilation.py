"""Compilation of the kernels that a search needs: once on a machine, before it begins.

Two processes of this module take parts of `evocity.evaluation.kernel_warmup` in turn. They compile
into numba's cache, from which every later process loads. An empty file beside the cache notes each
compiled part; its name is a hash of all that the part's kernels depend on.
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
from evocity.child_process import tie_to_parent
from evocity.coding.matching import available_cores
from evocity.evaluation import kernel_warmup
from evocity.fitness.part import own_name
from evocity.operators import OPERATORS
from evocity.recipe.recipe import Recipe

#: The number of compiling processes; they wait for each other, so a third would be idle.
_PROCESSES = 2
#: Seconds between two checks of the progress, and at most between two messages about it.
_LOOK, _WORD = 0.5, 5.0
#: Sides of range blocks: one, or the finest and the largest, px.
Sides = int | tuple[int, int]


def kernel_parts(recipe: Recipe, selecting: bool = False) -> list[str]:
    """List the parts of `kernel_warmup` for the births of a ``recipe``, and for ``selecting``."""
    code = recipe.genome
    names = [name for name in recipe.breeding if name in OPERATORS]
    # decoding that settles buildings has labelled them already
    unsettled = code.settle is not True or bool(recipe.locked.given)
    buildings = [kernel_warmup.BUILDINGS] if "region_fusion" in names and unsettled else []
    measured = [*recipe.measures, *recipe.recorded]
    own = [one for one in measured if one.origin != "evocity"]
    return [
        kernel_warmup.SEARCH,
        *([kernel_warmup.EVERYWHERE] if code.reach == "all" else []),
        kernel_warmup.DECODE,
        *([kernel_warmup.FIT] if code.fit else []),
        *(f"operator:{name}" for name in names),
        *(f"measure:{own_name(one.name)}" for one in measured if one not in own),
        *([kernel_warmup.VIEWS] if own else buildings),
        *([kernel_warmup.SELECTION] if selecting else []),
    ]


def compile_once(sides: Sides, parts: Sequence[str], tell: Callable[[str], None]) -> None:
    """Compile those of ``parts`` that this machine has not compiled yet, and ``tell`` the progress.
    It never raises: a kernel that is not compiled now is compiled at its first call."""
    folder = accelerate.cache_folder()
    if folder is None:
        return
    stamp = accelerate.stamp()  # it reads every file of kernels
    notes = {part: folder / _note(stamp, sides, part) for part in parts}
    missing = [part for part in parts if not notes[part].is_file()]
    if missing:
        with contextlib.suppress(OSError):
            _Crew(sides, missing, notes).work(tell)


def _note(stamp: tuple, sides: Sides, part: str) -> str:
    """Name the file which notes that a ``part`` was compiled."""
    state = repr((stamp, sides, part)).encode()
    return f"evocity-{hashlib.blake2b(state, digest_size=16).hexdigest()}.compiled"


class _Crew:
    """Processes that compile ``parts``: the first from the front, the other from the back."""

    def __init__(self, sides: Sides, parts: Sequence[str], notes: dict[str, Path]):
        self._sides, self._left, self._all = sides, list(parts), len(parts)
        self._notes = notes
        self._lock = threading.Condition()
        self._searched = kernel_warmup.SEARCH not in parts
        self._done = self._kernels = 0

    def work(self, tell: Callable[[str], None]) -> None:
        """Compile all parts, and report the progress to ``tell``."""
        count = min(_PROCESSES, available_cores(), self._all)
        helpers, drivers = [], []
        try:
            for number in range(count):
                helpers.append(_start(self._sides))
                arguments = helpers[-1], number
                # the end of this process waits for no daemon, and so for no compilation
                drivers.append(threading.Thread(target=self._drive, args=arguments, daemon=True))
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
                with contextlib.suppress(OSError), helper:  # it may end without reading all
                    driver.join()

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
                self._note_part(part)
            helper.stdin.close()
        except (OSError, ValueError):
            pass  # it crashed, or was ended
        finally:
            with self._lock:  # so that nobody waits for the part that it worked on
                self._searched = True
                self._lock.notify_all()

    def _next(self, from_front: bool) -> str | None:
        """Take the next part; None if none is left. Parts on genomes wait for the search."""
        with self._lock:
            while self._left:
                ready = [
                    part
                    for part in self._left
                    if self._searched or not kernel_warmup.needs_genomes(part)
                ]
                if ready:
                    part = ready[0 if from_front else -1]
                    self._left.remove(part)
                    return part
                self._lock.wait()
            return None

    def _note_part(self, part: str) -> None:
        with contextlib.suppress(OSError):
            self._notes[part].touch()
        with self._lock:
            self._done += 1
            self._searched |= part == kernel_warmup.SEARCH
            self._lock.notify_all()


def _start(sides: Sides) -> subprocess.Popen:
    path = os.pathsep.join(one or os.getcwd() for one in sys.path)
    environment = {key: value for key, value in os.environ.items() if key != kernel_warmup.VARIABLE}
    program = tie_to_parent(f"from {__name__} import compile_named; ")
    return subprocess.Popen(
        [sys.executable, "-c", f"{program}compile_named({sides!r})"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=environment | {"PYTHONPATH": path},
        start_new_session=True,  # only the search gets Ctrl-C, and ends them
    )


def compile_named(sides: Sides) -> None:
    """Compile the parts on standard input; print a line for each kernel and each finished part."""
    accelerate.watch_compiled(lambda: print("kernel", flush=True))
    for line in sys.stdin:
        kernel_warmup.warm_up(sides, [line.strip()])
        print("done", flush=True)
