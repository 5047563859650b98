"""Compiled straight skeleton of a polygon, and the faces that its arcs bound."""

import numpy as np

from evocity.accelerate import kernel

#: Determinant of two normals below which edges count as parallel.
_PARALLEL = 1e-7
#: Lengths that count as 0, metres.
_TINY = 1e-7


@kernel
def velocity(left, right, normals, weights):
    """Return x and y of the speed of the corner between two edges, and its kind: 0 for a corner, 1
    for edges that face each other, 2 for edges in one line of different speed."""
    ax, ay, bx, by = normals[left, 0], normals[left, 1], normals[right, 0], normals[right, 1]
    det = ax * by - ay * bx
    if abs(det) > _PARALLEL:
        p, q = weights[left], weights[right]
        return (p * by - q * ay) / det, (q * ax - p * bx) / det, 0
    if ax * bx + ay * by < 0:
        return 0.0, 0.0, 1
    if abs(weights[left] - weights[right]) > 1e-12:
        return 0.0, 0.0, 2
    return ax * weights[left], ay * weights[left], 0


@kernel
def skeleton(points, after, weights, most, nodes, arcs, deck):
    """Shrink a polygon, and write the arcs that its corners draw.

    points (n, 2), and the next point of the same ring (n,): the interior lies to the left. Edge k
    starts at point k and moves inwards by ``weights[k]``, 0 or more, per unit of time, until
    ``most``.

    nodes (m, 3) gets x, y and the time; the first n are the points. arcs (m, 4) gets two nodes and
    the edges whose faces meet there. deck (m, 2) gets two nodes and the edge of each side of what
    remains at ``most``.

    Returns the numbers of nodes, arcs and sides; the first is 0 without a result.

    Sources: Aichholzer, Aurenhammer, Alberts and Gärtner 1995, A novel type of skeleton for
    polygons; Felkel and Obdržálek 1998 for lists of active corners; edges of weight 0 after Biedl
    et al. 2015. The method tests all pairs at each event, n³ at worst.
    """
    n, room = points.shape[0], nodes.shape[0]
    normals, along = np.empty((n, 2)), np.empty((n, 2))
    offset = np.empty(n)
    for k in range(n):
        x, y = points[after[k], 0] - points[k, 0], points[after[k], 1] - points[k, 1]
        length = np.sqrt(x * x + y * y)
        if length < 1e-6:
            return 0, 0, 0
        along[k, 0], along[k, 1] = x / length, y / length
        normals[k, 0], normals[k, 1] = -y / length, x / length
        offset[k] = normals[k, 0] * points[k, 0] + normals[k, 1] * points[k, 1]
    # corners: place at their birth, speed, birth, edges beside them, neighbours, node
    at, speed, birth = np.empty((room, 2)), np.empty((room, 2)), np.zeros(room)
    left, right = np.empty(room, np.int64), np.empty(room, np.int64)
    before, following = np.empty(room, np.int64), np.empty(room, np.int64)
    node, alive = np.empty(room, np.int64), np.zeros(room, np.bool_)
    reflex = np.zeros(room, np.bool_)
    waiting = np.empty(room, np.int64)
    for k in range(n):
        nodes[k, 0], nodes[k, 1], nodes[k, 2] = points[k, 0], points[k, 1], 0.0
        following[k], before[after[k]] = after[k], k
        right[k], left[after[k]] = k, k
        node[k], alive[k] = k, True
        at[k, 0], at[k, 1] = points[k, 0], points[k, 1]
    for k in range(n):
        vx, vy, kind = velocity(left[k], right[k], normals, weights)
        if kind > 0:
            return 0, 0, 0
        speed[k, 0], speed[k, 1] = vx, vy
        p, q = left[k], right[k]
        reflex[k] = along[p, 0] * along[q, 1] - along[p, 1] * along[q, 0] < -1e-9
    corners, points_made, arcs_made = n, n, 0
    now = 0.0
    here, there = np.empty(2), np.empty(2)
    for _ in range(room):
        best, first, target = most, -1, -1
        for u in range(corners):
            if not alive[u]:
                continue
            v, e = following[u], right[u]
            dx = at[v, 0] + speed[v, 0] * (now - birth[v]) - at[u, 0]
            dy = at[v, 1] + speed[v, 1] * (now - birth[v]) - at[u, 1]
            dx -= speed[u, 0] * (now - birth[u])
            dy -= speed[u, 1] * (now - birth[u])
            length = dx * along[e, 0] + dy * along[e, 1]
            rate = (speed[v, 0] - speed[u, 0]) * along[e, 0]
            rate += (speed[v, 1] - speed[u, 1]) * along[e, 1]
            when = np.inf
            if rate < -1e-12:
                when = now + max(length, 0.0) / -rate
            elif length <= _TINY and rate <= 1e-12:
                when = now
            if when < best:
                best, first, target = when, u, -1
        for u in range(corners):
            if not (alive[u] and reflex[u]):
                continue
            px = at[u, 0] + speed[u, 0] * (now - birth[u])
            py = at[u, 1] + speed[u, 1] * (now - birth[u])
            for a in range(corners):
                if not alive[a]:
                    continue
                e = right[a]
                if e == left[u] or e == right[u]:
                    continue
                rate = normals[e, 0] * speed[u, 0] + normals[e, 1] * speed[u, 1] - weights[e]
                if rate > -1e-12:
                    continue
                gap = normals[e, 0] * px + normals[e, 1] * py - offset[e] - weights[e] * now
                if gap < -1e-6:
                    continue
                when = now + max(gap, 0.0) / -rate
                if when >= best - 1e-9:
                    continue
                b = following[a]
                x = at[u, 0] + speed[u, 0] * (when - birth[u])
                y = at[u, 1] + speed[u, 1] * (when - birth[u])
                low = (x - at[a, 0] - speed[a, 0] * (when - birth[a])) * along[e, 0]
                low += (y - at[a, 1] - speed[a, 1] * (when - birth[a])) * along[e, 1]
                high = (at[b, 0] + speed[b, 0] * (when - birth[b]) - x) * along[e, 0]
                high += (at[b, 1] + speed[b, 1] * (when - birth[b]) - y) * along[e, 1]
                if low < -_TINY or high < -_TINY:
                    continue
                best, first, target = when, u, a
        if first < 0:
            break
        now = best
        if corners + 4 > room or points_made + 4 > room or arcs_made + 6 > room:
            return 0, 0, 0
        u = first
        for k in range(2):
            here[k] = at[u, k] + speed[u, k] * (now - birth[u])
        count = 0
        if target < 0:
            v = following[u]
            for k in range(2):
                here[k] = (here[k] + at[v, k] + speed[v, k] * (now - birth[v])) / 2
        k = points_made
        nodes[k, 0], nodes[k, 1], nodes[k, 2] = here[0], here[1], now
        points_made += 1
        arcs[arcs_made, 0], arcs[arcs_made, 1] = node[u], k
        arcs[arcs_made, 2], arcs[arcs_made, 3] = left[u], right[u]
        arcs_made += 1
        alive[u] = False
        if target < 0:
            alive[v] = False
            arcs[arcs_made, 0], arcs[arcs_made, 1] = node[v], k
            arcs[arcs_made, 2], arcs[arcs_made, 3] = left[v], right[v]
            arcs_made += 1
            if following[v] == u:
                continue
            w = corners
            corners += 1
            left[w], right[w] = left[u], right[v]
            before[w], following[w] = before[u], following[v]
            waiting[0], count = w, 1
        else:
            a, b = target, following[target]
            e = right[a]
            w = corners
            corners += 2
            left[w], right[w], before[w], following[w] = left[u], e, before[u], b
            left[w + 1], right[w + 1], before[w + 1], following[w + 1] = (
                e,
                right[u],
                a,
                following[u],
            )
            if a == following[u]:  # the second part closes on a corner
                before[w + 1] = a
            waiting[0], waiting[1], count = w, w + 1, 2
        for k in range(count):
            w = waiting[k]
            node[w], birth[w], alive[w] = points_made - 1, now, True
            at[w, 0], at[w, 1] = here[0], here[1]
            following[before[w]] = w
            before[following[w]] = w
        # new corners: close lists of two, and follow ridges
        while count > 0:
            count -= 1
            w = waiting[count]
            if not alive[w]:
                continue
            x = following[w]
            vx, vy, kind = velocity(left[w], right[w], normals, weights)
            if following[x] == w or kind == 1:
                y = before[w]
                for k in range(2):
                    here[k] = at[x, k] + speed[x, k] * (now - birth[x])
                    there[k] = at[y, k] + speed[y, k] * (now - birth[y])
                if birth[x] == now:
                    here[0], here[1] = at[x, 0], at[x, 1]
                if birth[y] == now:
                    there[0], there[1] = at[y, 0], at[y, 1]
                ahead = (here[0] - at[w, 0]) ** 2 + (here[1] - at[w, 1]) ** 2
                behind = (there[0] - at[w, 0]) ** 2 + (there[1] - at[w, 1]) ** 2
                z = x if ahead <= behind else y
                if z == y:
                    here[0], here[1] = there[0], there[1]
                k = points_made
                if k + 2 > room or arcs_made + 4 > room or corners + 2 > room:
                    return 0, 0, 0
                nodes[k, 0], nodes[k, 1], nodes[k, 2] = here[0], here[1], now
                points_made += 1
                arcs[arcs_made, 0], arcs[arcs_made, 1] = node[w], k
                arcs[arcs_made, 2], arcs[arcs_made, 3] = left[w], right[w]
                arcs[arcs_made + 1, 0], arcs[arcs_made + 1, 1] = node[z], k
                arcs[arcs_made + 1, 2], arcs[arcs_made + 1, 3] = left[z], right[z]
                arcs_made += 2
                alive[w] = alive[z] = False
                if following[x] == w:
                    continue
                s = corners
                corners += 1
                if z == x:
                    left[s], right[s], before[s], following[s] = left[w], right[x], y, following[x]
                else:
                    left[s], right[s], before[s], following[s] = left[y], right[w], before[y], x
                node[s], birth[s], alive[s] = k, now, True
                at[s, 0], at[s, 1] = here[0], here[1]
                following[before[s]] = s
                before[following[s]] = s
                waiting[count] = s
                count += 1
                continue
            if kind == 2:
                return 0, 0, 0
            speed[w, 0], speed[w, 1] = vx, vy
            p, q = left[w], right[w]
            reflex[w] = along[p, 0] * along[q, 1] - along[p, 1] * along[q, 0] < -1e-9
    sides = 0
    for u in range(corners):
        if not alive[u]:
            continue
        if not np.isfinite(most) or points_made + 1 > room or arcs_made + 1 > room:
            return 0, 0, 0
        k = points_made
        nodes[k, 0] = at[u, 0] + speed[u, 0] * (most - birth[u])
        nodes[k, 1] = at[u, 1] + speed[u, 1] * (most - birth[u])
        nodes[k, 2] = most
        points_made += 1
        arcs[arcs_made, 0], arcs[arcs_made, 1] = node[u], k
        arcs[arcs_made, 2], arcs[arcs_made, 3] = left[u], right[u]
        arcs_made += 1
        node[u] = k
    for u in range(corners):
        if alive[u]:
            deck[sides, 0], deck[sides, 1] = node[u], node[following[u]]
            deck[sides, 2] = right[u]
            sides += 1
    return points_made, arcs_made, sides


