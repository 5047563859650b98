/** The canvas of the modeller: a picture, and over it the handles, which a pointer or keys move. */

import { COLOURS, element, FONT } from "./elements.js";
import { namesOf, outlinesOf, partsOf, placeOf } from "./modeller-handles.js";

export const SIDE = 600;
/** Distance from a handle at which a pointer holds it, and steps of the arrow keys; px. */
const NEAR = 11, STEP = 1, LONG_STEP = 10, SHORT_STEP = 0.1;
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/** `on`: the current `shape`, its `base` and what is `selected`, {part, name}; move(part, name, place),
 * select(part, name), remove(), drag(isDragging), look(). The fields `faulty` (a part) and `isShown` say what is drawn. */
export class Stage {
  constructor(parent, on) {
    this.on = on;
    const root = element(parent, "div", "modeller-stage");
    this.picture = element(root, "canvas", "", "", { width: SIDE, height: SIDE, role: "img", "aria-label": "the shape" });
    this.hands = element(root, "canvas", "", "", {
      width: SIDE, height: SIDE, tabindex: 0, role: "application",
      "aria-label": "handles of the shape. Arrow keys move the handle, Page Up and Page Down choose a map or a point, " +
        "the keys [ and ] choose a handle, and Delete removes a map or a point.",
    });
    this.context = this.picture.getContext("2d", { alpha: false });
    this.over = this.hands.getContext("2d");
    this.view = { left: 0, low: 0, wide: 1 };
    this.hands.addEventListener("pointerdown", (event) => this.hold(event));
    this.hands.addEventListener("pointermove", (event) => this.follow(event));
    for (const name of ["pointerup", "pointercancel"]) this.hands.addEventListener(name, () => this.release());
    this.hands.addEventListener("keydown", (event) => this.key(event));
    this.hands.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(event.deltaY > 0 ? 1.15 : 1 / 1.15, this.placeAt(event));
    }, { passive: false });
  }

  get shape() { return this.on.shape(); }
  get base() { return this.on.base(); }
  get selected() { return this.on.selected(); }

  // -- the view --------------------------------------------------------------------------------

  get scale() { return SIDE / this.view.wide; }

  /** The view as a map from the shape to px, y downwards. */
  get map() {
    const { left, low } = this.view, scale = this.scale;
    return [scale, 0, -left * scale, 0, -scale, SIDE + low * scale];
  }

  toPixels([x, y]) { return [(x - this.view.left) * this.scale, SIDE - (y - this.view.low) * this.scale]; }

  /** The place of a pointer in units of the shape. */
  placeAt({ clientX, clientY }) {
    const { left, top, width, height } = this.hands.getBoundingClientRect();
    const [x, y] = [(clientX - left) / width, (clientY - top) / height];
    return [this.view.left + x * this.view.wide, this.view.low + (1 - y) * this.view.wide];
  }

  /** Show a box [left, low, right, high] with a margin. */
  fit([left, low, right, high]) {
    const wide = 1.15 * Math.max(right - left, high - low, 1e-9);
    this.view = { left: (left + right - wide) / 2, low: (low + high - wide) / 2, wide };
    this.on.look();
  }

  zoom(factor, [x, y] = [this.view.left + this.view.wide / 2, this.view.low + this.view.wide / 2]) {
    const wide = this.view.wide * factor;
    if (!(wide > 1e-9 && wide < 1e9)) return;
    this.view = { left: x - (x - this.view.left) * factor, low: y - (y - this.view.low) * factor, wide };
    this.on.look();
  }

  // -- hands -----------------------------------------------------------------------------------

  /** The handle near a place: one of the selected part first. */
  handleAt(place) {
    const at = this.toPixels(place);
    let best = null;
    for (let part = 0; part < partsOf(this.shape); part += 1) {
      const isSelected = part === this.selected.part;
      for (const name of isSelected ? namesOf(this.shape) : namesOf(this.shape).slice(0, 1)) {
        const [x, y] = this.toPixels(placeOf(this.shape, this.base, part, name)), far = Math.hypot(x - at[0], y - at[1]);
        if (far <= NEAR && (!best || far < best.far - (best.isSelected ? 4 : 0))) best = { part, name, far, isSelected };
      }
    }
    if (best || this.shape.kind !== "frames") return best;
    const inside = outlinesOf(this.shape, this.base).find(({ points }) => isInside(points, place));
    return inside ? { part: inside.part, name: "middle" } : null;
  }

  hold(event) {
    if (event.button) return;
    const place = this.placeAt(event), handle = this.isShown ? this.handleAt(place) : null;
    this.hands.setPointerCapture(event.pointerId);
    if (!handle) {
      this.held = { place };
      return;
    }
    this.on.select(handle.part, handle.name);
    const at = placeOf(this.shape, this.base, handle.part, handle.name);
    this.held = { ...handle, by: at.map((value, axis) => value - place[axis]) };
    this.on.drag(true);
  }

  follow(event) {
    if (!this.held) return;
    const place = this.placeAt(event), { part, name, by } = this.held;
    if (by) this.on.move(part, name, place.map((value, axis) => value + by[axis]));
    else {
      this.view.left -= place[0] - this.held.place[0];
      this.view.low -= place[1] - this.held.place[1];
      this.on.look();
    }
  }

  release() {
    this.held = null;
    this.on.drag(false);
  }

  key(event) {
    if (!this.isShown) return;
    const { part, name } = this.selected, names = namesOf(this.shape), count = partsOf(this.shape);
    const arrow = ARROWS[event.key];
    if (arrow) {
      const step = (event.shiftKey ? LONG_STEP : event.altKey ? SHORT_STEP : STEP) / this.scale;
      const [x, y] = placeOf(this.shape, this.base, part, name);
      this.on.move(part, name, [x + arrow[0] * step, y - arrow[1] * step]);
    } else if (event.key === "PageDown") this.on.select((part + 1) % count, name);
    else if (event.key === "PageUp") this.on.select((part + count - 1) % count, name);
    else if (event.key === "]") this.on.select(part, names[(names.indexOf(name) + 1) % names.length]);
    else if (event.key === "[") this.on.select(part, names[(names.indexOf(name) + names.length - 1) % names.length]);
    else if (event.key === "Delete") this.on.remove();
    else return;
    event.preventDefault();
  }

  // -- drawing ---------------------------------------------------------------------------------

  /** Draw the handles. */
  drawHands() {
    const { over, shape, selected } = this;
    over.clearRect(0, 0, SIDE, SIDE);
    if (!this.isShown || !shape) return;
    over.font = `12px ${FONT}`;
    this.path(this.reference(), shape.kind === "frames", [4, 4], COLOURS.faint, 1);
    for (const one of outlinesOf(shape, this.base)) {
      const isFaulty = this.faulty !== null && (one.arc ?? one.part) === this.faulty, isSelected = one.part === selected.part;
      this.path(one.points, one.isClosed, [], isFaulty ? "#d00000" : isSelected ? COLOURS.chosen : "#3f74a3", isSelected || isFaulty ? 2 : 1);
      if (one.isClosed || one.arc !== undefined) this.mark(one);
      if (isFaulty) this.label("does not contract", one.points);
    }
    for (let part = 0; part < partsOf(shape); part += 1) {
      for (const name of part === selected.part ? namesOf(shape) : namesOf(shape).slice(0, 1)) {
        const [x, y] = this.toPixels(placeOf(shape, this.base, part, name)), isHeld = part === selected.part && name === selected.name;
        over.beginPath();
        if (name.startsWith("edge")) over.rect(x - 3.5, y - 3.5, 7, 7); else over.arc(x, y, isHeld ? 6 : 4, 0, 7);
        over.fillStyle = isHeld ? COLOURS.chosen : "#ffffff";
        over.fill();
        over.strokeStyle = part === selected.part ? COLOURS.chosen : "#3f74a3";
        over.lineWidth = 1.5;
        over.stroke();
      }
    }
  }

  reference() {
    if (this.shape.kind === "wire") return [[0, 0], [1, 0]];
    const { low: [x, y], high: [u, v] } = this.base;
    return this.shape.kind === "frames" ? [[x, y], [u, y], [u, v], [x, v]] : [];
  }

  path(points, isClosed, dash, colour, width) {
    const { over } = this;
    over.beginPath();
    points.forEach((point, k) => over[k ? "lineTo" : "moveTo"](...this.toPixels(point)));
    if (isClosed) over.closePath();
    over.setLineDash(dash);
    over.strokeStyle = colour;
    over.lineWidth = width;
    over.stroke();
    over.setLineDash([]);
  }

  /** Mark the first corner of a frame by its number; the left side of an arc, on which its copy lies, by a tick. */
  mark({ points: [from, to], isClosed, part, isFlipped }) {
    const [[x, y], [u, v]] = [from, to].map((point) => this.toPixels(point)), { over } = this;
    if (isClosed) {
      over.fillStyle = COLOURS.ink;
      over.fillText(String(part), x + 5, y - 5);
      return;
    }
    const long = Math.hypot(u - x, v - y) || 1, side = isFlipped ? 1 : -1, [p, q] = [(x + u) / 2, (y + v) / 2];
    over.beginPath();
    over.moveTo(p, q);
    over.lineTo(p - side * (v - y) / long * 8 + (u - x) / long * 3, q + side * (u - x) / long * 8 + (v - y) / long * 3);
    over.strokeStyle = COLOURS.faint;
    over.lineWidth = 1;
    over.stroke();
  }

  label(text, points) {
    const [x, y] = this.toPixels(points[0]), wide = this.over.measureText(text).width + 8;
    const at = [Math.min(Math.max(x, 0), SIDE - wide), Math.min(Math.max(y - 26, 0), SIDE - 18)];
    this.over.fillStyle = "#d00000";
    this.over.fillRect(...at, wide, 18);
    this.over.fillStyle = "#ffffff";
    this.over.fillText(text, at[0] + 4, at[1] + 13);
  }
}

function isInside(points, [x, y]) {
  let inside = false;
  points.forEach(([a, b], k) => {
    const [c, d] = points[(k + 1) % points.length];
    if ((b > y) !== (d > y) && x < a + (y - b) * (c - a) / (d - b)) inside = !inside;
  });
  return inside;
}
