"""Which address is answered by what. Ids are numbers; no part of a request ever becomes a path."""

import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Annotated

from pydantic import Field
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from evocity.analysis.asked import check_count
from evocity.analysis.fabrics import fabric_of
from evocity.errors import EvocityError
from evocity.studio.asked import Body, Faulty, body_of, number, numbers
from evocity.studio.begins import Begins, DeskAnswers
from evocity.studio.beside import QUANTITIES, buildings_of, difference_of
from evocity.studio.breeding import Breeding, Brood, Ready, operators_told
from evocity.studio.comparing import Compare, compared
from evocity.studio.drawing import BOARD, board_of
from evocity.studio.files import files
from evocity.studio.guard import FILE
from evocity.studio.keeping import Keep, keep
from evocity.studio.one import (
    COUNTS,
    MOST_STEPS,
    PICTURES,
    calls_of,
    fault_of,
    heights_of,
    pedigree_of,
    picture_of,
    png_of,
    told_of,
)
from evocity.studio.picks import Change, Id
from evocity.studio.runs import Opened, Runs
from evocity.studio.watched import framed
from evocity.viewer.sheet import MOST, SIDES

#: Births in one zip, at most.
MOST_SAVED = 100
_LARGEST = 2**31 - 1  # the page has ids as int32
_BYTES = "application/octet-stream"

Answer = Callable[[Request], Response]
#: Of one run.
OfRun = Callable[[Opened, Request], Response]


class Steer(Body):
    """What a run that goes on is asked for: to breed from picks too, or from these no longer."""

    steer: Annotated[str, Field(pattern="^(pick|drop)$")]
    ids: Annotated[list[Id], Field(min_length=1, max_length=1000)]


class Some(Body):
    """Births that are asked for as files."""

    ids: Annotated[list[Id], Field(min_length=1)]


