"""Search for buildings of a source city that fit a face: candidates, scores, the best of them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from evocity.citymap import BUILT_ABOVE, CityMap
from evocity.errors import MapError
from evocity.operators.plans.donor import Donor, donor_of
from evocity.operators.plans.gene import SCALES, FaceGene
from evocity.operators.plans.laying import LEAST_SHARE, Lot, lay_numbers, lot_of, places_of
from evocity.operators.plans.plan import Plan
from evocity.operators.plans.storeys import find_lift, storey_range

#: Places lie within this distance of the middle of a building, px of the source city.
NEAR = 8.0
#: Number of places that are drawn for a face.
DRAWS = 2000
#: Largest difference of the coverage, as a share of the lot.
SLACK = 0.2
#: Largest loss of front, as a share of the strip along the outline.
LOSS = 0.1
#: Largest share of the built ground whose place stands on the map already.
REPEATS = 0.01

# Points of a lot on which candidates are compared, and on which they are chosen and moved;
# candidates that are moved; those of them that are laid if none fits, and if some fit.
_POINTS, _FEW, _BEST, _TRIED, _LAID = 250, 80, 48, 16, 6
# Most that moves and sizes add to a score.
_HOPE = 0.4
# Moves of a candidate to the outline, px; the shortest of equally good ones wins.
_STEPS = np.stack(np.meshgrid(*[np.arange(-2.0, 3.0)] * 2, indexing="ij"), -1).reshape(-1, 2)
_MOVES = _STEPS[np.argsort((_STEPS**2).sum(axis=1), kind="stable")]
# Sizes that are tried for each, with moves beside it, px; the first of equally good ones wins.
_TRIALS = np.array(
    [
        (down, along, size)
        for size in (1.0, 0.96, 1.04, 0.92, 1.08)
        for down, along in ((0, 0), (-1, 0), (0, -1), (0, 1), (1, 0))
    ]
)
# Most front that growing over gaps may add.
_GROWN = 0.15


def _gene(candidate: np.ndarray, face: int, name: str, **more) -> FaceGene:
    """Make the gene of a candidate."""
    row, column, angle, mirror, scale, axis = candidate.tolist()
    axis = None if math.isnan(axis) else axis
    return FaceGene(face, name, row, column, angle, mirror > 0, scale, axis, **more)


def fill_face(
    plan: Plan,
    face: int,
    source: CityMap,
    rng: np.random.Generator,
    *,
    draws: int = DRAWS,
    slack: float = SLACK,
    loss: float = LOSS,
    used: np.ndarray | None = None,
    repeats: float = REPEATS,
    scales: tuple[float, float] = SCALES,
    name: str | None = None,
    storeys: bool = True,
    heights: np.ndarray | None = None,
    like: FaceGene | None = None,
) -> tuple[FaceGene, np.ndarray] | None:
    """Find buildings of a source city that fit a face of a plan.

    Candidates are places near a building of the source city. Each candidate turns with the walls
    around its place to the direction of the face's walls, or by right angles more; a coin decides
    on the mirror. The score of a candidate is the built share of the strip of 3 px along the
    outline of the lot, less twice the difference of the coverages beyond ``slack``. Buildings that
    the outline would cut too far do not count. The candidates with the best scores move by up to
    2 px to the outline. The result is the one with the largest front, after `lay_piece` has laid
    its buildings.

    Parameters
    ----------
    face : number of the face, 1…n.
    rng : the generator of all random numbers. A call takes equally many numbers for each face.
    draws : number of candidates, 1 or more.
    slack : largest accepted difference of the coverage from that of the face.
    loss : the front may be so much below the face's own front.
    used : bool ``(H, W)``, pixels of the source city that stand on the map already; None for none.
    repeats : largest share of the new built ground that comes from ``used`` pixels.
    scales : range of the size of the buildings on the ground. The size acts in all directions, or
        along one direction of the face's walls.
    name : name of the source city in the gene; None for ``source.name``.
    storeys : whether the heights keep to the range of the face and the buildings around it
        (`storey_range`).
    heights : float32 ``(H, W)``, heights around the face, metres; None for those of the plan's map.
    like : a gene whose angle, mirror, scale and axis all candidates have. If the place of this gene
        fits, no other place is tried.

    Returns
    -------
    The gene of the face, and the heights of the pixels of its lot, float32 ``(n,)``, metres, row by
    row. None for an open face, and where nothing fits. Raises `MapError` for a number that is not a
    face of the plan.
    """
    _check_face(plan, face)
    candidates = _draw(plan, face, donor_of(source), draws, scales, rng)
    if plan.open[face - 1]:
        return None
    goal = _Goal(float(plan.coverage[face - 1]), float(plan.front[face - 1]), slack, loss)
    how = {"name": name or source.name, "used": used, "repeats": repeats}
    how["limits"] = _limits(plan, face, heights, storeys)
    lot = lot_of(plan, face)
    if like is None:
        return _find(lot, face, source, candidates, goal, scales=scales, **how)
    scales = like.scale, like.scale
    found = (
        _find(lot, face, source, group, goal, scales=scales, **how)
        for group in _alike(candidates, like)
    )
    return next((result for result in found if result is not None), None)


def _alike(candidates: np.ndarray, like: FaceGene) -> list[np.ndarray]:
    """Turn candidates as the gene ``like`` does; its own place comes first, by itself."""
    others = candidates.copy()
    others[:, 2:] = like.angle, like.mirror, like.scale, _axis_number(like.axis)
    return [np.concatenate([[[like.row, like.column]], others[:1, 2:]], axis=1), others]


def _axis_number(axis: float | None) -> float:
    return math.nan if axis is None else axis


def fill_halves(
    plan: Plan,
    face: int,
    sources: tuple[CityMap, CityMap],
    rng: np.random.Generator,
    *,
    draws: int = DRAWS,
    slack: float = SLACK,
    loss: float = LOSS,
    used: Sequence[np.ndarray | None] = (None, None),
    repeats: float = REPEATS,
    scales: tuple[float, float] = SCALES,
    names: tuple[str, str] | None = None,
    storeys: bool = True,
    heights: np.ndarray | None = None,
) -> tuple[tuple[FaceGene, FaceGene], np.ndarray] | None:
    """Find buildings of two places for the two halves of a face (`Lot.side`).

    Each half is filled as `fill_face` fills a face, from the first and the second of ``sources``.
    Each half keeps its own coverage and front. No building is cut between the halves.

    Parameters are those of `fill_face`; ``used`` and ``names`` have an entry for each source.

    Returns the genes of the halves, and the heights of the pixels of the whole lot, float32
    ``(n,)``, metres. None for an open face, and where one half stays empty. Raises `MapError` for a
    number that is not a face of the plan.
    """
    _check_face(plan, face)
    drawn = [_draw(plan, face, donor_of(one), draws, scales, rng, half=True) for one in sources]
    if plan.open[face - 1]:
        return None
    lot, limits = lot_of(plan, face), _limits(plan, face, heights, storeys)
    built = plan.heights[lot.window][lot.mask] > BUILT_ABOVE
    goals = []
    for part in (1, 2):
        side = lot.side(part)
        coverage = np.mean(built[side]) if side.any() else 0
        if coverage == 0:
            return None
        front = _front(built, side & lot.strip)
        goals.append(_Goal(float(coverage), front, slack, loss))
    total, genes, taken = np.zeros(lot.down.size, np.float32), [], list(used)
    for number, source in enumerate(sources):
        result = _find(
            lot, face, source, drawn[number], goals[number], part=number + 1,
            name=source.name if names is None else names[number], used=taken[number],
            repeats=repeats, scales=scales, limits=limits, standing=total > 0,
        )  # fmt: skip
        if result is None:
            return None
        gene, new = result
        genes.append(gene)
        total[new > 0] = new[new > 0]
        if sources[0] is sources[1]:
            taken[1] = _taken(lot, gene, source, new > 0, taken[1])
    # buildings of the second half may stand on the first
    fits = (goal.fits(total > 0, lot, part) for part, goal in enumerate(goals, start=1))
    return ((genes[0], genes[1]), total) if all(fits) else None


@dataclass(frozen=True)
class _Goal:
    """Coverage and front of a lot or of a half of it, 0…1, and how far buildings may be off."""

    coverage: float
    front: float
    slack: float
    loss: float

    def fits(self, built: np.ndarray, lot: Lot, part: int) -> bool:
        side = lot.side(part)
        share = abs(np.mean(built[side]) - self.coverage) <= self.slack
        return bool(share and _front(built, lot.strip & side) >= self.front - self.loss)


def _front(built: np.ndarray, strip: np.ndarray) -> float:
    """Compute the built share of a strip, bool ``(n,)``; 1 for an empty strip."""
    count = np.count_nonzero(strip)
    return np.count_nonzero(built & strip) / count if count else 1.0


def _check_face(plan: Plan, face: int) -> None:
    if not 1 <= face <= len(plan):
        raise MapError(
            f"the plan has no face with the number {face}",
            f"the number of a face of the plan, from 1 to {len(plan)}",
            "choose a number in this range",
        )


def _limits(plan: Plan, face: int, heights, storeys: bool) -> dict[str, float]:
    """Find the limits of heights in a gene."""
    found = storey_range(plan, face, heights) if storeys else None
    return {} if found is None else {"lowest": found[0], "highest": found[1]}


def _find(
    lot: Lot,
    face: int,
    source: CityMap,
    candidates: np.ndarray,
    goal: _Goal,
    *,
    name: str,
    used,
    repeats: float,
    scales: tuple[float, float],
    limits: dict,
    part: int = 0,
    standing=None,
) -> tuple[FaceGene, np.ndarray] | None:
    """Lay the candidates with the best scores, and choose the one with the largest front."""
    donor = donor_of(source)
    if not len(donor.middles):
        return None
    rating = _Rating(lot, donor, goal, used, repeats, part, scales)
    side = lot.side(part)
    strip, count = lot.strip & side, max(np.count_nonzero(side), 1)
    best: tuple[float, FaceGene, np.ndarray] | None = None
    for tried, candidate in enumerate(rating.best(candidates, goal.front - goal.loss - _GROWN)):
        if tried >= (_TRIED if best is None else _LAID):
            break
        gene = _gene(candidate, face, name, part=part, **limits)
        numbers = lay_numbers(lot, gene, donor, standing=standing)
        built = numbers > 0
        whole = built if standing is None else built | standing
        own = _front(whole, strip)
        if own < goal.front - goal.loss or (best is not None and own <= best[0]):
            continue
        coverage = np.count_nonzero(whole & side) / count
        if abs(coverage - goal.coverage) > goal.slack:
            continue
        if _repeated(lot, gene, source, built, used) <= repeats:
            best = own, gene, numbers
    if best is None:
        return None
    _, gene, numbers = best
    stand = donor.heights[numbers[numbers > 0]]
    if stand.size and gene.lowest is not None and gene.highest is not None:
        gene = replace(gene, lift=find_lift(stand, gene.lowest, gene.highest))
    return gene, gene.clamp(donor.heights)[numbers]


def _draw(
    plan: Plan, face: int, donor: Donor, draws: int, scales, rng, half: bool = False
) -> np.ndarray:
    """Draw candidates, equally many numbers for any face: float64 ``(k, 6)``, with row, column,
    angle, mirror (0 or 1), scale, and axis, which is NaN for all directions."""
    building = rng.integers(max(len(donor.middles), 1), size=draws)
    shift = rng.uniform(-NEAR, NEAR, (draws, 2))
    quarter = rng.integers(4, size=draws)
    mirror = rng.random(draws) < 0.5
    scale = rng.uniform(*scales, draws)
    axis = np.array([np.nan, 0.0, math.pi / 2])[rng.integers(3, size=draws)]
    if not len(donor.middles):
        return np.empty((0, 6))
    limits = np.array(donor.city.shape) - 1.0
    places = np.clip(donor.middles[building] - 0.5 + shift, 0, limits)
    radius = math.sqrt(plan.lot_area[face - 1] / (1 + half)) / donor.city.metres_per_pixel / 2
    frames = donor.frames(places, radius)
    angles = plan.angle[face - 1] - np.where(mirror, -frames, frames) + quarter * (math.pi / 2)
    axis = axis + plan.angle[face - 1]
    return np.column_stack([places, np.mod(angles, 2 * math.pi), mirror, scale, axis])


class _Rating:
    """Scores of candidates on some points of a lot, evenly spaced."""

    def __init__(self, lot: Lot, donor: Donor, goal, used, repeats: float, part: int, scales):
        self._donor, self._goal = donor, goal
        self._used = np.zeros(donor.city.shape, bool) if used is None else used
        self._repeats, self._scales, self._part = repeats, scales, part
        side = lot.side(part)
        every, strip = np.flatnonzero(side), np.flatnonzero(lot.strip & side)
        self._many, self._few = (self._points(lot, every, strip, n) for n in (_POINTS, _FEW))

    def _points(self, lot: Lot, every: np.ndarray, strip: np.ndarray, most: int) -> tuple:
        """Choose about ``most`` points of the lot and as many of its strip: what the kernels
        need."""
        every = every[:: max(1, every.size // most)]
        points = np.concatenate([every, strip[:: max(1, strip.size // most)]])
        donor, goal = self._donor, self._goal
        area = np.count_nonzero(lot.side(self._part)) * lot.pixel**2
        # a building may stand in a half with half of what the lot must have of it
        share = LEAST_SHARE / 2 if self._part else LEAST_SHARE
        return (
            donor.numbers, donor.areas, self._used, donor.city.metres_per_pixel, donor.step,
            lot.down[points], lot.along[points], every.size, area / max(every.size, 1), share,
            goal.coverage, goal.slack, self._repeats,
        )  # fmt: skip

    def best(self, candidates: np.ndarray, least: float) -> np.ndarray:
        """Choose the candidates with the best scores. Each moves by whole pixels and takes the size
        where its score is best, and there at ``least`` so much."""
        from evocity.operators.plans._kernels import improve_candidates

        scores = self.scores(candidates, least - _HOPE, few=True)
        order = np.argsort(-scores, kind="stable")[:_BEST]
        chosen = candidates[order[scores[order] >= least - _HOPE]]
        if not chosen.size:
            return chosen
        improve_candidates(*self._few, chosen, _MOVES, _TRIALS, *self._scales)
        scores = self.scores(chosen, least)
        order = np.argsort(-scores, kind="stable")
        return chosen[order[scores[order] >= least]]

    def scores(self, candidates: np.ndarray, floor: float, few: bool = False) -> np.ndarray:
        """Score candidates, float64 ``(k,)``; −∞ where they leave the source city, or repeat too
        much of it, and mostly where they score less than ``floor``. With ``few`` points for a first
        choice."""
        from evocity.operators.plans._kernels import score_candidates

        scores = np.empty(len(candidates))
        score_candidates(*(self._few if few else self._many), candidates, floor, scores)
        return scores


def _pixels(rows, columns, city: CityMap):
    height, width = city.shape
    return (
        np.clip(np.rint(rows).astype(np.int64), 0, height - 1),
        np.clip(np.rint(columns).astype(np.int64), 0, width - 1),
    )


def _taken(lot: Lot, gene: FaceGene, source: CityMap, built: np.ndarray, used) -> np.ndarray:
    """Mark the pixels of the source city that a gene takes, and those beside them, as used."""
    taken = np.zeros(source.shape, bool) if used is None else used.copy()
    rows, columns = (places[built] for places in places_of(lot, gene, source))
    for down in (-0.5, 0.5):
        for along in (-0.5, 0.5):
            taken[_pixels(rows + down, columns + along, source)] = True
    return taken


def _repeated(lot: Lot, gene: FaceGene, source: CityMap, built: np.ndarray, used) -> float:
    """Compute the share of the built ground whose place stands on the map already."""
    if used is None or not built.any():
        return 0.0
    rows, columns = (places[built] for places in places_of(lot, gene, source))
    return float(used[_pixels(rows, columns, source)].mean())


__all__ = ["DRAWS", "LOSS", "REPEATS", "SLACK", "fill_face", "fill_halves"]
