/** Prisms of a height map: few flat surfaces. Roofs and ground are rectangles of one height; walls are as long as the
 * heights on both sides stay the same. */

import { coloursOf, WALLS } from "./axonometry.js";

/** Bytes of a corner: three float32 of its place; four int8 each of the normal, of the colour (unsigned), and of the
 * direction beyond the edges. Surfaces are drawn larger by a share of a pixel, so that no light shines between them. */
export const STRIDE = 24;
const FLAT = [0, 0, 0];

/** Corners that triangles share. */
export class Surfaces {
  constructor() {
    this.count = 0;
    this.grow(1 << 12);
  }

  grow(corners) {
    const bytes = new ArrayBuffer(corners * STRIDE);
    if (this.bytes) new Uint8Array(bytes).set(new Uint8Array(this.bytes));
    [this.bytes, this.room] = [bytes, corners];
    [this.places, this.signed, this.colours] = [new Float32Array(bytes), new Int8Array(bytes), new Uint8Array(bytes)];
  }

  corner([x, y, z], normal, rgb, beyond) {
    if (this.count === this.room) this.grow(2 * this.room);
    const at = (this.count++ * STRIDE) / 4;
    [this.places[at], this.places[at + 1], this.places[at + 2]] = [x, y, z];
    for (let c = 0; c < 3; c++) {
      this.signed[4 * at + 12 + c] = Math.round(127 * normal[c]);
      this.colours[4 * at + 16 + c] = rgb[c];
      this.signed[4 * at + 20 + c] = 127 * beyond[c];
    }
  }

  /** Add a rectangle of four corners [x, y, z], counterclockwise from outside. */
  rectangle(corners, normal, rgb) {
    const [first, , third] = corners;
    for (const one of corners) {
      const beyond = one.map((value, c) => (first[c] === third[c] ? 0 : 2 * (value === Math.max(first[c], third[c])) - 1));
      this.corner(one, normal, rgb, beyond);
    }
  }

  get used() { return new Uint8Array(this.bytes, 0, this.count * STRIDE); }
}

/** {surfaces, indices} of a city, metres from its middle, x to the east, y to the north, z up. */
export function prismsOf(city) {
  const surfaces = new Surfaces();
  addRoofs(surfaces, city);
  addWalls(surfaces, city, true);
  addWalls(surfaces, city, false);
  const count = surfaces.count / 4, indices = new Uint32Array(6 * count);
  for (let k = 0; k < count; k++) indices.set([4 * k, 4 * k + 1, 4 * k + 2, 4 * k, 4 * k + 2, 4 * k + 3], 6 * k);
  return { surfaces, indices };
}

function addRoofs(surfaces, city) {
  const { heights, rows, columns, metresPerPixel: side } = city, rgb = coloursOf(city);
  const done = new Uint8Array(heights.length);
  const alike = (a, b) => !done[b] && heights[a] === heights[b] && rgb[3 * a] === rgb[3 * b]
    && rgb[3 * a + 1] === rgb[3 * b + 1] && rgb[3 * a + 2] === rgb[3 * b + 2];
  for (let cell = 0; cell < heights.length; cell++) {
    if (done[cell] || heights[cell] !== heights[cell]) continue;
    const row = Math.floor(cell / columns), column = cell - row * columns;
    let wide = 1, deep = 1;
    while (column + wide < columns && alike(cell, cell + wide)) wide++;
    const isWhole = (first) => {
      for (let k = 0; k < wide; k++) if (!alike(cell, first + k)) return false;
      return true;
    };
    while (row + deep < rows && isWhole(cell + deep * columns)) deep++;
    for (let k = 0; k < deep; k++) done.fill(1, cell + k * columns, cell + k * columns + wide);
    const [west, east] = [(column - columns / 2) * side, (column + wide - columns / 2) * side];
    const [north, south] = [(rows / 2 - row) * side, (rows / 2 - row - deep) * side], up = heights[cell];
    surfaces.rectangle([[west, south, up], [east, south, up], [east, north, up], [west, north, up]],
      [0, 0, 1], rgb.subarray(3 * cell, 3 * cell + 3));
  }
}

/** Walls that face east and west, or north and south. */
function addWalls(surfaces, city, isAcross) {
  const { heights, rows, columns, metresPerPixel: side } = city, rgb = coloursOf(city);
  const lines = isAcross ? columns : rows, places = isAcross ? rows : columns;
  const at = (line, place) => (isAcross ? place * columns + line : line * columns + place);
  const up = (line, place) => (line < 0 || line >= lines ? 0 : heights[at(line, place)] || 0);
  const tint = (cell) => (city.colours ? rgb.subarray(3 * cell, 3 * cell + 3) : WALLS);
  for (let line = 0; line <= lines; line++) {
    for (let first = 0, end = 1; first < places; first = end++) {
      const before = up(line - 1, first), after = up(line, first);
      if (before === after) continue;
      const owner = at(before > after ? line - 1 : line, first), own = tint(owner);
      const isAlike = (place) => up(line - 1, place) === before && up(line, place) === after
        && tint(at(before > after ? line - 1 : line, place)).every((one, c) => one === own[c]);
      while (end < places && isAlike(end)) end++;
      const [low, high] = [Math.min(before, after), Math.max(before, after)];
      if (isAcross) {
        const x = (line - columns / 2) * side, [north, south] = [(rows / 2 - first) * side, (rows / 2 - end) * side];
        const [left, right] = before > after ? [south, north] : [north, south]; // from the viewer
        surfaces.rectangle([[x, left, low], [x, right, low], [x, right, high], [x, left, high]],
          [before > after ? 1 : -1, 0, 0], own);
      } else {
        const y = (rows / 2 - line) * side, [west, east] = [(first - columns / 2) * side, (end - columns / 2) * side];
        const [left, right] = before > after ? [west, east] : [east, west];
        surfaces.rectangle([[left, y, low], [right, y, low], [right, y, high], [left, y, high]],
          [0, before > after ? -1 : 1, 0], own);
      }
    }
  }
}

/** {surfaces, indices} of a scene's triangles, an ArrayBuffer: nine float32 for each, metres from the south-west corner
 * of the city, counterclockwise from outside; then three bytes of colour for each. */
export function trianglesOf(city, bytes) {
  const count = bytes.byteLength / 39, corners = new Float32Array(bytes, 0, 9 * count);
  const colours = new Uint8Array(bytes, 36 * count);
  const surfaces = new Surfaces(), { rows, columns, metresPerPixel: side } = city;
  const [wide, deep] = [(columns * side) / 2, (rows * side) / 2];
  for (let k = 0; k < count; k++) {
    const [ax, ay, az, bx, by, bz, cx, cy, cz] = corners.subarray(9 * k, 9 * k + 9);
    const [px, py, pz, qx, qy, qz] = [bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az];
    const normal = [py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx], long = Math.hypot(...normal) || 1;
    const unit = normal.map((one) => one / long), rgb = colours.subarray(3 * k, 3 * k + 3);
    for (let c = 0; c < 9; c += 3) {
      const place = [corners[9 * k + c] - wide, corners[9 * k + c + 1] - deep, corners[9 * k + c + 2]];
      surfaces.corner(place, unit, rgb, FLAT);
    }
  }
  return { surfaces, indices: Uint32Array.from({ length: surfaces.count }, (_, k) => k) };
}
