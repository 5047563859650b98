import { ramp } from "./ramp.js";

/** The overview of a file: its buildings as rings in metres, and its raster or density. A box is west, south, east,
 * north. `over`: facts of the server; `bytes`: grid, polygon and end of each ring, points. */
export class Outlines {
  constructor(over, bytes) {
    const { grid, rings, corner, step } = over;
    let at = grid ? 4 * Math.ceil((grid[0] * grid[1]) / 4) : 0;
    this.grid = grid && { rows: grid[0], columns: grid[1], values: bytes.subarray(0, grid[0] * grid[1]) };
    this.isPartial = over.partial;
    this.isRaster = over.kind === "raster";
    this.extent = over.extent;
    this.near = [corner[0], corner[1], corner[0] + 65535 * step, corner[1] + 65535 * step]; // where all buildings are known
    const buffer = bytes.slice(at).buffer, polygons = new Uint32Array(buffer, 0, rings), ends = new Uint32Array(buffer, 4 * rings, rings);
    const steps = new Uint16Array(buffer, 8 * rings);
    this.buildings = new Map(); // number -> { rings, box, area }
    at = 0;
    for (let k = 0; k < rings; k++) {
      const ring = [];
      for (; at < ends[k]; at++) ring.push([corner[0] + steps[2 * at] * step, corner[1] + steps[2 * at + 1] * step]);
      if (!this.buildings.has(polygons[k])) this.buildings.set(polygons[k], { rings: [], box: [Infinity, Infinity, -Infinity, -Infinity] });
      const one = this.buildings.get(polygons[k]);
      one.rings.push(ring);
      for (const [x, y] of ring) one.box = [Math.min(one.box[0], x), Math.min(one.box[1], y), Math.max(one.box[2], x), Math.max(one.box[3], y)];
    }
    for (const one of this.buildings.values()) one.area = areaOf(one.rings);
  }

  /** Count the buildings in a window, those that its edge cuts, and the built share of its ground; nothing where the
   * buildings are unknown. */
  count(box) {
    const whole = (box[2] - box[0]) * (box[3] - box[1]);
    if (this.isRaster) return { share: this.builtCells(box) };
    if (this.isPartial && box.some((edge, k) => (k < 2 ? edge < this.near[k] : edge > this.near[k]))) return {};
    let inside = 0, cut = 0, built = 0;
    for (const { rings, box: [west, south, east, north], area } of this.buildings.values()) {
      if (west >= box[2] || east <= box[0] || south >= box[3] || north <= box[1]) continue;
      if (west >= box[0] && east <= box[2] && south >= box[1] && north <= box[3]) {
        inside += 1;
        built += area;
      } else {
        const part = areaOf(rings.map((ring) => clip(ring, box)));
        if (part > 0) cut += 1;
        built += part;
      }
    }
    return { inside, cut, share: Math.min(1, built / whole) };
  }

  builtCells([west, south, east, north]) {
    const { rows, columns, values } = this.grid, [left, low, right, top] = this.extent;
    const at = (edge, from, size, count) => Math.max(0, Math.min(count, Math.round(((edge - from) / size) * count)));
    const [x, to] = [at(west, left, right - left, columns), at(east, left, right - left, columns)];
    const [y, end] = [at(top - north, 0, top - low, rows), at(top - south, 0, top - low, rows)];
    let built = 0;
    for (let row = y; row < end; row++) for (let column = x; column < to; column++) built += Number(values[row * columns + column] > 1);
    return built / Math.max(1, (end - y) * (to - x));
  }

  /** The raster or the density as a picture; null without one. `highest`: the end of the scale of heights. */
  picture(highest) {
    if (!this.grid) return null;
    const { rows, columns, values } = this.grid, canvas = document.createElement("canvas"), image = new ImageData(columns, rows);
    [canvas.width, canvas.height] = [columns, rows];
    const colours = this.isRaster ? ramp(Float32Array.from(values), highest) : null;
    values.forEach((value, k) => {
      if (colours) image.data.set(colours.subarray(3 * k, 3 * k + 3), 4 * k);
      else image.data.set([139, 127, 114], 4 * k);
      image.data[4 * k + 3] = colours ? 255 : value;
    });
    canvas.getContext("2d").putImageData(image, 0, 0);
    return canvas;
  }
}

/** The area within rings, of which holes run the other way round. */
function areaOf(rings) {
  let area = 0;
  for (const ring of rings) {
    for (let k = 0, last = ring.length - 1; k < ring.length; last = k++) area += ring[last][0] * ring[k][1] - ring[k][0] * ring[last][1];
  }
  return Math.abs(area) / 2;
}

/** The part of a ring within a box (Sutherland and Hodgman). */
function clip(ring, box) {
  let points = ring;
  for (let side = 0; side < 4 && points.length; side++) {
    const axis = side % 2, edge = box[side], isIn = (point) => (side < 2 ? point[axis] >= edge : point[axis] <= edge);
    const kept = [];
    points.forEach((point, k) => {
      const before = points[(k || points.length) - 1];
      if (isIn(point) !== isIn(before)) {
        const part = (edge - before[axis]) / (point[axis] - before[axis]), other = before[1 - axis] + part * (point[1 - axis] - before[1 - axis]);
        kept.push(axis ? [other, edge] : [edge, other]);
      }
      if (isIn(point)) kept.push(point);
    });
    points = kept;
  }
  return points;
}
