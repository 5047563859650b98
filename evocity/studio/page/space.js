import { Axonometry } from "./axonometry.js";
import { Orbit, Stroll } from "./camera.js";
import { element, field } from "./elements.js";
import { sunAt } from "./sun.js";
import { Walk, supported } from "./walk.js";

const HOW = {
  columns: "Drag to turn and tilt; drag with Shift to move. Zoom with the wheel, plus or minus. Turn with the arrow keys. Key 0 shows the whole map.",
  walk: "Walk with W, A, S, D or the arrow keys; Shift makes you faster. Drag, or press Q or E, to look around. Rise and sink with Page Up and Page Down.",
};
HOW.solids = HOW.columns;
/** The canvas of a kind. */
const canvasOf = (kind) => (kind === "columns" ? kind : "walk");

/** A city in three dimensions: exact columns in parallel projection, solids from outside, or a walk, both in the light
 * of a date and an hour; also two cities of one size from the same viewpoint. The next city appears from the viewpoint of the last one. */
export class Space {
  constructor(parent) {
    this.pair = element(parent, "div", "pair");
    this.views = [];
    this.how = element(parent, "p", "faint");
    this.light = element(parent, "div", "row");
    this.light.addEventListener("input", () => this.draw());
    this.date = field(this.light, "date", "date", "2026-06-21", { min: "1950-01-01", max: "2050-12-31" });
    this.hour = field(this.light, "hour", "range", "15", { min: "0", max: "24", step: "0.25" });
    this.latitude = field(this.light, "latitude", "number", "45", { min: "-90", max: "90", step: "0.1" });
    this.hands = {};
    new ResizeObserver(() => this.draw()).observe(parent);
  }

  /** The drawers of the first city. */
  get drawers() { return this.views[0].drawers; }

  /** Show one city or two, {city, title}, as "columns", or as "solids" or a "walk" if the browser can. A walk through
   * two cities stays where both are open. */
  show(listed, wanted) {
    const kind = this.kind = supported() ? wanted : "columns";
    this.light.hidden = kind === "columns";
    const { latitude } = listed[0].city;
    if (latitude !== undefined && latitude !== null && latitude !== this.given) this.latitude.value = latitude.toFixed(1);
    this.given = latitude;
    this.how.textContent = (wanted !== kind ? "This browser lacks WebGL2, so the page shows columns from outside, without streets, classes, objects or a walk. " : "") + HOW[kind];
    while (this.views.length < listed.length) this.views.push(new View(this.pair));
    this.views.forEach((view, place) => view.show(listed[place], kind, listed.length > 1));
    this.shown = this.views.slice(0, listed.length);
    const Hand = kind === "walk" ? Stroll : Orbit, way = kind === "walk" ? kind : "columns", was = this.hands[way];
    for (const one of Object.values(this.hands)) one.detach();
    const all = highestOfAll(listed.map((one) => one.city)), make = (camera) => new Hand(all, () => this.draw(), camera);
    let hand = make(was ? was.hand.camera : {});
    if (kind === "walk" && listed.length > 1 && !hand.isFree(...hand.camera.position)) hand = make({}); // within a wall of one
    const ends = this.shown.map((view) => hand.attach(view.canvases[canvasOf(kind)]));
    this.hands[way] = { hand, detach: () => ends.forEach((end) => end()) };
    this.draw();
  }

  /** Give the city at a place straight walls: `bytes`, the solids of `Walk`. */
  setSolids(place, bytes) {
    this.shown[place].setSolids(bytes);
    this.draw();
  }

  draw() {
    const { kind } = this;
    if (!kind) return;
    const { camera } = this.hands[kind === "walk" ? kind : "columns"].hand;
    const sun = sunAt(Number(this.latitude.value) || 0, this.date.value || "2026-06-21", Number(this.hour.value));
    for (const view of this.shown) view.draw(kind, camera, sun);
  }
}

/** One city, with a canvas of each kind. */
class View {
  constructor(parent) {
    this.root = element(parent, "figure");
    this.caption = element(this.root, "figcaption");
    const canvas = (kind) => element(this.root, "canvas", "", "", { role: "img", "data-kind": kind });
    this.canvases = { columns: canvas("columns"), walk: canvas("walk") };
    this.drawers = {};
  }

  show(state, kind, isOneOfTwo) {
    this.root.hidden = !state;
    if (!state) return;
    const { city, title } = state;
    this.city = city;
    this.caption.textContent = title;
    this.caption.hidden = !isOneOfTwo;
    const name = canvasOf(kind);
    for (const [one, canvas] of Object.entries(this.canvases)) canvas.hidden = one !== name;
    this.canvases[name].setAttribute("aria-label", `${title} in three dimensions. ${HOW[kind]}`);
    if (this.drawers[name]) this.drawers[name].show(city);
    else this.drawers[name] = new (name === "walk" ? Walk : Axonometry)(this.canvases[name], city);
  }

  setSolids(bytes) { this.drawers.walk.show(this.city, bytes); }

  draw(kind, camera, sun) {
    const name = canvasOf(kind);
    if (this.canvases[name].clientWidth) this.drawers[name].draw(camera, sun);
  }
}

/** The higher of all cities at each place: a walker on it is inside no city. */
function highestOfAll(cities) {
  if (cities.length < 2) return cities[0];
  return { ...cities[0], heights: cities[0].heights.map((one, k) => Math.max(one, ...cities.slice(1).map((other) => other.heights[k]))) };
}
