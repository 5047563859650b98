"""The addresses of studio and their answers. Ids are numbers; no part of a request becomes a path.
Only the page's own files and these answers have an address."""

import tempfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from evocity.analysis.arguments import check_count
from evocity.analysis.distributions import QUANTITIES
from evocity.analysis.individual import fabric_of
from evocity.analysis.page.page import PARTS
from evocity.coding.usage import COUNTS
from evocity.scene import Library
from evocity.search.calibration.recipe_text import describe_duration
from evocity.studio import birth_details as details
from evocity.studio.answers import (
    BYTES,
    Answer,
    Handler,
    RunChange,
    RunHandler,
    answer_safely,
    file_answer,
    page_files,
    parse_change,
    parse_query,
)
from evocity.studio.birth_details import Comparison, SceneOptions, compare_births
from evocity.studio.birth_growth import GrowthFile, GrowthRequest
from evocity.studio.children import (
    MOST_PARENTS,
    Brood,
    ReadyRequest,
    list_operators,
    reasons_against,
)
from evocity.studio.desk_routes import DeskRoutes, StudioOptions
from evocity.studio.drawing_board import BOARD, board_of, hatched
from evocity.studio.exports import ExportRequest, Exports, list_formats, subjects_of
from evocity.studio.filters import FieldPicture, FieldRequest, FilterKeepRequest, FilterRequest
from evocity.studio.guard import FILE
from evocity.studio.kept_children import KeepRequest, keep_children
from evocity.studio.modeller_runs import Modeller
from evocity.studio.picks import PickChange
from evocity.studio.request_fields import (
    Body,
    Id,
    RequestError,
    number,
    numbers,
)
from evocity.studio.runs import OpenRun, Runs
from evocity.studio.subprocesses import ResumeRequest, resume_run, stop_run
from evocity.viewer.sheet import MOST, SIDES, Sheet

#: Births in one zip, at most.
MOST_SAVED = 100
_SAVED = {"zip": "application/zip", "png": "image/png", "csv": "text/csv; charset=utf-8"}
_LARGEST = 2**31 - 1  # the page holds ids as int32
#: A reader of an argument in a query.
Argument = Callable[[Mapping[str, str]], object]


class SteerRequest(Body):
    """A request to a running run: to ``pick`` births to breed from too, or to ``drop`` them."""

    steer: Annotated[str, Field(pattern="^(pick|drop)$")]
    ids: Annotated[list[Id], Field(min_length=1, max_length=1000)]


class BirthIds(Body):
    ids: Annotated[list[Id], Field(min_length=1)]


