/** Shapes of the modeller: affine maps by their frames, wire forms and curves; whether maps contract; shapes between
 * two shapes. The formulas are those of `evocity.shapes`, which makes all files. A map is [a, b, e, c, d, f]: it takes
 * (x, y) to (a x + b y + e, c x + d y + f). */

/** Products of one length, and pieces of a box, at most. */
const MOST_PRODUCTS = 4096, MOST_PIECES = 40000;
/** The greatest length of a word. */
export const DEEPEST = 400;

export const apply = ([a, b, e, c, d, f], [x, y]) => [a * x + b * y + e, c * x + d * y + f];

/** The map `inner`, then the map `outer`. */
export const compose = ([a, b, e, c, d, f], [g, h, k, l, m, n]) =>
  [a * g + b * l, a * h + b * m, a * k + b * n + e, c * g + d * l, c * h + d * m, c * k + d * n + f];

/** The greatest factor of a map on a length. */
function normOf([a, b, , c, d]) {
  const whole = a * a + b * b + c * c + d * d, twice = 2 * Math.abs(a * d - b * c);
  return (Math.sqrt(whole + twice) + Math.sqrt(Math.max(0, whole - twice))) / 2;
}

/** The spectral radius of a map. */
function radiusOf([a, b, , c, d]) {
  const half = (a + d) / 2, area = a * d - b * c, root = half * half - area;
  return root < 0 ? Math.sqrt(area) : Math.abs(half) + Math.sqrt(root);
}

/** The map of an arc: it takes (0, 0) to `start` and (1, 0) to `end`. */
function arcMap([x, y], [u, v], isFlipped) {
  const [along, up] = [u - x, v - y], sign = isFlipped ? -1 : 1;
  return [along, -up * sign, x, up, along * sign, y];
}

/** The maps of a shape; none for a curve. */
export function mapsOf(shape) {
  if (shape.kind === "frames") return shape.maps;
  if (shape.kind === "curve") return [];
  return shape.arcs.map(([start, end], k) => arcMap(shape.points[start], shape.points[end], shape.flipped[k]));
}

/** Bounds of the joint spectral radius, by products of growing length, as `contraction_of`. */
export function contractionOf(maps) {
  let products = maps.map((map, k) => ({ map, word: [k] })), lower = 0, upper = Infinity, word = [0];
  for (let length = 1; ; length += 1) {
    let norm = 0;
    for (const one of products) {
      norm = Math.max(norm, normOf(one.map));
      const radius = radiusOf(one.map) ** (1 / length);
      if (radius > lower) [lower, word] = [radius, one.word];
    }
    upper = Math.min(upper, norm ** (1 / length));
    const isEnd = upper < 1 || lower >= 1 || length === 64 || products.length * maps.length > MOST_PRODUCTS;
    if (isEnd) return { lower, upper, word, products: products.map((one) => one.map), norm, length };
    products = products.flatMap((one) => maps.map((map, k) => ({ map: compose(one.map, map), word: [...one.word, k] })));
  }
}

/** Why a shape cannot be drawn, in a sentence; null for a good shape. */
export function faultOf(shape) {
  const maps = mapsOf(shape);
  if (!(shape.points || []).flat().every(Number.isFinite) || !maps.flat().every(Number.isFinite)) return "A number of the shape is not finite.";
  if (shape.kind === "curve") return null; // its maps do not change
  const { lower, upper, word } = contractionOf(maps);
  if (lower >= 1) {
    const which = word.length === 1 ? `${shape.kind === "wire" ? "arc" : "map"} ${word[0]}` : `the product of maps ${word.join(" ")}`;
    return `${which[0].toUpperCase()}${which.slice(1)} does not contract: its spectral radius is ${(lower ** word.length).toFixed(3)}, and it must be below 1.`;
  }
  if (upper >= 1) return `Nothing proves that the maps contract: their joint spectral radius lies between ${lower.toFixed(3)} and ${upper.toFixed(3)}.`;
  return null;
}

function fixedOf([a, b, e, c, d, f]) {
  const area = (1 - a) * (1 - d) - b * c;
  return Math.abs(area) < 1e-12 ? null : [((1 - d) * e + b * f) / area, (c * e + (1 - a) * f) / area];
}

/** A disc around the attractor: its centre, and its radius. */
function discOf(maps) {
  const fixed = maps.map(fixedOf).filter(Boolean), { products, norm, length } = contractionOf(maps);
  let centre = [0, 1].map((axis) => fixed.reduce((sum, one) => sum + one[axis], 0) / Math.max(1, fixed.length)), best = null;
  for (let turn = 0; turn < (products.length > 64 ? 1 : 20); turn += 1) {
    const reach = products.map((map) => Math.hypot(...apply(map, centre).map((value, axis) => value - centre[axis])) / (1 - (length === 1 ? normOf(map) : norm)));
    const far = reach.indexOf(Math.max(...reach)), end = fixedOf(products[far]);
    if (!best || reach[far] < best.radius) best = { centre, radius: reach[far] };
    if (!end) break;
    centre = centre.map((value, axis) => value + (end[axis] - value) / (turn + 3));
  }
  return { centre: best.centre, radius: best.radius * 1.0000001 + 1e-12 };
}

/** The box [left, low, right, high] of the attractor; it is wider by at most a five-hundredth of the disc, unless
 * that takes too many pieces. Pieces whose disc cannot widen the box end a branch. */
