"""The addresses of the modeller, and the runs that begin there.

Their folders have fixed names, beside the runs; no text of the page becomes a path.
"""

import json
import shlex
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

from starlette.requests import Request
from starlette.responses import Response

from evocity.errors import EvocityError
from evocity.io.bundled_cities import DISTRICTS
from evocity.studio import modeller, modeller_pictures
from evocity.studio.desk import MapNumber
from evocity.studio.modeller import FileText, MorphRequest, ShapeFields
from evocity.studio.modeller_pictures import PictureRequest
from evocity.studio.modeller_recipes import UseRequest, parts_of, recipe_text
from evocity.studio.output_files import make_folder, write_error, write_recipe
from evocity.studio.request_fields import Body
from evocity.studio.started_runs import StartedRuns, recipe_folder
from evocity.studio.subprocesses import RunProcesses


class Modeller:
    """The answers to the modeller; runs go into the folder ``home``, and ``add`` numbers them."""

    def __init__(self, home: Path, processes: RunProcesses, add: Callable[[Path], int]):
        self.home, self._started = home, StartedRuns(processes, add)

    @property
    def questions(self) -> Mapping[str, Callable[[Request], object]]:
        return {
            "modeller": lambda request: {
                "starts": modeller.starts(),
                "cities": sorted(DISTRICTS),
                "home": str(self.home),
                "started": self.started(),
            },
            "modeller-runs": lambda request: {"started": self.started()},
        }

    @property
    def changes(self) -> Mapping[str, tuple[type[Body], Callable]]:
        return {
            "modeller-open": (FileText, modeller.open_file),
            "modeller-morph": (MorphRequest, modeller.prepare_morph),
            "modeller-json": (ShapeFields, _json_file),
            "modeller-picture": (PictureRequest, _picture),
            "modeller-use": (UseRequest, self.use),
            "modeller-end": (MapNumber, self.end),
        }

    def started(self) -> list[dict]:
        return self._started.states()

    def use(self, request: UseRequest) -> dict:
        """Write the shape and a recipe into a new folder; begin the run if the request says so."""
        parts = parts_of(request)
        path = self._started.free_path(self.home, f"modelled-{request.role}")
        folder = make_folder(recipe_folder(path))
        try:
            for write in parts.values():
                write(folder)
            recipe = folder / "recipe.toml"
            write_recipe(recipe, recipe_text(request, path.name, list(parts)))
            if request.begin:
                self._started.begin(path, recipe)
        except (EvocityError, OSError) as error:
            shutil.rmtree(folder, ignore_errors=True)
            raise write_error(folder, error) from error
        command = shlex.join(["evocity", "run", str(recipe), "--out", str(path)])
        return {"folder": str(folder), "recipe": recipe.read_text(encoding="utf-8"),
                "command": command, "started": self.started()}  # fmt: skip

    def end(self, request: MapNumber) -> dict:
        self._started.end(request.map)
        return {"started": self.started()}


def _json_file(fields: ShapeFields) -> Response:
    content = json.dumps(fields.document(), allow_nan=False) + "\n"
    return Response(content, media_type="application/json")


def _picture(request: PictureRequest) -> Response:
    content, kind = modeller_pictures.picture_file(request)
    return Response(content, media_type=kind)
