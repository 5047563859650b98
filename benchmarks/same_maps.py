"""Maps of real files beside those of an older checkout:
python benchmarks/same_maps.py CHECKOUT FOLDER …

Both versions read each file, with 256 × 256 px of 2 m and with 1024 × 1024 px of 1 m, and rasters
with their own pixels. The table gives the files whose heights, reference system or rules differ.
"""

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

from _machine import description

ROOT = Path(__file__).resolve().parents[1]

#: Reads files in a process of its own: a line of JSON for each.
_READER = """
import hashlib, json, sys
from evocity.io import read_map
for line in sys.stdin:
    path, options = json.loads(line)
    city = read_map(path, **options)
    heights = city.heights
    print(json.dumps({
        "digest": hashlib.sha256(heights.tobytes()).hexdigest()[:16],
        "crs": (city.crs or "none").split("[")[0].replace("PROJCRS", "local"),
        "origin": city.origin,
        "rules": dict(city.height_rules),
        "built": float((heights > 0).sum()) * city.metres_per_pixel ** 2,
        "mean": float(heights[heights > 0].mean()),
        "highest": float(heights.max()),
    }), flush=True)
"""


def read(checkout: Path, jobs: list) -> list[dict]:
    """Read the maps of ``jobs`` by a ``checkout`` of evocity."""
    run = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", _READER],
        cwd=checkout,
        env=os.environ | {"PYTHONPATH": str(checkout)},
        input="".join(json.dumps(job) + "\n" for job in jobs),
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    return [json.loads(line) for line in run.stdout.splitlines()]


def described(found: dict) -> str:
    rules = ", ".join(f"{count} {rule}" for rule, count in found["rules"].items())
    return (
        f"{found['digest']}  {found['crs']:10}  {found['built']:.0f} m², "
        f"mean {found['mean']:.3f} m, "
        f"highest {found['highest']:.2f} m; {rules}"
    )


def main(checkout: Path, folders: list[Path]) -> None:
    print(description())
    paths = [p for one in folders for p in sorted(one.resolve().iterdir()) if p.suffix != ".md"]
    jobs = []
    for path in paths:
        jobs.append((str(path), {}))
        if path.suffix != ".tif":
            jobs.append((str(path), {"pixels": 1024, "metres_per_pixel": 1.0}))
    same = 0
    for job, old, new in zip(jobs, read(checkout, jobs), read(ROOT, jobs), strict=True):
        if old == new:
            same += 1
            continue
        print(f"{Path(job[0]).name}, {job[1].get('metres_per_pixel', 2.0):g} m")
        print(f"    before  {described(old)}\n    after   {described(new)}")
    print(f"{same} of {len(jobs)} maps of {len(paths)} files are the same")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("checkout", type=Path)
    parser.add_argument("folders", nargs="+", type=Path)
    given = parser.parse_args()
    main(given.checkout.resolve(), given.folders)
