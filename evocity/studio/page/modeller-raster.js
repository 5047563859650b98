/** Attractors in pixels, on typed arrays: all words whose pieces are smaller than a pixel, in lexicographic order; a
 * chaos game draws a preview of what takes longer. */

import { boxOf, compose, DEEPEST, sharesOf } from "./modeller-shapes.js";

/** A piece has a box smaller than this on both sides, px: its middle, and every point of it, are then within .5 px. */
const FINE = 0.7;
const BETWEEN = 4096;
const INK = [31, 41, 51];
const PAPER = 0xffffffff;
/** The ramp of a measure, from little to much. */
const RAMP = [[247, 224, 190], [226, 150, 90], [176, 64, 63], [70, 20, 50]];

const wordOf = ([red, green, blue]) => (0xff000000 | (blue << 16) | (green << 8) | red) >>> 0;

/** A square of `side` px that shows the attractor of `maps`. `view`: a map from the shape to px, y downwards.
 * `paint`: {mode: "ink", "first", "mixture" or "measure"; colours, mix}. */
export class Raster {
  constructor(side) {
    this.side = side;
    for (const one of [this, this.quick = {}]) {
      one.image = new ImageData(side, side);
      one.words = new Uint32Array(one.image.data.buffer);
      one.weights = new Float32Array(side * side);
      one.bits = new Uint32Array(one.weights.buffer);
    }
    this.tops = new Uint16Array(side * side);
    this.products = new Float64Array(6 * (DEEPEST + 1));
    this.letters = new Int32Array(DEEPEST + 1);
    this.colours = new Float64Array(3 * (DEEPEST + 1));
    this.shares = new Float64Array(DEEPEST + 1);
    this.measures = new Float64Array(DEEPEST + 1);
  }

  /** Begin to draw `image`. */
  begin(maps, view, paint) {
    Object.assign(this, { maps, view, paint, level: 0, arrived: true, count: 0, isNew: true });
    this.chances = sharesOf(maps);
    this.products.set(view);
    this.measures[0] = 2 ** 96; // products of small shares stay above the least float
    this.colours.fill(0, 0, 3);
    const mix = paint.mode === "mixture" ? paint.mix : 0;
    let share = 1;
    this.shares[0] = 0;
    for (let k = 0; k < DEEPEST; k += 1) {
      this.shares[k + 1] = this.shares[k] + share;
      share *= mix;
    }
    this.flat = Float64Array.from(maps.flat());
    this.base = Float64Array.from(maps.flatMap((_, k) => (paint.mode === "first" || paint.mode === "mixture" ? paint.colours[k] : INK.map((value) => value / 255))));
  }

  /** Begin the first step. */
  prepare() {
    const [left, low, right, high] = boxOf(this.maps);
    this.middle = [(left + right) / 2, (low + high) / 2];
    this.half = [(right - left) / 2, (high - low) / 2];
    this.clear(this);
    this.isNew = false;
  }

  clear({ words, weights }) {
    words.fill(PAPER);
    if (this.paint.mode === "measure") weights.fill(0);
  }

  /** Draw for at most `ms` milliseconds; whether all is drawn. */
  step(ms) {
    if (this.isNew) this.prepare();
    const { flat, products, letters, colours, measures, shares, chances, base, side, words, weights, paint } = this;
    const count = this.maps.length, [x, y] = this.middle, [wide, tall] = this.half, end = performance.now() + ms;
    const isMeasure = paint.mode === "measure", isPlain = paint.mode === "ink", ink = wordOf(INK);
    let { level, arrived } = this, turns = 0;
    while (level >= 0) {
      const at = 6 * level;
      if (arrived) {
        turns += 1;
        if (turns % BETWEEN === 0 && performance.now() > end) {
          Object.assign(this, { level, arrived });
          return false;
        }
        letters[level] = 0;
        const a = products[at], b = products[at + 1], c = products[at + 3], d = products[at + 4];
        const across = Math.abs(a) * wide + Math.abs(b) * tall, up = Math.abs(c) * wide + Math.abs(d) * tall;
        const px = a * x + b * y + products[at + 2], py = c * x + d * y + products[at + 5];
        if (px + across < 0 || px - across >= side || py + up < 0 || py - up >= side) letters[level] = count; // out of the picture
        else if ((2 * across < FINE && 2 * up < FINE) || level === DEEPEST) {
          letters[level] = count;
          if (px >= 0 && px < side && py >= 0 && py < side) {
            const pixel = Math.floor(py) * side + Math.floor(px);
            if (isMeasure) weights[pixel] += measures[level];
            else if (isPlain) words[pixel] = ink;
            else {
              const whole = 255 / (shares[level] || 1), from = 3 * level;
              words[pixel] = 0xff000000 | (Math.round(colours[from + 2] * whole) << 16) | (Math.round(colours[from + 1] * whole) << 8) | Math.round(colours[from] * whole);
            }
          }
        }
      }
      const letter = letters[level];
      if (letter >= count) {
        level -= 1;
        arrived = false;
        if (level >= 0) letters[level] += 1;
        continue;
      }
      const from = 6 * letter, to = at + 6;
      const a = products[at], b = products[at + 1], c = products[at + 3], d = products[at + 4];
      const g = flat[from], h = flat[from + 1], k = flat[from + 2], l = flat[from + 3], m = flat[from + 4], n = flat[from + 5];
      products[to] = a * g + b * l; products[to + 1] = a * h + b * m; products[to + 2] = a * k + b * n + products[at + 2];
      products[to + 3] = c * g + d * l; products[to + 4] = c * h + d * m; products[to + 5] = c * k + d * n + products[at + 5];
      if (isMeasure) measures[level + 1] = measures[level] * chances[letter];
      else if (!isPlain) {
        const share = shares[level + 1] - shares[level];
        for (let one = 0; one < 3; one += 1) colours[3 * level + 3 + one] = colours[3 * level + one] + share * base[3 * letter + one];
      }
      level += 1;
      arrived = true;
    }
    Object.assign(this, { level, arrived });
    if (isMeasure) this.ramp(this);
    return true;
  }

