import { COLOURS, FONT } from "./elements.js";
import { PAPER, ramp, scaleEnd } from "./ramp.js";

/** The axonometry of a city: exact columns in parallel projection. Each column of the picture is a vertical plane,
 * traversed from front to back over the height map.
 *
 * A city is {heights, rows, columns, metresPerPixel}, and optionally {colours, highest}: heights as Float32Array by
 * rows from north to south, metres, NaN outside the site; colours as three bytes a cell, otherwise those of the
 * height on a scale up to `highest` metres. A city does not change: another city replaces it. A camera is {azimuth,
 * tilt, zoom, centre}: the viewing direction in degrees clockwise from north; its height above the horizon in
 * degrees, 1 to 90; zoom 1 shows the whole city at any azimuth; centre = [east, north] in metres from the middle of
 * the city. The sun is {azimuth, height}, its direction in degrees. */

/** The direction of the light, as in evocity's pictures of scenes. */
export const SUN = { azimuth: 250, height: 40 };
/** Light in the shade, and the most light on a wall that faces the sun. */
export const AMBIENT = 0.62, MOST = 1.08;
export const WALLS = [228, 221, 210];
/** The code of a pixel: `PARTS` times its cell, plus one of these parts. */
const PARTS = 3, ROOF = 0, ACROSS = 1, ALONG = 2; // a wall that faces east or west, north or south

/** [sine, cosine] of degrees, exact at right angles. */
export function sinCos(degrees) {
  const whole = ((degrees % 360) + 360) % 360, quarters = whole / 90;
  if (Number.isInteger(quarters)) return [[0, 1], [1, 0], [0, -1], [-1, 0]][quarters % 4];
  return [Math.sin((whole * Math.PI) / 180), Math.cos((whole * Math.PI) / 180)];
}

/** The placement of a city on a picture, in px: `scale`, px a metre, and the place of the centre on the ground (`left`,
 * `low`). */
export function placement(city, camera, width, height) {
  const [sin, cos] = sinCos(camera.azimuth), [steep, flat] = sinCos(Math.min(90, Math.max(1, camera.tilt)));
  const across = Math.hypot(city.columns, city.rows) * city.metresPerPixel;
  const room = (across / 8) * flat; // for buildings at the far corner
  const whole = 0.97 * Math.min(width / across, height / (across * steep + room));
  return { sin, cos, steep, flat, scale: whole * camera.zoom, left: width / 2, low: (height + room * whole) / 2 };
}

/** The visible surface at each pixel, Int32Array by rows: `PARTS` times the cell, plus the part; -1 for none. */
export function surfaces(city, camera, width, height) {
  const { heights, rows, columns, metresPerPixel: side } = city;
  const { sin, cos, steep, flat, scale, left, low } = placement(city, camera, width, height);
  const [east, north] = camera.centre, codes = new Int32Array(width * height).fill(-1);
  const perX = sin / side, perY = -cos / side; // cells a metre ahead
  const stepX = Math.sign(perX), stepRow = Math.sign(perY) * columns, endX = perX > 0 ? 1 : 0, endY = perY > 0 ? 1 : 0;
  const rise = steep * scale, lift = flat * scale; // px up, a metre ahead and a metre of height
  const base = low - 0.5; // at the middle of a pixel
  const least = (low - height - highestOf(city) * lift) / rise; // nothing nearer reaches the picture
  for (let column = 0; column < width; column++) {
    const aside = (column + 0.5 - left) / scale;
    const x = columns / 2 + (east + aside * cos) / side, y = rows / 2 - (north - aside * sin) / side;
    const inX = entry(x, perX, columns), inY = entry(y, perY, rows);
    let from = Math.max(inX, inY, least), part = inX > inY ? ACROSS : ALONG;
    const end = Math.min(entry(x, -perX, columns, -1), entry(y, -perY, rows, -1));
    if (!(from < end)) continue;
    let cellX = Math.min(columns - 1, Math.max(0, Math.floor(x + from * perX)));
    let cellY = Math.min(rows - 1, Math.max(0, Math.floor(y + from * perY)));
    let cell = cellY * columns + cellX;
    let nextX = perX === 0 ? Infinity : (cellX + endX - x) / perX;
    let nextY = perY === 0 ? Infinity : (cellY + endY - y) / perY;
    let row = Math.min(height, Math.ceil(base - from * rise)) - 1; // the lowest that is still free
    while (row >= 0) {
      const isX = nextX < nextY, to = isX ? nextX : nextY, up = heights[cell];
      const top = base - up * lift;
      if (row >= top - to * rise) {
        let stop = Math.max(0, Math.ceil(top - from * rise));
        for (const code = PARTS * cell + part; row >= stop; row--) codes[row * width + column] = code;
        stop = Math.max(0, Math.ceil(top - to * rise));
        for (const code = PARTS * cell + ROOF; row >= stop; row--) codes[row * width + column] = code;
      } else if (up !== up) row = Math.min(row, Math.ceil(base - to * rise) - 1);
      if (to >= end) break;
      from = to;
      if (isX) {
        cellX += stepX;
        if (cellX < 0 || cellX >= columns) break;
        cell += stepX;
        nextX = (cellX + endX - x) / perX;
        part = ACROSS;
      } else {
        cell += stepRow;
        cellY += endY || -1;
        if (cellY < 0 || cellY >= rows) break;
        nextY = (cellY + endY - y) / perY;
        part = ALONG;
      }
    }
  }
  return codes;
}

