"""Streets as a plan: the energy distance of a map's streets from those of reference cities."""

import math
from dataclasses import dataclass

import numpy as np

from evocity.citymap import CityMap
from evocity.fitness import _kernels
from evocity.fitness.energy import mean_distance
from evocity.fitness.measure import Undefined, keep_result
from evocity.fitness.reference import Reference
from evocity.fitness.registry import fitness
from evocity.genome import Genome

#: Fewest edges of a street graph that show a distribution.
FEWEST = 20
#: Reach of the neighbourhood in which directions of edges are compared, metres.
NEARBY = 80.0
#: Features of each edge of a street graph.
FEATURES = (
    "log length",
    "log width",
    "bottleneck",
    "log length of the street",
    "dead end",
    "straightness",
    "order of directions",
)

# Least deviation of a feature: features that are the same in all edges of a reference count too.
_LEAST = 0.1
# Lengths and widths get so many metres more before the logarithm.
_MORE = 2.0
_ENDS = np.array([len(FEATURES)])


@fitness(goal="min", range=(-1, math.inf), any_site=True)
def street_distance(city: CityMap, reference: Reference, genome: Genome | None = None) -> float:
    """Distance between the streets of the map and those of other cities; about 0 for similar plans.

    The measure describes each edge of the street graph by seven features. The graph contains
    streets and alleys of 4 m or more (`CityMap.alley_graph`).

    - Feature 1 is the logarithm of l + 2 m, with l the length of the edge.
    - Feature 2 is the logarithm of w + 2 m, with w the median width of the edge.
    - Feature 3 is the bottleneck: the least width of the edge divided by its median width.
    - Feature 4 is the logarithm of s + 2 m, with s the length of the street that contains the edge.
      Edges that go straight on over a crossing form one street.
    - Feature 5 says whether the edge is a dead end; an exit from the map is not a dead end.
    - Feature 6 is the straightness: the distance between the edge's ends divided by its length.
    - Feature 7 is the order of directions: \\|Σ l e^{4iθ}\\| / Σ l over the edges within 80 m, with
      θ the direction from end to end and l the length of an edge. The place of an edge is the
      middle between its two ends.

    The measure divides each feature by its standard deviation in the reference, or by .1 if the
    deviation is smaller; in this deviation, all cities have equal weights. The reference is one
    city, or several cities with weights, as for `fabric_distance`. The value is the least of the
    distances to each city with a weight, and to all cities together. A map with the street plan of
    one of its source cities has a distance of about 0, whatever its buildings are. In the distance
    to all cities together, each edge has the weight of its city, divided by the number of the
    city's edges. For the source cities of a run, the genome gives the weight of each city, as for
    `fabric_distance`.

    Formula: 2 E\\|X − Y\\| − E\\|X − X′\\| − E\\|Y − Y′\\|, with E the mean over pairs, X and X′
    two different edges of the city, and Y and Y′ two different edges of the reference. The estimate
    is unbiased: a map compared with itself has a value slightly below 0. Unit: none; features count
    in standard deviations of the reference. Two windows of the same real city mostly have a
    distance from −.05 to .3. Range: from slightly below 0 upwards. Empty map: NaN. The distance is
    NaN if the map or the reference has fewer than 20 edges. Source: our own; energy distance,
    Székely & Rizzo 2013 (Journal of Statistical Planning and Inference 143:1249-1272).

    >>> lyon = evocity.read_map("lyon-1er")
    >>> street_distance(evocity.read_map("montpellier-pas-du-loup"), reference=lyon) > 0.3
    True
    >>> abs(street_distance(lyon, reference=lyon)) < 0.05
    True
    """
    scaled = _scaled_reference(reference)
    if isinstance(scaled, Undefined):
        return scaled
    own = edge_features(city)
    shares = reference.shares(city, genome)
    if reference.weights is None:
        shares = shares * scaled.density
        shares = shares / (shares.sum() or 1)
    reason = _too_few(city.name, own.shape[1])
    counted = [k for k, share in enumerate(shares) if share and scaled.counts[k]]
    if not reason and not shares.any():
        reason = f"nothing built in {city.name} comes from a city of the reference"
    reason = reason or _too_few("the reference", sum(scaled.counts[k] for k in counted))
    if reason:
        return Undefined(reason)
    own = scaled.scale(own)
    alike = mean_distance(own, own, _ENDS)[0]
    between = np.array([mean_distance(own, other, _ENDS)[0] for other in scaled.edges])
    pooled = shares / shares[counted].sum() * (np.array(scaled.counts) > 0)
    within = np.einsum("k,l,kl", pooled, pooled, scaled.within)
    distances = [2 * np.einsum("k,k", pooled, between) - within]
    distances += [
        2 * between[k] - scaled.within[k, k] for k in counted if scaled.counts[k] >= FEWEST
    ]
    return float(min(distances) - alike)


