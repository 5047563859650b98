"""Draws the plots of docs/plots.md: plot-objectives.png, plot-front.png, plot-pedigree.png and
plot-provenance.png.

Run it with the Python that has evocity and matplotlib installed, of a run of the bundled recipe:
evocity run demo --set run.population=24 --set run.generations=8 --out RUN
python docs/sheets/plots.py RUN
"""

import io
import sys
from pathlib import Path

from PIL import Image

import evocity
from evocity import plot

IMAGES = Path(__file__).parent.parent / "images"
MOST = 80_000  # bytes


def save(axes, name: str) -> None:
    """Write a figure with as many colours as the file has room for."""
    kept = io.BytesIO()
    axes.figure.savefig(kept, format="png", dpi=100)
    for colours in (128, 64, 40, 24):
        small = Image.open(kept).convert("RGB").quantize(colours, dither=Image.Dither.NONE)
        small.save(IMAGES / name, optimize=True)
        if (IMAGES / name).stat().st_size < MOST:
            return
    raise SystemExit(f"{name} is larger than {MOST} bytes")


def main(run: evocity.analysis.Run) -> None:
    goals = ["autosimilarity", "alignment", "crumbs", "slivers"]
    save(plot.objectives(run, goals)[0], "plot-objectives.png")
    save(plot.front(run, "alignment", "autosimilarity"), "plot-front.png")
    youngest = int(run.columns.ids[run.columns.alive][-1])
    save(plot.pedigree(run, youngest, 3), "plot-pedigree.png")
    save(plot.lifs(run[youngest], "provenance"), "plot-provenance.png")


if __name__ == "__main__":
    main(evocity.open_run(sys.argv[1]))
