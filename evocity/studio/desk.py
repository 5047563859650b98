"""The recipe desk: from maps to a run.

The server holds all choices as one `Draft`, so a page that is loaded again shows them. A process of
its own calibrates a recipe of the draft. `evocity run` carries out the run, and outlives studio. No
text of a page becomes a path or names a file; the command line names the files of measures.
"""

import contextlib
import os
import shutil
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from evocity import fitness
from evocity.errors import EvocityError, FitnessError, RecipeError, RunError
from evocity.recipe.reader import read_recipe
from evocity.recipe.values import Title
from evocity.search.calibration.calibration import OF_PARENTS, USUAL_GOALS
from evocity.search.calibration.recipe_text import describe_duration
from evocity.search.record.complete_run import CompleteRun
from evocity.studio.desk_maps import MEMORY, MapChoice, Maps, Number, Window, without_map
from evocity.studio.output_files import free_path, make_folder, write_error, write_recipe
from evocity.studio.request_fields import Body, RequestError, fault_of, typed_field, whole_field
from evocity.studio.subprocesses import DeskJob, RunProcesses, log_of

#: Parents, and lines of progress that are kept; at most.
MOST_PARENTS, _MOST_LINES = 8, 200


#: Goals, at most; bytes of a name, so that a folder can have it.
MOST_GOALS, MOST_NAME = 12, 200
_YEAR = 60 * 24 * 365  # minutes
_NAME = (
    f'a name of at most 100 letters and {MOST_NAME} bytes, without any of / \\ : * ? " < > | '
    "and without a dot at its start"
)


def _check_name(name: str) -> str:
    if len(name.encode()) > MOST_NAME or not name.isprintable():
        raise ValueError(f"a printable name of at most {MOST_NAME} bytes")
    return name


class GoalChoice(Body):
    """A measure to search by: highest or lowest value, ``target``, value of the first parent, or
    mean of the parents' maps."""

    measure: Annotated[str, Field(max_length=200)]
    want: Literal["max", "min", "target", "first", "parents"]
    target: Annotated[float | None, typed_field("target", "a number")] = None


class Draft(Body):
    """All choices at the desk. An empty ``name`` stands for a name made of the parents' names."""

    name: Annotated[
        Annotated[Title, AfterValidator(_check_name)] | Literal[""],
        typed_field("name of the run", _NAME),
    ] = ""
    seed: Annotated[int, whole_field("seed", 0, 2**53 - 1)] = 7
    population: Annotated[int, whole_field("individuals alive", 2, 1_000_000)] = 48
    generations: Annotated[int, whole_field("generations", 1, 1_000_000)] = 100
    minutes: Annotated[
        float | None, typed_field("minutes", f"a number from 1 to {_YEAR}", ge=1, le=_YEAR)
    ] = None
    window: Window = Window()
    maps: Annotated[tuple[MapChoice, ...], Field(max_length=64)] = ()
    goals: Annotated[tuple[GoalChoice, ...], Field(max_length=MOST_GOALS)] = tuple(
        GoalChoice(
            measure=name,
            want="parents" if name in OF_PARENTS else fitness.get(name).goal or "first",
        )
        for name in USUAL_GOALS
    )

    @property
    def parents(self) -> list[MapChoice]:
        return [choice for choice in self.maps if choice.chosen]


class MapNumber(Body):
    """A request about one map of the desk, or one run that began there."""

    map: Number


class BeginRequest(Body):
    """A request to begin a run by the recipe of the desk, or by the ``given`` one."""

    given: bool = False


@dataclass(frozen=True)
class OfferedMeasure:
    """A measure of evocity, or of a ``file`` of the command line, which may have ``several``."""

    measure: fitness.Measure
    file: str | None = None
    several: bool = False

    @property
    def state(self) -> dict:
        measure = self.measure
        return {
            "name": measure.name,
            "goal": measure.goal,
            "unit": measure.unit,
            "range": [end if abs(end) < float("inf") else None for end in measure.range],
            "told": measure.summary,
            "own": self.file is not None,
            "usual": measure.name in USUAL_GOALS,
        }


@dataclass
class StartedRun:
    """A run that began at the desk; ``has``: whether it has a generation."""

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


