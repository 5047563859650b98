import { COLOURS, fitCanvas } from "./elements.js";

/** Draw a file on a canvas of a size, CSS px: raster or density, buildings and extent, which stay while the window moves.
 * `toScreen` places metres; `highest`: the end of the scale of heights. */
export function drawFile(outlines, toScreen, size, highest) {
  const canvas = document.createElement("canvas"), context = fitCanvas(canvas, ...size), [west, south, east, north] = outlines.extent;
  const [x, y] = toScreen([west, north]), [right, low] = toScreen([east, south]), { near, isRaster } = outlines;
  context.fillStyle = "#f1eee7";
  context.fillRect(x, y, right - x, low - y);
  const picture = outlines.picture(highest);
  context.imageSmoothingEnabled = !isRaster;
  if (picture) context.drawImage(picture, x, y, right - x, low - y);
  if (picture && !isRaster) context.fillRect(...toScreen([near[0], near[3]]), ...[2, 3].map((k) => (near[k] - near[k - 2]) * scaleOf(toScreen)));
  const path = new Path2D();
  for (const { rings } of outlines.buildings.values()) for (const ring of rings) trace(path, ring.map(toScreen));
  context.fillStyle = "#8b7f72";
  context.fill(path, "evenodd");
  context.strokeStyle = COLOURS.line;
  context.setLineDash([4, 3]);
  context.strokeRect(x, y, right - x, low - y);
  return canvas;
}

const scaleOf = (toScreen) => toScreen([1, 0])[0] - toScreen([0, 0])[0];

function trace(path, points) {
  points.forEach((point, k) => path[k ? "lineTo" : "moveTo"](...point));
  path.closePath();
}

/** Draw the ring of an area, in CSS px; a lock is hatched. */
export function drawRing(context, points, colour, isHatched) {
  const path = new Path2D(), [left, right, top, low] = [0, 1].flatMap((axis) => [Math.min, Math.max].map((end) => end(...points.map((one) => one[axis]))));
  trace(path, points);
  if (isHatched) {
    context.save();
    context.clip(path);
    context.beginPath();
    for (let at = 7 * Math.floor((left + top) / 7); at < right + low; at += 7) {
      context.moveTo(at - low, low);
      context.lineTo(at - top, top);
    }
    context.strokeStyle = colour;
    context.lineWidth = 1;
    context.stroke();
    context.restore();
  }
  context.setLineDash(isHatched ? [] : [6, 4]);
  for (const [stroke, width] of [["#fff", 4], [colour, 2]]) {
    context.strokeStyle = stroke;
    context.lineWidth = width;
    context.stroke(path);
  }
  context.setLineDash([]);
}
