/** The picture of a shape on a canvas: K, 𝒯K, 𝒯²K …, or the attractor; curves too. */

import { Raster } from "./modeller-raster.js";
import { apply, boxOf, figureOf, lineOf, mapsOf, mixedColour, partOf, piecesOf } from "./modeller-shapes.js";

/** Pieces of one level, at most; points of a curve. */
export const MOST_PIECES = 6000, CURVE_POINTS = 4096;
/** Milliseconds of one picture for the attractor, and for its preview at least and at most; seconds after which a preview is enough. */
const SLICE = 14, LEAST = 2, PREVIEW = 8, PATIENCE = 6;
/** Milliseconds between two pictures of a drag: previews become coarser above this, and finer well below. */
const LATE = 28;
const INK = "rgb(31 41 51)";

/** The greatest level with at most `most` pieces. */
export function deepest(count, most = MOST_PIECES) {
  let level = 1;
  while (count > 1 && count ** (level + 1) <= most && level < 12) level += 1;
  return count > 1 ? level : 12;
}

const cssOf = (colour) => `rgb(${colour.map((value) => Math.round(255 * value)).join(" ")})`;

/** Draw 𝒯ⁿK of a shape with `maps`, as `piecesOf` lists its pieces: later pieces cover earlier ones. */
export function drawPieces(context, side, view, shape, maps, level, paint) {
  context.fillStyle = "#ffffff";
  context.fillRect(0, 0, side, side);
  const { points, lines, faces } = figureOf(shape, shape.primitive ? null : boxOf(maps));
  const isPlain = paint.mode === "ink" || paint.mode === "measure", mix = paint.mode === "first" ? 0 : paint.mix;
  let colour = null;
  const finish = () => { if (colour !== null) { context[faces.length ? "fill" : "stroke"](); } };
  for (const { map, letters } of piecesOf(maps, level)) {
    const next = isPlain ? INK : cssOf(mixedColour(letters, paint.colours, mix));
    if (next !== colour) {
      finish();
      colour = next;
      context.beginPath();
      context.fillStyle = context.strokeStyle = colour;
      context.lineWidth = 1.2;
    }
    const placed = points.map((point) => apply(view, apply(map, point)));
    for (const face of faces) {
      const turned = areaOf(face.map((k) => placed[k])) < 0 ? [...face].reverse() : face; // one sense: the union is filled
      turned.forEach((k, n) => context[n ? "lineTo" : "moveTo"](...placed[k]));
      context.closePath();
    }
    for (const [start, end] of lines) {
      context.moveTo(...placed[start]);
      context.lineTo(...placed[end]);
    }
    if (!faces.length && !lines.length) for (const [x, y] of placed) context.rect(x - 0.5, y - 0.5, 1, 1);
  }
  finish();
}

const areaOf = ([[a, b], [c, d], [e, f]]) => (c - a) * (f - b) - (e - a) * (d - b);

function drawCurve(context, side, view, shape, level) {
  context.fillStyle = "#ffffff";
  context.fillRect(0, 0, side, side);
  context.strokeStyle = INK;
  context.lineWidth = 1.5;
  const most = deepest(shape.matrices.length, CURVE_POINTS);
  let polygons = [shape.points];
  if (level === null) polygons = [lineOf(shape, most)];
  else for (let k = 0; k < Math.min(level, most); k += 1) polygons = polygons.flatMap((polygon) => shape.matrices.map((matrix) => partOf(polygon, matrix)));
  context.beginPath();
  for (const polygon of polygons) polygon.forEach((point, k) => context[k ? "lineTo" : "moveTo"](...apply(view, point)));
  context.stroke();
}

export class Picture {
  constructor(context, side) {
    [this.context, this.side] = [context, side];
    this.raster = new Raster(side);
    this.isDone = true;
    this.isSlow = false;
    this.budget = PREVIEW;
  }

  /** Draw a good shape at a level, null for the attractor. An attractor may need `go` afterwards. */
  draw(shape, view, level, paint, isDragging) {
    const maps = mapsOf(shape);
    this.isDone = true;
    if (shape.kind === "curve") drawCurve(this.context, this.side, view, shape, level);
    else if (level !== null) drawPieces(this.context, this.side, view, shape, maps, Math.min(level, deepest(maps.length)), paint);
    else {
      this.raster.begin(maps, view, paint);
      const between = performance.now() - (this.since || 0);
      this.since = performance.now();
      if (between > LATE && between < 1000) this.budget = Math.max(LEAST, this.budget / 2);
      else if (between < LATE * 0.7) this.budget = Math.min(PREVIEW, this.budget + 1);
      if (!isDragging) this.isSlow = false;
      this.isDone = false;
      if (!this.isSlow && this.go()) return;
      this.isSlow = true; // while this drag goes on
      this.raster.preview(this.budget);
      this.context.putImageData(this.raster.quick.image, 0, 0);
    }
  }

  /** Draw on; whether all is drawn, or takes too long. */
  go() {
    if (this.isDone) return true;
    if (this.raster.step(SLICE)) {
      this.context.putImageData(this.raster.image, 0, 0);
      this.isDone = true;
    } else if (performance.now() - this.since > 1000 * PATIENCE) this.isDone = true;
    return this.isDone;
  }
}
