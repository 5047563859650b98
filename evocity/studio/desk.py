"""The recipe desk: from maps to a run.

The server holds all choices as one `Draft`, so a page that is loaded again shows them. A process of
its own calibrates a recipe of the draft. `evocity run` carries out the run, and outlives studio. No
text of a page becomes a path or names a file; the command line names the files of measures.
"""

import contextlib
import os
import shutil
import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from evocity import fitness
from evocity.errors import EvocityError, FitnessError, MapError, RecipeError, RunError
from evocity.fitness.measure import Measure
from evocity.recipe.reader import read_recipe
from evocity.search.calibration.recipe_text import describe_forecast
from evocity.studio.desk_areas import USES, is_raster
from evocity.studio.desk_children import KeptChildren
from evocity.studio.desk_draft import MOST_NAME, Draft, OfferedMeasure
from evocity.studio.desk_maps import MEMORY, Maps, Number, without_map
from evocity.studio.output_files import make_folder, write_error, write_recipe
from evocity.studio.request_fields import Body, RequestError, fault_of
from evocity.studio.started_runs import StartedRuns, recipe_folder
from evocity.studio.subprocesses import DeskJob, RunProcesses

#: Parents, and lines of progress that are kept; at most.
MOST_PARENTS, _MOST_LINES = 8, 200


class MapNumber(Body):
    """A request about one map of the desk, or one run that began there."""

    map: Number


class BeginRequest(Body):
    """A request to begin a run by the recipe of the desk, or by the ``given`` one."""

    given: bool = False


