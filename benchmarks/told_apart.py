"""Can bred cities be told from real ones? python benchmarks/told_apart.py [RUN …] [--real FILE …]
[--learnt FILE.npz] [--save FILE.npz] [--members N]

Of each RUN, a run folder, the living of its last generation, decoded, stand beside the maps of its
source cities, and beside further real ones: the bundled districts, and every --real map file, up to
1024 m of it. Without a RUN, once-crossed children of three pairs of bundled districts are judged.

A random forest looks at 134 features of plan and buildings in windows of 128, 256 and 512 m, with
heights in whole metres. The area under its curve (AUC) is .5 where it cannot tell bred windows from
real ones, 1 where it always can. Whole places are held out:

- fresh: the forest learnt on the other given runs, and on real cities other than the sources. It
  needs two runs of different cities.
- quadrant: it learnt on three quadrants of these maps too, and judges the fourth.
- learnt: it learnt on the fronts in --learnt, a file that --save wrote of other runs, and on real
  cities. Runs that share a city with the judged one are left out.
- pictures: as quadrant, on patches of 64 px that `likeness.py` describes.
- floor: the forest separates real windows from real windows. A coin splits the quadrants of places,
  and half of the places are held out; mean and 90th percentile of 20 coins.

Then the shares of the smaller parent, and the features by what each gives away by itself.
"""

import argparse
import os
import time
import warnings
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import likeness
import numpy as np
from _machine import description
from _traits import traits
from sklearn.ensemble import RandomForestClassifier
from sklearn.metrics import roc_auc_score

import evocity
from evocity.citymap import CityMap
from evocity.errors import EvocityError
from evocity.fitness import smallest_share
from evocity.operators import QuarterFusion

#: Sides of windows, metres, and the steps between their corners.
WINDOWS = {128: 128, 256: 128, 512: 256}
TREES, COINS = 300, 20