/** The distance at which a line enters the range from 0 to `count` (`way` 1), or leaves it (-1). */
function entry(at, per, count, way = 1) {
  if (per === 0) return at >= 0 && at < count ? -way * Infinity : way * Infinity;
  return ((per > 0 ? 0 : count) - at) / (way * per);
}

/** The picture of `surfaces`, RGBA. */
export function raster(city, camera, width, height, sun = SUN) {
  return paintPixels(city, surfaces(city, camera, width, height), camera, sun);
}

function paintPixels(city, codes, camera, sun) {
  const roofs = paintsOf(city), pixels = new Uint32Array(codes.length);
  const lights = lightOf(camera, sun), walls = lights.map((light) => packColour(...WALLS.map((one) => one * light)));
  const isTinted = city.colours !== undefined, paper = packColour(...PAPER);
  for (let k = 0; k < codes.length; k++) {
    const code = codes[k];
    if (code < 0) {
      pixels[k] = paper;
      continue;
    }
    const cell = (code / PARTS) | 0, part = code - PARTS * cell;
    if (part === ROOF) pixels[k] = roofs[cell];
    else if (!isTinted) pixels[k] = walls[part];
    else {
      const paint = roofs[cell], light = lights[part];
      pixels[k] = packColour((paint & 255) * light, ((paint >> 8) & 255) * light, ((paint >> 16) & 255) * light);
    }
  }
  return new Uint8ClampedArray(pixels.buffer);
}

/** Light by part: Lambert's law, and a little darker for a wall at a grazing angle. A roof has 1, so that its colour
 * is that of the map. */
function lightOf(camera, sun) {
  const [sin, cos] = sinCos(camera.azimuth), [steep, flat] = sinCos(Math.min(90, Math.max(1, camera.tilt)));
  const [sunSin, sunCos] = sinCos(sun.azimuth), [sunSteep, sunFlat] = sinCos(Math.min(90, Math.max(1, sun.height)));
  const shade = (facing) => AMBIENT * (0.88 + 0.12 * facing);
  const wall = (along, sunAlong) => {
    // the visible wall faces against the viewing direction `along`
    const lit = Math.max(0, -Math.sign(along) * sunAlong * sunFlat) / sunSteep;
    return Math.min(MOST, shade(flat * Math.abs(along)) + (1 - shade(steep)) * lit);
  };
  return [1, wall(sin, sunSin), wall(cos, sunCos)];
}

const byte = (value) => (value >= 255 ? 255 : (value + 0.5) | 0);
// lowest byte first, as on every machine with a browser
const packColour = (r, g, b) => (0xff000000 | (byte(b) << 16) | (byte(g) << 8) | byte(r)) >>> 0;

const KEPT = new WeakMap();

/** Values that are computed once a city. */
function cacheOf(city) {
  if (!KEPT.has(city)) {
    let highest = 0;
    for (const up of city.heights) if (up > highest) highest = up;
    const rgb = coloursOf(city), paints = new Uint32Array(city.heights.length);
    for (let k = 0; k < paints.length; k++) paints[k] = packColour(rgb[3 * k], rgb[3 * k + 1], rgb[3 * k + 2]);
    KEPT.set(city, { highest, paints });
  }
  return KEPT.get(city);
}
const highestOf = (city) => cacheOf(city).highest;
const paintsOf = (city) => cacheOf(city).paints;

/** Three bytes a cell: the colours of a city, or those of its heights. */
export function coloursOf(city) {
  return city.colours ?? ramp(city.heights, city.highest ?? scaleEnd(city.heights));
}