class Desk:
    """The desk; its runs go into the folder ``home``. ``files``: measures by file; ``recipe``: a
    recipe to begin as it is; ``number`` gives a number to the run at a path; ``runs`` lists the
    runs whose kept children the desk offers."""

    def __init__(
        self,
        home: Path,
        processes: RunProcesses,
        number: Callable[[Path], int],
        files: Sequence[tuple[str, Sequence[Measure]]] = (),
        recipe: Path | None = None,
        runs: Callable[[], Sequence[Path]] = tuple,
    ):
        self.home, self.given = home.absolute(), recipe
        self._kept = KeptChildren(runs)
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
        self._started = StartedRuns(processes, number)

    # -- state -------------------------------------------------------------------------------------

    def state(self) -> dict:
        """Return plain values for the page."""
        with self._lock:
            result = self._result
            self.maps.add_children(self._kept.children)
            return {
                "draft": self.draft.model_dump(mode="json"),
                "usual": self._usual_name(self.draft),
                "home": str(self.home),
                "maps": self.maps.states(),
                "scale": self.maps.scale,
                "areas": self.maps.area_names(),
                "busy": self.busy,
                "said": self._lines,
                "fault": None if self._fault is None else fault_of(self._fault),
                "found": result and result | {"estimate": self._estimate(result)},
                "given": self._given_recipe(),
                "started": self._started.states(),
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
            "time": describe_forecast(result["duration"]),
            "size": result["size"],
            "free": free,
            "fits": result["size"] <= free,
        }

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
            for area in filter(None, (draft.lock, draft.within)):
                self.maps.check_area(area)
            names = [goal.measure for goal in draft.goals]
            for name in names:
                if name not in self._offered or names.count(name) > 1:
                    raise RequestError(
                        f"the measure {name!r} is unknown, or the goals name it twice",
                        "each measure of the list at most once",
                        "choose another measure",
                    )
            for goal in draft.goals:
                self._offered[goal.measure].check(goal)
            self._check_idle()
            if draft != self.draft:
                self.draft, self._result, self._fault, self._lines = draft, None, None, []
            choices = {choice.map: choice for choice in draft.maps}
            self.maps.place(draft.window, choices, {"lock": draft.lock, "within": draft.within})

    def _check_idle(self) -> None:
        if self.busy:
            raise RunError(
                "studio is already making a recipe",
                "one recipe at a time",
                "wait for that recipe, or stop it",
            )

    def drop(self, request: MapNumber) -> None:
        with self._lock:
            changed: dict[str, Any] = {"maps": without_map(self.draft.maps, request.map)}
            for use in USES:
                area = getattr(self.draft, use)
                if area is not None and area.map == request.map:
                    changed[use] = None
            self.change(self.draft.model_copy(update=changed))
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
            if all(goal.is_constraint for goal in draft.goals):
                raise FitnessError(
                    "all chosen measures are bounds, so the search has no goal",
                    "one or more measures with a goal besides the bounds",
                    "add a measure with a high value, a low value or a target as its goal",
                )
            # the usual goals may lack a measure that a parent does not have; chosen goals may not
            is_usual = set(draft.goals) == set(Draft().goals)
            areas = self._areas(draft)
            site = f"site{areas['within'].suffix}" if "within" in areas else None
            goals = (
                []
                if is_usual
                else [self._offered[goal.measure].goal(goal, site) for goal in draft.goals]
            )
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
                "locked": self._locked(draft, areas),
            }
            path = str(folder / "recipe.toml")
            job = {"job": "calibrate", "words": words, "goals": goals, "path": path}
            self._lines, self._fault, self._result = [], None, None
            self._job = DeskJob(MEMORY, None, "calibrating")
            self._thread = threading.Thread(
                target=self._calibrate, args=(self._job, job), daemon=True, name="calibrating"
            )
            self._thread.start()

    def _areas(self, draft: Draft) -> dict[str, Path]:
        """Return the files of the areas of a ``draft``, by their use. Raises `EvocityError` for an
        area that cannot be used."""
        areas = {use: getattr(draft, use) for use in USES}
        chosen = {choice.map for choice in draft.parents}
        for area in filter(None, areas.values()):
            if area.map not in chosen:
                raise MapError(
                    f"an area lies on the map {self.maps[area.map].title}, which is not a parent",
                    "areas on maps that are parents",
                    "choose this map as a parent, or remove the area",
                )
        return {use: self.maps.marked(use, area) for use, area in areas.items() if area}

    def _child_lock(self, draft: Draft) -> tuple[Path, Path] | None:
        """Return the files of the lock of the first child that has one, unless a lock is drawn."""
        if draft.lock is not None:
            return None
        return next(filter(None, (self.maps.locks(one.map) for one in draft.parents)), None)

    def _locked(self, draft: Draft, areas: Mapping[str, Path]) -> dict[str, str] | None:
        """Return the keys of ``[locked]``."""
        if "lock" not in areas:
            if self._child_lock(draft) is None:
                return None
            return {"mask": "locked.npy", "heights": "locked-heights.npy"}
        key = "mask" if is_raster(areas["lock"]) else "footprints"
        keys = {key: f"locked{areas['lock'].suffix}"}
        if draft.lock is not None and draft.lock.map != draft.parents[0].map:
            keys["city"] = self.maps[draft.lock.map].title
        return keys

    def _copied_maps(self, draft: Draft) -> tuple[Path, list[dict]]:
        """Copy the parents' maps into a new folder; return it, and parents for a recipe there."""
        folder = self.maps.folder / f"recipe-{self._draft_turn}"
        self._draft_turn += 1
        try:
            folder.mkdir()
            return folder, self._copy_all(draft, folder)
        except (EvocityError, OSError) as error:
            shutil.rmtree(folder, ignore_errors=True)
            raise write_error(folder, error) from error

    def _copy_all(self, draft: Draft, folder: Path) -> list[dict]:
        """Copy maps and areas for a recipe into a ``folder``; return its parents."""
        for use, path in self._areas(draft).items():
            shutil.copyfile(path, folder / f"{USES[use]}{path.suffix}")
        if lock := self._child_lock(draft):
            for path, name in zip(lock, ("locked.npy", "locked-heights.npy"), strict=True):
                shutil.copyfile(path, folder / name)
        return [self.maps.copy_chosen(choice, folder) for choice in draft.parents]

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
                path, recipe = self._started.free_path(self.home, run), self.given
            elif self._result is not None and not request.given:
                path, recipe = self._write_recipe(self._result["text"])
                made = recipe.parent
            else:
                raise RunError(
                    "studio has not made a recipe yet",
                    "a finished recipe",
                    "press “make the recipe” first",
                )
            try:
                self._started.begin(path, recipe.resolve())
            except EvocityError:
                if made is not None:
                    shutil.rmtree(made, ignore_errors=True)
                raise

    def _write_recipe(self, text: str) -> tuple[Path, Path]:
        """Write the recipe with its maps beside the run; return the paths of run and recipe."""
        path = self._started.free_path(self.home, self.draft.name or self._usual_name(self.draft))
        folder = make_folder(recipe_folder(path))
        try:
            self._copy_all(self.draft, folder)
            write_recipe(folder / "recipe.toml", text)
        except (EvocityError, OSError) as error:
            shutil.rmtree(folder, ignore_errors=True)
            raise write_error(folder, error) from error
        return path, folder / "recipe.toml"

    def end(self, request: MapNumber) -> None:
        """End a run of this desk, by its place in the list, before it has a folder."""
        with self._lock:
            self._started.end(request.map)

    def close(self) -> None:
        self.stop()
        if self._thread is not None:
            self._thread.join(5.0)
        self.maps.close()
