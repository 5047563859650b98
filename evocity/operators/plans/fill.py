"""Search for buildings of a source city that fit a face: candidates, scores, the best of them."""

import math
from dataclasses import dataclass, replace

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import MapError
from evocity.operators.plans.donor import Donor, donor_of
from evocity.operators.plans.gene import SCALES, FaceGene
from evocity.operators.plans.laying import Lot, lay_piece, places_of
from evocity.operators.plans.plan import Plan

#: Places lie within this distance of the middle of a building, px of the source city.
NEAR = 8.0
#: Number of places that are drawn for a face.
DRAWS = 200
#: Largest difference of the coverage, as a share of the lot.
SLACK = 0.2
#: Largest loss of front, as a share of the strip along the outline.
LOSS = 0.1
#: Largest share of the built ground whose place stands on the map already.
REPEATS = 0.01

# Points of a lot on which candidates are compared; candidates that are laid; moves of a candidate
# to the outline, px.
_POINTS, _BEST, _MOVES = 250, 12, 2
# Most front that growing over gaps may add.
_GROWN = 0.15


@dataclass(frozen=True, eq=False)
class _Candidates:
    """Places of a source city, with turn, mirror and scale, ``(k,)`` each."""

    row: np.ndarray
    column: np.ndarray
    angle: np.ndarray
    mirror: np.ndarray
    scale: np.ndarray

    def __getitem__(self, which: np.ndarray) -> "_Candidates":
        return _Candidates(*(values[which] for values in vars(self).values()))

    def gene(self, k: int, face: int, name: str) -> FaceGene:
        row, column, angle, mirror, scale = (values[k].item() for values in vars(self).values())
        return FaceGene(face, name, row, column, angle, mirror, scale)

    def turns(self, pixel: float) -> np.ndarray:
        """Compute the rows and then the columns, px of ``pixel`` metres, that a metre down and a
        metre along the plan become in the source city: float64 ``(k, 4)``. See
        `FaceGene.offsets`."""
        size, sign = self.scale * pixel, np.where(self.mirror, -1.0, 1.0)
        cosine, sine = np.cos(self.angle) / size, np.sin(self.angle) / size
        return np.column_stack([cosine, -sine, sign * sine, sign * cosine])


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
) -> tuple[FaceGene, np.ndarray] | None:
    """Find buildings of a source city that fit a face of a plan.

    Candidates are places near a building of the source city. Each candidate turns with the walls
    around its place to the direction of the face's walls, or by right angles more; a coin decides
    on the mirror. The score of a candidate is the built share of the strip of 3 px along the
    outline of the lot, less twice the difference of the coverages beyond ``slack``. The candidates
    with the best scores move by up to 2 px to the outline. The result is the one with the largest
    front, after `lay_piece` has laid its buildings.

    Parameters
    ----------
    face : number of the face, 1…n.
    rng : the generator of all random numbers. A call takes equally many numbers for each face.
    draws : number of candidates, 1 or more.
    slack : largest accepted difference of the coverage from that of the face.
    loss : the front may be so much below the face's own front.
    used : bool ``(H, W)``, pixels of the source city that stand on the map already; None for none.
    repeats : largest share of the new built ground that comes from ``used`` pixels.
    scales : range of the size of the buildings on the ground.
    name : name of the source city in the gene; None for ``source.name``.

    Returns
    -------
    The gene of the face, and the heights of the pixels of its lot, float32 ``(n,)``, metres, row by
    row. None for an open face, and where nothing fits. Raises `MapError` for a number that is not a
    face of the plan.
    """
    if not 1 <= face <= len(plan):
        raise MapError(
            f"face = {face}", f"a face of the plan, 1…{len(plan)}", "use the number of a face"
        )
    donor, name = donor_of(source), name or source.name
    candidates = _draw(plan, face, donor, draws, scales, rng)
    if plan.open[face - 1] or not len(donor.middles):
        return None
    lot = Lot(plan, face)
    coverage, front = float(plan.coverage[face - 1]), float(plan.front[face - 1])
    rating = _Rating(lot, donor, coverage, slack, used, repeats)
    best: tuple[float, FaceGene, np.ndarray] | None = None
    for candidate in rating.best(candidates, front - loss - _GROWN):
        gene = candidate.gene(0, face, name)
        heights = lay_piece(lot, gene, donor)
        built = heights > 0
        own = float(np.mean(built[lot.strip])) if lot.strip.any() else 1.0
        fits = abs(np.mean(built) - coverage) <= slack and own >= front - loss
        fits = fits and _repeated(lot, gene, source, built, used) <= repeats
        if fits and (best is None or own > best[0]):
            best = own, gene, heights
    return None if best is None else best[1:]


