"""Draws the pictures of docs/kinds.md: python docs/sheets/kinds.py FOLDER, which has the runs of
runs/leaf.toml, runs/shore.toml and runs/course.toml, each by its name."""

import json
import sys
from pathlib import Path

import numpy as np
from PIL import Image

import evocity
from evocity.kinds.window_lines import strip_mask

DOCS = Path(__file__).resolve().parents[1]
SIDE, GAP = 256, 12


def drawn(mask: np.ndarray) -> Image.Image:
    picture = Image.fromarray(np.where(mask, 40, 255).astype(np.uint8)).convert("RGB")
    return picture.resize((SIDE, SIDE), Image.Resampling.NEAREST)


def beside(*pictures: Image.Image) -> Image.Image:
    wide = len(pictures) * SIDE + (len(pictures) - 1) * GAP
    sheet = Image.new("RGB", (wide, SIDE), (200, 200, 200))
    for place, one in enumerate(pictures):
        sheet.paste(one, (place * (SIDE + GAP), 0))
    return sheet


def bests(run, name: str) -> list[np.ndarray]:
    """Where the best of the first population lies, and the best of all."""
    values = run.columns.value(name)
    first = run.columns.generation == 0
    found = []
    for among in (first, np.ones_like(first)):
        row = int(np.nanargmin(np.where(among, values, np.nan)))
        print(name, run.columns.ids[row], values[row])
        found.append(run[int(run.columns.ids[row])].genome.mask)
    return found


def main(folder: Path) -> None:
    leaf = np.asarray(Image.open(DOCS.parent / "runs" / "leaf.png").convert("L")) < 128
    run = evocity.open_run(folder / "leaf")
    sheet = beside(drawn(leaf), *map(drawn, bests(run, "leaf_distance")))
    sheet.save(DOCS / "images" / "kinds-leaf.png", optimize=True)
    told = json.loads((DOCS.parent / "runs" / "shore.geojson").read_text())
    shore = strip_mask(np.array(told["coordinates"]), 4.0, 64, 2.0)
    run = evocity.open_run(folder / "shore")
    sheet = beside(drawn(shore), *map(drawn, bests(run, "shore_distance")))
    sheet.save(DOCS / "images" / "kinds-shore.png", optimize=True)
    run = evocity.open_run(folder / "course")
    chosen = max(
        (run[int(one)] for one in run.columns.ranked()[0]),
        key=lambda one: one.genome.courses[0].length * (one.scores["built_area_lost"] < 0.05),
    )
    print(chosen.id, chosen.scores)
    path = DOCS / "images" / "kinds-course.png"
    chosen.save(path)
    picture = Image.open(path).convert("P", palette=Image.Palette.ADAPTIVE, colors=96)
    picture.save(path, optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
