"""Courses bred together with their fabric against random ones: python benchmarks/site.py [FOLDER]

Lyon, 256 m: built area lost against the share of buildings within 50 m of the course, 540
evaluations a seed, five seeds. The hypervolume is that of (built area lost, share of buildings
further away) below (.25, 1), as a share of that rectangle. Random courses have control points drawn
evenly in the window, and lie in Lyon's own code; those that are no individuals are drawn again, and
count for nothing. FOLDER keeps the runs and a picture of each.
"""

import argparse
import statistics
import tempfile
import time
from pathlib import Path

import numpy as np

import evocity
from evocity.fitness import buildings_near_course, built_area_lost
from evocity.search.preparation.preparation import prepare

LOST = 0.25
POPULATION, GENERATIONS, SEEDS = 30, 17, range(5)


def recipe_of(seed: int) -> evocity.Recipe:
    return evocity.Recipe(
        run={
            "name": f"site-{seed}",
            "kind": "site",
            "seed": seed,
            "population": POPULATION,
            "generations": GENERATIONS,
        },
        map={"pixels": 64, "metres_per_pixel": 4.0},
        genome={"block": 4, "fit": False},
        parents=["lyon-1er"],
        curves=[{"width": 14, "lay": 0, "start": [20, 2], "end": [200, 250], "points": 4}],
        fitness=["built_area_lost", "buildings_near_course"],
        operators={
            "point_perturbation": {"weight": 6, "step": {"from": 0.01, "to": 0.5}},
            "point_exchange": 2,
            "relocation": 2,
        },
        evaluation={"workers": 0},
    )


def volume(points) -> float:
    """The share of the rectangle (LOST, 1) that ``points`` (lost, near) dominate."""
    kept = sorted((lost, 1 - near) for lost, near in points if lost < LOST)
    area, least = 0.0, 1.0
    for lost, far in kept:
        if far < least:
            area += (LOST - lost) * (least - far)
            least = far
    return area / LOST


def values_of(site) -> tuple[float, float]:
    return built_area_lost(site), buildings_near_course(site)


def random_courses(seed: int, count: int) -> list[tuple[float, float]]:
    source = prepare(recipe_of(seed)).sources[0].genome
    rng, found = np.random.default_rng(seed), []
    course = source.courses[0]
    while len(found) < count:
        points = rng.uniform(0, source.side, course.points.shape)
        site = type(source).of(source.fabric, (course.replace(points=points),))
        if site.problem is None:
            found.append(values_of(site))
    return found


def bred(seed: int, folder: Path) -> list[tuple[float, float]]:
    out = folder / f"site-{seed}"
    with evocity.Search(recipe_of(seed), out=out) as search:
        for _ in search:
            pass
    run, found = evocity.open_run(out), []
    for birth in run.individuals(list(range(POPULATION * (GENERATIONS + 1)))):
        if not birth.ok:
            continue
        for course in birth.genome.courses:
            assert course.problem is None, f"birth {birth.id}: {course.problem}"
        found.append((birth.values["built_area_lost"], birth.values["buildings_near_course"]))
    run.save(run.best("buildings_near_course").id, folder / f"site-{seed}.png")
    return found


def main(folder: Path) -> None:
    rows = []
    for seed in SEEDS:
        start = time.process_time()
        ours = bred(seed, folder)
        drawn = random_courses(seed, POPULATION * (GENERATIONS + 1))
        rows.append((volume(ours), volume(drawn)))
        print(
            f"seed {seed}: bred {rows[-1][0]:.3f}, random {rows[-1][1]:.3f}, "
            f"{len(ours)} individuals, "
            f"{time.process_time() - start:.0f} s of a core",
            flush=True,
        )
    mine, theirs = (statistics.median(column) for column in zip(*rows, strict=True))
    print(f"median: bred {mine:.3f}, random {theirs:.3f}, {mine / theirs:.2f} times")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path)
    given = parser.parse_args().folder
    with tempfile.TemporaryDirectory() as made:
        folder = given or Path(made)
        folder.mkdir(parents=True, exist_ok=True)
        main(folder)
