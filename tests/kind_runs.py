"""Recipes of small runs that breed shapes, curves and sites."""

import json

import numpy as np
from PIL import Image
from toy_runs import town

PARENTS = {
    "shape": '[[parents]]\nshape = "sierpinski"\n[[parents]]\nshape = "koch"\n',
    "curve": "[[parents]]\ncurve = [[4, 60], [40, 110], [80, 20], [120, 70]]\n"
    '[[parents]]\ncurve = [[4, 20], [60, 40], [80, 90], [120, 10]]\nname = "other"\n',
    "site": '[[parents]]\nmap = "left.npy"\n[[parents]]\nmap = "right.npy"\n'
    '[[curves]]\nwidth = 8\nlay = 0\nfrom = "shore.geojson"\n'
    "[[curves]]\nwidth = 4\nlay = 6\nstart = [4, 4]\nend = [4, 120]\npoints = 3\n",
}
MEASURES = {
    "shape": '[[fitness]]\nfile = "leaf.png"\n[[fitness]]\nname = "gsi"\ntarget = 0.2\n',
    "curve": '[[fitness]]\nfile = "shore.geojson"\n[[fitness]]\nname = "sinuosity"\ngoal = "min"\n',
    "site": '[[fitness]]\nname = "built_area_lost"\n[[fitness]]\nname = "buildings_near_course"\n'
    '[[fitness]]\nfile = "shore.geojson"\nmax = 400\n',
}
RECORDED = {
    "shape": ["shape_cover", "shape_dimension"],
    "curve": ["curve_length", "curve_dimension", "simplicity", "gsi"],
    "site": ["area_within_reach", "curve_length", "fsi"],
}
RECIPE = """
[run]
name = "{kind}"
kind = "{kind}"
seed = 5
population = 6
generations = {generations}
record = {recorded}
[map]
pixels = 64
metres_per_pixel = 2.0
[evaluation]
workers = {workers}
{rest}
"""


def written(folder, kind, generations=2, workers=0, more="", parents=None, measures=None):
    np.save(folder / "left.npy", np.roll(town(1), 1, axis=0))
    np.save(folder / "right.npy", np.roll(town(2), 2, axis=1))
    x = np.linspace(2, 126, 60)
    line = np.column_stack([x, 64 + 20 * np.sin(x / 20)]).tolist()
    told = {"type": "LineString", "window": True, "coordinates": line}
    (folder / "shore.geojson").write_text(json.dumps(told))
    dark = np.full((40, 40), 255, np.uint8)
    dark[10:30, 15:25] = 0
    Image.fromarray(dark).save(folder / "leaf.png")
    genome = "[genome]\nblock = 4\nfit = false\n" if kind == "site" else ""
    rest = genome + (parents or PARENTS[kind]) + (measures or MEASURES[kind]) + more
    path = folder / "kind.toml"
    recorded = json.dumps(RECORDED[kind])
    path.write_text(RECIPE.format(**{
        "kind": kind, "generations": generations, "workers": workers, "rest": rest,
        "recorded": recorded,
    }))  # fmt: skip
    return path