@dataclass
class Place:
    """A real map or the maps of a run, and the features of their windows.

    cities: names of the source cities. windows: of each side, (features, quadrants).
    """

    name: str
    cities: frozenset[str]
    maps: list[CityMap]
    bred: bool
    share: list[float] = field(default_factory=list)
    sources: list[CityMap] = field(default_factory=list)
    windows: dict[int, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    patches: tuple[np.ndarray, np.ndarray] | None = None


NAMES: list[str] = []


def main(given) -> None:
    print(description())
    start = time.perf_counter()
    bred = [of_run(path, given.members) for path in given.runs] or crossed_once()
    real = real_places(bred, given.real)
    for place in (*bred, *real):
        measure(place, pictures=not given.no_pictures)
    learnt = load(given.learnt) if given.learnt else []
    if given.save:
        save(given.save, bred)
    print(
        f"{sum(len(one.maps) for one in bred)} bred maps, {len(real)} real places, "
        f"{len(NAMES)} features; {time.perf_counter() - start:.0f} s"
    )
    sides = [side for side in WINDOWS if any(one.windows[side][0].size for one in real)]
    hows = ("fresh", "quadrant", *(("learnt",) if learnt else ()))
    columns = [f"{how} {side}" for side in sides for how in hows]
    columns += [] if given.no_pictures else ["pictures"]
    print(
        f"\n{'AUC':34}"
        + "".join(f"{name:>14}" for name in columns)
        + "  smaller parent: least, mean"
    )
    rows = []
    for place in bred:
        row = []
        for side in sides:

            def of(one, side=side):
                return one.windows[side]

            row.append(judged(place, bred, real, of))
            row.append(by_quadrants(place, bred, real, of))
            if learnt:
                row.append(judged(place, learnt, real, of))
        if not given.no_pictures:
            row.append(by_quadrants(place, bred, real, lambda one: one.patches))
        rows.append(row)
        least, mean = (min(place.share), np.mean(place.share)) if place.share else (np.nan, np.nan)
        print(line(place.name, row) + f"{least:9.2f}, {mean:.2f}", flush=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a column without any number
        print(line("mean", np.nanmean(rows, axis=0)))
    low, high = [], []
    for column in columns:
        side = None if column == "pictures" else int(column.split()[1])
        aucs = floors(real, side) if column.startswith(("fresh", "pictures")) else [np.nan]
        low.append(np.mean(aucs))
        high.append(np.percentile(aucs, 90))
    print(line("floor: real windows, mean", low))
    print(line("floor: real windows, 90 %", high))
    ranked(bred, real, given.features)


def line(name: str, row) -> str:
    return f"{name[:33]:34}" + "".join(f"{one:14.2f}" for one in row)


# -- places --------------------------------------------------------------------------------


def of_run(path: Path, most: int) -> Place:
    """The living of the last generation of a run folder, at most so many."""
    run = evocity.open_run(path)
    sources = [source.city for source in run.sources()]
    found = sorted(set(run.members(run.generations[-1])["id"].to_pylist()))
    births = [one for one in run.individuals(found) if one.parents]
    chosen = births[:: max(1, -(-len(births) // most))]
    maps, shares = [], []
    for birth in chosen:
        maps.append(evocity.decode(birth.genome).city)
        shares.append(float(smallest_share(maps[-1], birth.genome, sources)))
    names = frozenset(city.name for city in sources)
    place = Place(Path(path).name, names, maps, True, shares)
    place.sources = sources
    return place


def crossed_once() -> list[Place]:
    """Children of one quarter fusion, three pairs of bundled districts."""
    codes = {name: evocity.encode(evocity.read_map(name)).genome for name in evocity.cities()[1:4]}
    places = []
    for pair in combinations(codes, 2):
        parents = [codes[name] for name in pair]
        maps, shares = [], []
        sources = [evocity.read_map(name) for name in pair]
        for seed in range(8):
            rng = np.random.default_rng(seed)
            child = QuarterFusion()(parents, rng)
            maps.append(evocity.decode(child).city)
            shares.append(float(smallest_share(maps[-1], child, sources)))
        places.append(Place(" x ".join(pair), frozenset(pair), maps, True, shares))
        places[-1].sources = sources
    return places


def real_places(bred: list[Place], files: list[Path]) -> list[Place]:
    """The source cities, the bundled districts, and the maps of files, each once."""
    maps = {city.name: city for place in bred for city in place.sources}
    pixel = bred[0].maps[0].metres_per_pixel
    for name in evocity.cities():
        maps.setdefault(name, evocity.read_map(name, metres_per_pixel=pixel))
    for path in files:
        for side in (1024, 768, 512):
            try:
                city = evocity.read_map(path, metres_per_pixel=pixel, pixels=round(side / pixel))
            except EvocityError:
                continue
            maps[city.name] = city
            break
    return [Place(name, frozenset([name]), [city], False) for name, city in maps.items()]


def measure(place: Place, pictures: bool) -> None:
    """Compute the features of all windows of a place, and of patches."""
    for side, step in WINDOWS.items():
        rows, quadrants = [], []
        for city in place.maps:
            for window, quadrant in windows(city, side, step):
                found = traits(window)
                NAMES[:] = list(found)
                rows.append(list(found.values()))
                quadrants.append(quadrant)
        place.windows[side] = (
            np.array(rows).reshape(len(rows), len(NAMES)),
            np.array(quadrants, int),
        )
    if not pictures:
        return
    seen, quadrants = [], []
    for city in place.maps[:12]:
        whole = city.replace(np.round(city.heights))
        middles = [side // 2 for side in city.shape]
        for y, x in likeness.patches(city.shape):
            inside = [likeness.within(y, x, q, middles)[0] for q in range(4)]
            if any(inside):
                seen.append(likeness.described(whole, y, x))
                quadrants.append(int(np.argmax(inside)))
    place.patches = np.array(seen), np.array(quadrants, int)


def windows(city: CityMap, side: int, step: int):
    """Windows of a map that are built on by 5 % at least, and the quadrants of their middles, −1
    for windows that lie in more than one."""
    pixel = city.metres_per_pixel
    side, step = round(side / pixel), round(step / pixel)
    for y in range(0, city.shape[0] - side + 1, step):
        for x in range(0, city.shape[1] - side + 1, step):
            part = city.replace(city.heights[y : y + side, x : x + side])
            if part.built.mean() < 0.05:
                continue
            parts = {
                2 * (v >= city.shape[0] / 2) + (u >= city.shape[1] / 2)
                for v in (y, y + side - 1)
                for u in (x, x + side - 1)
            }
            yield part, parts.pop() if len(parts) == 1 else -1


# -- the forest ----------------------------------------------------------------------------


def forest(rows: np.ndarray, truth: np.ndarray, seed: int = 0) -> RandomForestClassifier:
    trees = TREES if rows.shape[1] < 200 else TREES // 3
    made = RandomForestClassifier(
        trees, random_state=seed, n_jobs=1, class_weight="balanced", min_samples_leaf=2
    )
    return made.fit(rows, truth)


def judged(place: Place, bred: list[Place], real: list[Place], of) -> float:
    """AUC of a forest that tells the windows of a bred ``place`` from real ones of its cities."""
    own = [one for one in real if one.cities & place.cities]
    others = [one for one in bred if one is not place and not one.cities & place.cities]
    apart = [one for one in real if not one.cities & place.cities]
    learn = [of(one)[0] for one in others if of(one)[0].size]
    known = [of(one)[0] for one in apart if of(one)[0].size]
    asked = [of(place)[0]], [of(one)[0] for one in own if of(one)[0].size]
    if not learn or not known or not asked[1] or not asked[0][0].size:
        return np.nan
    made = forest(*told(known, learn))
    rows, truth = told(asked[1], asked[0])
    return roc_auc_score(truth, made.predict_proba(rows)[:, 1])


def told(real: list[np.ndarray], bred: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    rows = [rows for rows in (*real, *bred) if rows.size]
    width = rows[0].shape[1] if rows else 0
    rows = np.concatenate([np.empty((0, width)), *rows])
    counts = sum(map(len, real)), sum(map(len, bred))
    return rows, np.repeat([0, 1], counts)


def by_quadrants(place: Place, bred: list[Place], real: list[Place], of) -> float:
    """The AUC where each quadrant of the maps of a ``place`` is held out in turn."""
    near = [one for one in real if one.cities & place.cities]
    rows, truth = told([of(one)[0] for one in near], [of(place)[0]])
    quadrants = np.concatenate([of(one)[1] for one in (*near, place)])
    strange = [one for one in (*real, *bred) if not one.cities & place.cities]
    more = told(*([of(one)[0] for one in strange if one.bred is kind] for kind in (False, True)))
    chance, known = np.zeros(len(rows)), quadrants >= 0
    if len(set(truth[known])) < 2:
        return np.nan
    for quadrant in range(4):
        inside, outside = quadrants == quadrant, known & (quadrants != quadrant)
        if len(set(truth[outside])) == 2 and inside.any():
            own = rows[outside], truth[outside]
            learnt = [np.concatenate(pair) for pair in zip(own, more, strict=True)]
            chance[inside] = forest(*learnt).predict_proba(rows[inside])[:, 1]
    return roc_auc_score(truth[known], chance[known])


def floors(real: list[Place], side: int | None) -> list[float]:
    """AUC, above a half, of forests that tell two halves of the real windows apart by a coin for
    each quadrant of each place; half of the places are held out."""
    if side and side >= 512:
        return [np.nan]
    rows, quadrants, numbers = [], [], []
    for number, one in enumerate(real):
        found, where = one.patches if side is None else one.windows[side]
        if found.size:
            rows.append(found)
            quadrants.append(where)
            numbers.append(np.full(len(found), number))
    rows, quadrants, numbers = (np.concatenate(one) for one in (rows, quadrants, numbers))
    aucs = []
    for seed in range(COINS if side else COINS // 4):
        rng = np.random.default_rng(seed)
        truth = rng.integers(0, 2, (len(real), 5))[numbers, quadrants]
        held = rng.permutation(len(real))[numbers] % 2 == 0
        if min(len(set(truth[held])), len(set(truth[~held]))) == 2:
            made = forest(rows[~held], truth[~held], seed)
            auc = roc_auc_score(truth[held], made.predict_proba(rows[held])[:, 1])
            aucs.append(max(auc, 1 - auc))
    return aucs or [np.nan]


def ranked(bred: list[Place], real: list[Place], most: int) -> None:
    """Print the features by what each gives away in windows of 256 m of one pair, on average."""
    table = []
    for place in bred:
        own = [one.windows[256][0] for one in real if one.cities & place.cities]
        rows, truth = told(own, [place.windows[256][0]])
        aucs = []
        for column in rows.T:
            known = ~np.isnan(column)
            both = len(set(truth[known])) == 2
            aucs.append(roc_auc_score(truth[known], column[known]) if both else 0.5)
        middles = [np.nanmean(rows[truth == kind], axis=0) for kind in (0, 1)]
        table.append([aucs, *middles])
    aucs, one, other = np.mean(table, axis=0)
    print(f"\n{'features at 256 m':34}{'AUC':>14}{'real':>14}{'bred':>14}")
    for at in np.argsort(-np.abs(aucs - 0.5))[:most]:
        print(f"{NAMES[at]:34}{aucs[at]:14.2f}{one[at]:14.3g}{other[at]:14.3g}")


# -- fronts of other runs ------------------------------------------------------------------


def save(path: Path, bred: list[Place]) -> None:
    """Write the features of the bred windows, float16, by run, cities and side."""
    tables = {
        f"{place.name}|{','.join(sorted(place.cities))}|{side}": rows.astype(np.float32)
        for place in bred
        for side, (rows, _) in place.windows.items()
    }
    np.savez_compressed(path, names=np.array(NAMES), **tables)


def load(path: Path) -> list[Place]:
    """Read what `save` wrote; refuse other features."""
    places: dict[str, Place] = {}
    with np.load(path) as tables:
        if tables["names"].tolist() != NAMES:
            raise SystemExit(f"{path}: features of another release. Write it again with --save.")
        for key in tables.files:
            if key == "names":
                continue
            name, cities, side = key.split("|")
            made = Place(name, frozenset(cities.split(",")), [], True)
            place = places.setdefault(name, made)
            rows = tables[key].astype(float)
            place.windows[int(side)] = rows, np.full(len(rows), -1)
    return list(places.values())


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", nargs="*", type=Path, metavar="RUN")
    parser.add_argument("--real", nargs="*", default=[], type=Path, metavar="FILE")
    parser.add_argument("--learnt", type=Path, help="features of fronts of other runs")
    parser.add_argument("--save", type=Path, help="file for the features of these runs")
    parser.add_argument("--members", type=int, default=24, help="most individuals of a run")
    parser.add_argument("--features", type=int, default=25, help="rows of the last table")
    parser.add_argument("--no-pictures", action="store_true")
    main(parser.parse_args())
