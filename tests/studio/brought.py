"""Files that a user brings to the desk, and a run that goes from there."""

import contextlib
import json
import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import quote

import numpy as np
from asking import Client, Told

from evocity.studio.guard import FILE, FILE_KIND, HEADER
from evocity.studio.server import Server

KIND = ("Content-Type", FILE_KIND)
#: A window of 128 m, a short run of few.
SMALL = {
    "window": {"pixels": 32, "metres_per_pixel": 4.0},
    "population": 4,
    "generations": 1,
    "goals": [{"measure": "gsi", "want": "max"}, {"measure": "crumbs", "want": "min"}],
}


def footprints(path: Path, seed: int) -> Path:
    """Houses in rows, GeoJSON; whom to thank for them is told."""
    rng = np.random.default_rng(seed)
    metre = 1 / 111_320
    features = []
    for row in range(7):
        for column in range(6):
            west, south = (18 * column - 54) * metre, (18 * row - 60) * metre
            wide, tall = rng.integers(9, 15, 2) * metre
            ring = [(0, 0), (wide, 0), (wide, tall), (0, tall), (0, 0)]
            features.append(
                {
                    "type": "Feature",
                    "properties": {"height": int(rng.integers(2, 8)) * 3},
                    "geometry": {
                        "type": "Polygon",
                        "coordinates": [[[west + x, south + y] for x, y in ring]],
                    },
                }
            )
    told = {"type": "FeatureCollection", "attribution": f"drawn by {seed}", "features": features}
    path.write_text(json.dumps(told))
    return path


@contextlib.contextmanager
def ending(server: Server) -> Iterator[None]:
    """Where the block fails, runs that it began end too: they would go on for long."""
    try:
        yield
    except BaseException:
        end_runs(server)
        raise


def end_runs(server: Server) -> None:
    for process, _ in server.studio.desk_routes.processes._of.values():
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)


def bring(client: Client, name: str, content: bytes, headers=(KIND, HEADER)) -> Told:
    return client.ask("POST", f"{FILE}?name={quote(name, safe='')}", headers, content)


def desk(client: Client) -> dict:
    told = client.get("/api/desk")
    assert told.status == 200
    return told.json


def wait(client: Client, ready, seconds: float = 120.0) -> dict:
    """The desk, once it is ``ready``."""
    end = time.monotonic() + seconds
    while not ready(told := desk(client)):
        assert time.monotonic() < end, told
        time.sleep(0.05)
    return told


def is_read(told: dict) -> bool:
    return not any(one["reading"] for one in told["maps"])


def chosen(client: Client, parents: list[int], **more) -> Told:
    """Tell the desk that these are the parents of a small run."""
    draft = desk(client)["draft"] | SMALL | more
    placed = more.get("maps", [{"map": n, "chosen": True} for n in parents])
    return client.post("/api/desk-change", draft | {"maps": placed})
