/** The handles of a shape: each has a name, a place, and a way to move. A frame is the image of a reference rectangle
 * `base` {low, high}; wire forms and curves have their points. */

import { apply, compose, mapsOf } from "./modeller-shapes.js";

/** Corners and edges of a frame, as shares of its reference rectangle. */
const FRAME = {
  middle: [0.5, 0.5], "corner 1": [0, 0], "corner 2": [1, 0], "corner 3": [1, 1], "corner 4": [0, 1],
  "edge 1": [0.5, 0], "edge 2": [1, 0.5], "edge 3": [0.5, 1], "edge 4": [0, 0.5],
};

const within = ({ low, high }, shares) => shares.map((share, axis) => low[axis] + share * (high[axis] - low[axis]));

/** The corners of a frame. */
const cornersOf = (map, base) => [[0, 0], [1, 0], [1, 1], [0, 1]].map((shares) => apply(map, within(base, shares)));

/** The number of parts of a shape that have handles of their own. */
export const partsOf = (shape) => (shape.kind === "frames" ? shape.maps.length : shape.points.length);

/** The names of the handles of one part. */
export const namesOf = (shape) => (shape.kind === "frames" ? Object.keys(FRAME) : ["point"]);

/** The place of a handle. */
export function placeOf(shape, base, part, name) {
  return shape.kind === "frames" ? apply(shape.maps[part], within(base, FRAME[name])) : shape.points[part];
}

/** The shape after a handle has moved to `place`. */
export function moveHandle(shape, base, part, name, place) {
  if (shape.kind !== "frames") return { ...shape, points: shape.points.map((point, k) => (k === part ? place : point)) };
  const from = placeOf(shape, base, part, name), by = place.map((value, axis) => value - from[axis]);
  const map = movedMap(shape.maps[part], base, name, by);
  return map ? { ...shape, maps: shape.maps.map((one, k) => (k === part ? map : one)) } : shape;
}

/** The middle moves a frame. An edge moves, and the other edge of its pair stays. A corner turns and scales the frame
 * about the corner across. */
function movedMap(map, base, name, [x, y]) {
  const shares = FRAME[name];
  let [a, b, e, c, d, f] = map;
  if (name === "middle") return [a, b, e + x, c, d, f + y];
  if (name.startsWith("edge")) {
    const axis = shares[0] === 0.5 ? 1 : 0, sign = shares[axis] ? 1 : -1, stays = shares[axis] ? base.low[axis] : base.high[axis];
    const long = base.high[axis] - base.low[axis], [u, v] = [sign * x / long, sign * y / long];
    if (axis) [b, d] = [b + u, d + v]; else [a, c] = [a + u, c + v];
    return [a, b, e - u * stays, c, d, f - v * stays];
  }
  const [p, q] = apply(map, within(base, shares)), [s, t] = apply(map, within(base, shares.map((one) => 1 - one)));
  const [u, v] = [p - s, q - t], whole = u * u + v * v;
  if (whole < 1e-18) return null;
  const [g, h] = [((u + x) * u + (v + y) * v) / whole, ((v + y) * u - (u + x) * v) / whole]; // as complex numbers
  return compose([g, -h, s - g * s + h * t, h, g, t - h * s - g * t], map);
}

/** The shape with one more map, or one more point after a point. The new frame has half the size of the reference. */
export function addPart(shape, base, after) {
  if (shape.kind === "frames") {
    const [x, y] = within(base, [0.5, 0.5]);
    return { ...shape, maps: [...shape.maps, [0.5, 0, x / 2, 0, 0.5, y / 2]] };
  }
  if (shape.kind === "curve") return shape;
  const arc = Math.max(0, shape.arcs.findIndex(([start]) => start === after));
  const [start, end] = shape.arcs[arc] || [0, 1], added = shape.points.length;
  const [[x, y], [u, v]] = [shape.points[start], shape.points[end]], middle = [(x + u) / 2 - (v - y) / 4, (y + v) / 2 + (u - x) / 4];
  const arcs = shape.arcs.flatMap((one, k) => (k === arc ? [[start, added], [added, end]] : [one]));
  const flipped = shape.flipped.flatMap((one, k) => (k === arc ? [one, one] : [one]));
  return { ...shape, points: [...shape.points, middle], arcs, flipped };
}

/** The shape without a map or a point; the arcs at a point become one. Null where too little would remain. */
export function removePart(shape, part) {
  if (shape.kind === "frames") return shape.maps.length < 2 ? null : { ...shape, maps: shape.maps.filter((_, k) => k !== part) };
  if (shape.kind === "curve" || shape.points.length < 3) return null;
  const into = shape.arcs.findIndex(([, end]) => end === part), out = shape.arcs.findIndex(([start]) => start === part);
  let pairs = shape.arcs.map((arc, k) => ({ arc, isFlipped: shape.flipped[k] }));
  if (into >= 0 && out >= 0) pairs[into] = { arc: [shape.arcs[into][0], shape.arcs[out][1]], isFlipped: shape.flipped[into] };
  pairs = pairs.filter(({ arc: [start, end] }) => start !== part && end !== part);
  if (!pairs.length) return null;
  const renamed = (point) => point - Number(point > part);
  return {
    ...shape, points: shape.points.filter((_, k) => k !== part),
    arcs: pairs.map(({ arc }) => arc.map(renamed)), flipped: pairs.map(({ isFlipped }) => isFlipped),
  };
}

/** The shape with one map mirrored across its own middle, or the arcs that begin at a point mirrored. */
export function mirrorPart(shape, base, part) {
  if (shape.kind === "curve") return shape;
  if (shape.kind === "wire") return { ...shape, flipped: shape.flipped.map((one, k) => (shape.arcs[k][0] === part ? !one : one)) };
  const [x] = within(base, [0.5, 0.5]);
  return { ...shape, maps: shape.maps.map((map, k) => (k === part ? compose(map, [-1, 0, 2 * x, 0, 1, 0]) : map)) };
}

/** Lines that show the parts of a shape: {part, points, isClosed}. */
export function outlinesOf(shape, base) {
  if (shape.kind === "frames") return shape.maps.map((map, part) => ({ part, points: cornersOf(map, base), isClosed: true }));
  if (shape.kind === "curve") return [{ part: -1, points: shape.points, isClosed: false }];
  return shape.arcs.map(([start, end], arc) => ({ part: start, arc, points: [shape.points[start], shape.points[end]], isClosed: false, isFlipped: shape.flipped[arc] }));
}

/** A wire form as frames. */
export const framesOf = (shape) => ({ ...shape, kind: "frames", maps: mapsOf(shape), points: [], arcs: [], flipped: [] });
