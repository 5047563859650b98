"""The cost of seals and canaries: python benchmarks/seals.py [--births N] [--beside CHECKOUT]

First the demonstration's recipe, two workers, about N births: processor time of the main process
and the workers, and the share of it inside seals and labels of files, the chain of events, checks
of the lock and the folder, canaries, and what a worker puts back after each birth. With --beside,
then bytes of files of an older checkout and of this one: genome files, and the files of two runs
with the same births.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import threading
import time
import zlib
from collections import Counter
from pathlib import Path
from unittest.mock import patch

from _machine import description

import evocity
from evocity.evaluation.answers import Checked, Ready
from evocity.evaluation.worker_pool import Workers
from evocity.store import checksums, event_chain, log, merge, run_log, writer
from evocity.store.layout import Folder
from evocity.store.lock import Lock

ROOT = Path(__file__).resolve().parents[1]

#: The functions of each kind of work in the main process: places where they are called.
WORK = {
    "seals of files": [
        (checksums, "read_footer"),
        (checksums, "place_of_seal"),
        (checksums, "digest_of"),
        (checksums, "check_seal"),
        (merge, "label_for"),
        (merge, "check_label"),
        (log, "check_label"),
        (run_log, "check_digests"),
        (writer, "digests_of"),
        (writer, "sealed_json"),
    ],
    "chain of events": [(event_chain, "_digest"), (event_chain, "check_chain")],
    "lock and folder": [(Lock, "check"), (Folder, "check_parts")],
}

#: Runs in a process of its own, as a worker does it: microseconds of one restoration.
_RESTORATION = """
import time
import evocity
from evocity.evaluation.process_state import ProcessState
state = ProcessState()
state.restore()
began = time.process_time()
for _ in range(2000):
    state.restore()
print((time.process_time() - began) / 2000)
"""

#: Writes files with the evocity that it imports: prints the bytes of each.
_WRITER = """
import json, sys
from pathlib import Path
import numpy as np
import evocity
from evocity.citymap import CityMap

folder, recipes = Path(sys.argv[1]), sys.argv[2:]
rng = np.random.default_rng(0)
lots = np.where(rng.random((16, 16)) < 0.5, rng.integers(3, 20, (16, 16)), 0)
place = {"origin": (770000.0, 6270000.0), "crs": "EPSG:2154"}
town = CityMap(lots.repeat(4, 0).repeat(4, 1).astype(np.float32), 2.0, name="town", **place)
wide = {"block": 4, "reach": 8, "fit": False}
for name, city, how in (
    ("town, leaves", town, {}),
    ("town, B = 4", town, wide),
    ("lyon-1er", evocity.read_map("lyon-1er"), {"fit": False}),
):
    evocity.encode(city, threads=1, **how).genome.write(folder / f"genome of {name}")
for recipe in recipes:
    read = evocity.read_recipe(recipe)
    with evocity.Search(read, out=folder / Path(recipe).stem, workers=0) as search:
        for generation in search:
            pass
print(json.dumps({str(p.relative_to(folder)): p.stat().st_size
                  for p in sorted(folder.rglob("*")) if p.is_file()}))
