"""Draws noon-sun.png and noon-sun-bred.png of docs/fitness.md: shade at noon, 21 December.

Run it with the Python that has evocity installed; the second picture needs the run:
evocity run runs/noon-sun.toml, then python docs/sheets/noon_sun.py runs/noon-sun
"""

import runpy
import sys
from pathlib import Path

import numpy as np
from _sheet import contact_sheet, save
from PIL import Image

import evocity
from evocity.pictures.picture import render

MEASURE = Path(__file__).parents[2] / "runs" / "noon_sun.py"
SHADE = np.array([92, 132, 190])


def shaded(city, shade) -> Image.Image:
    """The map of heights, its open ground in shade coloured."""
    picture = np.array(render(city, legend=False).convert("RGB"))
    picture[shade(city) & ~city.built] = SHADE
    return Image.fromarray(picture).resize((512, 512), Image.Resampling.NEAREST)


def drawn(city) -> Image.Image:
    return render(city, legend=False).convert("RGB").resize((512, 512), Image.Resampling.NEAREST)


def main(folder: str | None = None) -> None:
    sun = runpy.run_path(str(MEASURE))
    measure, shade = sun["noon_sun"], sun["shade"]

    def told(city, name: str) -> str:
        share, density = measure(city), evocity.fitness.fsi(city)
        return f"{name}: {share:.0%} of the open ground in the sun, FSI {density:.1f}"

    cities = [evocity.read_map(name) for name in ("lyon-1er", "montpellier-pas-du-loup")]
    row = [(told(city, city.name), shaded(city, shade)) for city in cities]
    credit = list(dict.fromkeys(city.attribution for city in cities))
    save(contact_sheet([row], thanks=credit), "noon-sun.png")
    if folder is None:
        return
    run = evocity.open_run(folder)
    last = run.individuals(run.members(run.generations[-1]).column("id").to_pylist())
    kept = max((one for one in last if one.feasible), key=lambda one: one.values["noon_sun"])
    city = evocity.decode(kept.genome).city
    print(f"individual {kept.id}: {kept.values}")
    row = [(f"individual {kept.id}", drawn(city)), (told(city, "shade"), shaded(city, shade))]
    save(contact_sheet([row], thanks=city.attribution.split("; ")), "noon-sun-bred.png")


if __name__ == "__main__":
    main(*sys.argv[1:])
