/** Births as columns, from a buffer: filters by brushes, and orders. */

import { number } from "./elements.js";

/** One column: numbers, or indices of `words`. */
export class Column {
  constructor(about, values) {
    Object.assign(this, about);
    this.values = values;
    let low = Infinity, high = -Infinity;
    for (const value of values) {
      if (value < low && value > -Infinity) low = value;
      if (value > high && value < Infinity) high = value;
    }
    this.low = low <= high ? low : 0;
    this.high = low <= high ? high : 1;
  }

  get isWords() { return this.words.length > 0; }

  /** The place of a value between the ends: 0…1, NaN for no value. */
  share(value) {
    if (this.isWords) return (value + 0.5) / this.words.length;
    if (this.high === this.low) return Number.isFinite(value) ? 0.5 : NaN;
    return Number.isFinite(value) ? (value - this.low) / (this.high - this.low) : NaN;
  }

  /** The value at a share; the ends at and beyond 0 and 1. */
  value(share) {
    if (share <= 0) return this.low;
    return share >= 1 ? this.high : this.low + share * (this.high - this.low);
  }

  /** The rank of a value: a lower rank is earlier in the gallery. */
  rank(value) {
    if (this.target !== null) return Math.abs(value - this.target);
    return this.goal === "max" ? -value : value;
  }

  /** The value of a row for people, with its unit. */
  text(row) {
    const value = this.values[row];
    return this.isWords ? this.words[value].replaceAll("_", " ") : `${number(value)} ${this.unit}`.trimEnd();
  }

  /** The name of the order. */
  orderName(reversed) {
    if (this.isWords) return reversed ? "Z to A" : "A to Z";
    if (this.goal !== null || this.target !== null) return reversed ? "worst first" : "best first";
    return reversed ? "highest first" : "lowest first";
  }
}

/** The brush of a column, which may have any name, also "constructor". */
export const brushOf = (brushes, name) => (Object.hasOwn(brushes, name) ? brushes[name] : []);

export class Births {
  /** From facts of the columns, and a buffer: ids as int32, then each column as float32. */
  constructor(about, buffer) {
    const view = ArrayBuffer.isView(buffer) ? buffer : new Uint8Array(buffer);
    const bytes = view.buffer.slice(view.byteOffset, view.byteOffset + view.byteLength);
    this.about = about;
    this.count = about.count;
    this.ids = new Int32Array(bytes, 0, this.count);
    this.columns = about.columns.map((column, place) =>
      new Column(column, new Float32Array(bytes, 4 * this.count * (1 + place), this.count)));
    this.byName = new Map(this.columns.map((one) => [one.name, one]));
    this.orders = new Map();
  }

  /** The row of an id, -1 for an unknown id. */
  row(id) {
    let low = 0, high = this.count - 1;
    while (low <= high) {
      const middle = (low + high) >> 1;
      if (this.ids[middle] === id) return middle;
      if (this.ids[middle] < id) low = middle + 1;
      else high = middle - 1;
    }
    return -1;
  }

  /** 1 for each row that passes all brushes. */
  matches(brushes) {
    const kept = new Uint8Array(this.count).fill(1);
    for (const [name, brush] of Object.entries(brushes)) {
      const column = this.byName.get(name);
      if (!column || !brush.length) continue;
      const spans = column.isWords ? brush.map((word) => Array(2).fill(column.words.indexOf(word))) : brush;
      const { values } = column;
      for (let row = 0; row < this.count; row++) {
        let within = 0;
        for (let k = 0; k < spans.length && !within; k++) {
          within = values[row] >= spans[k][0] && values[row] <= spans[k][1] ? 1 : 0;
        }
        kept[row] &= within;
      }
    }
    return kept;
  }

  /** All rows in order; births without a value come last, among equal ones the lower id first. */
  rowOrder({ name, reversed }) {
    const key = `${reversed ? "-" : "+"}${name}`;
    if (!this.orders.has(key)) {
      const column = this.byName.get(name) || this.byName.get("id");
      this.orders.set(key, this.sortRows(column, reversed));
    }
    return this.orders.get(key);
  }

  /** All rows in order by any column. */
  sortRows(column, reversed = false) {
    return radixSort(this.count, (row) => column.rank(column.values[row]), reversed);
  }
}

/** Sort 0…count-1 by float32 keys, stably, in three rounds of 11 bits. */
function radixSort(count, key, reversed) {
  const float = new Float32Array(1), bits = new Uint32Array(float.buffer);
  let keys = new Uint32Array(count), rows = Uint32Array.from({ length: count }, (_, row) => row);
  for (let row = 0; row < count; row++) {
    float[0] = key(row) + 0; // -0 is 0
    const upward = bits[0] >>> 31 ? ~bits[0] >>> 0 : (bits[0] | 0x80000000) >>> 0;
    keys[row] = Number.isNaN(float[0]) ? 0xffffffff : reversed ? ~upward >>> 0 : upward;
  }
  for (let shift = 0; shift < 33; shift += 11) {
    const starts = new Uint32Array(2049);
    for (let k = 0; k < count; k++) starts[((keys[k] >>> shift) & 2047) + 1]++;
    for (let k = 1; k < 2049; k++) starts[k] += starts[k - 1];
    const nextKeys = new Uint32Array(count), nextRows = new Uint32Array(count);
    for (let k = 0; k < count; k++) {
      const place = starts[(keys[k] >>> shift) & 2047]++;
      nextKeys[place] = keys[k];
      nextRows[place] = rows[k];
    }
    [keys, rows] = [nextKeys, nextRows];
  }
  return rows;
}
