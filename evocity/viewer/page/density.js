/** Many lines between two axes as what they are together: how many cross each pixel. */

/** Steps into which an axis is divided. */
export const LEVELS = 128;
/** The level of who has no value. */
export const NOWHERE = 255;

/** Uint8: the level of each birth on an axis, from above; `turned`, the least is above. */
export function levels(column, turned) {
  const found = new Uint8Array(column.values.length);
  for (let row = 0; row < found.length; row++) {
    const share = column.share(column.values[row]);
    found[row] = Number.isNaN(share) ? NOWHERE :
      Math.round((turned ? share : 1 - share) * (LEVELS - 1));
  }
  return found;
}

/** Float32 `height` a pixel column of `width`: how many of the rows with `mask` cross each pixel. */
export function crossings(left, right, mask, width, height) {
  const pairs = new Uint32Array(LEVELS * LEVELS);
  for (let row = 0; row < mask.length; row++) {
    if (mask[row] && left[row] !== NOWHERE && right[row] !== NOWHERE) pairs[left[row] * LEVELS + right[row]]++;
  }
  const found = new Float32Array(width * height);
  const scale = (height - 1) / (LEVELS - 1);
  for (let pair = 0; pair < pairs.length; pair++) {
    const count = pairs[pair];
    if (!count) continue;
    const from = ((pair / LEVELS) | 0) * scale, to = (pair % LEVELS) * scale;
    const step = (to - from) / width;
    if (Math.abs(step) <= 1) {
      let y = from + 0.5 + step / 2;
      for (let place = 0; place < found.length; place += height) {
        found[place + (y | 0)] += count;
        y += step;
      }
    } else { // steep: all that it crosses in a pixel column
      let y = from + 0.5;
      for (let place = 0; place < found.length; place += height) {
        const next = y + step;
        const first = Math.max(0, Math.min(y, next) | 0), last = Math.min(height - 1, Math.max(y, next) | 0);
        for (let k = first; k <= last; k++) found[place + k] += count;
        y = next;
      }
    }
  }
  return found;
}

/** A picture of crossings in a colour, the more the denser, up to `most` opaque. */
export function shaded(counts, width, height, [red, green, blue], most) {
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
