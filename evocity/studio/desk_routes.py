"""The addresses of the recipe desk, ``/api/desk`` and ``/api/desk-NAME``."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, PlainTextResponse, Response

from evocity.errors import EvocityError, MapError, reason_of
from evocity.fitness import Measure
from evocity.studio import guard
from evocity.studio.desk import BeginRequest, Desk, MapNumber
from evocity.studio.desk_draft import Draft
from evocity.studio.request_fields import Body, RequestError, fault_of, number
from evocity.studio.runs import Runs
from evocity.studio.subprocesses import RunProcesses

_LARGEST = 2**31 - 1
_LONGEST_NAME = 1000
_BYTES = "application/octet-stream"


@dataclass(frozen=True)
class StudioOptions:
    """Options of the command line: the ``folder`` of runs; whether it is ``fresh`` and may be
    missing; ``files`` of measures, each with its measures; a ``recipe`` to begin as it is; the
    folder of a ``library`` of objects for 3D views."""

    folder: Path | None = None
    fresh: bool = False
    files: Sequence[tuple[str, Sequence[Measure]]] = ()
    recipe: Path | None = None
    library: Path | None = None


class DeskRoutes:
    """The answers of the desk; its runs join ``runs``."""

    def __init__(self, runs: Runs, options: StudioOptions):
        folder = options.folder
        if folder is None:
            folder = runs[0].watcher.path.parent if len(runs) else Path("runs")
        self.processes = RunProcesses()
        self.desk = Desk(
            folder.resolve(),
            self.processes,
            runs.add,
            options.files,
            options.recipe,
            lambda: runs.paths,
        )

    @property
    def questions(self) -> Mapping[str, Callable[[Request], object]]:
        return {
            "desk": lambda request: self._state(),
            "desk-measures": lambda request: {"measures": self.desk.measures()},
            "desk-picture": lambda request: self._of_map(request, "picture", "image/png"),
            "desk-overview": lambda request: self._of_map(request, "overview", _BYTES),
        }

    @property
    def changes(self) -> Mapping[str, tuple[type[Body], Callable[[Body], object]]]:
        """Addresses that change the desk, each with its body; the answer is the new state."""
        desk = self.desk
        acts: dict[str, tuple[type[Body], Callable]] = {
            "desk-change": (Draft, desk.change),
            "desk-drop": (MapNumber, desk.drop),
            "desk-calibrate": (Body, lambda body: desk.calibrate()),
            "desk-stop": (Body, lambda body: desk.stop()),
            "desk-begin": (BeginRequest, desk.begin),
            "desk-end": (MapNumber, desk.end),
        }
        return {name: (kind, self._then_state(act)) for name, (kind, act) in acts.items()}

    def _state(self) -> dict:
        return self.desk.state() | {"longest": guard.MOST_FILE}

    def _then_state(self, act: Callable[[Body], None]) -> Callable[[Body], dict]:
        def answer(body: Body) -> dict:
            act(body)
            return self._state()

        return answer

    def _of_map(self, request: Request, what: str, kind: str) -> Response:
        """Answer with the picture or the overview of a ``map``; other arguments only distinguish it
        from earlier ones."""
        read = getattr(self.desk.maps, what)
        content = read(number(request.query_params, "map", 0, _LARGEST))
        return Response(content, media_type=kind)

    async def file(self, request: Request) -> Response:
        """Take a map that a user brings, called ``name``, or an area if ``area`` is 1; write it as
        it arrives."""
        name, path, is_kept = request.query_params.get("name", ""), None, False
        try:
            if not 0 < len(name) <= _LONGEST_NAME:
                raise RequestError(
                    "the uploaded file has no name",
                    "a file with a name",
                    "load the page again, and choose the file again",
                )
            try:
                path, suffix = self.desk.maps.begin(name)
            except EvocityError:  # a browser shows the answer only after it has sent the whole file
                async for _ in request.stream():
                    pass
                raise
            with open(path, "xb") as file:
                async for part in request.stream():
                    file.write(part)
            is_area = request.query_params.get("area") == "1"
            add = self.desk.maps.add_area if is_area else self.desk.maps.add
            added = await run_in_threadpool(add, path, name, suffix)
            is_kept = True
            return JSONResponse({"map": added})
        except guard.FileTooLong as error:
            return error.answer
        except EvocityError as error:
            status = 400 if isinstance(error, RequestError) else 409
            return JSONResponse({"error": fault_of(error)}, status, {"connection": "close"})
        except ClientDisconnect:  # no browser waits for the answer
            return PlainTextResponse("the file is incomplete\n", 400)
        except OSError as error:
            fault = MapError(
                f"studio cannot store the uploaded file: {reason_of(error)}",
                "free space in the folder of temporary files",
                "free some space on that disk, and upload the file again",
            )
            return JSONResponse({"error": fault_of(fault)}, 409, {"connection": "close"})
        finally:
            if path is not None and not is_kept:
                path.unlink(missing_ok=True)

    def close(self) -> None:
        self.desk.close()
