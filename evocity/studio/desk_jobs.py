"""The jobs of the desk in a process of their own: read maps, calibrate a recipe. A job arrives as a
line of JSON; its results leave as lines of JSON."""

import json
import os
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from evocity.errors import EvocityError, describe_error
from evocity.search.calibration.calibration import calibrate_recipe
from evocity.search.calibration.recipe_text import RecipeSettings
from evocity.search.steering.estimate import largest_run

#: The longer side of a picture, px, at most.
LARGEST = 640


def main() -> None:
    """Do the job on the first line of standard input; end after it, or when the input closes."""
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # measures and libraries may print; that is not a result
    line = b""
    while not line.endswith(b"\n"):  # a thread that reads sys.stdin would lock it at the end
        line += os.read(0, 1 << 16) or b"\n"
    job = json.loads(line)
    threading.Thread(target=_end_with_studio, daemon=True).start()

    def send(**result: Any) -> None:
        print(json.dumps(result), file=out, flush=True)

    try:
        _JOBS[job["job"]](job, send)
    except EvocityError as error:
        send(error=[error.found, error.expected, error.remedy])
    except MemoryError:
        send(error=["there is not enough memory", "a smaller map", "cut a part out of the map"])
    except Exception as error:  # the page shows it, whatever it is
        remedy = "report it to the makers of evocity, with the choices on the desk"
        send(error=[describe_error(error), "no error", remedy])


def _end_with_studio() -> None:
    while os.read(0, 1 << 16):
        pass
    os._exit(1)


def _read_maps(job: Mapping, send: Callable) -> None:
    """Read the ``maps`` with options of `read_map`. Send the facts of each map, or the error."""
    from PIL import Image

    from evocity.io import read_map
    from evocity.pictures import render

    for entry in job["maps"]:
        try:
            city = read_map(entry["map"], **entry["options"])
        except EvocityError as error:
            send(map=entry["number"], error=[error.found, error.expected, error.remedy])
            continue
        picture = render(city, legend=False)
        picture.thumbnail((LARGEST, LARGEST), Image.Resampling.BOX)
        picture.save(entry["picture"], "PNG")
        rows, columns = city.shape
        about = {
            "metres": [columns * city.metres_per_pixel, rows * city.metres_per_pixel],
            "built": float(city.built.mean()),
            "rules": dict(city.height_rules),
            "highest": float(city.heights.max(initial=0)),
            "attribution": city.attribution,
            "taken": city.taken,
        }
        send(map=entry["number"], about=about)


def _calibrate(job: Mapping, send: Callable) -> None:
    """Calibrate a recipe for the ``words`` and ``goals``, as it would lie at ``path``."""
    from evocity.fitness import get
    from evocity.fitness.registry import load_file
    from evocity.search.calibration.recipe_text import Goal

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
            "bounds": {bound.measure.name: bound.keys for bound in result.bounds},
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


_JOBS = {"read": _read_maps, "calibrate": _calibrate}
