"""What it costs to ask a run the morning after: benchmarks/analysis.py FOLDER

    python benchmarks/soak.py --generations 999 --drawn --keep FOLDER  # 0 to 999: a thousand
    python benchmarks/analysis.py FOLDER/run

Processor seconds of each question, by a `Run` that was opened anew, the least of three; libraries
and kernels are loaded before.
"""

import argparse
import os
from collections.abc import Callable
from pathlib import Path

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import numpy as np
from _machine import description, seconds

import evocity

#: So many births are compared by looks.
COMPARED = 320


def main(path: Path, asked: list[str]) -> None:
    print(description())
    run = evocity.open_run(path)
    ids = run.columns.ids[run.columns.ok]
    last = int(ids[-1])
    some = ids[np.linspace(0, len(ids) - 1, COMPARED).astype(int)]
    print(
        f"{len(run.generations)} generations, {len(run)} births, {len(run.archive)} in its archive"
    )
    questions: dict[str, Callable[[], object]] = {
        "open_run": lambda: evocity.open_run(path),
        "scores": lambda: evocity.open_run(path).scores,
        "where": lambda: evocity.open_run(path).where("feasible and not alive"),
        "series": lambda: evocity.open_run(path).series,
        "history": lambda: evocity.open_run(path).history(),
        "genome": lambda: evocity.open_run(path)[last].genome,
        "ancestors": lambda: evocity.open_run(path).ancestors(last),
        "lineage": lambda: evocity.open_run(path).lineage(last),
        "archive": lambda: evocity.open_run(path).archive,
        "compromise": lambda: evocity.open_run(path).compromise(),
        "credit": lambda: evocity.open_run(path).credit(),
        "survivors": lambda: evocity.open_run(path).survivors(),
        f"clusters of {len(some)}": lambda: evocity.open_run(path).clusters(5, of=some),
    }
    for name, ask in questions.items():
        if asked and name.split()[0] not in asked:
            continue
        ask()
        print(f"{name:20} {seconds(ask):7.3f} s", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("path", type=Path, metavar="FOLDER", help="a run")
    parser.add_argument("asked", nargs="*", metavar="NAME", help="some of the questions alone")
    given = parser.parse_args()
    main(given.path, given.asked)
