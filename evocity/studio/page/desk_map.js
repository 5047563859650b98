import { drawFile, drawRing } from "./desk_canvas.js";
import { Outlines } from "./desk_outlines.js";
import { button, choice, COLOURS, element, fitCanvas, number } from "./elements.js";
import { frame } from "./overlay.js";
import { getBlob } from "./server.js";

/** The uses of a drawn area: key, name, colour. */
export const USES = [["lock", "lock", "#34302e"], ["within", "boundary", "#2a6a9e"]];
const WAYS = { ArrowUp: [0, 1], ArrowDown: [0, -1], ArrowLeft: [-1, 0], ArrowRight: [1, 0] };
const SIDES = ["west", "south", "east", "north"];
/** Milliseconds after the last key before the window is read there; height of the map, px. */
const SOON = 500, TALL = 340;
let hints = 0;

/** A map of a file, to move the window on and to draw areas on. All places are metres east and north. `on`: window(), its
 * pixels and metres; scale(), the end of the scale of heights; areas(); moved(); drew(use, shape). */
export class WindowMap {
  constructor(parent, title, on) {
    [this.on, this.at, this.tool, this.points, this.zoom] = [on, null, "window", [], 1];
    const figure = element(parent, "figure", "file-map");
    const tools = this.tools = element(figure, "div", "row", "", { role: "group", "aria-label": `tools on the map of ${title}` });
    this.buttons = new Map([["window", "move the window"], ...USES.map(([use, name]) => [use, `draw the ${name}`])].map(([tool, text]) => [tool, button(tools, text, () => this.use(tool))]));
    this.shape = choice(tools, "shape", ["rectangle", "polygon"], (event) => { event.stopPropagation(); this.use(this.tool); });
    for (const [text, by] of [["zoom in", 1.6], ["zoom out", 1 / 1.6], ["whole file", 0]]) button(tools, text, () => this.zoomBy(by));
    this.middle = button(tools, "middle of the file", () => this.move(null));
    this.canvas = element(figure, "canvas", "", "", { tabindex: "0", role: "application", "aria-label": `map of ${title} with the window` });
    this.text = element(figure, "p", "", "", { role: "status" });
    this.hint = element(figure, "p", "faint", "", { id: `hint-${++hints}` });
    this.canvas.setAttribute("aria-describedby", this.hint.id);
    this.listen();
    new ResizeObserver(() => this.redraw()).observe(figure);
    this.use("window");
  }

  /** Show the map of the server, `one`, with the window `at` a place. */
  async show(one, at) {
    this.last = one;
    if (this.isHeld || this.waits) return;
    const { over, about, map, turn } = one, shown = at || (about && about.at) || null;
    this.isFixed = over.fixed;
    this.middle.hidden = this.isFixed;
    const isSame = JSON.stringify([shown, over.extent, this.on.window(), this.on.areas(), about && about.areas, this.on.scale()]);
    const key = over.partial ? turn : JSON.stringify([over.extent, over.rings, over.count]);
    if (isSame === this.shown && key === this.key) return;
    [this.shown, this.about, this.set] = [isSame, about, at];
    this.at = shown || [(over.extent[0] + over.extent[2]) / 2, (over.extent[1] + over.extent[3]) / 2];
    if (key !== this.key) {
      this.key = key;
      try {
        const bytes = new Uint8Array(await (await getBlob("desk-overview", { map, turn })).arrayBuffer());
        this.outlines = new Outlines(over, bytes);
      } catch (error) {
        this.key = this.shown = null; // the next state tries again
        this.say(error.message);
        return;
      }
    }
    if (this.isHeld) return;
    this.base = null;
    this.redraw();
    this.tell();
  }

  // -- places --------------------------------------------------------------------------------

  /** The window as a box. */
  get box() {
    const { pixels, metres } = this.on.window(), half = (pixels * metres) / 2;
    return [this.at[0] - half, this.at[1] - half, this.at[0] + half, this.at[1] + half];
  }

  /** Fit the file and the window, or a part of these around the window; px for a metre and the middle. */
  fit() {
    const [west, south, east, north] = this.outlines.extent.map((edge, k) => (k < 2 ? Math.min(edge, this.box[k]) : Math.max(edge, this.box[k])));
    const scale = Math.min(this.wide / (east - west || 1), TALL / (north - south || 1)) * 0.94 * this.zoom;
    const middle = this.zoom > 1 ? [...this.at] : [(west + east) / 2, (south + north) / 2];
    this.view = { scale, middle };
  }