export function boxOf(maps) {
  const { centre: [x, y], radius } = discOf(maps), flat = Float64Array.from(maps.flat()), count = maps.length;
  const products = new Float64Array(6 * (DEEPEST + 1)), letters = new Int32Array(DEEPEST + 1);
  for (let fine = radius / 500; ; fine *= 2) {
    let [left, low, right, high] = [Infinity, Infinity, -Infinity, -Infinity], level = 0, pieces = 0, isNew = true;
    for (const fixed of maps.map(fixedOf)) {
      if (!fixed) continue;
      for (const [u, v] of maps.map((map) => apply(map, fixed))) { // points of the attractor
        left = Math.min(left, u); right = Math.max(right, u); low = Math.min(low, v); high = Math.max(high, v);
      }
    }
    products.set([1, 0, 0, 0, 1, 0]);
    while (level >= 0 && pieces < MOST_PIECES) {
      const at = 6 * level, a = products[at], b = products[at + 1], c = products[at + 3], d = products[at + 4];
      if (isNew) {
        pieces += 1;
        letters[level] = 0;
        const u = a * x + b * y + products[at + 2], v = c * x + d * y + products[at + 5];
        const across = Math.sqrt(a * a + b * b) * radius, up = Math.sqrt(c * c + d * d) * radius;
        const isInside = u - across >= left && u + across <= right && v - up >= low && v + up <= high;
        if (isInside || level === DEEPEST || (across < fine && up < fine)) {
          letters[level] = count;
          left = Math.min(left, u - across); right = Math.max(right, u + across); low = Math.min(low, v - up); high = Math.max(high, v + up);
        }
      }
      const letter = letters[level];
      if (letter >= count) {
        level -= 1;
        isNew = false;
        if (level >= 0) letters[level] += 1;
        continue;
      }
      const from = 6 * letter, to = at + 6, g = flat[from], h = flat[from + 1], l = flat[from + 3], m = flat[from + 4];
      products[to] = a * g + b * l; products[to + 1] = a * h + b * m; products[to + 2] = a * flat[from + 2] + b * flat[from + 5] + products[at + 2];
      products[to + 3] = c * g + d * l; products[to + 4] = c * h + d * m; products[to + 5] = c * flat[from + 2] + d * flat[from + 5] + products[at + 5];
      level += 1;
      isNew = true;
    }
    if (level < 0) return [left, low, right, high];
  }
}

/** The share of each map in the measure µ: as its area, but at least a hundredth, as `Shape.chaos`. */
export function sharesOf(maps) {
  const areas = maps.map(([a, b, , c, d]) => Math.abs(a * d - b * c)), sum = areas.reduce((a, b) => a + b, 0);
  const least = areas.map((area) => Math.max(area / Math.max(sum, 1e-300), 0.01)), whole = least.reduce((a, b) => a + b, 0);
  return least.map((share) => share / whole);
}

/** The initial figure K of a shape: {points, lines, faces}. */
export function figureOf(shape, box) {
  if (shape.primitive) return shape.primitive;
  const [left, low, right, high] = box;
  return { points: [[left, low], [right, low], [right, high], [left, high]], lines: [], faces: [[0, 1, 2], [0, 2, 3]] };
}

/** The words of a length, as {map, letters}, in lexicographic order. */
export function piecesOf(maps, depth) {
  let pieces = [{ map: [1, 0, 0, 0, 1, 0], letters: [] }];
  for (let level = 0; level < depth; level += 1) {
    pieces = pieces.flatMap((one) => maps.map((map, k) => ({ map: compose(one.map, map), letters: [...one.letters, k] })));
  }
  return pieces;
}

/** The colour of a word, red, green, blue of 0…1: each letter counts `mix` times as much as the letter before. */
export function mixedColour(letters, colours, mix) {
  const sum = [0, 0, 0];
  let share = 1, shares = 0;
  for (const letter of letters) {
    for (let k = 0; k < 3; k += 1) sum[k] += share * colours[letter][k];
    shares += share;
    share *= mix;
  }
  return letters.length ? sum.map((value) => value / shares) : colours[0];
}

/** The points of a curve, its ends included: P T_θ s for all words θ, with the fixed vectors s of the ends. */
export function lineOf({ points, matrices, ends }, depth) {
  let polygons = [points];
  for (let level = 0; level < depth; level += 1) polygons = polygons.flatMap((polygon) => matrices.map((matrix) => partOf(polygon, matrix)));
  const at = (polygon, weights) => [0, 1].map((axis) => polygon.reduce((sum, point, k) => sum + point[axis] * weights[k], 0));
  return [...polygons.map((polygon) => at(polygon, ends[0])), at(polygons.at(-1), ends[1])];
}

/** The control points of a part of a curve. */
export const partOf = (polygon, matrix) => polygon.map((_, j) => [0, 1].map((axis) => polygon.reduce((sum, point, i) => sum + point[axis] * matrix[i][j], 0)));

/** The maps at time `t` of a metamorphosis that the server has prepared: pairs of maps, and, unless all numbers are
 * interpolated, turn and stretch of each. */
export function mapsBetween({ pairs, linear }, t) {
  const mean = (one, other) => one.map((value, k) => (1 - t) * value + t * other[k]);
  return pairs.map(({ first, last, turn, stretches, angle }) => {
    if (linear) return mean(first, last);
    const [p, q, r, s] = mean(...stretches), [, , e, , , f] = mean(first, last);
    const back = angle === null ? mean([1, 0, 0, 1], [turn[4], turn[5], turn[6], turn[7]]) :
      [Math.cos(angle * t), -Math.sin(angle * t), Math.sin(angle * t), Math.cos(angle * t)];
    const [u, v, w, z] = times(turn, back), [a, b, c, d] = times([u, v, w, z], [p, q, r, s]);
    return [a, b, e, c, d, f];
  });
}

const times = ([a, b, c, d], [p, q, r, s]) => [a * p + b * r, a * q + b * s, c * p + d * r, c * q + d * s];