class Studio:
    """What is answered of the runs at ``paths``, of those within ``folder``, and of the desk where
    runs begin, as ``begins`` tells. Raises `RunError` as `Runs`.

    Addresses of one run are ``/api/NUMBER/NAME``, those of all ``/api/NAME``.
    """

    def __init__(
        self,
        paths: Iterable[str | Path],
        folder: str | Path | None = None,
        begins: Begins | None = None,
    ):
        begins = Begins(None if folder is None else Path(folder)) if begins is None else begins
        self.runs = Runs(paths, folder, begins.fresh)
        self._begins = DeskAnswers(self.runs, begins)
        asked: dict[str, Answer] = {
            "runs": lambda request: JSONResponse(
                {"runs": self.runs.told(), "more": self.runs.more}
            ),
            "operators": lambda request: JSONResponse({"operators": operators_told()}),
            **self._begins.asked,
        }
        asked_of_run: dict[str, OfRun] = {
            "changes": self.changes,
            "births": self.births,
            "tiles": self.tiles,
            "one": self.one,
            "picture": self.picture,
            "pedigree": self.pedigree,
            "heights": self.heights,
            "solids": self.solids,
            "calls": self.calls,
            "difference": self.difference,
            "buildings": self.buildings,
            "board": self.board,
            "brood": self.brood,
            "brood-tiles": self.brood_tiles,
            "brood-picture": self.brood_picture,
            "picks": lambda one, request: JSONResponse(one.picks.told()),
        }
        changed_of_run: dict[str, OfRun] = {
            "pick": self.pick,
            "steer": self.steer,
            "compare": self.compare,
            "ready": self.ready,
            "breed": self.breed,
            "stop": self.stop,
            "keep": self.keep,
            "zip": self.zip,
            "png": self.png,
            "csv": self.csv,
            **self._begins.changed_of_run,
        }
        routes = [Route(address, _file(*one)) for address, one in files().items()]
        routes += [Route(f"/api/{name}", _safely(answer)) for name, answer in asked.items()]
        for method, answers in (("GET", asked_of_run), ("POST", changed_of_run)):
            routes += [
                Route(f"/api/{{run}}/{name}", _safely(self._of_run(answer)), methods=[method])
                for name, answer in answers.items()
            ]
        changed = self._begins.changed.items()
        routes += [Route(f"/api/{name}", _safely(one), methods=["POST"]) for name, one in changed]
        routes.append(Route(FILE, self._begins.file, methods=["POST"]))
        self.app = Starlette(routes=routes)
        self.app.router.redirect_slashes = False

    def close(self) -> None:
        self._begins.close()
        self.runs.close()

    def _of_run(self, answer: OfRun) -> Answer:
        def answered(request: Request) -> Response:
            run = number(request.path_params, "run", 0, len(self.runs) - 1)
            return answer(self.runs[run], request)

        return answered

    # -- asked -------------------------------------------------------------------------------

    def changes(self, run: Opened, request: Request) -> Response:
        """What is new since a generation: `Watched.news`, and whether there are births ``more``;
        what became of the ``process``, if studio began one."""
        after = number(request.query_params, "after", -1, _LARGEST)
        news = run.watched.news()
        process = self._begins.carried.told(run.watched.path)
        began = {} if process is None else {"process": process}
        return JSONResponse(news | {"more": news["generation"] > after} | began)

    def births(self, run: Opened, request: Request) -> Response:
        """All births of whole generations, as columns."""
        with run.watched.reading:
            run.watched.news()
            return Response(run.watched.moment.buffer, media_type=_BYTES)

    def tiles(self, run: Opened, request: Request) -> Response:
        """Small pictures of ``ids``, one image; of a ``side``."""
        ids = numbers(request.query_params, "ids", MOST)
        side = number(request.query_params, "side", *SIDES)
        if side not in SIDES:
            raise Faulty(f"side = {side}", f"one of {SIDES}", "ask for one of them")
        sheet = run.watched.sheet([one for one in ids if 0 <= one <= _LARGEST], side)
        return Response(framed(sheet.about, sheet.image), media_type=_BYTES)

    def one(self, run: Opened, request: Request) -> Response:
        return JSONResponse(self._of_one(run, request, told_of))

    def picture(self, run: Opened, request: Request) -> Response:
        """A ``kind`` of picture, on one scale with a birth ``beside`` it."""
        kind = request.query_params.get("kind")
        if kind not in PICTURES:
            raise Faulty("no such picture", f"kind = {' or '.join(PICTURES)}", "ask for one")
        other = self._beside(request)
        content = self._of_one(run, request, lambda m, one: picture_of(m, one, kind, other))
        return Response(content, media_type="image/png")

    def pedigree(self, run: Opened, request: Request) -> Response:
        """So many ``steps`` back."""
        steps = number(request.query_params, "steps", 1, MOST_STEPS, 4)
        return JSONResponse(self._of_one(run, request, lambda m, one: pedigree_of(m, one, steps)))

    def heights(self, run: Opened, request: Request) -> Response:
        return Response(framed(*self._of_one(run, request, heights_of)), media_type=_BYTES)

    def solids(self, run: Opened, request: Request) -> Response:
        """`Solids`."""
        content = run.solids.of(number(request.query_params, "id", 0, _LARGEST))
        return Response(content, media_type=_BYTES)

    def calls(self, run: Opened, request: Request) -> Response:
        """Of a ``count``, how often it calls its own parts, as picture; as `picture`."""
        count = request.query_params.get("count")
        if count not in COUNTS:
            raise Faulty("no such count", f"count = {' or '.join(COUNTS)}", "ask for one")
        other = self._beside(request)
        content = self._of_one(run, request, lambda m, one: calls_of(m, one, count, other))
        return Response(framed(*content), media_type=_BYTES)

    def difference(self, run: Opened, request: Request) -> Response:
        """What it has more and less than the one ``beside`` it."""
        other = number(request.query_params, "beside", 0, _LARGEST)
        content = self._of_one(run, request, lambda m, one: difference_of(m, one, other))
        return Response(framed(*content), media_type=_BYTES)

    def buildings(self, run: Opened, request: Request) -> Response:
        """How its buildings are distributed, by one of `QUANTITIES`."""
        of, other = request.query_params.get("of"), self._beside(request)
        if of not in QUANTITIES:
            raise Faulty("no such quantity", f"of = {' or '.join(QUANTITIES)}", "ask for one")
        return JSONResponse(
            self._of_one(run, request, lambda m, one: buildings_of(m, one, of, other))
        )

    def _beside(self, request: Request) -> int | None:
        other = number(request.query_params, "beside", -1, _LARGEST, -1)
        return None if other < 0 else other

    def _of_one(self, run: Opened, request: Request, told: Callable):
        identifier = number(request.query_params, "id", 0, _LARGEST)
        with run.watched.reading:
            return told(run.watched.moment, identifier)

    def compare(self, run: Opened, request: Request) -> Response:
        """How births differ, see `compared`; many ids, so asked for by a body."""
        asked = body_of(Compare, request.state.body)
        with run.watched.reading:
            return Response(compared(run.watched.moment, asked), media_type=_BYTES)

    # -- changed -----------------------------------------------------------------------------

    def pick(self, run: Opened, request: Request) -> Response:
        asked = body_of(Change, request.state.body)
        known = set(run.watched.moment.table.ids.tolist())
        return JSONResponse(run.picks.change(asked, known))

    def steer(self, run: Opened, request: Request) -> Response:
        """Asked of the run itself, as `evocity pick` does."""
        from evocity.search import commands

        asked = body_of(Steer, request.state.body)
        kind = commands.Pick if asked.steer == "pick" else commands.Unpick
        command = kind(ids=tuple(asked.ids))
        going = commands.send(run.watched.path, command)
        return JSONResponse({"words": command.words, "going": going})

    # -- children ----------------------------------------------------------------------------

    def brood(self, run: Opened, request: Request) -> Response:
        return JSONResponse(self._broods(run, request).told())

    def brood_tiles(self, run: Opened, request: Request) -> Response:
        """Small pictures of children, ``ids`` their numbers."""
        numbered = numbers(request.query_params, "ids", MOST)
        sheet = self._broods(run, request).sheet(self._brood_of(request), numbered, SIDES[0])
        return Response(framed(sheet.about, sheet.image), media_type=_BYTES)

    def brood_picture(self, run: Opened, request: Request) -> Response:
        one = number(request.query_params, "id", 0, _LARGEST)
        picture = self._broods(run, request).picture(self._brood_of(request), one)
        return Response(png_of(picture), media_type="image/png")

    def _broods(self, run: Opened, request: Request) -> Breeding:
        """Those of the ``board``, or the others."""
        return run.drawn if number(request.query_params, "board", 0, 1, 0) else run.breeding

    def board(self, run: Opened, request: Request) -> Response:
        """What can be drawn over two births, ``ids``."""
        ids = numbers(request.query_params, "ids", 2)
        if len(ids) != 2:
            raise Faulty("one birth", "two to draw over", "choose another for one of them")
        with run.watched.reading:
            found = run.watched.moment.run
            parents = [fabric_of(found.header, found.genome(one), BOARD) for one in ids]
        return Response(framed(*board_of(parents)), media_type=_BYTES)

    def _brood_of(self, request: Request) -> int:
        return number(request.query_params, "brood", 0, _LARGEST)

    def ready(self, run: Opened, request: Request) -> Response:
        asked = body_of(Ready, request.state.body)
        breeding = self.runs.breeding(run, asked.board)
        with run.watched.reading:
            breeding.ready(run.watched.moment, asked.parents)
        return JSONResponse(breeding.told())

    def breed(self, run: Opened, request: Request) -> Response:
        asked = body_of(Brood, request.state.body)
        breeding = self.runs.breeding(run, asked.board)
        with run.watched.reading:
            breeding.begin(asked, run.watched.moment)
        return JSONResponse(breeding.told())

    def stop(self, run: Opened, request: Request) -> Response:
        body_of(Body, request.state.body)
        run.breeding.stop()
        return JSONResponse(run.breeding.told())

    def keep(self, run: Opened, request: Request) -> Response:
        asked = body_of(Keep, request.state.body)
        with run.watched.reading:
            moment = run.watched.moment
            moment.run.told.rows(asked.picks)  # all are births
            broods = run.drawn if asked.board else run.breeding
            return JSONResponse(keep(moment.run, broods, asked, run.picks.is_own))

    # -- files -------------------------------------------------------------------------------

    def zip(self, run: Opened, request: Request) -> Response:
        """Births as files, with their scores and whom to thank."""
        ids = self._some(request)
        check_count("births in a zip", len(ids), MOST_SAVED)
        return self._saved(run, ids, "births.zip", "application/zip")

    def png(self, run: Opened, request: Request) -> Response:
        """Births on a contact sheet."""
        return self._saved(run, self._some(request), "births.png", "image/png")

    def csv(self, run: Opened, request: Request) -> Response:
        """Scores of births as a table."""
        return self._saved(run, self._some(request), "births.csv", "text/csv; charset=utf-8")

    def _some(self, request: Request) -> list[int]:
        return list(dict.fromkeys(body_of(Some, request.state.body).ids))

    def _saved(self, run: Opened, ids: list[int], name: str, kind: str) -> Response:
        with run.watched.reading, tempfile.TemporaryDirectory() as folder:
            births, path = run.watched.moment.run, Path(folder) / name
            if name.endswith(".csv"):
                births.to_csv(path, of=ids)
            else:
                births.save(ids, path)
            content = path.read_bytes()
        return Response(content, media_type=kind)


def _file(kind: str, content: bytes):
    async def answer(request: Request) -> Response:
        return Response(content, headers={"content-type": kind})

    return answer


def _safely(answer: Answer):
    """``answer``, in a thread; what is at fault is told in three parts."""

    async def answered(request: Request) -> Response:
        if request.method == "POST":
            request.state.body = await request.body()
        try:
            return await run_in_threadpool(answer, request)
        except Faulty as error:
            return JSONResponse({"error": fault_of(error)}, 400)
        except EvocityError as error:
            return JSONResponse({"error": fault_of(error)}, 409)

    return answered


__all__ = ["MOST_SAVED", "Studio"]