class Studio:
    """The answers about the runs at ``paths``, the runs in the folder of the ``options``, and the
    desk. Addresses of one run are ``/api/NUMBER/NAME``, all others ``/api/NAME``."""

    def __init__(self, paths: Iterable[str | Path], options: StudioOptions):
        library = None if options.library is None else Library.read(options.library)
        self.runs = Runs(paths, options.folder, options.fresh, library)
        self.desk_routes = DeskRoutes(self.runs, options)
        self.exports = Exports()
        desk = self.desk_routes
        self.modeller = Modeller(desk.desk.home, desk.processes, self.runs.add)
        questions: dict[str, Handler] = {
            "runs": lambda request: {"runs": self.runs.states(), "more": self.runs.more},
            **self.desk_routes.questions,
            **self.modeller.questions,
        }
        run_questions: dict[str, RunHandler] = {
            "changes": self.changes,
            "births": self.births,
            "part": lambda run, request: {"value": run.watcher.part(_PART(request.query_params))},
            "tiles": self.tiles,
            **{name: _details(*parts) for name, parts in _DETAILS.items()},
            "solids": self.solids,
            "scene-options": lambda run, request: {"library": self.runs.library is not None},
            "board": self.board,
            "brood": self.brood,
            "brood-tiles": self.brood_tiles,
            "brood-picture": self.brood_picture,
            "operators": self.operators,
            "lock": self.lock,
            "formats": lambda run, request: list_formats(run.watcher.moment.run),
            "picks": lambda run, request: run.picks.state(),
            "filtered": parse_query(FilterRequest, lambda run, body: run.filters.heights(body)),
            "field": parse_query(FieldPicture, lambda run, body: run.autosimilarity.picture(body)),
            "growth-file": lambda run, request: run.growth.file(self.desk_routes.processes),
            "grown": parse_query(GrowthRequest, lambda run, body: run.growth.heights(body)),
        }
        run_changes: dict[str, tuple[type[Body], RunChange]] = {
            "pick": (PickChange, self.pick),
            "steer": (SteerRequest, self.steer),
            "compare": (Comparison, self.compare),
            "ready": (ReadyRequest, self.ready),
            "breed": (Brood, self.breed),
            "stop": (Body, self.stop),
            "keep": (KeepRequest, self.keep),
            "export": (ExportRequest, self.export),
            **{suffix: (BirthIds, partial(self.saved, suffix)) for suffix in _SAVED},
            "filter-keep": (
                FilterKeepRequest,
                lambda run, body: run.filters.keep(body, run.picks.is_own),
            ),
            "fields": (FieldRequest, lambda run, body: run.autosimilarity.begin(body)),
            "fields-stop": (Body, lambda run, body: run.autosimilarity.stop()),
            "grow": (GrowthRequest, lambda run, body: run.growth.begin(body)),
            "grow-stop": (Body, lambda run, body: run.growth.stop()),
            "grow-save": (GrowthFile, self.save_growth),
            "stop-run": (Body, self.stop_run),
            "resume": (ResumeRequest, self.resume),
        }
        routes = [Route(address, file_answer(*file)) for address, file in page_files().items()]
        routes += [
            Route(f"/api/{name}", answer_safely(answer)) for name, answer in questions.items()
        ]
        for name, answer in run_questions.items():
            routes.append(Route(f"/api/{{run}}/{name}", answer_safely(self._of_run(answer))))
        for name, (kind, change) in run_changes.items():
            answer = answer_safely(self._of_run(parse_change(kind, change)))
            routes.append(Route(f"/api/{{run}}/{name}", answer, methods=["POST"]))
        for name, (kind, act) in [*desk.changes.items(), *self.modeller.changes.items()]:
            routes.append(
                Route(f"/api/{name}", answer_safely(parse_change(kind, act)), methods=["POST"])
            )
        routes.append(Route(FILE, self.desk_routes.file, methods=["POST"]))
        self.app = Starlette(routes=routes)
        self.app.router.redirect_slashes = False

    def close(self) -> None:
        self.exports.close()
        self.desk_routes.close()
        self.runs.close()

    def _of_run(self, answer: RunHandler) -> Handler:
        def answer_of_run(request: Request) -> Answer:
            run = number(request.path_params, "run", 0, len(self.runs) - 1)
            return answer(self.runs[run], request)

        return answer_of_run

    # -- questions ---------------------------------------------------------------------------

    def changes(self, run: OpenRun, request: Request) -> dict:
        """Answer with `RunWatcher.news`, whether there are ``more`` births, the `outlook`, the
        generations ``planned``, and the ``process``."""
        after = number(request.query_params, "after", -1, _LARGEST)
        news = run.watcher.news()
        process = self.desk_routes.processes.state(run.watcher.path)
        extra = {} if process is None else {"process": process}
        if news["generation"] >= 0 and news["problem"] is None:
            with run.watcher.reading:
                moment = run.watcher.moment
                extra |= moment.outlook | {"planned": moment.planned}
            if extra["seconds_left"]:
                extra["time_left"] = describe_duration(extra["seconds_left"])
        return news | {"more": news["generation"] > after} | extra

    def births(self, run: OpenRun, request: Request) -> bytes:
        with run.watcher.reading:
            run.watcher.news()
            return run.watcher.moment.buffer

    def tiles(self, run: OpenRun, request: Request) -> Sheet:
        ids = numbers(request.query_params, "ids", MOST)
        side = number(request.query_params, "side", *SIDES)
        if side not in SIDES:
            raise RequestError(
                f"side = {side} is invalid",
                f"one of the widths {SIDES} in pixels",
                "choose one of these widths",
            )
        return run.watcher.sheet([n for n in ids if 0 <= n <= _LARGEST], side)

    def solids(self, run: OpenRun, request: Request) -> tuple[dict, bytes]:
        query = request.query_params
        options = {one.name: bool(number(query, one.name, 0, 1, 0)) for one in fields(SceneOptions)}
        return run.solids.of(number(query, "id", 0, _LARGEST), SceneOptions(**options))

    def compare(self, run: OpenRun, request: Comparison) -> bytes:
        """Answer with distances, see `compare_births`; ids may be many, so a body has them."""
        with run.watcher.reading:
            return compare_births(run.watcher.moment, request)

    # -- changes -----------------------------------------------------------------------------

    def pick(self, run: OpenRun, request: PickChange) -> dict:
        return run.picks.change(request, set(run.watcher.moment.table.ids.tolist()))

    def steer(self, run: OpenRun, request: SteerRequest) -> dict:
        from evocity.search.record import commands

        kind = commands.Pick if request.steer == "pick" else commands.Unpick
        command = kind(ids=tuple(request.ids))
        going = commands.send(run.watcher.path, command)
        return {"words": command.words, "going": going}

    def stop_run(self, run: OpenRun, request: Body) -> dict:
        stop_run(run.watcher.path)
        return {}

    def resume(self, run: OpenRun, request: ResumeRequest) -> dict:
        resume_run(run.watcher.path, self.desk_routes.processes, request)
        return {}

    # -- children ----------------------------------------------------------------------------

    def operators(self, run: OpenRun, request: Request) -> dict:
        """Answer with the operators, each with the reason why it does not suit the births."""
        parents = numbers(request.query_params, "ids", MOST_PARENTS) if request.query_params else ()
        with run.watcher.reading:
            moment = run.watcher.moment
            reasons = reasons_against(moment, run.breeding.genomes(moment, parents).values())
        return {"operators": list_operators(reasons)}

    def lock(self, run: OpenRun, request: Request) -> Response:
        """Answer with a hatched picture of the lock of the run, empty without a lock."""
        header, layer = run.watcher.moment.run.header, run.watcher.moment.run.condensation
        none = np.zeros((header.height, header.width), bool)
        return _png(details.png_of)(hatched(none if layer is None else layer.mask))

    def brood(self, run: OpenRun, request: Request) -> dict:
        return run.broods(_is_board(request)).state()

    def brood_tiles(self, run: OpenRun, request: Request) -> Sheet:
        children = numbers(request.query_params, "ids", MOST)
        return run.broods(_is_board(request)).sheet(_brood_of(request), children, SIDES[0])

    def brood_picture(self, run: OpenRun, request: Request) -> Response:
        child = number(request.query_params, "id", 0, _LARGEST)
        picture = run.broods(_is_board(request)).picture(_brood_of(request), child)
        return Response(details.png_of(picture), media_type="image/png")

    def board(self, run: OpenRun, request: Request) -> tuple[dict, bytes]:
        ids = numbers(request.query_params, "ids", 2)
        if len(ids) != 2:
            raise RequestError(
                "the request compares a birth with itself",
                "two different births",
                "choose another birth for the comparison",
            )
        with run.watcher.reading:
            opened = run.watcher.moment.run
            return board_of([fabric_of(opened.header, opened.genome(n), BOARD) for n in ids])

    def ready(self, run: OpenRun, request: ReadyRequest) -> dict:
        if self.runs.is_busy_beside(run, request.board):
            return run.broods(request.board).state() | {"waits": True}
        breeding = self.runs.breeding(run, request.board)
        with run.watcher.reading:
            breeding.prepare(run.watcher.moment, request.parents)
        return breeding.state()

    def breed(self, run: OpenRun, request: Brood) -> dict:
        breeding = self.runs.breeding(run, request.board)
        with run.watcher.reading:
            breeding.begin(request, run.watcher.moment)
        return breeding.state()

    def stop(self, run: OpenRun, request: Body) -> dict:
        run.breeding.stop()
        return run.breeding.state()

    def keep(self, run: OpenRun, request: KeepRequest) -> dict:
        with run.watcher.reading:
            opened, broods = run.watcher.moment.run, run.broods(request.board)
            return keep_children(opened, broods, request, run.picks.is_own)

    def save_growth(self, run: OpenRun, request: GrowthFile) -> dict:
        """Write a grown fabric by `evocity grow`; answer with the state of the process."""
        return run.growth.save(request, self.desk_routes.processes, run.picks.is_own)

    def export(self, run: OpenRun, request: ExportRequest) -> Response:
        """Answer with births or children as a file of another program."""
        with run.watcher.reading:
            subjects = subjects_of(run.watcher.moment.run, run.broods(request.board), request)
        name, content = self.exports.write(run.watcher.moment.run, subjects, request)
        about = {"content-disposition": f'attachment; filename="{name}"'}
        return Response(content, media_type=BYTES, headers=about)

    # -- files -------------------------------------------------------------------------------

    def saved(self, suffix: str, run: OpenRun, request: BirthIds) -> Response:
        """Answer with births as files in a zip, on a contact sheet, or as a table."""
        ids = list(dict.fromkeys(request.ids))
        if suffix == "zip":
            check_count("births in a zip", len(ids), MOST_SAVED)
        with run.watcher.reading, tempfile.TemporaryDirectory() as folder:
            births, path = run.watcher.moment.run, Path(folder) / f"births.{suffix}"
            if suffix == "csv":
                births.to_csv(path, of=ids)
            else:
                births.save(ids, path)
            content = path.read_bytes()
        return Response(content, media_type=_SAVED[suffix])


