"""Which address is answered by what. Ids are numbers; no part of a request ever becomes a path."""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

from pydantic import Field
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from evocity.analysis.asked import check_count
from evocity.errors import EvocityError
from evocity.studio.asked import Body, Faulty, body_of, number, numbers
from evocity.studio.breeding import Breeding, Brood, Ready, operators_told
from evocity.studio.files import files
from evocity.studio.keeping import Keep, keep
from evocity.studio.one import (
    MOST_STEPS,
    PICTURES,
    fault_of,
    heights_of,
    pedigree_of,
    picture_of,
    png_of,
    told_of,
)
from evocity.studio.picks import Change, Id, Picks
from evocity.studio.watched import Watched, framed
from evocity.viewer.sheet import MOST, SIDES

#: Births in one zip, at most.
MOST_SAVED = 100
_LARGEST = 2**31 - 1  # the page has ids as int32
_BYTES = "application/octet-stream"

Answer = Callable[[Request], Response]


class Steer(Body):
    """What a run that goes on is asked for: to breed from picks too, or from these no longer."""

    steer: Annotated[str, Field(pattern="^(pick|drop)$")]
    ids: Annotated[list[Id], Field(min_length=1, max_length=1000)]


class Some(Body):
    """Births that are asked for as files."""

    ids: Annotated[list[Id], Field(min_length=1)]


