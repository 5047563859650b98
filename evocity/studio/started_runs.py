"""The runs that began at the desk or in the modeller, which processes of their own carry out."""

import contextlib
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from evocity.errors import RunError
from evocity.search.record.complete_run import CompleteRun
from evocity.studio.output_files import free_path
from evocity.studio.request_fields import RequestError
from evocity.studio.subprocesses import RunProcesses, log_of


@dataclass
class StartedRun:
    """A run that began here; ``has``: whether it has a generation."""

    name: str
    folder: Path
    recipe: Path
    run: int | None = None
    has: bool = False

    def look(self, number: Callable[[Path], int]) -> None:
        """Note the folder, which then gets a ``number``, and the first generation."""
        if self.run is None and os.path.lexists(self.folder / "provenance.json"):
            self.run = number(self.folder)
        if not self.has and self.run is not None:
            with contextlib.suppress(RunError):
                self.has = bool(CompleteRun(self.folder).generations)


class StartedRuns:
    """The runs that began in one pane; ``number`` gives a number to the run at a path."""

    def __init__(self, processes: RunProcesses, number: Callable[[Path], int]):
        self._processes, self._number = processes, number
        self._runs: list[StartedRun] = []

    def begin(self, path: Path, recipe: Path) -> None:
        """Carry out a ``recipe`` in the new folder ``path``."""
        self._processes.begin(path, ["run", str(recipe), "--out", str(path)], log_of(path))
        self._runs.append(StartedRun(path.name, path, recipe))

    def end(self, place: int) -> None:
        """End a run by its ``place`` in the list, before it has a folder."""
        if not 0 <= place < len(self._runs):
            raise RequestError(
                f"the list of started runs has no run {place}",
                "a run that this page started",
                "load the page again",
            )
        self._processes.end(self._runs[place].folder)

    def states(self) -> list[dict]:
        """Return the runs as plain values, with the states of their processes."""
        states = []
        for one in self._runs:
            one.look(self._number)
            paths = {"folder": str(one.folder), "recipe": str(one.recipe)}
            states.append(vars(one) | paths | (self._processes.state(one.folder) or {}))
        return states

    def free_path(self, home: Path, name: str) -> Path:
        """Return a free path for a run in the folder ``home``, also free for the recipe beside
        it."""
        taken = {one.folder for one in self._runs if self._processes.is_busy(one.folder)}

        def is_free(path: Path) -> bool:
            beside = recipe_folder(path)
            return path not in taken and not any(map(os.path.lexists, (path, beside)))

        return free_path(home, name, is_free)


def recipe_folder(path: Path) -> Path:
    """Return the folder of the recipe of the run at ``path``."""
    return path.with_name(f"{path.name}-recipe")
