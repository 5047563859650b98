/** Steps of undo, at most. */
const MOST_STEPS = 50;
/** Parts of a λ-field along a side. */
export const FIELD = 8;
/** The least opacity and brightness of a marked pixel in a picture, of 255. */
const OPAQUE = 128, BRIGHT = 32;
/** Bytes of such a picture, at most. */
const MOST_BYTES = 20e6;

/** The layers of a drawing over a map of `height` × `width` px: macro-blocks by their corners; in cells of `cell` px
 * a painted λ, the locked part and the measured part. */
export class Layers {
  constructor({ height, width, cell }) {
    Object.assign(this, { height, width, cell });
    [this.rows, this.columns] = [Math.ceil(height / cell), Math.ceil(width / cell)];
    this.steps = [];
    this.blank();
  }

  blank() {
    const count = this.rows * this.columns;
    this.blocks = [];
    this.painted = new Float32Array(count);
    this.locked = new Uint8Array(count);
    this.within = new Uint8Array(count);
  }

  remember() {
    const { blocks, painted, locked, within } = this;
    this.steps.push({ blocks: blocks.slice(), painted: painted.slice(), locked: locked.slice(), within: within.slice() });
    if (this.steps.length > MOST_STEPS) this.steps.shift();
  }

  back() { Object.assign(this, this.steps.pop()); }

  /** Fill a square of cells of a layer with a value. */
  fill(layer, { row, column, side }, value) {
    const [west, east] = [Math.max(0, column), Math.min(this.columns, column + side)];
    for (let y = Math.max(0, row); y < Math.min(this.rows, row + side); y++) layer.fill(value, y * this.columns + west, y * this.columns + east);
  }

  /** A layer as the server expects it; null without any mark. */
  marked(layer) { return layer.includes(1) ? { cell: this.cell, marked: layer.join("") } : null; }

  /** Mark a layer by a picture over the whole map: each cell with at least half of its pixels neither black nor
   * transparent. Returns the number of marked cells. */
  async mark(layer, file) {
    if (file.size > MOST_BYTES) throw new Error(`Studio does not accept the picture ${file.name}, because the file is too large (${Math.round(file.size / 1e6)} MB). Choose a picture of at most ${MOST_BYTES / 1e6} MB.`);
    let picture;
    try {
      picture = await createImageBitmap(file, { premultiplyAlpha: "none", colorSpaceConversion: "none" });
    } catch {
      throw new Error(`${file.name} is not a picture that this browser can read. Choose a PNG picture of the whole map: black pixels and transparent pixels mark nothing.`);
    }
    const { height, width, cell, rows, columns } = this, canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [width, height];
    const context = canvas.getContext("2d", { willReadFrequently: true });
    context.imageSmoothingEnabled = false;
    context.drawImage(picture, 0, 0, width, height);
    picture.close();
    const { data } = context.getImageData(0, 0, width, height), marked = new Uint32Array(rows * columns), all = new Uint32Array(rows * columns);
    for (let k = 0; k < height * width; k++) {
      const at = Math.floor(Math.floor(k / width) / cell) * columns + Math.floor((k % width) / cell);
      all[at] += 1;
      if (data[4 * k + 3] >= OPAQUE && Math.max(data[4 * k], data[4 * k + 1], data[4 * k + 2]) >= BRIGHT) marked[at] += 1;
    }
    layer.forEach((_, at) => { layer[at] = Number(2 * marked[at] >= all[at]); });
    return layer.reduce((sum, one) => sum + one, 0);
  }

  /** The mean of the painted λ in the cells of a square, px; the square has at least one cell. */
  mean(top, left, side) {
    const span = (from) => [Math.floor(from / this.cell), Math.max(Math.floor(from / this.cell) + 1, Math.floor((from + side) / this.cell))];
    const [[first, last], [west, east]] = [span(top), span(left)];
    let sum = 0;
    for (let y = first; y < last; y++) for (let x = west; x < east; x++) sum += this.painted[y * this.columns + x];
    return sum / ((last - first) * (east - west));
  }

  /** The means of the painted λ in equal parts of the map, `FIELD` along a side. */
  field() {
    const sums = new Float64Array(FIELD * FIELD), counts = new Float64Array(FIELD * FIELD);
    for (let k = 0; k < this.painted.length; k++) {
      const y = Math.floor((Math.floor(k / this.columns) * FIELD) / this.rows), x = Math.floor(((k % this.columns) * FIELD) / this.columns);
      sums[y * FIELD + x] += this.painted[k];
      counts[y * FIELD + x] += 1;
    }
    return Array.from(sums, (one, k) => +(one / Math.max(1, counts[k])).toFixed(4));
  }
}
