/** A map with a drawing over it, on a canvas: the measured part stands out, the locked part is hatched. */

/** The hatched lock of a run, as large as its maps; transparent without a lock. */
export const loadLock = async (server) => createImageBitmap(await server.getBlob("lock"));

/** Draw the map `ours`, a canvas, with parts of `theirs` by `layers`: macro-blocks of `side` px on a `grid`, or,
 * if it `isPainted`, as opaque as λ. `scale`: CSS px for a px of the map; `lock`: the
 * hatched lock of the run. */
export function drawLayers(context, layers, { ours, theirs, grid, side, scale, isPainted, lock }) {
  const { height, width, cell, columns, painted, locked, within, blocks } = layers, step = cell * scale;
  context.imageSmoothingEnabled = false;
  context.drawImage(ours, 0, 0, width * scale, height * scale);
  const part = (y, x, tall, long) => context.drawImage(theirs, x, y, long, tall, x * scale, y * scale, long * scale, tall * scale);
  if (!isPainted) {
    for (const [row, column] of blocks) part(row * grid, column * grid, side, side);
    for (const [row, column] of blocks) frame(context, column * grid * scale, row * grid * scale, side * scale, side * scale);
  }
  const isPart = within.includes(1), faded = new Path2D(), hatched = new Path2D();
  for (let k = 0; k < painted.length; k++) {
    const y = Math.floor(k / columns) * cell, x = (k % columns) * cell;
    if (isPainted && painted[k]) {
      context.globalAlpha = painted[k];
      part(y, x, Math.min(cell, height - y), Math.min(cell, width - x));
      context.globalAlpha = 1;
    }
    if (!within[k]) faded.rect(x * scale, y * scale, step, step);
    if (locked[k]) {
      hatched.moveTo(x * scale, y * scale + step);
      hatched.lineTo(x * scale + step, y * scale);
    }
  }
  if (isPart) {
    context.fillStyle = "rgb(250 248 244 / 0.62)";
    context.fill(faded);
    outline(context, layers, scale);
  }
  context.strokeStyle = "#34302e";
  context.lineWidth = 1;
  context.stroke(hatched);
  context.drawImage(lock, 0, 0, width * scale, height * scale);
}

/** Draw the edge of the measured part. */
function outline(context, { cell, columns, rows, within }, scale) {
  const step = cell * scale, isIn = (y, x) => y >= 0 && x >= 0 && y < rows && x < columns && within[y * columns + x] === 1;
  const path = new Path2D();
  for (let y = 0; y <= rows; y++) {
    for (let x = 0; x <= columns; x++) {
      for (const [down, across] of [[0, 1], [1, 0]]) {
        if (isIn(y, x) === isIn(y - across, x - down)) continue;
        path.moveTo(x * step, y * step);
        path.lineTo((x + across) * step, (y + down) * step);
      }
    }
  }
  for (const [colour, line] of [["#fff", 4], ["#34302e", 2]]) {
    context.strokeStyle = colour;
    context.lineWidth = line;
    context.setLineDash(colour === "#fff" ? [] : [6, 4]);
    context.stroke(path);
  }
  context.setLineDash([]);
}

/** Draw a frame that is visible on pale and dark ground. */
export function frame(context, x, y, wide, tall, width = 1) {
  for (const [colour, line] of [["#fff", width + 2], ["#34302e", width]]) {
    context.strokeStyle = colour;
    context.lineWidth = line;
    context.strokeRect(x, y, wide, tall);
  }
}