@kernel
def merged(nodes, count, points, arcs, many, deck, sides, least):
    """Return for each of ``count`` nodes the node that stands for it, int64: ends of arcs and of
    the deck's sides shorter than ``least`` are one. The first ``points`` nodes
    stand for themselves."""
    root = np.arange(count)
    for k in range(many + sides):
        if k < many:
            i, j = arcs[k, 0], arcs[k, 1]
        else:
            i, j = deck[k - many, 0], deck[k - many, 1]
        far = 0.0
        for axis in range(3):
            far += (nodes[i, axis] - nodes[j, axis]) ** 2
        while root[i] != i:
            i = root[i]
        while root[j] != j:
            j = root[j]
        if i == j:
            continue
        if far < least * least:
            i, j = min(i, j), max(i, j)
            if j < points:
                continue
            root[j] = i
    for k in range(count):
        i = k
        while root[i] != i:
            i = root[i]
        root[k] = i
    return root


@kernel
def trace(after, weights, root, arcs, many, deck, sides, corners, starts):
    """Write the face of each edge as a ring of nodes, from the edge's start on: ``corners[starts[k]
    : starts[k + 1]]``, counterclockwise. The ring of an edge of weight 0 without arcs has two.

    Returns whether each face has exactly one ring."""
    n = len(after)
    room = many + sides + 2
    ends, used = np.empty((room, 2), np.int64), np.empty(room, np.bool_)
    # arcs by edge
    begin = np.zeros(n + 1, np.int64)
    for k in range(many):
        begin[arcs[k, 2] + 1] += 1
        begin[arcs[k, 3] + 1] += 1
    for k in range(n):
        begin[k + 1] += begin[k]
    fill, own = begin.copy(), np.empty(2 * many, np.int64)
    for k in range(many):
        for side in range(2, 4):
            e = arcs[k, side]
            own[fill[e]] = k
            fill[e] += 1
    length = 0
    starts[0] = 0
    for e in range(n):
        count = 0
        for m in range(begin[e], begin[e + 1] + sides):
            if m < begin[e + 1]:
                i, j = root[arcs[own[m], 0]], root[arcs[own[m], 1]]
            else:
                side = m - begin[e + 1]
                if deck[side, 2] != e:
                    continue
                i, j = root[deck[side, 0]], root[deck[side, 1]]
            if i == j:
                continue
            same = -1
            for k in range(count):
                if (ends[k, 0] == i and ends[k, 1] == j) or (ends[k, 0] == j and ends[k, 1] == i):
                    same = k
            if same >= 0:  # there and back again
                count -= 1
                ends[same, 0], ends[same, 1] = ends[count, 0], ends[count, 1]
                continue
            ends[count, 0], ends[count, 1] = i, j
            count += 1
        used[:count] = False
        corners[length], corners[length + 1] = e, after[e]
        length += 2
        if count == 0:
            if weights[e] > 0:
                return False
            starts[e + 1] = length
            continue
        place = after[e]
        for step in range(count):
            chosen = -1
            for k in range(count):
                if not used[k] and (ends[k, 0] == place or ends[k, 1] == place):
                    if chosen >= 0:
                        return False
                    chosen = k
            if chosen < 0:
                return False
            used[chosen] = True
            place = ends[chosen, 1] if ends[chosen, 0] == place else ends[chosen, 0]
            if step < count - 1:
                if place == e:
                    return False
                corners[length] = place
                length += 1
        if place != e:
            return False
        starts[e + 1] = length
    return True