  /** Draw random points for `ms` milliseconds in `quick.image`, as a preview. Where pieces overlap, the greater first letter wins. */
  preview(ms) {
    this.clear(this.quick);
    this.tops.fill(0);
    const { side, tops, paint, base, quick: { words, weights } } = this, count = this.maps.length, end = performance.now() + ms;
    const [a, b, e, c, d, f] = this.view, area = a * d - b * c;
    const back = [d / area, -b / area, (b * f - d * e) / area, -c / area, a / area, (c * e - a * f) / area];
    const maps = Float64Array.from(this.maps.flatMap((map) => compose(compose(this.view, map), back)));
    const table = new Uint8Array(4096);
    let filled = 0, sum = 0;
    this.chances.forEach((share, k) => {
      sum += share * 4096;
      for (const stop = k === count - 1 ? 4096 : Math.round(sum); filled < stop; filled += 1) table[filled] = k;
    });
    const isMeasure = paint.mode === "measure", isPlain = paint.mode === "ink", mix = paint.mode === "mixture" ? paint.mix : 0, ink = wordOf(INK);
    let x = e, y = f, seed = 2463534242, red = 0, green = 0, blue = 0;
    for (let turn = -500; ; turn += 1) {
      seed ^= seed << 13; seed ^= seed >>> 17; seed ^= seed << 5;
      const letter = table[seed & 4095], from = 6 * letter;
      const next = maps[from] * x + maps[from + 1] * y + maps[from + 2];
      y = maps[from + 3] * x + maps[from + 4] * y + maps[from + 5];
      x = next;
      if (!isPlain && !isMeasure) {
        red = (1 - mix) * base[3 * letter] + mix * red;
        green = (1 - mix) * base[3 * letter + 1] + mix * green;
        blue = (1 - mix) * base[3 * letter + 2] + mix * blue;
      }
      if (turn < 0) continue;
      if ((turn & 8191) === 8191 && performance.now() > end) break;
      if (!(x >= 0 && x < side && y >= 0 && y < side)) continue;
      const pixel = (y | 0) * side + (x | 0);
      if (isMeasure) weights[pixel] += 1;
      else if (tops[pixel] <= letter + 1) {
        tops[pixel] = letter + 1;
        words[pixel] = isPlain ? ink : 0xff000000 | (Math.round(255 * blue) << 16) | (Math.round(255 * green) << 8) | Math.round(255 * red);
      }
    }
    if (isMeasure) this.ramp(this.quick);
  }

  /** Colour each pixel by its weight, on a scale of logarithms over a factor of 1000. The upper bits of a float, its
   * exponent and seven bits of its fraction, name the logarithm in a table: within a third of a step. */
  ramp({ bits, words }) {
    let most = 0;
    for (let pixel = 0; pixel < bits.length; pixel += 1) if (bits[pixel] > most) most = bits[pixel]; // as the floats are ordered
    const top = LOGARITHMS[most >>> 16];
    for (let pixel = 0; pixel < bits.length; pixel += 1) {
      if (bits[pixel]) words[pixel] = SHADES[Math.max(0, STEPS + LOGARITHMS[bits[pixel] >>> 16] - top)];
    }
  }
}

/** The ramp in small steps, as words of pixels. */
const STEPS = 300, SHADES = Uint32Array.from({ length: STEPS + 1 }, (_, step) => {
  const at = step / STEPS * (RAMP.length - 1), k = Math.min(RAMP.length - 2, Math.floor(at));
  return wordOf(RAMP[k].map((value, one) => Math.round(value + (at - k) * (RAMP[k + 1][one] - value))));
});

/** The logarithm of a positive float in steps of the ramp, by the upper 16 bits of the float. */
const LOGARITHMS = Int32Array.from({ length: 1 << 15 }, (_, upper) => {
  const exponent = upper >>> 7, fraction = (upper & 127) + 0.5;
  return Math.round((exponent - 127 + Math.log2(1 + fraction / 128)) * Math.LN2 / Math.LN10 * STEPS / 3);
});
