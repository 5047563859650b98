"""Buildings of a quarter between streets: one place of an original, turned to the quarter."""

from dataclasses import dataclass

import numpy as np

from evocity.operators.plans.donor import Donor
from evocity.operators.plans.gene import FaceGene
from evocity.operators.plans.laying import Lot, lay_piece

# Least share of a building that a street may leave of it.
_LEAST_SHARE = 0.25
# Points of a lot on which candidates are compared, and candidates that are laid.
_POINTS, _BEST = 160, 3
# Candidates lie around one place of the original, within this share of a quarter's side.
_NEAR = 0.2
# Difference of the coverage that costs nothing.
_SLACK = 0.02
# Widest street over which a quarter looks for streets that end in its own, metres; the place beyond
# the front where such a street shows, px; weight of such streets in the score.
_WIDEST, _BEYOND, _MOUTHS = 30.0, 3, 0.5


@dataclass(frozen=True, eq=False)
class Places:
    """Places of an original with turn and mirror, ``(k,)`` each."""

    row: np.ndarray
    column: np.ndarray
    angle: np.ndarray
    mirror: np.ndarray

    def turns(self, pixel: float) -> np.ndarray:
        """Compute the rows and then the columns, px of ``pixel`` metres, that a metre down and a
        metre along the plan become in the original: float64 ``(k, 4)``."""
        sign = np.where(self.mirror, -1.0, 1.0)
        cosine, sine = np.cos(self.angle) / pixel, np.sin(self.angle) / pixel
        return np.column_stack([cosine, -sine, sign * sine, sign * cosine])

    @property
    def candidates(self) -> np.ndarray:
        """The places as `score_candidates` takes them, float64 ``(k, 6)``."""
        scale, axis = np.ones(self.row.size), np.full(self.row.size, np.nan)
        return np.column_stack([self.row, self.column, self.angle, self.mirror, scale, axis])

    def gene(self, k: int, face: int, name: str) -> FaceGene:
        row, column, angle = (float(v[k]) for v in (self.row, self.column, self.angle))
        return FaceGene(face, name, row, column, angle, bool(self.mirror[k]))


def draw_places(
    lot: Lot,
    angle: float,
    donor: Donor,
    colour: int,
    side: float,
    *,
    candidates: int,
    turned: bool,
    rng: np.random.Generator,
) -> Places:
    """Draw places around one place of an original, in the quarter ``colour`` of the original, so
    that quarters side by side show different places. The walls around a place turn to the
    direction ``angle`` of the quarter's streets, in quarters of about ``side`` px."""
    count = candidates
    place = (rng.random(2) + divmod(colour, 2)) / 2
    near = rng.uniform(-_NEAR, _NEAR, (count, 2)) * side
    quarter = rng.integers(4, size=count)
    mirror = rng.random(count) < 0.5
    limits = np.array(donor.city.shape, float)
    places = place * limits + near - 0.5
    frames = donor.frames(places, side / 2)
    if turned:
        angles = angle - np.where(mirror, -frames, frames) + quarter * (np.pi / 2)
    else:
        mirror[:] = False
        angles = angle - frames
        angles = angles - np.rint(angles / (np.pi / 2)) * (np.pi / 2)
    row, column = places.T
    draws = Places(row, column, angles, mirror)
    if not lot.rows.size:
        return draws
    # the whole lot lies within the original
    ways = np.arange(16) * (np.pi / 8)
    reach = np.sin(ways)[:, None] * lot.down + np.cos(ways)[:, None] * lot.along
    ends = reach.argmax(axis=1)
    turns = draws.turns(donor.city.metres_per_pixel)
    for axis, values in enumerate((draws.row, draws.column)):
        away = turns[:, 2 * axis : 2 * axis + 2] @ np.stack([lot.down[ends], lot.along[ends]])
        low, high = -away.min(axis=1), limits[axis] - 1 - away.max(axis=1)
        values[:] = np.where(low <= high, np.clip(values, low, np.maximum(low, high)), -1)
    return draws