def _draw(plan: Plan, face: int, donor: Donor, draws: int, scales, rng) -> _Candidates:
    """Draw candidates: equally many numbers for any face."""
    building = rng.integers(max(len(donor.middles), 1), size=draws)
    shift = rng.uniform(-NEAR, NEAR, (draws, 2))
    quarter = rng.integers(4, size=draws)
    mirror = rng.random(draws) < 0.5
    scale = rng.uniform(*scales, draws)
    if not len(donor.middles):
        return _Candidates(*(np.empty(0) for _ in range(5)))
    limits = np.array(donor.city.shape) - 1.0
    places = np.clip(donor.middles[building] - 0.5 + shift, 0, limits)
    radius = math.sqrt(plan.lot_area[face - 1]) / donor.city.metres_per_pixel / 2
    frames = donor.frames(places, radius)
    angles = plan.angle[face - 1] - np.where(mirror, -frames, frames) + quarter * (math.pi / 2)
    return _Candidates(*places.T, np.mod(angles, 2 * math.pi), mirror, scale)


class _Rating:
    """Scores of candidates on some points of a lot, evenly spaced."""

    def __init__(self, lot: Lot, donor: Donor, coverage: float, slack: float, used, repeats: float):
        every, strip = np.arange(lot.rows.size), np.flatnonzero(lot.strip)
        every = every[:: max(1, every.size // _POINTS)]
        strip = strip[:: max(1, strip.size // _POINTS)]
        self._count = every.size
        points = np.concatenate([every, strip])
        self._down, self._along = lot.down[points], lot.along[points]
        self._donor, self._coverage, self._slack = donor, coverage, slack
        self._used = np.zeros(donor.city.shape, bool) if used is None else used
        self._repeats = repeats

    def best(self, candidates: _Candidates, least: float) -> list[_Candidates]:
        """Choose the candidates with the best scores, each moved by whole pixels to where its score
        is best, and there at ``least`` so much."""
        scores = self.scores(candidates)
        order = np.argsort(-scores, kind="stable")[:_BEST]
        chosen = candidates[order[np.isfinite(scores[order])]]
        if not chosen.row.size:
            return []
        steps = np.arange(-_MOVES, _MOVES + 1)
        moves = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)
        # the shortest of equally good moves wins
        moves = moves[np.argsort((moves**2).sum(axis=1), kind="stable")]
        many = chosen[np.repeat(np.arange(chosen.row.size), len(moves))]
        down, along = np.tile(moves.T.astype(float), chosen.row.size)
        many = replace(many, row=many.row + down, column=many.column + along)
        scores = self.scores(many).reshape(-1, len(moves))
        first = np.arange(len(scores)) * len(moves)
        good = scores.max(axis=1) >= least
        return [many[[k]] for k in (first + scores.argmax(axis=1))[good]]

    def scores(self, candidates: _Candidates) -> np.ndarray:
        """Score candidates, float64 ``(k,)``; −∞ where they leave the source city, or repeat too
        much of it."""
        from evocity.operators.plans._kernels import count_built

        city, inner = self._donor.city, self._count
        pixel, strip = city.metres_per_pixel, self._down.size - self._count
        ratio = pixel / self._donor.step
        counts = np.empty((candidates.row.size, 4), np.int64)
        count_built(
            self._donor.numbers, self._used, ratio, self._down, self._along, inner,
            candidates.row, candidates.column, candidates.turns(pixel), counts,
        )  # fmt: skip
        built, front, again, beyond = counts.T
        off = np.abs(built / inner - self._coverage) - self._slack
        scores = front / strip if strip else np.ones(len(counts))
        scores = scores - 2 * np.maximum(off, 0)
        # points are few, so the whole lot decides on small shares
        wrong = (beyond > 0) | (again > 2 * self._repeats * built + 2)
        height, width = city.shape
        wrong |= (candidates.row < 0) | (candidates.row > height - 1)
        wrong |= (candidates.column < 0) | (candidates.column > width - 1)
        return np.where(wrong, -np.inf, scores)


def _pixels(rows, columns, city: CityMap):
    height, width = city.shape
    return (
        np.clip(np.rint(rows).astype(np.int64), 0, height - 1),
        np.clip(np.rint(columns).astype(np.int64), 0, width - 1),
    )


def _repeated(lot: Lot, gene: FaceGene, source: CityMap, built: np.ndarray, used) -> float:
    """Compute the share of the built ground whose place stands on the map already."""
    if used is None or not built.any():
        return 0.0
    rows, columns = (places[built] for places in places_of(lot, gene, source))
    return float(used[_pixels(rows, columns, source)].mean())


__all__ = ["DRAWS", "LOSS", "REPEATS", "SLACK", "fill_face"]
