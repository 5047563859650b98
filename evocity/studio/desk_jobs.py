"""The jobs of the desk in a process of their own: read maps, calibrate a recipe. A job arrives as a
line of JSON; its results leave as lines of JSON."""

import json
import os
import queue
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import EvocityError, describe_error
from evocity.evaluation import linux_processes
from evocity.studio.birth_growth import grow_birth
from evocity.studio.kept_sources import keep_sources

#: The longer side of a picture, px, at most.
LARGEST = 640


#: Seconds that a process waits for another job; bytes of its memory above which it ends, on Linux.
IDLE, LARGEST_PROCESS = 300.0, 1 << 30


def main() -> None:
    """Do the jobs on the lines of standard input: one, or until `IDLE` seconds without a job if
    they say that the process ``lasts``. End when the input closes."""
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # measures and libraries may print; that is not a result
    lines: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_read_lines, args=(lines,), daemon=True).start()

    def send(**result: Any) -> None:
        print(json.dumps(result), file=out, flush=True)

    job = json.loads(lines.get())
    if job.get("lasts"):
        keep_sources()
    _do(job, send)
    while job.get("lasts"):
        send(waits=True)
        # not the peak: that begins with the memory of the process that started this one
        if linux_processes.resident_memory(os.getpid()) > LARGEST_PROCESS:
            return
        try:
            job = json.loads(lines.get(timeout=IDLE))
        except queue.Empty:
            return
        _do(job, send)


def _do(job: Mapping, send: Callable) -> None:
    try:
        _JOBS[job["job"]](job, send)
    except EvocityError as error:
        send(error=[error.found, error.expected, error.remedy])
    except MemoryError:
        send(error=["there is not enough memory", "a smaller map", "cut a part out of the map"])
    except Exception as error:  # the page shows it, whatever it is
        remedy = "report it to the makers of evocity, with the choices on the desk"
        send(error=[describe_error(error), "no error", remedy])


def _read_lines(lines: "queue.SimpleQueue[bytes]") -> None:
    """Read standard input; end with studio. A thread that reads sys.stdin would lock it."""
    rest = b""
    while read := os.read(0, 1 << 16):
        *whole, rest = (rest + read).split(b"\n")
        for line in whole:
            lines.put(line)
    os._exit(1)


def _read_maps(job: Mapping, send: Callable) -> None:
    """Read the ``maps``. Send the facts and the overview of each map, or the error."""
    for entry in job["maps"]:
        read = _read_child if entry.get("child") else _read_map
        result: dict[str, Any] = {}
        try:
            read(entry, result)
        except EvocityError as error:
            result["error"] = [error.found, error.expected, error.remedy]
        send(map=entry["number"], **result)


def _read_map(entry: Mapping, result: dict) -> None:
    """Read a map with options of `read_map`, its window ``at`` a place of its overview, and mark
    its ``areas``."""
    from evocity.io import read_map
    from evocity.studio.desk_areas import mark_area
    from evocity.studio.desk_overview import Overview, lon_lat

    options = dict(entry["options"])
    at, areas = options.pop("at", None), options.pop("areas", {})
    overview = Overview(entry["map"], options, entry.get("over"))
    side = options.get("pixels", 256) * options.get("metres_per_pixel", 2.0)
    shown, city = at or overview.middle, None
    try:
        center = overview.facts.get("start") if at is None else lon_lat(overview.frame, at)
        city = read_map(entry["map"], **options | ({"center": center} if center else {}))
        shown = overview.window_of(city)
    except EvocityError as error:
        if any(words in error.found for words in ("no building in", "beyond the raster")):
            overview.check_window(at, side)
        raise
    finally:  # the page shows the file also where the window cannot be read
        if entry.get("overview"):
            overview.write(Path(entry["overview"]), shown, side)
            result["over"] = overview.facts
    result["about"] = _describe(city, entry["picture"]) | {
        "at": shown,
        "areas": {use: mark_area(city, shown, use, area) for use, area in areas.items()},
    }