class Desk:
    """The desk; its runs go into the folder ``home``. ``files``: measures by file; ``recipe``: a
    recipe to begin as it is; ``number`` gives a number to the run at a path."""

    def __init__(
        self,
        home: Path,
        processes: RunProcesses,
        number: Callable[[Path], int],
        files: Sequence[tuple[str, Sequence[fitness.Measure]]] = (),
        recipe: Path | None = None,
    ):
        self.home, self.given = home.absolute(), recipe
        self._processes, self._number = processes, number
        self._lock = threading.RLock()  # taken before the lock of the maps, never after it
        self.maps = Maps()
        ours = (one for one in fitness.measures() if one.origin == "evocity")
        offered = [OfferedMeasure(one) for one in ours]
        for file, measures in files:
            path = os.path.abspath(file)
            offered += [OfferedMeasure(one, path, len(measures) > 1) for one in measures]
        self._offered = {one.measure.name: one for one in offered}
        self.draft = Draft()
        self._draft_turn = 0
        self._job: DeskJob | None = None
        self._thread: threading.Thread | None = None
        self._lines: list[str] = []
        self._fault: EvocityError | None = None
        self._result: dict | None = None
        self._started: list[StartedRun] = []

    # -- state -------------------------------------------------------------------------------------

    def state(self) -> dict:
        """Return plain values for the page."""
        with self._lock:
            result = self._result
            return {
                "draft": self.draft.model_dump(mode="json"),
                "usual": self._usual_name(self.draft),
                "home": str(self.home),
                "maps": self.maps.states(),
                "busy": self.busy,
                "said": self._lines,
                "fault": None if self._fault is None else fault_of(self._fault),
                "found": result and result | {"estimate": self._estimate(result)},
                "given": self._given_recipe(),
                "started": [self._state_of(run) for run in self._started],
            }

    def measures(self) -> list[dict]:
        return [offered.state for offered in self._offered.values()]

    @property
    def busy(self) -> bool:
        return self._thread is not None and self._thread.is_alive()

    def _given_recipe(self) -> dict | None:
        if self.given is None:
            return None
        text = ""
        with contextlib.suppress(OSError, ValueError):
            text = self.given.read_text(encoding="utf-8")
        return {"path": str(self.given), "text": text}

    def _estimate(self, result: dict) -> dict:
        above = self.home
        while not above.is_dir() and above != above.parent:
            above = above.parent
        free = shutil.disk_usage(above).free
        return {
            "births": result["births"],
            "time": describe_duration(result["duration"]),
            "size": result["size"],
            "free": free,
            "fits": result["size"] <= free,
        }

    def _state_of(self, started: StartedRun) -> dict:
        started.look(self._number)
        paths = {"folder": str(started.folder), "recipe": str(started.recipe)}
        return vars(started) | paths | (self._processes.state(started.folder) or {})

    # -- the draft ---------------------------------------------------------------------------------

    def change(self, draft: Draft) -> None:
        """Replace the draft; a recipe for another draft is dropped."""
        with self._lock:
            for choice in draft.maps:
                self.maps.check(choice)
            if len({choice.map for choice in draft.maps}) < len(draft.maps):
                raise RequestError(
                    "the page chose one map twice",
                    "maps that are all different",
                    "load the page again, and choose the maps again",
                )
            names = [goal.measure for goal in draft.goals]
            for name in names:
                if name not in self._offered or names.count(name) > 1:
                    raise RequestError(
                        f"the measure {name!r} is unknown, or the goals name it twice",
                        "each measure of the list at most once",
                        "choose another measure",
                    )
            self._check_idle()
            if draft != self.draft:
                self.draft, self._result, self._fault, self._lines = draft, None, None, []
            self.maps.place(draft.window, {choice.map: choice for choice in draft.maps})

    def _check_idle(self) -> None:
        if self.busy:
            raise RunError(
                "studio is already making a recipe",
                "one recipe at a time",
                "wait for that recipe, or stop it",
            )

    def drop(self, request: MapNumber) -> None:
        with self._lock:
            kept = without_map(self.draft.maps, request.map)
            self.change(self.draft.model_copy(update={"maps": kept}))
            self.maps.drop(request.map)

    def _usual_name(self, draft: Draft) -> str:
        titles = [self.maps[one.map].title for one in draft.parents if one.map in self.maps]
        name = "-x-".join(title.replace(" ", "-") for title in titles).lstrip(".")
        while len(name.encode()) > MOST_NAME or len(name) > 100:
            name = name[:-1]
        return name or "run"

    # -- calibration -------------------------------------------------------------------------------

    def calibrate(self) -> None:
        """Begin the calibration of a recipe for the draft. After an error no file remains."""
        with self._lock:
            self._check_idle()
            draft = self.draft
            if not 1 <= len(draft.parents) <= MOST_PARENTS:
                raise RecipeError(
                    f"the choice has {len(draft.parents)} maps as parents",
                    f"1 to {MOST_PARENTS} maps, preferably two or more",
                    "change the number of maps",
                )
            if not draft.goals:
                raise FitnessError(
                    "the choice has no measure as a goal",
                    "one or more measures",
                    "add a measure to the goals",
                )
            # the usual goals may lack a measure that a parent does not have; chosen goals may not
            is_usual = set(draft.goals) == set(Draft().goals)
            goals = [] if is_usual else [self._goal(goal) for goal in draft.goals]
            folder, parents = self._copied_maps(draft)
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
            path = str(folder / "recipe.toml")
            job = {"job": "calibrate", "words": words, "goals": goals, "path": path}
            self._lines, self._fault, self._result = [], None, None
            self._job = DeskJob(MEMORY, None, "calibrating")
            self._thread = threading.Thread(
                target=self._calibrate, args=(self._job, job), daemon=True, name="calibrating"
            )
            self._thread.start()

    def _goal(self, choice: GoalChoice) -> dict:
        offered = self._offered[choice.measure]
        if choice.want == "target" and choice.target is None:
            raise FitnessError(
                f"the goal of the measure {choice.measure} is a target without a number",
                "a number as target",
                "type the target, or choose another goal",
            )
        if choice.want == "first" and offered.measure.goal is not None:
            raise FitnessError(
                f"the measure {choice.measure} cannot have the goal “the value of the first "
                "parent”",
                "the goal of a high value, a low value, or a target",
                "choose one of these goals",
            )
        goal = choice.want if choice.want in ("max", "min") else None
        return {
            "measure": choice.measure,
            "file": offered.file,
            "several": offered.several,
            "goal": None if goal == offered.measure.goal else goal,
            "target": choice.target if choice.want == "target" else None,
            "of_parents": choice.want == "parents",
        }

    def _copied_maps(self, draft: Draft) -> tuple[Path, list[dict]]:
        """Copy the parents' maps into a new folder; return it, and parents for a recipe there."""
        folder = self.maps.folder / f"recipe-{self._draft_turn}"
        self._draft_turn += 1
        try:
            folder.mkdir()
            return folder, [self._parent(choice, folder) for choice in draft.parents]
        except (EvocityError, OSError) as error:
            shutil.rmtree(folder, ignore_errors=True)
            raise write_error(folder, error) from error

    def _parent(self, choice: MapChoice, folder: Path) -> dict:
        entry = self.maps[choice.map]
        named = {"name": entry.title} if entry.is_own else {}
        return self.maps.copy_chosen(choice, folder) | named | choice.options

    def _calibrate(self, process: DeskJob, job: dict) -> None:
        def receive(result: dict) -> None:
            with self._lock:
                if "said" in result:
                    self._lines = [*self._lines, result["said"]][-_MOST_LINES:]
                if "calibrated" in result:
                    self._result = result["calibrated"]

        try:
            process.run(job, receive)
            if process.stopped:
                self._lines, self._result = [*self._lines, "stopped"], None
        except EvocityError as error:
            self._fault = error
        except Exception as error:  # the page shows it
            self._fault = RunError(
                f"studio could not make the recipe: {type(error).__name__}: {error}",
                "a recipe without errors",
                "correct the choices that the error names, and make the recipe again",
            )
        finally:
            shutil.rmtree(Path(job["path"]).parent, ignore_errors=True)

    def stop(self) -> None:
        if self._job is not None:
            self._job.stop()

    # -- a run -------------------------------------------------------------------------------------

    def begin(self, request: BeginRequest) -> None:
        """Carry out the recipe, in a new folder. After an error no file remains."""
        with self._lock:
            made = None  # a folder for this run only
            if request.given and self.given is not None:
                run = read_recipe(self.given).run.name  # its measures were executed already
                path, recipe = self._free_path(run, False), self.given
            elif self._result is not None and not request.given:
                path, recipe = self._write_recipe(self._result["text"])
                made = recipe.parent
            else:
                raise RunError(
                    "studio has not made a recipe yet",
                    "a finished recipe",
                    "press “make the recipe” first",
                )
            started = StartedRun(path.name, path, recipe.resolve())
            words = ["run", str(started.recipe), "--out", str(path)]
            try:
                self._processes.begin(path, words, log_of(path))
            except EvocityError:
                if made is not None:
                    shutil.rmtree(made, ignore_errors=True)
                raise
            self._started.append(started)

    def _write_recipe(self, text: str) -> tuple[Path, Path]:
        """Write the recipe with its maps beside the run; return the paths of run and recipe."""
        path = self._free_path(self.draft.name or self._usual_name(self.draft), True)
        folder = path.with_name(f"{path.name}-recipe")
        try:
            for choice in self.draft.parents:
                self.maps.copy_chosen(choice, folder)
            write_recipe(folder / "recipe.toml", text)
        except (EvocityError, OSError) as error:
            shutil.rmtree(folder, ignore_errors=True)
            raise write_error(folder, error) from error
        return path, folder / "recipe.toml"

    def _free_path(self, name: str, with_recipe: bool) -> Path:
        """Return a free path for a run; make the folder of its recipe ``with_recipe``."""
        taken = {run.folder for run in self._started if self._processes.is_busy(run.folder)}

        def is_free(path: Path) -> bool:
            folder = path.with_name(f"{path.name}-recipe")
            return path not in taken and not os.path.lexists(path) and not os.path.lexists(folder)

        path = free_path(self.home, name, is_free)
        if with_recipe:
            make_folder(path.with_name(f"{path.name}-recipe"))
        return path

    def end(self, request: MapNumber) -> None:
        """End a run of this desk, by its place in the list, before it has a folder."""
        with self._lock:
            place = request.map
            if not 0 <= place < len(self._started):
                raise RequestError(
                    f"the list of started runs has no run {place}",
                    "a run that this page started",
                    "load the page again",
                )
            self._processes.end(self._started[place].folder)

    def close(self) -> None:
        self.stop()
        if self._thread is not None:
            self._thread.join(5.0)
        self.maps.close()