  toScreen([x, y]) {
    const { scale, middle } = this.view;
    return [this.wide / 2 + (x - middle[0]) * scale, TALL / 2 - (y - middle[1]) * scale];
  }

  /** The place of a pointer. */
  toMap(event) {
    const { left, top } = this.canvas.getBoundingClientRect(), { scale, middle } = this.view;
    return [middle[0] + (event.clientX - left - this.wide / 2) / scale, middle[1] - (event.clientY - top - TALL / 2) / scale];
  }

  /** The nearest corner of a pixel of the window. */
  snap(place) {
    const { metres } = this.on.window();
    return place.map((one, axis) => +(this.box[axis] + metres * Math.round((one - this.box[axis]) / metres)).toFixed(3));
  }

  zoomBy(by) {
    this.zoom = by ? Math.max(1, Math.min(64, this.zoom * by)) : 1;
    this.base = null;
    this.redraw();
  }

  // -- the window ----------------------------------------------------------------------------

  /** Move the window; null is the middle of the file. */
  move(at) {
    if (this.isFixed) return;
    this.set = at && at.map((one) => +one.toFixed(2));
    if (at) this.at = this.set;
    if (this.zoom > 1 && !this.isHeld) this.base = null;
    this.tell();
    this.redraw();
    if (this.isHeld) return;
    clearTimeout(this.waits);
    this.waits = setTimeout(() => { this.waits = null; this.on.moved(); }, SOON);
  }

  /** Describe what falls in and out of the window. */
  tell() {
    if (!this.outlines) return;
    const { inside, cut, share } = this.outlines.count(this.box), built = `${Math.round(100 * share)} % of the window is built`;
    const texts = [share === undefined ? "Studio counts the buildings once it has read this window" : inside === undefined ? built : `The window holds ${inside} whole buildings and cuts ${cut}; ${built}`];
    const beyond = this.outlines.extent.map((edge, k) => (k < 2 ? edge - this.box[k] : this.box[k] - edge));
    const out = SIDES.map((side, k) => [beyond[k], side]).filter(([by]) => by >= 1).map(([by, side]) => `${number(Math.round(by))} m in the ${side}`);
    if (out.length) texts.push(`The window leaves the file by ${out.join(", ")}`);
    this.say(`${[...this.notice, ...texts].join(". ")}.`);
  }

  say(text) {
    if (this.text.textContent !== text) this.text.textContent = text;
  }

  // -- drawing -------------------------------------------------------------------------------

  use(tool) {
    [this.tool, this.points, this.spot, this.notice] = [tool, [], null, []];
    for (const [name, one] of this.buttons) one.setAttribute("aria-pressed", String(name === tool));
    this.shape.parentNode.hidden = tool === "window";
    this.hint.textContent = tool === "window"
      ? this.isFixed ? "This file has no place on Earth, so its window is the middle of the file." : "Drag the window, or focus the map and move the window by arrow keys: Shift moves further."
      : this.isPolygon ? "Click on each corner, and double-click on the last. By keys: arrows move, Enter sets a corner, c closes the shape, Backspace removes a corner."
        : "Drag from corner to corner. By keys: arrows move, Enter sets a corner, Escape begins again.";
    if (this.outlines) this.redraw();
  }

  get isPolygon() { return this.shape.value === "polygon"; }

  addPoint(place) {
    this.points.push(this.snap(place));
    if (!this.isPolygon && this.points.length === 2) return this.close();
    this.say(`corner ${this.points.length} of the ${this.nameOf(this.tool)}`);
    this.redraw();
  }

  /** End a shape. */
  close() {
    const points = this.ring(this.points);
    this.points = [];
    this.redraw();
    if (points.length > 2) this.on.drew(this.tool, points);
    else {
      this.notice = ["A shape needs at least three corners"];
      this.tell();
    }
  }

  /** The ring of points: two corners make a rectangle; the second click of a double-click adds no corner. */
  ring(points) {
    if (!this.isPolygon && points.length === 2) {
      const [[west, south], [east, north]] = points;
      return west === east || south === north ? [] : [[west, south], [east, south], [east, north], [west, north]];
    }
    return points.filter((one, k) => !k || one.join() !== points[k - 1].join());
  }

  nameOf(tool) { return USES.find(([use]) => use === tool)[1]; }

