"""Reads one input after the other, as told on standard input, and tells what came of each.

A process of its own, so that a crash, a hang or a bomb costs the tests nothing else. One JSON
document a line, in and out.
"""

import contextlib
import json
import os
import resource
import shutil
import sys
import warnings
from pathlib import Path

#: Address space beyond that of the warm process, bytes: what asks for more gets a MemoryError.
ROOM = 3 << 30


def main(home: str, seconds: float) -> None:
    """``home``: the folder that may be written to; ``seconds``: what views of GeoPackages get."""
    replies = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    readers = _readers()
    from evocity.accelerate import watch_compiled
    from evocity.io import geopackage_sql

    geopackage_sql.SECONDS = seconds
    compiled: list[bool] = []
    watch_compiled(lambda: compiled.append(True))
    _limit()
    outside = _watch(home)
    print(json.dumps({"ready": os.getpid()}), file=replies, flush=True)
    for line in sys.stdin:
        job = json.loads(line)
        told, compiled[:] = None, [True]
        while compiled:  # what compiling a kernel takes, once a machine, is not the input's
            compiled.clear()
            outside.clear()
            told = _outcome(readers, job, outside)
        print(json.dumps(told), file=replies, flush=True)


def _outcome(readers, job: dict, outside: list) -> dict:
    from evocity.errors import EvocityError

    path = Path(job["path"])
    if "base" in job:  # one part of a folder is another
        place = path.parent / "whole"
        shutil.rmtree(place, ignore_errors=True)
        shutil.copytree(job["base"], place)
        (place / job["part"]).parent.mkdir(exist_ok=True)
        shutil.copyfile(path, place / job["part"])
        path = place
        outside.clear()
    before = _listing(path)
    parser = _reset_parser()
    start, resident = _seconds(), _reset()
    outcome, message = "read", ""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", PendingDeprecationWarning)  # of rasterio to affine
            readers[job["kind"]](path)
    except EvocityError as error:
        outcome, message = "refused", str(error)
    except BaseException as error:
        import traceback

        outcome = "raised"
        message = "".join(traceback.format_exception(error, limit=-6))[-3000:]
    told = {
        "number": job["number"],
        "outcome": outcome,
        "message": message,
        "seconds": _seconds() - start,
        "mib": max(0, _peak() - resident, _peak_of_parser(parser)) / 1024,
        "made": sorted({*outside, *(_listing(path) ^ before)}),
    }
    if "base" in job:
        shutil.rmtree(path, ignore_errors=True)
    return told


def _readers() -> dict:
    """By kind, what reads an input; each imported and warm."""
    import numpy as np

    import evocity
    from evocity.citymap import CityMap
    from evocity.fitness.type_table import TypeTable
    from evocity.io import read_condensation, read_map, read_mask
    from evocity.scene.library import Library
    from evocity.views.classes import ClassTable
    from evocity.views.streets.kinds import StreetKinds

    square = np.zeros((64, 64), np.float32)
    square[8:40, 8:40] = 6
    city = CityMap(square, 2.0, name="city", origin=(770000.0, 6270128.0), crs="EPSG:2154")

    def map_of(path):
        scaled = {"height_scale": 0.1} if path.suffix == ".png" else {}
        found = read_map(path, pixels=32, metres_per_pixel=2.0, **scaled)
        repr(found), found.taken

    def whole_map(path):
        stated = {".png": {"metres_per_pixel": 2.0, "height_scale": 0.1}}
        stated[".npy"] = {"metres_per_pixel": 2.0}
        repr(read_map(path, **stated.get(path.suffix, {})))

    def mask(path):
        read_mask(path, [city])
        read_condensation(path, city)

    def genome(path):
        repr(evocity.decode(evocity.read_genome(path)).city)

    def run(path):
        opened = evocity.open_run(path)
        opened.status(), opened.history(), opened.events(), opened.sources(), opened.references()
        opened.births(), opened.members(), opened.parts(), opened.condensation
        ids = opened.members(0)["id"].to_pylist()[:3]
        opened.individuals(ids), [opened.ancestors(one) for one in ids[:1]]

    def told(path):
        from evocity.report import failures, unrecorded
        from evocity.search.record.commands import command_state

        opened = evocity.open_run(path)
        failures(opened), unrecorded(opened)
        with contextlib.suppress(ValueError):  # told where the run is resumed
            command_state(opened)

    def report(path):
        from evocity.report import write_report

        page = Path(os.environ["TMPDIR"]) / "report.html"
        write_report(path, page)
        page.unlink()

    def recipe(path):
        evocity.read_recipe(path)

    return {
        "map": map_of,
        "whole map": whole_map,
        "mask": mask,
        "genome": genome,
        "run": run,
        "told": told,
        "report": report,
        "recipe": recipe,
        "classes": ClassTable.read,
        "kinds": StreetKinds.read,
        "types": TypeTable.read,
        "library": Library.read,
    }


