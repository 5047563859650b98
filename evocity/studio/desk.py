"""The recipe desk: from maps on a table to a run that goes on.

What is chosen there is one `Draft`, which the server holds, so that a page that is loaded again has
it. Of a draft a recipe is calibrated in a process of its own; a run by it is carried out by
`evocity run`, which outlives studio. No word of a page becomes a path, and none names a file: those
of measures are named on the command line.
"""

import contextlib
import os
import shutil
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from evocity import fitness
from evocity.errors import EvocityError, FitnessError, RecipeError, RunError
from evocity.files import whole_file
from evocity.search.calibration import USUAL_GOALS
from evocity.search.opening import open_run
from evocity.search.reading import read_recipe
from evocity.search.recipe_text import duration
from evocity.studio.apart import Carried, Errand
from evocity.studio.asked import Faulty
from evocity.studio.draft import MOST_NAME, Begin, Draft, Wanted, Which
from evocity.studio.maps import MEMORY, Maps, Placed
from evocity.studio.one import fault_of
from evocity.studio.resuming import log_of

#: Parents, at most; lines of what calibrating says that are kept.
MOST_PARENTS, _MOST_SAID = 8, 200
_MOST_NAMES = 10_000


@dataclass(frozen=True)
class Offered:
    """A measure at the desk: of evocity's own, or of a ``file`` named on the command line, which
    may have ``several``."""

    measure: fitness.Measure
    file: str | None = None
    several: bool = False

    @property
    def told(self) -> dict:
        one = self.measure
        return {
            "name": one.name,
            "goal": one.goal,
            "unit": one.unit,
            "range": [value if abs(value) < float("inf") else None for value in one.range],
            "told": one.summary,
            "own": self.file is not None,
            "usual": one.name in USUAL_GOALS,
        }


@dataclass
class Started:
    """A run that was begun at the desk; ``run``: its number, None until it has a folder; whether it
    ``has`` a generation."""

    name: str
    path: Path
    recipe: Path
    run: int | None = None
    has: bool = False

    def look(self, number: Callable[[Path], int]) -> None:
        """See whether it has a folder, which has a ``number`` then, and a generation."""
        if self.run is None and os.path.lexists(self.path / "provenance.json"):
            self.run = number(self.path)
        if not self.has and self.run is not None:
            with contextlib.suppress(RunError):
                self.has = bool(open_run(self.path).generations)


