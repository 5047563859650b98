/** The density of many lines between two axes: how many cross each pixel. */

/** Levels of an axis. */
export const LEVELS = 128;
/** The level of births without a value. */
const NOWHERE = 255;

/** Uint8: the level of each birth on an axis, from the top; if it is `turned`, the least is at the top. */
export function levels(column, turned) {
  const places = new Uint8Array(column.values.length);
  for (let row = 0; row < places.length; row++) {
    const share = column.share(column.values[row]);
    places[row] = Number.isNaN(share) ? NOWHERE :
      Math.round((turned ? share : 1 - share) * (LEVELS - 1));
  }
  return places;
}

/** Float32, `height` for each of `width` pixel columns: how many rows of the `mask` cross each pixel. */
export function crossings(left, right, mask, width, height) {
  const pairs = new Uint32Array(LEVELS * LEVELS);
  for (let row = 0; row < mask.length; row++) {
    if (mask[row] && left[row] !== NOWHERE && right[row] !== NOWHERE) pairs[left[row] * LEVELS + right[row]]++;
  }
  const counts = new Float32Array(width * height);
  const scale = (height - 1) / (LEVELS - 1);
  for (let pair = 0; pair < pairs.length; pair++) {
    const count = pairs[pair];
    if (!count) continue;
    const from = ((pair / LEVELS) | 0) * scale, to = (pair % LEVELS) * scale;
    const step = (to - from) / width;
    if (Math.abs(step) <= 1) {
      let y = from + 0.5 + step / 2;
      for (let place = 0; place < counts.length; place += height) {
        counts[place + (y | 0)] += count;
        y += step;
      }
    } else { // a steep line crosses several pixels of a column
      let y = from + 0.5;
      for (let place = 0; place < counts.length; place += height) {
        const next = y + step;
        const first = Math.max(0, Math.min(y, next) | 0), last = Math.min(height - 1, Math.max(y, next) | 0);
        for (let k = first; k <= last; k++) counts[place + k] += count;
        y = next;
      }
    }
  }
  return counts;
}

/** A picture of crossings in a colour, denser for more of them, up to an opacity of `most`. */
export function shade(counts, width, height, [red, green, blue], most) {
  const image = new ImageData(width, height);
  const pixels = new Uint32Array(image.data.buffer); // little-endian: 0xAABBGGRR
  const colour = (blue << 16) | (green << 8) | red;
  let top = 1;
  for (let k = 0; k < counts.length; k++) if (counts[k] > top) top = counts[k];
  const alphas = new Uint8Array(1024);
  for (let k = 0; k < 1024; k++) alphas[k] = 255 * most * (0.15 + 0.85 * (k / 1023));
  const unit = 1023 / Math.log1p(top);
  const logs = Float32Array.from({ length: Math.min(top, 4096) + 1 }, (_, n) => Math.log1p(n) * unit);
  for (let x = 0, place = 0; x < width; x++) {
    for (let y = 0; y < height; y++, place++) {
      const count = counts[place];
      if (!count) continue;
      const step = count < logs.length ? logs[count] : Math.log1p(count) * unit;
      pixels[y * width + x] = ((alphas[step | 0] << 24) | colour) >>> 0;
    }
  }
  return image;
}