def _limit() -> None:
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + ROOM
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _watch(home: str) -> list[str]:
    """What Python opens to write outside ``home``, or sends elsewhere, from now on."""
    found: list[str] = []

    def hook(event: str, args: tuple) -> None:
        if event.startswith("socket.") and event in ("socket.connect", "socket.getaddrinfo"):
            found.append(f"{event} {args[-1]!r}")
        elif event == "open" and isinstance(args[1], str) and set(args[1]) & set("wax+"):
            name = os.path.abspath(os.fsdecode(args[0])) if not isinstance(args[0], int) else home
            cached = "/__pycache__" in name  # a kernel, compiled for the first time
            if not cached and not name.startswith((home, "/proc/", "/dev/null")):
                found.append(name)
        elif event == "subprocess.Popen":
            if "evocity.parquet_child" not in str(args[1]):  # parses Parquet without a seal
                found.append(event)
        elif event in ("os.system", "os.exec", "os.posix_spawn"):
            found.append(event)

    sys.addaudithook(hook)
    return found


def _listing(path: Path) -> set[str]:
    """What lies about an input, with the place that processes share."""
    places = [path.parent, Path.cwd(), Path(os.environ["TMPDIR"])]
    found = {str(one) for place in places for one in place.rglob("*")}
    return {one for one in found if "__pycache__" not in one}


def _seconds() -> float:
    """Seconds of processor, also of the parser: what other work on the machine takes is not theirs.
    `fuzz_drive` ends what waits for too long."""
    ticks, pid = 0, _parser()
    with contextlib.suppress(OSError):
        if pid is not None:
            fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
            ticks = sum(map(int, fields[11:13]))
    return sum(os.times()[:4]) + ticks / os.sysconf("SC_CLK_TCK")


def _reset() -> int:
    Path("/proc/self/clear_refs").write_text("5")
    return _status("VmRSS")


def _peak() -> int:
    return _status("VmHWM")


def _parser() -> int | None:
    """The process that parses Parquet without a seal, if there is one."""
    from evocity import parquet_child

    process = parquet_child._child._process
    return None if process is None or process.poll() is not None else process.pid


def _reset_parser() -> tuple[int | None, int]:
    """The parser, and its memory before an input."""
    pid = _parser()
    with contextlib.suppress(OSError, KeyError):
        if pid is not None:
            Path(f"/proc/{pid}/clear_refs").write_text("5")
            return pid, _status("VmRSS", pid)
    return None, 0


def _peak_of_parser(before: tuple[int | None, int]) -> int:
    """KiB that the parser took for an input; all of its memory if it is a new process."""
    pid = _parser()
    with contextlib.suppress(OSError, KeyError):
        if pid is not None:
            return _status("VmHWM", pid) - (before[1] if before[0] == pid else 0)
    return 0


def _status(key: str, pid: int | str = "self") -> int:
    """KiB of a process, by the kernel."""
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith(f"{key}:"):
            return int(line.split()[1])
    raise KeyError(key)


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]))