def find_mouths(lot: Lot, face: int, lots: np.ndarray, built: np.ndarray) -> np.ndarray:
    """Find the pixels of a lot's strip that face a street which ends on the other side: bool
    ``(n,)``. Quarters without buildings so far have no streets."""
    rows, columns = lot.rows[lot.strip], lot.columns[lot.strip]
    outward = -lot.inward[:, rows, columns]
    row, column = rows + lot.window[0].start, columns + lot.window[1].start
    depth = lot.depth[rows, columns]
    known, facing = np.zeros(rows.size, bool), np.zeros(rows.size, bool)
    known_built = np.zeros(lots.max(initial=0) + 1, bool)
    known_built[lots[built]] = True
    for away in range(1, int(_WIDEST / lot.pixel) + 1):
        y, x = (
            np.rint(at + step * (depth + away)).astype(np.int64)
            for at, step in zip((row, column), outward, strict=True)
        )
        inside = (y >= 0) & (x >= 0) & (y < lots.shape[0]) & (x < lots.shape[1])
        y, x = np.where(inside, y, 0), np.where(inside, x, 0)
        met = inside & ~known & (lots[y, x] > 0) & (lots[y, x] != face)
        known |= met
        y, x = (
            np.clip(np.rint(at + _BEYOND * step), 0, side - 1).astype(np.int64)
            for at, step, side in zip((y, x), outward, lots.shape, strict=True)
        )
        facing |= met & known_built[lots[y, x]] & ~built[y, x]
    mouths = np.zeros(lot.rows.size, bool)
    mouths[lot.strip] = facing
    return mouths


def fill_quarter(
    lot: Lot, face: int, donor: Donor, draws: Places, goal: float, mouths: np.ndarray
) -> tuple[FaceGene, np.ndarray, float] | None:
    """Lay the places with the best scores, and choose the best one.

    The score is the built share of the strip along the outline, without the pixels ``mouths``, less
    twice the difference of the coverage from ``goal``, less half of the built share of the mouths.

    Returns the gene, the heights of the lot's pixels, float32 ``(n,)``, metres, and the built share
    of the strip; None if no place holds the lot.
    """
    from evocity.operators.plans._kernels import score_candidates

    every, strip = np.arange(lot.rows.size), np.flatnonzero(lot.strip & ~mouths)
    open_ends = np.flatnonzero(mouths)
    every = every[:: max(1, every.size // _POINTS)]
    strip = strip[:: max(1, strip.size // _POINTS)]
    open_ends = open_ends[:: max(1, open_ends.size // _POINTS)]
    pixel, nowhere = donor.city.metres_per_pixel, np.zeros(donor.city.shape, bool)

    area = lot.rows.size * lot.pixel**2

    def score(points: np.ndarray, inner: int, coverage: float, slack: float) -> np.ndarray:
        scores = np.empty(draws.row.size)
        score_candidates(
            donor.numbers, donor.areas, nowhere, pixel, donor.step, lot.down[points],
            lot.along[points], inner, area / max(inner, 1), _LEAST_SHARE if inner else 0.0,
            coverage, slack, 1.0, draws.candidates, -np.inf, scores,
        )  # fmt: skip
        return scores

    scores = score(np.concatenate([every, strip]), every.size, goal, _SLACK)
    if open_ends.size:
        scores = scores - _MOUTHS * np.maximum(score(open_ends, 0, 0.0, 0.0), 0)
    order = np.argsort(-scores, kind="stable")[:_BEST]
    best: tuple[float, FaceGene, np.ndarray, float] | None = None
    front = lot.strip & ~mouths
    for k in order[np.isfinite(scores[order])].tolist():
        gene = draws.gene(k, face, donor.city.name)
        heights = lay_piece(lot, gene, donor, least_share=_LEAST_SHARE)
        own = float(np.mean(heights[front] > 0)) if front.any() else 1.0
        rating = own - 2 * max(abs(float(np.mean(heights > 0)) - goal) - _SLACK, 0)
        if mouths.any():
            rating -= _MOUTHS * float(np.mean(heights[mouths] > 0))
        if best is None or rating > best[0]:
            best = rating, gene, heights, own
    return None if best is None else best[1:]