@keep_result
def edge_features(city: CityMap) -> np.ndarray:
    """Compute `FEATURES` of the n edges of the map's street graph: float64 ``(7, n)``.

    Lengths and widths in m (logarithms). About 0.3 ms at 256² once the street graph is there.
    """
    graph = city.alley_graph
    ends = graph.nodes[graph.ends]
    along = ends[:, 1] - ends[:, 0]
    chord = np.hypot(*along.T)
    dead = ((graph.degree == 1) & ~graph.at_frame)[graph.ends].any(axis=1)
    length = np.maximum(graph.length, 1e-9)
    turn = 4 * np.arctan2(along[:, 1], along[:, 0])
    directed = length * (chord > 0)
    middle = ends.mean(axis=1)
    order = np.empty(len(graph))
    _kernels.order_nearby(
        np.ascontiguousarray(middle.T),
        np.stack([directed * np.cos(turn), directed * np.sin(turn), length]),
        NEARBY,
        order,
    )
    return np.stack(
        [
            np.log(length + _MORE),
            np.log(graph.clear + _MORE),
            graph.least / np.maximum(graph.clear, 1e-9),
            np.log(np.bincount(graph.street, length)[graph.street] + _MORE),
            dead,
            np.minimum(chord / length, 1),
            order,
        ]
    )


@dataclass(frozen=True, eq=False)
class _Scaled:
    """The edges of a reference in units of its deviations, and the distances among them.

    deviation : (7,). edges : float32 (7, n) of each city, scaled; counts : n of each city.
    density : edges per built pixel of each city.
    within : (k, k), mean distance between the edges of two cities; for one city, between two
        different edges.
    """

    deviation: np.ndarray
    edges: list[np.ndarray]
    counts: list[int]
    density: np.ndarray
    within: np.ndarray

    def scale(self, table: np.ndarray) -> np.ndarray:
        return np.ascontiguousarray(table / self.deviation[:, None], dtype=np.float32)


@keep_result
def _scaled_reference(reference: Reference) -> _Scaled | Undefined:
    tables = [edge_features(city) for city in reference.cities]
    counts = [table.shape[1] for table in tables]
    if reason := _too_few("the reference", sum(counts)):
        return Undefined(reason)
    filled = [table for table in tables if table.shape[1]]
    centre = np.mean([table.mean(axis=1) for table in filled], axis=0)
    variance = np.mean([((table.T - centre) ** 2).mean(axis=0) for table in filled], axis=0)
    built = [max(np.count_nonzero(city.built), 1) for city in reference.cities]
    scaled = _Scaled(
        deviation=np.maximum(np.sqrt(variance), _LEAST),
        edges=[],
        counts=counts,
        density=np.array(counts) / built,
        within=np.zeros((len(tables), len(tables))),
    )
    scaled.edges.extend(map(scaled.scale, tables))
    for k, one in enumerate(scaled.edges):
        for m, other in enumerate(scaled.edges[: k + 1]):
            scaled.within[k, m] = scaled.within[m, k] = mean_distance(one, other, _ENDS)[0]
    return scaled


def _too_few(where: str, count: int) -> str:
    if count >= FEWEST:
        return ""
    return f"{count} edges of the street graph in {where}; the comparison needs {FEWEST}"
