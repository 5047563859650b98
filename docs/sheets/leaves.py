"""Draws the borders of two leaves as curves with details, by the captions of figures 5 to 9 of
Hnaidi, Guérin and Akkouche: each leaf with an eighth of its numbers, a leaf that takes the details
of the other leaf by the maps of either, and details made larger and smaller.

The pictures are runs/leaf.png and runs/toothed-leaf.png; the second is drawn by `toothed_leaf`.
Run it with the Python that has evocity installed: python docs/sheets/leaves.py
"""

import warnings
from pathlib import Path

import numpy as np
from _sheet import contact_sheet, save
from PIL import Image, ImageDraw

from evocity.fitness.curves import read_dark
from evocity.scene import picture_outline
from evocity.shapes import Detailed, fit_curve, line_picture, rms_of

RUNS = Path(__file__).parent.parent.parent / "runs"
SIDE, PIXELS = 240, 256
DEPTH, FINE = 8, 5


def toothed_leaf() -> Image.Image:
    """Draw a leaf with a stem, whose border has teeth like those of a cherry leaf."""
    at = np.linspace(0, 1, 1001)
    blade = 0.27 * np.sin(np.pi * at**0.8) ** 0.9
    teeth = 0.022 * (1 - (19 * at) % 1) * (blade > 0.03)
    half = np.maximum(blade + teeth, 0.006)
    up = 0.18 + 0.76 * at
    right = np.column_stack([0.5 + half, 1 - up])
    left = np.column_stack([0.5 - half, 1 - up])[::-1]
    stem = np.array([[0.492, 0.97], [0.508, 0.97]])
    points = np.vstack([stem, right, left]) * 4 * PIXELS
    picture = Image.new("L", (4 * PIXELS, 4 * PIXELS), 255)
    ImageDraw.Draw(picture).polygon([tuple(point) for point in points], 0)
    small = picture.resize((PIXELS, PIXELS), Image.Resampling.BOX)
    return small.point(lambda grey: 0 if grey < 128 else 255)


def border(name: str, reach: float) -> np.ndarray:
    return picture_outline(read_dark((RUNS / name).read_bytes(), name), reach)


def drawn(*lines: np.ndarray) -> Image.Image:
    whole = [line[np.append(True, (np.diff(line, axis=0) != 0).any(axis=1))] for line in lines]
    picture = line_picture(whole, side=2 * SIDE)
    return picture.convert("RGB").resize((SIDE, SIDE))


def row(like: Detailed, smooth: Detailed, rough: Detailed) -> list[tuple[str, Image.Image]]:
    """Carry the details of ``rough`` to ``smooth`` by the maps of ``like``."""
    one, donor = smooth.recoded(like), rough.recoded(like)
    return [
        ("(a) a toothed leaf", drawn(smooth.line())),
        ("(b) the details: a fern leaf", drawn(rough.line())),
        ("(c) (a) with the details of (b)", drawn(one.transferred(donor, FINE).line())),
    ]


def main() -> None:
    toothed_leaf().save(RUNS / "toothed-leaf.png", optimize=True)
    fern = fit_curve(border("leaf.png", 1.5), depth=DEPTH, starts=3)
    toothed = fit_curve(border("toothed-leaf.png", 0), depth=DEPTH, starts=3)
    for name, leaf in (("fern leaf", fern), ("toothed leaf", toothed)):
        extent = np.ptp(leaf.line(), axis=0).max()
        print(f"{name}: an eighth is {rms_of(leaf, 3):.3f} px off, {extent:.0f} px high")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # some of these borders cross themselves
        finer = range(DEPTH - FINE, DEPTH)
        rows = [
            [
                ("(a) a fern leaf", drawn(fern.line())),
                ("(b) by an eighth of its numbers", drawn(fern.dropped(3).line())),
                ("(a) and (b)", drawn(fern.dropped(3).line(), fern.line())),
            ],
            [
                ("(a) a toothed leaf", drawn(toothed.line())),
                ("(b) by an eighth of its numbers", drawn(toothed.dropped(3).line())),
                ("(a) and (b)", drawn(toothed.dropped(3).line(), toothed.line())),
            ],
            row(toothed, toothed, fern),
            row(fern, toothed, fern),
            [
                ("(a) a toothed leaf", drawn(toothed.line())),
                ("(b) details doubled", drawn(toothed.amplified(2, finer).line())),
                ("(c) details halved", drawn(toothed.amplified(0.5, finer).line())),
            ],
        ]
    titles = (
        "figure 5: a border, by an eighth of its numbers",
        "figure 6: a second border",
        "figure 7: details carried by the maps of (a)",
        "figure 8: details carried by the maps of (b)",
        "figure 9: details made larger and smaller",
    )
    save(contact_sheet(rows, titles=titles), "shapes-leaves.png", colours=32)


if __name__ == "__main__":
    main()