/** A round length of at most `most` metres: 1, 2 or 5 times a power of ten. */
export function roundLength(most) {
  const power = 10 ** Math.floor(Math.log10(most));
  return power * [5, 2, 1].find((one) => one * power <= most * 1.001);
}

export class Axonometry {
  constructor(canvas, city) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d", { alpha: false, willReadFrequently: true });
    this.show(city);
  }

  /** Show another city from the next `draw` on. */
  show(city) {
    this.city = city;
    this.codes = null;
  }

  /** Draw the city for a camera, as large and as sharp as the canvas on the screen. */
  draw(camera, sun = SUN) {
    const { canvas, context, city } = this, ratio = window.devicePixelRatio || 1;
    if (!canvas.clientWidth || !canvas.clientHeight) return; // hidden
    const wide = Math.max(1, Math.round(canvas.clientWidth * ratio));
    const tall = Math.max(1, Math.round(canvas.clientHeight * ratio));
    if (canvas.width !== wide || canvas.height !== tall) [canvas.width, canvas.height] = [wide, tall];
    this.codes = surfaces(city, camera, wide, tall);
    context.putImageData(new ImageData(paintPixels(city, this.codes, camera, sun), wide, tall), 0, 0);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    const place = placement(city, camera, wide, tall);
    drawNorth(context, place);
    drawScale(context, place.scale / ratio, canvas.clientWidth, canvas.clientHeight);
  }

  /** {row, column, height, part} of the surface at a point of the canvas, CSS px from its upper left corner; part
   * "roof" or "wall". Null where nothing is drawn. */
  pick(x, y) {
    const { canvas, city, codes } = this, ratio = canvas.width / (canvas.clientWidth || 1);
    const across = Math.floor(x * ratio), down = Math.floor(y * ratio);
    if (!codes || across < 0 || down < 0 || across >= canvas.width || down >= canvas.height) return null;
    const code = codes[down * canvas.width + across], cell = Math.floor(code / PARTS);
    if (code < 0) return null;
    return {
      row: Math.floor(cell / city.columns), column: cell % city.columns, height: city.heights[cell],
      part: code % PARTS === ROOF ? "roof" : "wall",
    };
  }
}

/** Draw an arrow that points north on the ground. */
function drawNorth(context, { sin, cos, steep }) {
  const size = 15, flat = Math.max(steep, 0.3);
  const way = [-sin * size, -cos * flat * size], side = [cos * size * 0.35, -sin * flat * size * 0.35];
  const long = Math.hypot(...way) || 1, letter = way.map((one) => one + (one / long) * 9);
  const at = [32, 34], point = (a, b) => [at[0] + a * way[0] + b * side[0], at[1] + a * way[1] + b * side[1]];
  for (const [half, colour] of [[1, COLOURS.ink], [-1, COLOURS.paper]]) {
    context.beginPath();
    for (const [a, b] of [[1, 0], [-1, half], [-0.5, 0]]) context.lineTo(...point(a, b));
    context.closePath();
    context.fillStyle = colour;
    context.fill();
    context.strokeStyle = COLOURS.ink;
    context.lineWidth = 1;
    context.stroke();
  }
  drawText(context, "N", at[0] + letter[0], at[1] + letter[1], "center");
}

/** Draw a scale bar of a round length, true along the horizontal. */
function drawScale(context, scale, width, height) {
  const metres = roundLength(Math.min(width / 4, 160) / scale), long = metres * scale, [x, y] = [12, height - 16];
  context.fillStyle = COLOURS.paper;
  context.strokeStyle = COLOURS.ink;
  context.lineWidth = 1;
  context.fillRect(x, y, long, 4);
  context.strokeRect(x + 0.5, y + 0.5, Math.round(long) - 1, 4);
  context.fillStyle = COLOURS.ink;
  context.fillRect(x, y, long / 2, 5);
  drawText(context, metres < 1000 ? `${metres} m` : `${metres / 1000} km`, x + long + 6, y + 2.5, "left");
}

/** Draw a text that is legible on any ground. */
function drawText(context, text, x, y, align) {
  context.font = `600 12px ${FONT}`;
  context.textAlign = align;
  context.textBaseline = "middle";
  context.lineWidth = 3;
  context.lineJoin = "round";
  context.strokeStyle = COLOURS.paper;
  context.strokeText(text, x, y);
  context.fillStyle = COLOURS.ink;
  context.fillText(text, x, y);
}
