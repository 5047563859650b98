"""The runs that a studio shows, each by its number: those that were named, those of a folder."""

import contextlib
import os
import threading
from collections.abc import Iterable
from pathlib import Path

from evocity.errors import RunError
from evocity.store import Run
from evocity.store.lock import is_held
from evocity.studio.breeding import Breeding
from evocity.studio.picks import Picks
from evocity.studio.solids import Solids
from evocity.studio.watched import Watched

#: Runs that are taken from a folder, at most.
MOST_RUNS = 500


class Opened:
    """One run: its folder while one looks at it, who is picked of it, broods of it. Raises
    `RunError` if it cannot be read, or is damaged."""

    def __init__(self, path: Path):
        self.watched = Watched(path)
        self.solids = Solids(self.watched)
        self.picks = Picks(self.watched.path)
        self.breeding = Breeding()
        #: Of the drawing board, one child a brood.
        self.drawn = Breeding()


class Runs:
    """Runs by number, 0 upwards, which none changes as long as studio lives: those at ``paths``,
    then those within ``folder``, which is looked at again and again. A run is opened when it is
    first asked for. Raises `RunError` for a path that is no run, and for a folder that is none,
    unless it ``may_lack``."""

    def __init__(
        self,
        paths: Iterable[str | Path],
        folder: str | Path | None = None,
        may_lack: bool = False,
    ):
        self._lock = threading.RLock()
        self._paths: list[Path] = []
        self._opened: dict[int, Opened] = {}
        self._folder = None if folder is None else Path(folder).resolve()
        #: Runs of the folder that are not taken, for there are too many.
        self.more = 0
        for path in paths:
            self.add(Run(path).path)
        if self._folder is not None and not (may_lack and not os.path.lexists(self._folder)):
            _within(self._folder)
        if self._paths:
            _ = self[0]  # what is damaged is told before anything is answered
        self.told()

    def __len__(self) -> int:
        return len(self._paths)

    def __getitem__(self, number: int) -> Opened:
        with self._lock:
            if number not in self._opened:
                self._opened[number] = Opened(self._paths[number])
            return self._opened[number]

    def add(self, path: str | Path) -> int:
        """The number of the run at ``path``, from now on."""
        path = Path(path).resolve()
        with self._lock:
            if path not in self._paths:
                self._paths.append(path)
            return self._paths.index(path)

    def told(self) -> list[dict]:
        """Each run's number, a name that no other has, and whether it is bred by a process now."""
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
        """Take what is new in the folder; one that is gone has nothing new."""
        if self._folder is None:
            return
        try:
            found = _within(self._folder)
        except RunError:
            return
        new = [path for path in found if path not in self._paths]
        room = max(0, MOST_RUNS - len(self._paths))
        self.more = len(new[room:])
        self._paths += new[:room]

    def breeding(self, run: Opened, board: bool = False) -> Breeding:
        """The broods of a ``run``, those of its ``board`` or the others, for one to begin: other
        workers end. Raises `RunError` while another is bred, for one is at a time."""
        with self._lock:
            wanted = run.drawn if board else run.breeding
            every = [two for one in self._opened.values() for two in (one.breeding, one.drawn)]
            others = [one for one in every if one is not wanted]
            if any(one.busy for one in others):
                raise RunError(
                    "another brood is being bred, of another run or in another pane",
                    "one at a time",
                    "wait for it, or stop it",
                )
            for one in others:
                one.rest()
            return wanted

    def close(self) -> None:
        for one in self._opened.values():
            one.breeding.close()
            one.drawn.close()


def _is_going(path: Path) -> bool:
    with contextlib.suppress(RunError):  # told by the run itself
        return is_held(path / "lock")
    return False


def _within(folder: Path) -> list[Path]:
    """The runs in a ``folder``, by name. Raises `RunError` where it cannot be read."""
    try:
        with os.scandir(folder) as listed:
            names = sorted(one.name for one in listed if not one.name.startswith("."))
    except OSError as error:
        raise RunError(
            f"{folder}: {error.strerror or error}",
            "a folder with runs in it, each a folder written by `evocity run`",
            "name another",
        ) from None
    found = (folder / name for name in names)
    return [path.resolve() for path in found if os.path.lexists(path / "provenance.json")]


__all__ = ["MOST_RUNS", "Opened", "Runs"]
