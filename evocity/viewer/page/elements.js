/** Elements of the page, and numbers as text. All text is set as text. */

/** Make an element of a class, with a text, within a parent. */
export function element(parent, tag, name = "", text = "", attributes = {}) {
  const made = document.createElement(tag);
  if (name) made.className = `evocity-${name}`;
  if (text !== "") made.textContent = text;
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (parent) parent.append(made);
  return made;
}

/** A button that acts on a click. */
export function button(parent, text, act, attributes = {}) {
  const made = element(parent, "button", "", text, { type: "button", ...attributes });
  made.addEventListener("click", act);
  return made;
}

/** An input of a type with a text before it, and an initial value. */
export function field(parent, text, type, value = "", attributes = {}) {
  const input = element(element(parent, "label", "", text && `${text} `), "input", "", "", { type, ...attributes });
  input.value = value;
  return input;
}

/** A tick box with a text behind it. */
export function tick(parent, text, isTicked = false) {
  const label = element(parent, "label"), box = element(label, "input", "", "", { type: "checkbox" });
  box.checked = isTicked;
  label.append(text);
  return box;
}

/** A list to choose from, [value, text] each, that acts on a change. */
export function choice(parent, text, options, act = null, attributes = {}) {
  const select = element(element(parent, "label", "", text && `${text} `), "select", "", "", attributes);
  offer(select, options);
  if (act) select.addEventListener("change", act);
  return select;
}

/** Offer [value, text] each, or texts, in place of the options of a list; a value that stays is kept. */
export function offer(select, options) {
  const was = select.value, pairs = options.map((one) => (Array.isArray(one) ? one : [one, one]));
  select.replaceChildren(...pairs.map(([value, text]) => element(null, "option", "", text, { value })));
  if (pairs.some(([value]) => String(value) === was)) select.value = was;
}

/** A number with four digits; a dash for no number. */
export function number(value) {
  if (!Number.isFinite(value)) return "–";
  const rounded = Number(value.toPrecision(4));
  const size = Math.abs(rounded);
  return size !== 0 && (size < 1e-3 || size >= 1e7) ? rounded.toExponential() : String(rounded);
}

/** 1204 as "1 204". */
export const countText = (count) => String(count).replace(/\B(?=(\d{3})+$)/g, "\u202f");

/** A text cut to a width in px in the font of a canvas. */
export function shortenText(context, text, width) {
  if (context.measureText(text).width <= width) return text;
  let low = 0, high = text.length;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (context.measureText(`${text.slice(0, middle)}…`).width <= width) low = middle;
    else high = middle - 1;
  }
  return low ? `${text.slice(0, low)}…` : "";
}

/** Give a canvas a size in CSS px, as sharp as the screen; its context, in CSS px. */
export function fitCanvas(canvas, width, height) {
  const ratio = window.devicePixelRatio || 1;
  const wide = Math.max(1, Math.round(width * ratio)), tall = Math.max(1, Math.round(height * ratio));
  if (canvas.width !== wide || canvas.height !== tall) [canvas.width, canvas.height] = [wide, tall];
  canvas.style.width = `${width}px`;
  canvas.style.height = `${height}px`;
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return context;
}

/** The colours of pictures, plots and the report. */
export const COLOURS = {
  paper: "#faf8f4", ink: "#34302e", faint: "#6b645e", line: "#d8d1c4", pale: [140, 130, 115],
  passing: [63, 116, 163], chosen: "#b0403f",
};
export const FONT = 'system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif';