def _read_child(entry: Mapping, result: dict) -> None:
    """Read a kept child, and write what it locks."""
    from evocity.coding import decode
    from evocity.genome import read_genome

    genome, options = read_genome(entry["map"]), entry["options"]
    city = decode(genome).city
    pixels, metres = city.shape[0], city.metres_per_pixel
    about = _describe(city, entry["picture"]) | {"pixels": pixels, "metres_per_pixel": metres}
    layer = genome.condensation
    if layer is not None:
        files = [f"{entry['picture']}.{name}.npy" for name in ("lock", "heights")]
        np.save(files[0], layer.mask.astype(np.uint8))
        np.save(files[1], layer.heights)
        about |= {"lock_files": files, "locked": float(layer.mask.mean())}
    result["about"] = about
    window = options.get("pixels", pixels), options.get("metres_per_pixel", metres)
    if window != (pixels, metres):
        raise EvocityError(
            f"the child has {pixels} px of {metres:g} m, and the window {window[0]} px of "
            f"{window[1]:g} m",
            "the window of the child",
            f"set the width to {pixels} px and {metres:g} metres per pixel, or leave the child out",
        )


def _describe(city: CityMap, picture: str) -> dict:
    """Write the heights of a small picture; return the facts of a map."""
    from evocity.pictures.colours import scale_end

    rows, columns = city.shape
    step = -(-max(rows, columns) // LARGEST)
    np.save(picture, np.ascontiguousarray(city.heights[::step, ::step]))
    return {
        "metres": [columns * city.metres_per_pixel, rows * city.metres_per_pixel],
        "pixel": step * city.metres_per_pixel,
        "built": float(city.built.mean()),
        "rules": dict(city.height_rules),
        "highest": float(city.heights.max(initial=0)),
        "scale": float(scale_end(city)),
        "attribution": city.attribution,
        "taken": city.taken,
    }


def _calibrate(job: Mapping, send: Callable) -> None:
    """Calibrate a recipe for the ``words`` and ``goals``, as it would lie at ``path``."""
    from evocity.fitness import get
    from evocity.fitness.registry import load_file
    from evocity.search.calibration.calibration import calibrate_recipe
    from evocity.search.calibration.recipe_text import Goal, RecipeSettings
    from evocity.search.steering.estimate import largest_run

    path = Path(job["path"])
    goals = []
    for goal in job["goals"]:
        name, file = goal["measure"], goal["file"]
        measures = [get(name)] if file is None else [m for m in load_file(file) if m.name == name]
        goals.append(
            Goal(
                measures[0],
                file,
                goal["several"],
                goal["target"],
                goal["goal"],
                of_parents=goal["of_parents"],
                bounds=goal["bounds"],
                is_constraint=goal["is_constraint"],
                within=goal["within"],
            )
        )
    result = calibrate_recipe(
        RecipeSettings(**job["words"]), goals, path, lambda text: send(said=text)
    )
    sources = path.parent / "sources"
    sources.mkdir()
    for number, source in enumerate(result.sources):
        source.genome.write(sources / f"{number}.genome.parquet")
    births, size = largest_run(sources, result.recipe)
    values = {
        name: {parent: [_plain(value) for value in pair] for parent, pair in of.items()}
        for name, of in result.values.items()
    }
    send(
        calibrated={
            "text": result.text,
            "values": values,
            "bounds": {bound.measure.name: bound.keys for bound in result.bounds}
            | {goal["measure"]: goal["bounds"] for goal in job["goals"] if goal["bounds"]},
            "notes": list(result.notes),
            "failing": result.failing,
            "births": births,
            "generations": result.recipe.run.generations,
            "size": size,
            "seconds": result.seconds,
            "duration": result.duration,
            "workers": result.recipe.worker_count,
        }
    )


def _plain(value: float) -> float | None:
    return float(value) if value == value else None  # JSON has no NaN


def _export(job: Mapping, send: Callable) -> None:
    from evocity.studio.exports import write_exports

    write_exports(job, send)


_JOBS = {"read": _read_maps, "calibrate": _calibrate, "export": _export, "grow": grow_birth}
