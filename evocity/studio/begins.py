"""The addresses of the recipe desk, ``/api/desk`` and ``/api/desk-NAME``, and of a run that is
stopped or resumed."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, PlainTextResponse, Response

from evocity.errors import EvocityError, MapError
from evocity.fitness import Measure
from evocity.studio import guard
from evocity.studio.apart import Carried
from evocity.studio.asked import Body, Faulty, body_of, number
from evocity.studio.desk import Desk
from evocity.studio.draft import Begin, Draft, Which
from evocity.studio.one import fault_of
from evocity.studio.resuming import Resume, resume, stop
from evocity.studio.runs import Opened, Runs

_LARGEST = 2**31 - 1
_LONGEST_NAME = 1000


@dataclass(frozen=True)
class Begins:
    """What the command line tells of the desk: the folder ``into`` which runs go, None for beside
    the first run that is shown, else `runs`, and whether that is ``fresh``, and may lack until the
    first; ``files`` of measures, each with what it declares; a ``recipe`` that is offered as it is.
    """

    into: Path | None = None
    fresh: bool = False
    files: Sequence[tuple[str, Sequence[Measure]]] = ()
    recipe: Path | None = None


class DeskAnswers:
    """Of the desk; runs that are begun there are shown among ``runs``."""

    def __init__(self, runs: Runs, begins: Begins):
        into = begins.into
        if into is None:
            into = runs[0].watched.path.parent if len(runs) else Path("runs")
        self.carried = Carried()
        self.desk = Desk(into.resolve(), self.carried, runs.add, begins.files, begins.recipe)

    @property
    def asked(self) -> Mapping[str, Callable[[Request], Response]]:
        return {
            "desk": lambda request: self._told(),
            "desk-measures": lambda request: JSONResponse({"measures": self.desk.measures()}),
            "desk-picture": self.picture,
        }

    @property
    def changed(self) -> Mapping[str, Callable[[Request], Response]]:
        desk = self.desk
        return {
            "desk-change": self._then(Draft, desk.change),
            "desk-drop": self._then(Which, desk.drop),
            "desk-calibrate": self._then(Body, lambda asked: desk.calibrate()),
            "desk-stop": self._then(Body, lambda asked: desk.stop()),
            "desk-begin": self._then(Begin, desk.begin),
            "desk-end": self._then(Which, lambda asked: desk.end(asked.map)),
        }

    @property
    def changed_of_run(self) -> Mapping[str, Callable[[Opened, Request], Response]]:
        return {"stop-run": self.stop_run, "resume": self.resume}

    def _told(self) -> Response:
        return JSONResponse(self.desk.told() | {"longest": guard.MOST_FILE})

    def _then(self, kind: type[Body], change: Callable[[Body], None]):
        def answered(request: Request) -> Response:
            change(body_of(kind, request.state.body))
            return self._told()

        return answered

    def picture(self, request: Request) -> Response:
        """Of a ``map``; ``turn`` tells one from those before."""
        content = self.desk.maps.picture(number(request.query_params, "map", 0, _LARGEST))
        return Response(content, media_type="image/png")

    async def file(self, request: Request) -> Response:
        """A map that a user brings, called ``name``: written as it comes, never held in memory."""
        name, path = request.query_params.get("name", ""), None
        try:
            if not 0 < len(name) <= _LONGEST_NAME:
                raise Faulty("a file without a name", "its name", "load the page again")
            try:
                path, suffix = self.desk.maps.begin(name)
            except EvocityError:  # a browser sees the answer only once all is sent
                async for _ in request.stream():
                    pass
                raise
            with open(path, "xb") as file:
                async for part in request.stream():
                    file.write(part)
            laid = await run_in_threadpool(self.desk.maps.add, path, name, suffix)
            return JSONResponse({"map": laid})
        except guard.TooLong as error:
            _removed(path)
            return error.answer
        except EvocityError as error:
            _removed(path)
            status = 400 if isinstance(error, Faulty) else 409
            return JSONResponse({"error": fault_of(error)}, status, {"connection": "close"})
        except ClientDisconnect:  # nobody waits for an answer
            _removed(path)
            return PlainTextResponse("the file was cut off\n", 400)
        except OSError as error:
            _removed(path)
            fault = MapError(
                f"the file cannot be kept: {error.strerror or error}",
                "room for it in the folder of temporary files",
                "check the space left",
            )
            return JSONResponse({"error": fault_of(fault)}, 409, {"connection": "close"})

    def stop_run(self, run: Opened, request: Request) -> Response:
        body_of(Body, request.state.body)
        stop(run.watched.path)
        return JSONResponse({})

    def resume(self, run: Opened, request: Request) -> Response:
        resume(run.watched.path, self.carried, body_of(Resume, request.state.body))
        return JSONResponse({})

    def close(self) -> None:
        self.desk.close()


def _removed(path: Path | None) -> None:
    if path is not None:
        path.unlink(missing_ok=True)


__all__ = ["Begins", "DeskAnswers"]
