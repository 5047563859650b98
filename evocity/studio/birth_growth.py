"""The fabric that grows around the window of a birth: in a process of its own for the page, and by
`evocity grow` for files."""

import os
import shlex
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from evocity.analysis import open_run
from evocity.analysis.individual import Individual, fabric_of
from evocity.errors import EvocityError
from evocity.search.preparation.trust import state_folder
from evocity.studio.background_job import BackgroundJob, JobSlot
from evocity.studio.output_files import free_path, make_folder
from evocity.studio.request_fields import Body, Id
from evocity.studio.subprocesses import DeskJob, RunProcesses

#: Bytes of memory of a growth, at most.
MEMORY = 4 << 30


class GrowthRequest(Body):
    """A fabric around a birth: ``times`` as long at each side as the window."""

    id: Id
    times: Literal[2, 3] = 2
    seed: Annotated[int, Field(ge=0, lt=2**31)] = 0
    streets: bool = False
    straight: bool = False


class GrowthFile(GrowthRequest):
    suffix: Literal["parquet", "glb", "tif"]


class BirthGrowth:
    """The growth of births of the run in a folder, one at a time."""

    def __init__(self, run: Path):
        self._run, self._slot = run, JobSlot()
        self._file: Path | None = None
        self.stop = self._slot.stop

    def begin(self, request: GrowthRequest) -> dict:
        """Begin to grow, or go on; return the state and the command that writes a file."""
        words = self.words(request, f"grown-{request.id}.glb")
        state = self._slot.begin(request, lambda job: self._grow(job, request))
        return state | {"command": shlex.join(["evocity", *words])}

    def heights(self, request: GrowthRequest) -> tuple[dict, bytes]:
        """Return the grown map, and the ``top`` and ``left`` of the window in it, px."""
        return self._slot.result(request, "the maps")

    def words(self, request: GrowthRequest, output: str) -> list[str]:
        """Return the words of `evocity grow` that write this fabric to a file."""
        height, width = self._size(request)
        words = ["grow", str(self._run), "--id", str(request.id), "--width", str(width)]
        words += ["--height", str(height), "--seed", str(request.seed)]
        words += [f"--{name}" for name in ("streets", "straight") if getattr(request, name)]
        return [*words, "-o", output]

    def save(self, request: GrowthFile, processes: RunProcesses, is_own: bool) -> dict:
        """Begin `evocity grow` into a new folder beside the run; return the path and state."""
        above = self._run.parent if is_own else state_folder() / "children"
        name = f"{self._run.name}-grown"
        folder = make_folder(free_path(above, name, lambda one: not os.path.lexists(one)))
        path = folder / f"grown-{request.id}.{request.suffix}"
        words = self.words(request, str(path))
        processes.begin(path, words, folder / "grow.log")
        self._file = path
        return self.file(processes)

    def file(self, processes: RunProcesses) -> dict:
        """Return the path of the last file, and the state of the process that writes it."""
        path = self._file
        return {} if path is None else {"path": str(path), **(processes.state(path) or {})}

    def _size(self, request: GrowthRequest) -> tuple[int, int]:
        header = open_run(self._run).header
        return request.times * header.height, request.times * header.width

    def _grow(self, job: BackgroundJob, request: GrowthRequest) -> tuple[dict, bytes] | None:
        process = DeskJob(MEMORY, None, "the growth", "a smaller window")
        job.at_stop.append(process.stop)
        about: dict = {}

        def receive(result: dict) -> None:
            if "grown" in result:
                about.update(result["grown"])
            else:
                job.done, job.total = result["done"], result["total"]

        height, width = self._size(request)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "grown.npy"
            facts = request.model_dump() | {"height": height, "width": width}
            facts |= {"job": "grow", "run": str(self._run), "file": str(path)}
            try:
                process.run(facts, receive)
            except EvocityError:
                if not about:  # otherwise the process only ended too slowly
                    raise
            if not about:
                return None
            heights = np.load(path, allow_pickle=False)
        return about, np.ascontiguousarray(heights, "<f4").tobytes()


def grow_birth(job: Mapping, send: Callable[..., Any]) -> None:
    """Grow the fabric of a ``job`` as `evocity grow` does, in the process of the job."""
    from evocity.growth import grow

    run = open_run(job["run"])
    genome = fabric_of(run.header, Individual(run.columns, job["id"]).genome, "the growth")
    grown = grow(
        genome,
        job["height"],
        job["width"],
        np.random.default_rng(job["seed"]),
        turned=not job["straight"],
        streets=job["streets"],
    )
    grown.account(progress=lambda done, total: send(done=int(done), total=int(total)))
    city = grown.city()
    np.save(job["file"], city.heights)
    top, left = (int(at) for at in grown.place)
    about: dict[str, Any] = {
        "height": city.shape[0],
        "width": city.shape[1],
        "top": top,
        "left": left,
    }
    about["window"] = list(genome.pavement.raster(np.zeros(len(genome), bool)).shape)
    send(grown=about | {"metres": float(city.metres_per_pixel)})