"""


class Meter:
    """Adds up the processor seconds that threads spend in functions, by kind of work."""

    def __init__(self):
        self.spent: Counter[str] = Counter()
        self._local = threading.local()

    def metered(self, kind: str, call):
        def timed(*words, **named):
            if getattr(self._local, "inside", False):
                return call(*words, **named)
            self._local.inside, began = True, time.thread_time()
            try:
                return call(*words, **named)
            finally:
                self.spent[kind] += time.thread_time() - began
                self._local.inside = False

        return timed


class CanaryMeter:
    """Adds up the processor seconds of workers from each request for a canary to its answer.
    ``workers``: the processor seconds of each worker at its last message."""

    def __init__(self, meter: Meter):
        self.count, self.workers, self._meter, self._before = 0, {}, meter, {}

    def check(self, pool, seat, *, call=Workers._check) -> None:
        self._before[seat.token] = self._spent_by(seat.pid)
        call(pool, seat)

    def hear(self, pool, seat, message, *, call=Workers._hear) -> None:
        self.workers[seat.token] = self._spent_by(seat.pid)
        if isinstance(message, Ready):  # made, then evaluated twice
            self._meter.spent["canaries at the start"] += 2 * message.seconds
        elif isinstance(message, Checked):
            spent = self.workers[seat.token] - self._before.pop(seat.token)
            self._meter.spent["canaries"] += spent
            self.count += 1
        call(pool, seat, message)

    def _spent_by(self, pid: int) -> float:
        return int(Path(f"/proc/{pid}/schedstat").read_text().split()[0]) / 1e9


def demo(folder: Path, name: str, guarded: bool = True, checkout: Path = ROOT, **changes) -> Path:
    """Write the demonstration's recipe of a checkout with other numbers, and with or without its
    bounds; return its path."""
    text = (checkout / "evocity/data/recipes/demo.toml").read_text(encoding="utf-8")
    text = text if guarded else text.split("# A guard:")[0]
    for key, value in changes.items():
        lines = [
            f"{key} = {value}" if one.split(" = ")[0] == key else one for one in text.splitlines()
        ]
        text = "\n".join(lines)
    path = folder / f"{name}.toml"
    path.write_text(text, encoding="utf-8")
    return path


def profile(folder: Path, wanted: int) -> None:
    meter = Meter()
    canaries = CanaryMeter(meter)
    recipe = evocity.read_recipe(demo(folder, "profiled", generations=max(1, wanted // 48)))
    patches = [
        patch.object(place, name, meter.metered(kind, getattr(place, name)))
        for kind, places in WORK.items()
        for place, name in places
    ]
    patches += [
        patch.object(Workers, "_check", lambda *words: canaries.check(*words)),
        patch.object(Workers, "_hear", lambda *words: canaries.hear(*words)),
    ]
    began = time.process_time()
    for one in patches:
        one.start()
    try:
        with evocity.Search(recipe, out=folder / "profiled", workers=2) as search:
            births = [generation.births for generation in search][-1]
    finally:
        for one in patches:
            one.stop()
    whole = time.process_time() - began + sum(canaries.workers.values())
    command = [sys.executable, "-c", _RESTORATION]
    one = float(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    meter.spent["put back after births"] = births * one
    content = b"".join(p.read_bytes() for p in (folder / "profiled").rglob("*.parquet"))
    began = time.process_time()
    zlib.crc32(content)
    meter.spent["checksums of pages"] = time.process_time() - began
    print(f"\n{births} births, {canaries.count} canaries: {whole:.1f} s of processors")
    for kind, spent in [*sorted(meter.spent.items()), ("all", meter.spent.total())]:
        print(f"  {kind:24}{1e3 * spent:10.1f} ms{100 * spent / whole:9.3f} %")


def sizes(folder: Path, beside: Path) -> None:
    small = {"pixels": 64, "metres_per_pixel": 8.0, "population": 8, "generations": 70}
    # the older evocity does not know the measures of later recipes
    recipes = [
        demo(folder, "short run", checkout=beside, generations=3),
        demo(folder, "long run", False, beside, **small),
    ]
    found = []
    for name, checkout in (("beside", beside), ("this", ROOT)):
        place = folder / name
        place.mkdir()
        words = [sys.executable, "-c", _WRITER, str(place), *map(str, recipes)]
        environment = os.environ | {"PYTHONPATH": str(checkout)}
        done = subprocess.run(
            words, cwd=place, env=environment, check=True, stdout=subprocess.PIPE, text=True
        )
        found.append(json.loads(done.stdout.splitlines()[-1]))
    assert set(found[0]) <= set(found[1]), set(found[0]) - set(found[1])
    print(f"\n{'bytes':44}{'files':>6}{'beside':>12}{'this':>12}{'':4}all    worst file")
    for kind in dict.fromkeys(map(_kind, found[0])):
        names = [one for one in found[0] if _kind(one) == kind]
        before, now = (sum(one[name] for name in names) for one in found)
        worst = max(_ratio(found[0][name], found[1][name]) for name in names)
        print(
            f"{kind:44}{len(names):6}{before:12}{now:12}{_change(_ratio(before, now))}"
            f"{_change(worst)}"
        )
    for run in ("short run", "long run"):
        before, now = (
            sum(size for name, size in one.items() if name.startswith(run)) for one in found
        )
        print(f"{run:44}{'':6}{before:12}{now:12}{_change(now / before)}")


def _kind(name: str) -> str:
    """The kind of a file: all generations, or sources, of a run are one."""
    path = Path(name)
    for mark in ("generation-", "segment-"):
        if path.name.startswith(mark):
            return str(path.with_name(f"{mark}…"))
    return str(path.with_name("*" + "".join(path.suffixes))) if "sources" in name else name


def _ratio(before: int, now: int) -> float:
    """How much larger a file is now; 1 for one that stays empty."""
    return 1.0 if before == now else now / max(before, 1)


def _change(ratio: float) -> str:
    return f"{100 * (ratio - 1):+9.2f} %"


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--births", type=int, default=1000)
    options.add_argument("--beside", type=Path, help="folder of an older checkout of evocity")
    given = options.parse_args()
    print(description())
    with tempfile.TemporaryDirectory() as folder:
        profile(Path(folder), given.births)
        if given.beside:
            sizes(Path(folder), given.beside.resolve())


if __name__ == "__main__":
    main()