  listen() {
    const { canvas } = this;
    let hold = null;
    canvas.addEventListener("pointerdown", (event) => {
      if (!this.outlines || event.button !== 0) return;
      canvas.focus();
      canvas.setPointerCapture(event.pointerId);
      const place = this.toMap(event);
      this.isHeld = true;
      [this.spot, this.notice] = [null, []];
      if (this.tool === "window") {
        const isIn = place.every((one, axis) => one >= this.box[axis] && one <= this.box[axis + 2]);
        hold = isIn ? place.map((one, axis) => one - this.at[axis]) : [0, 0];
        if (!isIn) this.move(place);
      } else if (!this.isPolygon) this.points = [this.snap(place), this.snap(place)];
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!this.isHeld) return;
      const place = this.toMap(event);
      if (this.tool === "window") this.move(place.map((one, axis) => one - hold[axis]));
      else if (!this.isPolygon) this.points = [this.points[0], this.snap(place)];
      this.redraw();
    });
    canvas.addEventListener("pointerup", (event) => {
      if (!this.isHeld) return;
      this.isHeld = false;
      if (this.tool === "window") this.move(this.isFixed ? null : this.at);
      else if (!this.isPolygon) this.close();
      else this.addPoint(this.toMap(event));
      this.show(this.last, this.set); // what arrived meanwhile
    });
    canvas.addEventListener("pointercancel", () => { this.isHeld = false; this.points = []; });
    canvas.addEventListener("dblclick", () => this.tool !== "window" && this.isPolygon && this.close());
    canvas.addEventListener("keydown", (event) => this.press(event));
  }

  press(event) {
    if (!this.outlines) return;
    this.notice = [];
    const way = WAYS[event.key], { pixels, metres } = this.on.window();
    if (event.key === "+" || event.key === "-") this.zoomBy(event.key === "+" ? 1.6 : 1 / 1.6);
    else if (this.tool === "window") {
      const step = Math.max(1, Math.round(pixels / 32)) * metres * (event.shiftKey ? 8 : 1);
      if (way) this.move(this.at.map((one, axis) => one + step * way[axis]));
      else if (event.key === "Home") this.move(null);
      else return;
    } else if (way) {
      const step = metres * Math.max(1, Math.round(pixels / 64)) * (event.shiftKey ? 8 : 1);
      this.spot = this.snap((this.spot || this.at).map((one, axis) => one + step * way[axis]));
      const [x, y] = this.spot.map((one, axis) => number(Math.round(one - this.box[axis])));
      this.say(`${x} m east and ${y} m north of the window's south-west corner`);
      this.redraw();
    } else if (event.key === "Enter") this.addPoint(this.spot || this.at);
    else if (event.key === "c") this.close();
    else if (event.key === "Backspace" || event.key === "Escape") {
      this.points = event.key === "Escape" ? [] : this.points.slice(0, -1);
      this.redraw();
    } else return;
    event.preventDefault();
  }

  // -- the canvas ----------------------------------------------------------------------------

  redraw() {
    if (this.next) return;
    this.next = requestAnimationFrame(() => { this.next = null; this.draw(); });
  }

  draw() {
    const wide = Math.floor(this.canvas.parentNode.clientWidth);
    if (!this.outlines || !wide) return;
    if (wide !== this.wide || !this.base) {
      this.wide = wide;
      this.fit();
      this.base = drawFile(this.outlines, (place) => this.toScreen(place), [wide, TALL], this.on.scale());
    }
    const context = fitCanvas(this.canvas, wide, TALL), { about } = this;
    context.drawImage(this.base, 0, 0, wide, TALL);
    const [west, south, east, north] = this.box, [x, y] = this.toScreen([west, north]), [right, low] = this.toScreen([east, south]);
    context.fillStyle = "rgb(176 64 63 / 0.08)";
    context.fillRect(x, y, right - x, low - y);
    frame(context, x, y, right - x, low - y, this.tool === "window" ? 2 : 1);
    const areas = this.on.areas();
    for (const [use, , colour] of USES) {
      const read = about && about.areas && about.areas[use];
      const rings = areas[use] ? areas[use].shapes : [];
      for (const ring of [...rings, ...(areas[use] && read && read.rings ? read.rings : [])]) drawRing(context, ring.map((one) => this.toScreen(one)), colour, use === "lock");
    }
    if (this.points.length) drawRing(context, (this.isPolygon ? this.points : this.ring(this.points)).map((one) => this.toScreen(one)), COLOURS.chosen, false);
    if (this.spot) {
      const [a, b] = this.toScreen(this.spot);
      for (const [long, tall] of [[14, 1], [1, 14]]) frame(context, a - long / 2, b - tall / 2, long, tall);
    }
  }
}
