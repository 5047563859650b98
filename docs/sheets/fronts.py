"""Draws fronts.webp: windows of two real cities, and of the last fronts of two runs.

Run it with the Python that has evocity installed: python docs/sheets/fronts.py EARLIER RUN. EARLIER
is a run folder of the release 0.2, and RUN of this release; both have the same source cities. The
page docs/gallery.md tells the commands.
"""

import sys

from _sheet import IMAGES, contact_sheet
from PIL import Image

import evocity
from evocity.pictures import render

HIGHEST, EACH, SIDE = 40.0, 3, 288


def pictures(city: evocity.CityMap) -> tuple[Image.Image, Image.Image]:
    """Draw a map from above, and in three dimensions."""
    plan = render(city, highest=HIGHEST, legend=False, zoom=2).resize((SIDE, SIDE))
    scene = evocity.scene(city, squared=True)
    view = scene.picture(width=SIDE, tilt=52, legend=False, highest=HIGHEST).convert("RGB")
    tile = Image.new("RGB", (SIDE, SIDE), view.getpixel((0, 0)))
    tile.paste(view, (0, (SIDE - view.height) // 2))
    return plan, tile


def row(named: list[tuple[str, evocity.CityMap]]) -> list[tuple[str, Image.Image]]:
    """Draw a row of a sheet: maps from above, then the same maps in three dimensions."""
    drawn = [(name, *pictures(city)) for name, city in named]
    return [(name, plan) for name, plan, _ in drawn] + [("", view) for *_, view in drawn]


def draw(earlier: str, later: str) -> Image.Image:
    """Draw the sheet of two run folders."""
    runs = [evocity.open_run(folder) for folder in (earlier, later)]
    sources = [source.city for source in runs[1].sources()]
    rows = [row([(city.name, city) for city in sources])]
    for run in runs:
        kept = [choice.individual for choice in run.keep(EACH)]
        rows.append(row([(f"individual {one.id}", one.city) for one in kept]))
    titles = ["source cities", "bred by evocity 0.2", "bred by this release"]
    thanks = [f"{city.name}: {city.attribution}" for city in sources]
    return contact_sheet(rows, titles=titles, thanks=thanks)


if __name__ == "__main__":
    target = IMAGES / "fronts.webp"
    draw(*sys.argv[1:3]).save(target, quality=78, method=6)
    print(f"wrote {target.relative_to(IMAGES.parent)}, {target.stat().st_size // 1024} KB")
