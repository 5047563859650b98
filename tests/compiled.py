"""Compile, once a machine, the kernels that several files of tests call: before them, on two cores.

Processes that run tests side by side would else begin by compiling the same ones, each by itself.
What no command and no search of the usual sides calls is compiled by the first test that does.
"""

import hashlib
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from towns import draw_town

from evocity import accelerate
from evocity.evaluation import kernel_warmup
from evocity.evaluation.compilation import compile_once
from evocity.pavement.levels import USUAL

AT = ("--metres-per-pixel", "2")
#: What two processes do, one after the other each: commands on ``town.npy``, a drawn town of 64².
COMMANDS = (
    (
        ("scene", "town.npy", *AT, "--streets", "-o", "town.glb"),
        ("pattern", "radial", "--pixels", "64", "-o", "radial.gpkg"),
        ("score", "town.npy", *AT),
    ),
    (
        ("encode", "town.npy", *AT, "--block", "4", "-o", "town.parquet"),
        ("grow", "town.parquet", "--width", "128", "--height", "96", "-o", "grown.tif"),
        ("autosimilarity", "town.npy", *AT, "--block", "4", "-o", "alike.png"),
        ("show", "town.parquet", "--usage", "-o", "usage.png"),
        ("decode", "town.parquet", "--low-pass", "2", "-o", "low.png"),
    ),
)
#: A process of these.
CARRIED_OUT = """
import sys
from evocity.cli import main
for line in sys.stdin:
    main(line.split(), standalone_mode=False)
"""


def carry_out(folder: Path) -> bool:
    """Whether all commands ended well."""
    np.save(folder / "town.npy", draw_town(1, side=64).heights)
    how = {
        "stdin": subprocess.PIPE,
        "stdout": subprocess.DEVNULL,
        "stderr": subprocess.DEVNULL,
        "text": True,
        "cwd": folder,
    }
    running = [subprocess.Popen([sys.executable, "-c", CARRIED_OUT], **how) for _ in COMMANDS]
    for process, commands in zip(running, COMMANDS, strict=True):
        process.stdin.write("".join(f"{' '.join(words)}\n" for words in commands))
        process.stdin.close()
    return sum(process.wait() for process in running) == 0


def main() -> None:
    folder = accelerate.cache_folder()
    if folder is None:  # kernels are not compiled here
        return
    told = repr((accelerate.stamp(), COMMANDS)).encode()
    note = folder / f"tests-{hashlib.blake2b(told, digest_size=16).hexdigest()}.compiled"
    if note.is_file():
        return
    compile_once(4, kernel_warmup.every_part(), print)
    compile_once(USUAL, kernel_warmup.every_part(), print)
    with tempfile.TemporaryDirectory() as place:
        if carry_out(Path(place)):
            note.touch()


if __name__ == "__main__":
    main()
