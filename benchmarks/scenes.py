"""Scenes of decoded cities: how long the files take, and how large they are:
python benchmarks/scenes.py

A code of Lyon, decoded at 256², and that map laid side by side to 512² and 1024²: dense fabric
throughout. Besides two children of 1024²: that code decoded at zoom 4, and one bred of Lyon and
Montpellier at .5 m a pixel. Seconds of CPU, the least of three, once all is compiled.
"""

import argparse
import os
import tempfile
import time
from pathlib import Path

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import numpy as np
from _machine import description

import evocity
import evocity.scene
from evocity.citymap import CityMap
from evocity.operators import make

REPEATS = 3


def bred() -> np.ndarray:
    """Heights of a child of 1024², .5 m a pixel."""
    window = {"pixels": 1024, "metres_per_pixel": 0.5}
    maps = [evocity.read_map(name, **window) for name in ("lyon-1er", "montpellier-pas-du-loup")]
    parents = [evocity.encode(one).genome for one in maps]
    return evocity.decode(make("region_fusion")(parents, np.random.default_rng(1))).city.heights


def seconds(
    heights: np.ndarray, folder: Path, metres: float = 2.0
) -> tuple[dict[str, float], dict[str, int], int]:
    """CPU of walls and of each file, the files' sizes, and how many buildings there are."""
    city = CityMap(heights, metres)
    began = time.process_time()
    scene = evocity.scene(city)
    spent = {"walls": time.process_time() - began}
    sizes = {}
    for suffix in evocity.scene.SUFFIXES:
        path = folder / f"city{suffix}"
        began = time.process_time()
        scene.write(path)
        spent[suffix] = time.process_time() - began
        sizes[suffix] = path.stat().st_size
    return spent, sizes, len(scene.walls)


def roofs(heights: np.ndarray, folder: Path, metres: float = 2.0) -> tuple[float, float, int]:
    """CPU of a scene with pitched roofs and of its .glb file, and the file's bytes."""
    city = CityMap(heights, metres)
    began = time.process_time()
    scene = evocity.scene(city, roofs=True)
    assert scene.groups
    made = time.process_time()
    scene.write(folder / "roofs.glb")
    written = time.process_time()
    return made - began, written - made, (folder / "roofs.glb").stat().st_size


def main() -> None:
    print(description())
    genome = evocity.encode(evocity.read_map("lyon-1er")).genome
    heights = evocity.decode(genome).city.heights
    cases = {"256² (child)": (heights,), "512² (2 × 2)": (np.tile(heights, (2, 2)),)}
    cases["1024² (4 × 4)"] = (np.tile(heights, (4, 4)),)
    cases["1024² (zoom 4)"] = (evocity.decode(genome, zoom=4).city.heights,)
    cases["1024² (bred)"] = bred(), 0.5
    with tempfile.TemporaryDirectory() as folder:
        seconds(heights, Path(folder))  # compiles
        roofs(heights, Path(folder))
        for name, (one, *metres) in cases.items():
            runs = [seconds(one, Path(folder), *metres) for _ in range(REPEATS)]
            least = {key: min(run[0][key] for run in runs) for key in runs[0][0]}
            _, sizes, count = runs[0]
            told = [f"{key} {value:.3f} s" for key, value in least.items()]
            told += [f"{key} {size / 1e6:.2f} MB" for key, size in sizes.items()]
            print(f"{name}: {count} buildings, {sum(least.values()):.2f} s in all")
            print("   " + ", ".join(told))
            pitched = [roofs(one, Path(folder), *metres) for _ in range(REPEATS)]
            made, written = (min(run[k] for run in pitched) for k in range(2))
            size = pitched[0][2]
            each = f"{size / count / 1e3:.1f} kB each"
            print(f"   with roofs: {made:.3f} s, .glb {written:.3f} s, {each}")


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__.partition("\n\n")[0]).parse_args()
    main()
