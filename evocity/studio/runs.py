"""The runs of a studio, each by its number: runs of the command line, and all runs of a folder."""

import contextlib
import os
import threading
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from evocity.errors import RunError, reason_of
from evocity.store import RunLog
from evocity.store.lock import is_held
from evocity.studio.birth_details import Solids
from evocity.studio.birth_growth import BirthGrowth
from evocity.studio.children import Breeding
from evocity.studio.filters import Autosimilarity, FilterDesk
from evocity.studio.picks import Picks
from evocity.studio.run_watcher import RunWatcher

if TYPE_CHECKING:
    from evocity.scene import Library

#: Runs from a folder, at most.
MOST_RUNS = 500


class OpenRun:
    """One run with its watcher, picks and broods. Raises `RunError` if it cannot be read."""

    def __init__(self, path: Path, library: "Library | None" = None):
        self.watcher = RunWatcher(path)
        self.solids = Solids(self.watcher, library)
        self.filters = FilterDesk(self.watcher)
        self.autosimilarity = Autosimilarity(self.watcher)
        self.growth = BirthGrowth(self.watcher.path)
        self.picks = Picks(self.watcher.path)
        self.breeding = Breeding()
        #: The broods of the drawing board, one child each.
        self.board = Breeding()

    def broods(self, is_board: bool) -> Breeding:
        return self.board if is_board else self.breeding


class Runs:
    """Runs by number, which never changes: the runs at ``paths``, then all runs within ``folder``,
    also later ones. A run is opened at its first request. The folder may be missing if it
    ``may_lack``. ``library``: objects for 3D views."""

    def __init__(
        self,
        paths: Iterable[str | Path],
        folder: Path | None,
        may_lack: bool,
        library: "Library | None" = None,
    ):
        self.library = library
        self._lock = threading.RLock()
        self._paths: list[Path] = []
        self._open_runs: dict[int, OpenRun] = {}
        self._folder = None if folder is None else folder.resolve()
        #: The number of runs in the folder beyond `MOST_RUNS`.
        self.more = 0
        for path in paths:
            self.add(RunLog(path).path)
        if self._folder is not None and not (may_lack and not os.path.lexists(self._folder)):
            _runs_in(self._folder)
        if self._paths:
            _ = self[0]  # raises now if the run is damaged
        self.states()

    def __len__(self) -> int:
        return len(self._paths)

    @property
    def paths(self) -> list[Path]:
        with self._lock:
            return list(self._paths)

    def __getitem__(self, number: int) -> OpenRun:
        with self._lock:
            if number not in self._open_runs:
                self._open_runs[number] = OpenRun(self._paths[number], self.library)
            return self._open_runs[number]

    def add(self, path: str | Path) -> int:
        """Add the run at ``path``, unless it is there; return its number."""
        path = Path(path).resolve()
        with self._lock:
            if path not in self._paths:
                self._paths.append(path)
            return self._paths.index(path)

    def states(self) -> list[dict]:
        """Return the number of each run, a unique name, and whether a process breeds it now."""
        with self._lock:
            self._look()
            names = [path.name for path in self._paths]
            return [
                {
                    "run": number,
                    "name": path.name if names.count(path.name) == 1 else str(path),
                    "going": _is_going(path),
                }
                for number, path in enumerate(self._paths)
            ]

    def _look(self) -> None:
        """Add the new runs of the folder; a missing folder has no new runs."""
        if self._folder is None:
            return
        with contextlib.suppress(RunError):
            new = [path for path in _runs_in(self._folder) if path not in self._paths]
            room = max(0, MOST_RUNS - len(self._paths))
            self.more = len(new[room:])
            self._paths += new[:room]

    @property
    def _broods(self) -> list[Breeding]:
        return [two for run in self._open_runs.values() for two in (run.breeding, run.board)]

    def is_busy_beside(self, run: OpenRun, is_board: bool) -> bool:
        """Whether studio breeds in another run than a ``run``, or in the other pane of the run."""
        with self._lock:
            chosen = run.broods(is_board)
            return any(one.busy for one in self._broods if one is not chosen)

    def breeding(self, run: OpenRun, is_board: bool = False) -> Breeding:
        """Return the broods of a ``run``, ready for a new one: all other workers end."""
        with self._lock:
            if self.is_busy_beside(run, is_board):
                raise RunError(
                    "studio is breeding children in another run or in another pane of the page",
                    "one group of children at a time",
                    "wait for those children, or stop them",
                )
            chosen = run.broods(is_board)
            for breeding in self._broods:
                if breeding is not chosen:
                    breeding.release_workers()
            return chosen

    def close(self) -> None:
        for run in self._open_runs.values():
            run.autosimilarity.stop()
            run.growth.stop()
        every = self._broods
        for breeding in every:  # all at once, then wait for each
            breeding.cancel()
        for breeding in every:
            breeding.close()


def _is_going(path: Path) -> bool:
    with contextlib.suppress(RunError):  # the run itself shows this problem
        return is_held(path / "lock")
    return False


def _runs_in(folder: Path) -> list[Path]:
    """Return the runs in a ``folder``, by name. Raises `RunError` where it cannot be read."""
    try:
        with os.scandir(folder) as entries:
            names = sorted(entry.name for entry in entries if not entry.name.startswith("."))
    except OSError as error:
        raise RunError(
            f"{folder} cannot be read: {reason_of(error)}",
            "a folder that contains run folders of `evocity run`",
            "name another folder",
        ) from None
    paths = (folder / name for name in names)
    return [path.resolve() for path in paths if os.path.lexists(path / "provenance.json")]