@kernel
def sides(points, starts, cosine):
    """Return the side of each edge, int64 ``(p,)``, and the number of sides. A side has edges of a
    ring whose directions have at least this ``cosine`` to the side's first edge. Sides begin at the
    sharpest corner of a ring."""
    count = len(points)
    of = np.empty(count, np.int64)
    way = np.empty((count, 2))
    sides = 0
    for ring in range(len(starts) - 1):
        low, high = starts[ring], starts[ring + 1]
        for k in range(low, high):
            ahead = k + 1 if k + 1 < high else low
            x, y = points[ahead, 0] - points[k, 0], points[ahead, 1] - points[k, 1]
            length = max(np.sqrt(x * x + y * y), 1e-12)
            way[k, 0], way[k, 1] = x / length, y / length
        sharpest, least = low, 2.0
        for k in range(low, high):
            behind = k - 1 if k > low else high - 1
            turn = way[k, 0] * way[behind, 0] + way[k, 1] * way[behind, 1]
            if turn < least:
                sharpest, least = k, turn
        first = sharpest
        for step in range(high - low):
            k = low + (sharpest - low + step) % (high - low)
            if step > 0 and way[k, 0] * way[first, 0] + way[k, 1] * way[first, 1] < cosine:
                sides += 1
                first = k
            of[k] = sides
        sides += 1
    return of, sides
