/** The colours of heights, as in evocity's maps (evocity/pictures/colours.py). */

export const PAPER = [250, 248, 244], BUILT_ABOVE = 1.5;
const GROUND = [241, 238, 231], STEPS = 1024;
const RAMP = [
  [237, 213, 174], [232, 182, 130], [222, 146, 98], [203, 107, 84], [169, 74, 86],
  [124, 53, 92], [78, 38, 85], [36, 23, 65],
];

/** The end of the scale of a city's colours, a round number of metres above nearly all roofs. A single tower does not
 * make the rest pale. */
export function scaleEnd(heights) {
  const roofs = heights.filter((one) => one > BUILT_ABOVE).sort(), last = roofs.length - 1;
  if (last < 0) return 10;
  const at = 0.995 * last, low = Math.floor(at);
  const usual = roofs[low] + (at - low) * (roofs[Math.min(last, low + 1)] - roofs[low]);
  const end = roofs[last] > 2 * usual ? usual : roofs[last];
  const step = end <= 50 ? 5 : end <= 150 ? 10 : 50;
  return Math.max(10, step * Math.ceil(end / step));
}

/** RGB of each height in metres: pale at the ground, dark at the highest. */
export function ramp(heights, highest) {
  const end = Math.max(highest, 2 * BUILT_ABOVE), table = tableTo(end), scale = (STEPS - 1) / end;
  const colours = new Uint8Array(3 * heights.length);
  for (let k = 0; k < heights.length; k++) {
    const step = heights[k] > 0 ? Math.min(STEPS - 1, Math.floor(Math.fround(heights[k] * Math.fround(scale)))) : 0;
    for (let c = 0; c < 3; c++) colours[3 * k + c] = table[3 * step + c];
  }
  return colours;
}

/** Colours at even steps from 0 to `end` metres, mixed in OKLab. */
function tableTo(end) {
  const stops = RAMP.map(labOf), ground = labOf(GROUND);
  // a trace just under the threshold is half-way from the ground to the lowest roof
  const trace = ground.map((one, c) => (one + stops[0][c]) / 2);
  const where = [0, BUILT_ABOVE * 0.999];
  for (let k = 0; k < stops.length; k++) where.push(BUILT_ABOVE + ((end - BUILT_ABOVE) * k) / (stops.length - 1));
  const colours = [ground, trace, ...stops], table = new Uint8Array(3 * STEPS);
  for (let step = 0, place = 0; step < STEPS; step++) {
    const metres = (end * step) / (STEPS - 1);
    while (place < where.length - 2 && metres > where[place + 1]) place++;
    const share = (metres - where[place]) / (where[place + 1] - where[place]);
    const [low, high] = [colours[place], colours[place + 1]];
    rgbOf(low.map((one, c) => one + share * (high[c] - one)))
      .forEach((one, c) => { table[3 * step + c] = Math.round(255 * one); });
  }
  return table;
}

// Ottosson, "A perceptual color space for image processing" (2020), and its inverse
const TO_LMS = [
  [0.4122214708, 0.5363325363, 0.0514459929],
  [0.2119034982, 0.6806995451, 0.1073969566],
  [0.0883024619, 0.2817188376, 0.6299787005],
];
const TO_LAB = [
  [0.2104542553, 0.793617785, -0.0040720468],
  [1.9779984951, -2.428592205, 0.4505937099],
  [0.0259040371, 0.7827717662, -0.8086757660],
];
const FROM_LMS = inverse(TO_LMS), FROM_LAB = inverse(TO_LAB);

function labOf(rgb) {
  const linear = rgb.map((one) => (one <= 10.31475 ? one / 3294.6 : ((one / 255 + 0.055) / 1.055) ** 2.4));
  return times(TO_LAB, times(TO_LMS, linear).map(Math.cbrt));
}

function rgbOf(lab) {
  return times(FROM_LMS, times(FROM_LAB, lab).map((one) => one ** 3)).map((one) => {
    const linear = Math.min(1, Math.max(0, one));
    return linear <= 0.0031308 ? 12.92 * linear : 1.055 * linear ** (1 / 2.4) - 0.055;
  });
}

function times(matrix, vector) {
  return matrix.map((row) => row[0] * vector[0] + row[1] * vector[1] + row[2] * vector[2]);
}

function inverse([[a, b, c], [d, e, f], [g, h, i]]) {
  const all = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g);
  return [
    [e * i - f * h, c * h - b * i, b * f - c * e],
    [f * g - d * i, a * i - c * g, c * d - a * f],
    [d * h - e * g, b * g - a * h, a * e - b * d],
  ].map((row) => row.map((one) => one / all));
}