def _is_board(request: Request) -> bool:
    return bool(number(request.query_params, "board", 0, 1, 0))


def _brood_of(request: Request) -> int:
    return number(request.query_params, "brood", 0, _LARGEST)


def _word(name: str, known: Iterable[str]) -> Argument:
    """Return a reader of the word ``name`` of a query, which must be ``known``."""

    def read(query: Mapping[str, str]) -> str:
        word, words = query.get(name), list(known)
        if word not in words:
            raise RequestError(
                f"the query parameter {name!r} has an unknown value",
                f"{name} = {' or '.join(words)}",
                "choose one of the expected values",
            )
        return word

    return read


def _other_birth(query: Mapping[str, str]) -> int | None:
    other = number(query, "beside", -1, _LARGEST, -1)
    return None if other < 0 else other


def _details(function: Callable[..., Answer], *readers: Argument) -> RunHandler:
    """Return a handler for one birth; the ``readers`` find further arguments in the query."""

    def answer(run: OpenRun, request: Request) -> Answer:
        arguments = [read(request.query_params) for read in readers]
        identifier = number(request.query_params, "id", 0, _LARGEST)
        with run.watcher.reading:
            return function(run.watcher.moment, identifier, *arguments)

    return answer


def _png(function: Callable[..., bytes]) -> Callable[..., Response]:
    return lambda *arguments: Response(function(*arguments), media_type="image/png")


_PART = _word("name", PARTS)
# The answers about one birth, and the further arguments of each.
_DETAILS: dict[str, tuple[Callable, ...]] = {
    "one": (details.describe_birth,),
    "picture": (_png(details.picture_of), _word("kind", details.PICTURES), _other_birth),
    "heights": (details.heights_of,),
    "calls": (details.call_counts_of, _word("count", COUNTS), _other_birth),
    "difference": (details.difference_of, lambda query: number(query, "beside", 0, _LARGEST)),
    "buildings": (details.buildings_of, _word("of", QUANTITIES), _other_birth),
}
