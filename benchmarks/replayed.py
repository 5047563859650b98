"""Births of a run, replayed by two checkouts in turn:
python benchmarks/replayed.py [RUN] [--beside CHECKOUT]

Each checkout repeats the same logged births in one process of its own, from the same parents and
draws, and compares digest, status and all values with the log. The table gives the processor time
of breeding and measuring a birth, by operator: of each birth the least of --rounds. The checkouts
take turns, a few births each, so that both meet the same noise. Births before --from are not
repeated; the first turn is not counted. After each birth the cache of decoded maps forgets the
child, so that every round measures it again. Without RUN, the demonstration breeds two generations
first.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

import numpy as np
from _machine import description

ROOT = Path(__file__).resolve().parents[1]

#: Runs in a process of its own, in a checkout: repeats the births whose ids come in, a line of
#: them at a time.
_REPLAYER = """
import json, sys, time
import evocity
try:
    from evocity.coding.decoding_cache import forget
    from evocity.evaluation.evaluator import Evaluator
except ImportError:  # before the rooms of 0.3
    from evocity.coding.decoded import _decodings
    from evocity.search.evaluator import Evaluator

    def forget(genome):
        for key in [key for key in _decodings._kept if key[0] == genome.digest]:
            del _decodings._kept[key]

spent, real = [], Evaluator.born

def born(self, operator, *rest):
    start = time.process_time()
    outcome = real(self, operator, *rest)
    spent.append(1e3 * (time.process_time() - start))
    if operator is not None and outcome.genome is not None:
        forget(outcome.genome)
    return outcome

Evaluator.born = born
run = evocity.open_run(sys.argv[1])
for line in sys.stdin:
    ids = json.loads(line)
    spent.clear()
    found = evocity.replay(run, ids, accept_changes=True, trust=True)
    differs = [f"{one.id}: {dict(one.differs)}" for one in found if not one.same]
    print(json.dumps([spent, differs]), flush=True)
"""


class Replayer:
    """A checkout that repeats births when asked."""

    def __init__(self, checkout: Path, run: Path):
        words = [sys.executable, "-W", "ignore", "-c", _REPLAYER, str(run.resolve())]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
        one = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        environment = os.environ | one | {"PYTHONPATH": str(checkout)}
        self._process = subprocess.Popen(words, cwd=checkout, env=environment, **pipes)

    def step(self, ids: list[int]) -> tuple[list[float], list[str]]:
        """Return milliseconds of each birth, and the births that differ."""
        self._process.stdin.write(json.dumps(ids) + "\n")
        self._process.stdin.flush()
        return tuple(json.loads(self._process.stdout.readline()))

    def close(self) -> None:
        self._process.communicate()


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    options.add_argument("run", type=Path, nargs="?")
    options.add_argument("--beside", type=Path, help="folder of another checkout of evocity")
    options.add_argument("--from", type=int, default=48, dest="first")
    options.add_argument("--births", type=int, default=192)
    options.add_argument("--turns", type=int, default=6)
    options.add_argument("--rounds", type=int, default=3)
    given = options.parse_args()
    print(description())
    if given.run is not None:
        compare(given)
        return
    with tempfile.TemporaryDirectory() as folder:
        given.run = Path(folder, "run")
        words = ["run", "demo", "--generations", "2", "--out", str(given.run)]
        subprocess.run([sys.executable, "-m", "evocity", *words], cwd=ROOT, check=True)
        compare(given)


def compare(given: argparse.Namespace) -> None:
    """Replay births of a run by all checkouts, and print the table."""
    sys.path.insert(0, str(ROOT))
    import evocity

    rows = evocity.open_run(given.run).births(columns=["id", "operator"]).to_pylist()
    rows = [row for row in rows if row["id"] >= given.first][: given.births]
    operators = {row["id"]: row["operator"] for row in rows}
    checkouts = {"this": ROOT} | ({"beside": given.beside.resolve()} if given.beside else {})
    replayers = {name: Replayer(folder, given.run) for name, folder in checkouts.items()}
    least = {name: {} for name in replayers}
    differing = defaultdict(set)
    turns = [ids.tolist() for ids in np.array_split(list(operators), given.turns)]
    for number, ids in enumerate([turns[0], *turns * given.rounds]):
        for name, replayer in replayers.items():
            milliseconds, differs = replayer.step(ids)
            differing[name] |= set(differs)
            for one, value in zip(sorted(ids), milliseconds, strict=True) if number else ():
                least[name][one] = min(value, least[name].get(one, np.inf))
    for replayer in replayers.values():
        replayer.close()
    print(f"\n{len(operators)} births; ms of processor time a birth")
    print(f"{'':22}{'births':>7}" + "".join(f"{name:>9}" for name in least))
    groups = {
        name: [one for one in operators if operators[one] == name] for name in operators.values()
    }
    for title, ids in [*sorted(groups.items()), ("all", list(operators))]:
        means = "".join(f"{np.mean([found[one] for one in ids]):9.2f}" for found in least.values())
        print(f"{title:22}{len(ids):7}{means}")
    for name, found in differing.items():
        print(f"{name}: {len(operators) - len(found)} of {len(operators)} births as logged")
        print("".join(f"    {line}\n" for line in sorted(found)[:10]), end="")


if __name__ == "__main__":
    main()