class Studio:
    """What is answered of the run in the folder ``path``. Raises `RunError` if there is none."""

    def __init__(self, path: str | Path):
        self.watched = Watched(path)
        self.picks = Picks(self.watched.path)
        self.breeding = Breeding()
        asked: dict[str, Answer] = {
            "/api/changes": self.changes,
            "/api/births": self.births,
            "/api/tiles": self.tiles,
            "/api/one": self.one,
            "/api/picture": self.picture,
            "/api/pedigree": self.pedigree,
            "/api/heights": self.heights,
            "/api/operators": self.operators,
            "/api/brood": self.brood,
            "/api/brood-tiles": self.brood_tiles,
            "/api/brood-picture": self.brood_picture,
            "/api/picks": lambda request: JSONResponse(self.picks.told()),
        }
        changed: dict[str, Answer] = {
            "/api/pick": self.pick,
            "/api/steer": self.steer,
            "/api/ready": self.ready,
            "/api/breed": self.breed,
            "/api/stop": self.stop,
            "/api/keep": self.keep,
            "/api/zip": self.zip,
            "/api/png": self.png,
            "/api/csv": self.csv,
        }
        routes = [Route(address, _file(*one)) for address, one in files().items()]
        routes += [Route(address, _safely(answer)) for address, answer in asked.items()]
        routes += [
            Route(address, _safely(answer), methods=["POST"]) for address, answer in changed.items()
        ]
        self.app = Starlette(routes=routes)
        self.app.router.redirect_slashes = False

    # -- asked -------------------------------------------------------------------------------

    def changes(self, request: Request) -> Response:
        """What is new since a generation: `Watched.news`, and whether there are births ``more``."""
        after = number(request.query_params, "after", -1, _LARGEST)
        news = self.watched.news()
        return JSONResponse(news | {"more": news["generation"] > after})

    def births(self, request: Request) -> Response:
        """All births of whole generations, as columns."""
        with self.watched.reading:
            self.watched.news()
            return Response(self.watched.moment.buffer, media_type=_BYTES)

    def tiles(self, request: Request) -> Response:
        """Small pictures of ``ids``, one image; of a ``side``."""
        ids = numbers(request.query_params, "ids", MOST)
        side = number(request.query_params, "side", *SIDES)
        if side not in SIDES:
            raise Faulty(f"side = {side}", f"one of {SIDES}", "ask for one of them")
        sheet = self.watched.sheet([one for one in ids if 0 <= one <= _LARGEST], side)
        return Response(framed(sheet.about, sheet.image), media_type=_BYTES)

    def one(self, request: Request) -> Response:
        return JSONResponse(self._of_one(request, told_of))

    def picture(self, request: Request) -> Response:
        """A ``kind`` of picture."""
        kind = request.query_params.get("kind")
        if kind not in PICTURES:
            raise Faulty("no such picture", f"kind = {' or '.join(PICTURES)}", "ask for one")
        content = self._of_one(request, lambda moment, one: picture_of(moment, one, kind))
        return Response(content, media_type="image/png")

    def pedigree(self, request: Request) -> Response:
        """So many ``steps`` back."""
        steps = number(request.query_params, "steps", 1, MOST_STEPS, 4)
        return JSONResponse(self._of_one(request, lambda m, one: pedigree_of(m, one, steps)))

    def heights(self, request: Request) -> Response:
        return Response(framed(*self._of_one(request, heights_of)), media_type=_BYTES)

    def _of_one(self, request: Request, told: Callable):
        identifier = number(request.query_params, "id", 0, _LARGEST)
        with self.watched.reading:
            return told(self.watched.moment, identifier)

    # -- changed -----------------------------------------------------------------------------

    def pick(self, request: Request) -> Response:
        asked = body_of(Change, request.state.body)
        known = set(self.watched.moment.table.ids.tolist())
        return JSONResponse(self.picks.change(asked, known))

    def steer(self, request: Request) -> Response:
        """Asked of the run itself, as `evocity pick` does."""
        from evocity.search import commands

        asked = body_of(Steer, request.state.body)
        kind = commands.Pick if asked.steer == "pick" else commands.Unpick
        command = kind(ids=tuple(asked.ids))
        going = commands.send(self.watched.path, command)
        return JSONResponse({"words": command.words, "going": going})

    # -- children ----------------------------------------------------------------------------

    def operators(self, request: Request) -> Response:
        """By what children may be bred."""
        return JSONResponse({"operators": operators_told()})

    def brood(self, request: Request) -> Response:
        return JSONResponse(self.breeding.told())

    def brood_tiles(self, request: Request) -> Response:
        """Small pictures of children, ``ids`` their numbers."""
        numbered = numbers(request.query_params, "ids", MOST)
        sheet = self.breeding.sheet(self._brood_of(request), numbered, SIDES[0])
        return Response(framed(sheet.about, sheet.image), media_type=_BYTES)

    def brood_picture(self, request: Request) -> Response:
        one = number(request.query_params, "id", 0, _LARGEST)
        picture = self.breeding.picture(self._brood_of(request), one)
        return Response(png_of(picture), media_type="image/png")

    def _brood_of(self, request: Request) -> int:
        return number(request.query_params, "brood", 0, _LARGEST)

    def ready(self, request: Request) -> Response:
        asked = body_of(Ready, request.state.body)
        with self.watched.reading:
            self.breeding.ready(self.watched.moment, asked.parents)
        return JSONResponse(self.breeding.told())

    def breed(self, request: Request) -> Response:
        asked = body_of(Brood, request.state.body)
        with self.watched.reading:
            self.breeding.begin(asked, self.watched.moment)
        return JSONResponse(self.breeding.told())

    def stop(self, request: Request) -> Response:
        body_of(Body, request.state.body)
        self.breeding.stop()
        return JSONResponse(self.breeding.told())

    def keep(self, request: Request) -> Response:
        asked = body_of(Keep, request.state.body)
        with self.watched.reading:
            moment = self.watched.moment
            moment.run.told.rows(asked.picks)  # all are births
            return JSONResponse(keep(moment.run, self.breeding, asked, self.picks.is_own))

    # -- files -------------------------------------------------------------------------------

    def zip(self, request: Request) -> Response:
        """Births as files, with their scores and whom to thank."""
        ids = self._some(request)
        check_count("births in a zip", len(ids), MOST_SAVED)
        return self._saved(ids, "births.zip", "application/zip")

    def png(self, request: Request) -> Response:
        """Births on a contact sheet."""
        return self._saved(self._some(request), "births.png", "image/png")

    def csv(self, request: Request) -> Response:
        """Scores of births as a table."""
        return self._saved(self._some(request), "births.csv", "text/csv; charset=utf-8")

    def _some(self, request: Request) -> list[int]:
        return list(dict.fromkeys(body_of(Some, request.state.body).ids))

    def _saved(self, ids: list[int], name: str, kind: str) -> Response:
        with self.watched.reading, tempfile.TemporaryDirectory() as folder:
            run, path = self.watched.moment.run, Path(folder) / name
            if name.endswith(".csv"):
                run.to_csv(path, of=ids)
            else:
                run.save(ids, path)
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
