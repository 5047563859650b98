"""Roofs on footprints with more corners: those at which kinds of ground meet at a wall."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely

from evocity.formats import Group
from evocity.formats.numbering import number_rows
from evocity.formats.shells import Shells
from evocity.formats.solids import Rings


def join_nodes(roofed: Sequence[Group], noded: Sequence[Group]) -> list[Group]:
    """Give the groups with roofs the footprints of the same groups with more corners.

    roofed : groups whose roofs stand on footprints without these corners. noded : the same solids
    in the same order. Walls with more corners on the ground become triangles, so that each face
    stays flat.
    """
    joined = []
    for group, own in zip(roofed, noded, strict=True):
        roofs = group.roofs
        if roofs is not None:
            lost = roofs.owned(len(group))
            roofs = _with_nodes(roofs, group.rings, own.rings, len(group))
            if roofs is not None:
                lost &= ~roofs.owned(len(group))
            group = _flatten(group, lost, own.heights)
        joined.append(replace(group, polygons=own.polygons, roofs=roofs))
    return joined


def _flatten(group: Group, lost: np.ndarray, tops: np.ndarray) -> Group:
    """Give the solids ``lost``, bool ``(n,)``, flat roofs at the heights ``tops`` of the map."""
    if not lost.any():
        return group
    shapes, eaves = list(group.attributes["roof"]), list(group.attributes["eavesHeight"])
    for k in np.flatnonzero(lost).tolist():
        shapes[k], eaves[k] = "flat", round(float(tops[k]), 3)
    more = {"roof": shapes, "eavesHeight": eaves}
    return replace(
        group, heights=np.where(lost, tops, group.heights), attributes={**group.attributes, **more}
    )


def without_nodes(polygons: np.ndarray, footprints: np.ndarray, grid: float) -> np.ndarray:
    """Remove the corners of ``polygons`` that are not corners of the ``footprints`` on a ``grid``,
    metres. Polygons that would not be valid, or would lose a real corner, keep all corners."""
    rings, owner = shapely.get_rings(polygons, return_index=True)
    points, ring = shapely.get_coordinates(rings, return_index=True)
    own, of_own = shapely.get_coordinates(footprints, return_index=True)
    known = np.column_stack([of_own, np.round(own / grid).astype(np.int64)])
    asked = np.column_stack([owner[ring], np.round(points / grid).astype(np.int64)])
    # the grid may have moved a corner by a step
    steps = [(0, x, y) for x in (-1, 0, 1) for y in (-1, 0, 1)]
    known = np.concatenate([known + step for step in steps])
    number = number_rows(np.concatenate([known, asked]))
    real = np.zeros(len(number), bool)
    real[number[: len(known)]] = True
    kept = real[number[len(known) :]]
    plain = polygons.copy()
    rows = np.arange(len(rings) + 1)
    starts, first = np.searchsorted(ring, rows), np.searchsorted(owner, np.arange(len(plain) + 1))
    for k in np.unique(owner[ring[~kept]]).tolist():
        spans = [slice(starts[r], starts[r + 1]) for r in range(first[k], first[k + 1])]
        parts = [points[span][kept[span]] for span in spans]
        if min(len(set(map(tuple, part.tolist()))) for part in parts) < 3:
            continue
        polygon = shapely.Polygon(parts[0], parts[1:])
        near = polygon.is_valid and polygon.hausdorff_distance(polygons[k]) < 2 * grid
        if near:
            plain[k] = polygon
    return plain


def _with_nodes(roofs: Shells, plain: Rings, noded: Rings, count: int) -> Shells | None:
    """Number the corners on the ground by ``noded`` rings in place of ``plain`` ones, and divide
    the walls that have more corners there. Solids that do not match lose their roofs."""
    first, begins = plain.starts[plain.first(count)], noded.starts[noded.first(count)]
    after = noded.after
    places: dict[int, dict[int, int]] = {}
    for solid in np.unique(roofs.owner).tolist():
        own = plain.points[first[solid] : first[solid + 1]].tolist()
        all_ = {
            tuple(point): k
            for k, point in enumerate(noded.points[begins[solid] : begins[solid + 1]].tolist())
        }
        at = [all_.get(tuple(point), -1) for point in own]
        if min(at) >= 0:
            places[solid] = dict(enumerate(at))
    corners: list[int] = []
    sizes: list[int] = []
    owners: list[int] = []
    parts: list[int] = []
    triangles: list[list[int]] = []
    of: list[int] = []
    total = 0
    spans = np.searchsorted(roofs.of, np.arange(len(roofs.owner) + 1)).tolist()

    def add(face: list[int], solid: int, part: int, rows: list[list[int]]) -> None:
        nonlocal total
        of.extend([len(sizes)] * len(rows))
        triangles.extend([[total + k for k in row] for row in rows])
        corners.extend(face)
        sizes.append(len(face))
        owners.append(solid)
        parts.append(part)
        total += len(face)

    for k, (solid, part) in enumerate(zip(roofs.owner.tolist(), roofs.part.tolist(), strict=True)):
        if solid not in places:
            continue
        begin, end = int(roofs.starts[k]), int(roofs.starts[k + 1])
        own = roofs.corners[begin:end].tolist()
        face = [c if c >= 0 else -1 - places[solid][-1 - c] for c in own]
        rows = (roofs.triangles[spans[k] : spans[k + 1]] - begin).tolist()
        known = set(places[solid].values())
        between = {}
        for one, other in zip(face, face[1:] + face[:1], strict=True):
            if one < 0 and other < 0:
                nodes = _between(-1 - one, -1 - other, known, after, int(begins[solid]))
                if nodes:
                    between[one, other] = [-1 - node for node in nodes]
        if not between:
            add(face, solid, part, rows)
            continue
        for row in rows:
            for fan in _fans([face[c] for c in row], between):
                add(fan, solid, part, [[0, 1, 2]])
    if not sizes:
        return None
    return Shells(
        points=roofs.points,
        corners=np.array(corners, np.int64),
        starts=np.concatenate([[0], np.cumsum(sizes)]),
        owner=np.array(owners, np.int64),
        part=np.array(parts, np.uint8),
        triangles=np.array(triangles, np.int64).reshape(-1, 3),
        of=np.array(of, np.int64),
    )


def _between(one: int, other: int, known: set[int], after: np.ndarray, begin: int) -> list[int]:
    """List the nodes on the edge from point ``one`` to point ``other`` of a solid; none if this is
    not an edge of its footprint."""
    nodes, here = [], int(after[begin + one]) - begin
    while here not in known:
        nodes.append(here)
        here = int(after[begin + here]) - begin
    return nodes if here == other else []


def _fans(triangle: list[int], between: dict[tuple[int, int], list[int]]) -> list[list[int]]:
    """Divide a triangle at the nodes on its sides."""
    for k in range(3):
        a, b, apex = (triangle[(k + j) % 3] for j in range(3))
        nodes = between.get((a, b))
        if nodes:
            line = [a, *nodes, b]
            pieces = [[line[j], line[j + 1], apex] for j in range(len(line) - 1)]
            return [fan for piece in pieces for fan in _fans(piece, between)]
    return [triangle]
