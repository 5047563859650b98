"""What a process of its own does for the desk: read maps, calibrate a recipe. It is told what by a
line of JSON, and tells what comes of it by lines of JSON."""

import json
import os
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from evocity.errors import EvocityError, told

#: Pixels of a picture along its longer side, at most.
LARGEST = 640


def main() -> None:
    """Do what the first line of standard input says; end with it, or as soon as it is closed."""
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # what measures and libraries print is none of it
    told_first = b""
    while not told_first.endswith(b"\n"):  # sys.stdin would be locked at the end by who reads it
        told_first += os.read(0, 1 << 16) or b"\n"
    errand = json.loads(told_first)
    threading.Thread(target=_end_with_studio, daemon=True).start()

    def tell(**said: Any) -> None:
        print(json.dumps(said), file=out, flush=True)

    try:
        _ERRANDS[errand["errand"]](errand, tell)
    except EvocityError as error:
        tell(error=[error.found, error.expected, error.remedy])
    except MemoryError:
        tell(error=["there is not enough memory for this", "a smaller map", "cut a part out of it"])
    except Exception as error:  # told on the page, whatever it is
        tell(error=[told(error), "no error", "tell evocity's makers, with what was asked for"])


def _end_with_studio() -> None:
    while os.read(0, 1 << 16):
        pass
    os._exit(1)


def _read(errand: Mapping, tell: Callable) -> None:
    """Each of the ``maps``: a file, or a bundled district, options of `read_map`, and where its
    picture goes. What is told of it, or why it cannot be read."""
    from PIL import Image

    from evocity.io import read_map
    from evocity.pictures import render

    for one in errand["maps"]:
        try:
            city = read_map(one["map"], **one["options"])
        except EvocityError as error:
            tell(map=one["number"], error=[error.found, error.expected, error.remedy])
            continue
        picture = render(city, legend=False)
        picture.thumbnail((LARGEST, LARGEST), Image.Resampling.BOX)
        picture.save(one["picture"], "PNG")
        rows, columns = city.shape
        about = {
            "metres": [columns * city.metres_per_pixel, rows * city.metres_per_pixel],
            "built": float(city.built.mean()),
            "rules": dict(city.height_rules),
            "highest": float(city.heights.max(initial=0)),
            "attribution": city.attribution,
            "taken": city.taken,
        }
        tell(map=one["number"], about=about)


def _calibrate(errand: Mapping, tell: Callable) -> None:
    """A recipe for the ``words``, searched by the ``goals``, as it would stand at ``path``; the
    folder there has the maps."""
    from evocity.fitness import get
    from evocity.fitness.registry import load_file
    from evocity.search.calibration import begun
    from evocity.search.estimate import at_most
    from evocity.search.recipe_text import Goal, Words

    path = Path(errand["path"])
    goals = []
    for one in errand["goals"]:
        name, file = one["measure"], one["file"]
        found = [get(name)] if file is None else [m for m in load_file(file) if m.name == name]
        goals.append(Goal(found[0], file, one["several"], one["target"], one["goal"]))
    found = begun(Words(**errand["words"]), goals, path, lambda text: tell(said=text))
    sources = path.parent / "sources"
    sources.mkdir()
    for number, source in enumerate(found.sources):
        source.genome.write(sources / f"{number}.genome.parquet")
    births, size = at_most(sources, found.recipe)
    values = {
        name: {parent: [_plain(one) for one in pair] for parent, pair in of.items()}
        for name, of in found.values.items()
    }
    tell(
        calibrated={
            "text": found.text,
            "values": values,
            "bounds": {one.measure.name: one.keys for one in found.bounds},
            "notes": list(found.notes),
            "failing": found.failing,
            "births": births,
            "generations": found.recipe.run.generations,
            "size": size,
            "seconds": found.seconds,
            "duration": found.duration,
            "workers": found.recipe.worker_count,
        }
    )


def _plain(value: float) -> float | None:
    return float(value) if value == value else None  # NaN is no JSON


_ERRANDS = {"read": _read, "calibrate": _calibrate}

__all__ = ["LARGEST", "main"]