class Desk:
    """Runs begun here go into the folder ``home``. ``files``: of measures, each with what it
    declares; ``recipe``: one to begin by as it is. ``runs`` numbers a run at a path."""

    def __init__(
        self,
        home: Path,
        carried: Carried,
        runs: Callable[[Path], int],
        files: Sequence[tuple[str, Sequence[fitness.Measure]]] = (),
        recipe: Path | None = None,
    ):
        self.home, self.given = home.absolute(), recipe
        self._carried, self._runs = carried, runs
        self._lock = threading.RLock()  # that of the maps is taken within it, never around it
        self.maps = Maps()
        own = [one for one in fitness.measures() if one.origin == "evocity"]
        offered = [Offered(one) for one in own]
        for file, measures in files:
            path = os.path.abspath(file)
            offered += [Offered(one, path, len(measures) > 1) for one in measures]
        self._offered = {one.measure.name: one for one in offered}
        self.draft = Draft()
        self._draft_turn = 0
        self._errand: Errand | None = None
        self._thread: threading.Thread | None = None
        self._said: list[str] = []
        self._fault: EvocityError | None = None
        self._found: dict | None = None
        self._started: list[Started] = []

    # -- told --------------------------------------------------------------------------------------

    def told(self) -> dict:
        """Plain values: the draft, the maps, how far calibrating is, what it found, and the runs
        that were begun here."""
        with self._lock:
            return {
                "draft": self.draft.model_dump(mode="json"),
                "usual": self._usual_name(self.draft),
                "home": str(self.home),
                "maps": self.maps.told(),
                "busy": self.busy,
                "said": self._said,
                "fault": None if self._fault is None else fault_of(self._fault),
                "found": self._found and self._found | {"estimate": self._estimate(self._found)},
                "given": self._given(),
                "started": [self._start_told(one) for one in self._started],
            }

    def measures(self) -> list[dict]:
        """What can be searched by, plain values."""
        return [one.told for one in self._offered.values()]

    @property
    def busy(self) -> bool:
        """Whether a recipe is being calibrated."""
        return self._thread is not None and self._thread.is_alive()

    def _given(self) -> dict | None:
        if self.given is None:
            return None
        with contextlib.suppress(OSError, ValueError):
            return {"path": str(self.given), "text": self.given.read_text(encoding="utf-8")}
        return {"path": str(self.given), "text": ""}

    def _estimate(self, found: dict) -> dict:
        """What a run takes of the night and of the disk."""
        above = self.home
        while not above.is_dir() and above != above.parent:
            above = above.parent
        free = shutil.disk_usage(above).free
        return {
            "births": found["births"],
            "time": duration(found["duration"]),
            "size": found["size"],
            "free": free,
            "fits": found["size"] <= free,
        }

    def _start_told(self, one: Started) -> dict:
        one.look(self._runs)
        process = self._carried.told(one.path) or {}
        return {
            "name": one.name,
            "folder": str(one.path),
            "recipe": str(one.recipe),
            "run": one.run,
            "has": one.has,
            **process,
        }

    # -- the draft ---------------------------------------------------------------------------------

    def change(self, draft: Draft) -> None:
        """Take a draft in place of the one before; a recipe that was calibrated for another is
        none of it. Raises `Faulty` for maps and measures that there are not."""
        with self._lock:
            for one in draft.maps:
                _ = self.maps[one.map]
            if len({one.map for one in draft.maps}) < len(draft.maps):
                raise Faulty("a map twice", "each once", "load the page again")
            names = [one.measure for one in draft.goals]
            for name in names:
                if name not in self._offered or names.count(name) > 1:
                    raise Faulty(f"{name!r} as goal", "a measure of the list, once", "choose it")
            if self.busy:
                raise RunError("a recipe is being calibrated", "one at a time", "wait, or stop it")
            if draft != self.draft:
                self.draft, self._found, self._fault, self._said = draft, None, None, []
            self.maps.place(draft.window, {one.map: one for one in draft.maps})

    def drop(self, asked: Which) -> None:
        """Take a user's map from the desk."""
        with self._lock:
            kept = tuple(one for one in self.draft.maps if one.map != asked.map)
            self.change(self.draft.model_copy(update={"maps": kept}))
            self.maps.drop(asked.map)

    def _usual_name(self, draft: Draft) -> str:
        titles = [self.maps[one.map].title for one in draft.parents if one.map in self.maps]
        name = "-x-".join(title.replace(" ", "-") for title in titles).lstrip(".")
        while len(name.encode()) > MOST_NAME or len(name) > 100:
            name = name[:-1]
        return name or "run"

    # -- calibrating -------------------------------------------------------------------------------

    def calibrate(self) -> None:
        """Have a recipe made of the draft. Raises `EvocityError` for what is no draft of a run, and
        where its maps cannot be laid out; then nothing is left."""
        with self._lock:
            if self.busy:
                raise RunError("a recipe is being calibrated", "one at a time", "wait, or stop it")
            draft = self.draft
            if not 1 <= len(draft.parents) <= MOST_PARENTS:
                raise RecipeError(
                    f"{len(draft.parents)} maps are chosen",
                    f"1 to {MOST_PARENTS}, better two or more",
                    "choose maps that shall be bred",
                )
            if not draft.goals:
                raise FitnessError("no measure is chosen", "one or more", "choose some")
            # the usual ones may lack where a parent does not have them; what is chosen may not
            is_usual = set(draft.goals) == set(Draft().goals)
            goals = [] if is_usual else [self._goal(one) for one in draft.goals]
            folder, parents = self._gathered(draft)
            words = {
                "name": draft.name or self._usual_name(draft),
                "parents": parents,
                **draft.window.model_dump(),
                "population": draft.population,
                "generations": draft.generations,
                "seed": draft.seed,
                "minutes": draft.minutes,
                "by": "evocity studio",
            }
            errand = {
                "errand": "calibrate",
                "words": words,
                "goals": goals,
                "path": str(folder / "recipe.toml"),
            }
            self._said, self._fault, self._found = [], None, None
            self._errand = Errand(MEMORY, None, "calibrating")
            self._thread = threading.Thread(
                target=self._calibrate, args=(self._errand, errand), daemon=True, name="calibrating"
            )
            self._thread.start()

    def _goal(self, one: Wanted) -> dict:
        offered = self._offered[one.measure]
        if one.want == "target" and one.target is None:
            raise FitnessError(f"{one.measure}: no target", "a number", "write one")
        if one.want == "first" and offered.measure.goal is not None:
            raise FitnessError(
                f"{one.measure}: what the first has", "high, low or a target", "choose another"
            )
        chosen = one.want if one.want in ("max", "min") else None
        return {
            "measure": one.measure,
            "file": offered.file,
            "several": offered.several,
            "goal": None if chosen == offered.measure.goal else chosen,
            "target": one.target if one.want == "target" else None,
        }

    def _gathered(self, draft: Draft) -> tuple[Path, list[dict]]:
        """A new folder with the parents' maps, and each parent as a recipe in there has it."""
        folder = self.maps.folder / f"recipe-{self._draft_turn}"
        self._draft_turn += 1
        try:
            folder.mkdir()
            return folder, [self._parent(one, folder) for one in draft.parents]
        except (EvocityError, OSError) as error:
            shutil.rmtree(folder, ignore_errors=True)
            raise _unwritten(folder, error) from error

    def _parent(self, placed: Placed, folder: Path) -> dict:
        one = self.maps[placed.map]
        named = {"name": one.title} if one.is_own else {}
        return {"map": self.maps.copy(placed.map, folder)} | named | placed.options

    def _calibrate(self, errand: Errand, job: dict) -> None:
        def told(said: dict) -> None:
            with self._lock:
                if "said" in said:
                    self._said = [*self._said, said["said"]][-_MOST_SAID:]
                if "calibrated" in said:
                    self._found = said["calibrated"]

        try:
            errand.run(job, told)
            if errand.stopped:
                self._said, self._found = [*self._said, "stopped"], None
        except EvocityError as error:
            self._fault = error
        except Exception as error:  # told on the page
            self._fault = RunError(f"{type(error).__name__}: {error}", "no error", "try again")
        finally:
            shutil.rmtree(Path(job["path"]).parent, ignore_errors=True)

    def stop(self) -> None:
        """Calibrate no more."""
        if self._errand is not None:
            self._errand.stop()

    # -- a run -------------------------------------------------------------------------------------

    def begin(self, asked: Begin) -> None:
        """Carry out the recipe, in a new folder. Raises `RunError` where there is none, and where
        nothing can be written; then nothing is left."""
        with self._lock:
            made = None  # for this run alone
            if asked.given and self.given is not None:
                run = read_recipe(self.given).run.name  # its measures were executed already
                path, recipe = self._free(run, None), self.given
            elif self._found is not None and not asked.given:
                path, recipe = self._written(self._found["text"])
                made = recipe.parent
            else:
                raise RunError("no recipe", "one that was calibrated", "calibrate one first")
            started = Started(path.name, path, recipe.resolve())
            words = ["run", str(started.recipe), "--out", str(path)]
            try:
                self._carried.begin(path, words, log_of(path))
            except EvocityError:
                if made is not None:
                    shutil.rmtree(made, ignore_errors=True)
                raise
            self._started.append(started)

    def _written(self, text: str) -> tuple[Path, Path]:
        """Where the run goes, and its recipe, which lies with its maps in a folder beside it."""
        path = self._free(self.draft.name or self._usual_name(self.draft), True)
        folder = path.with_name(f"{path.name}-recipe")
        try:
            for one in self.draft.parents:
                self.maps.copy(one.map, folder)
            with whole_file(folder / "recipe.toml") as temporary:
                temporary.write_text(text, encoding="utf-8")
            read_recipe(folder / "recipe.toml")  # that it can be run is known before it is told
        except (EvocityError, OSError) as error:
            shutil.rmtree(folder, ignore_errors=True)
            raise _unwritten(folder, error) from error
        return path, folder / "recipe.toml"

    def _free(self, name: str, with_recipe: bool | None) -> Path:
        """Where a run called so, or nearly, can go; the folder of its recipe is made, if wanted."""
        try:
            self.home.mkdir(parents=True, exist_ok=True)
            taken = {one.path for one in self._started if self._carried.is_at(one.path)}
            for number in range(1, _MOST_NAMES):
                path = self.home / (name if number == 1 else f"{name}-{number}")
                folder = path.with_name(f"{path.name}-recipe")
                if path in taken or os.path.lexists(path) or os.path.lexists(folder):
                    continue
                if with_recipe:
                    folder.mkdir()
                return path
        except OSError as error:
            raise _unwritten(self.home, error) from error
        raise RunError(f"{self.home} has {_MOST_NAMES} runs {name}", "room", "choose another name")

    def end(self, place: int) -> None:
        """End a run that was begun here before it has a folder; later `evocity stop` does."""
        with self._lock:
            if not 0 <= place < len(self._started):
                raise Faulty(f"no run {place}", "one that was begun here", "load the page again")
            self._carried.end(self._started[place].path)

    def close(self) -> None:
        self.stop()
        if self._thread is not None:
            self._thread.join(5.0)
        self.maps.close()


def _unwritten(folder: Path, error: Exception) -> EvocityError:
    if isinstance(error, EvocityError):
        return error
    return RunError(
        f"{folder} cannot be written: {getattr(error, 'strerror', None) or error}",
        "a folder that this user may write to, with room left",
        "check its owner, and the space left",
    )


__all__ = ["Desk"]
