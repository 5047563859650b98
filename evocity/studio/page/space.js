import { Axonometry } from "./axonometry.js";
import { Orbit, Stroll } from "./camera.js";
import { element } from "./elements.js";
import { sunAt } from "./sun.js";
import { Walk, supported } from "./walk.js";

const HOW = {
  columns: "Drag to turn and tilt; drag with Shift to move. Zoom with the wheel, plus or minus. Turn with the arrow keys. Key 0 shows the whole map.",
  walk: "Walk with W, A, S, D or the arrow keys; Shift makes you faster. Drag, or press Q or E, to look around. Rise and sink with Page Up and Page Down.",
};

/** A city in three dimensions: exact columns in parallel projection, or a walk in the light of a date and an hour;
 * also two cities of one size from the same viewpoint. The next city appears from the viewpoint of the last one. */
export class Space {
  constructor(parent) {
    this.pair = element(parent, "div", "pair");
    this.views = [];
    this.how = element(parent, "p", "faint");
    this.light = element(parent, "div", "row");
    const field = (text, type, value, limits) => {
      const input = element(element(this.light, "label", "", `${text} `), "input", "", "", { type, ...limits });
      input.value = value;
      input.addEventListener("input", () => this.draw());
      return input;
    };
    this.date = field("date", "date", "2026-06-21", { min: "1950-01-01", max: "2050-12-31" });
    this.hour = field("hour", "range", "15", { min: "0", max: "24", step: "0.25" });
    this.latitude = field("latitude", "number", "45", { min: "-90", max: "90", step: "1" });
    this.hands = {};
    new ResizeObserver(() => this.draw()).observe(parent);
  }

  /** The drawers of the first city. */
  get drawers() { return this.views[0].drawers; }

  /** Show one city or two, {city, title}; as a walk if it `isWalk` and the browser can. A walk through two cities
   * stays where both are open. */
  show(listed, isWalk) {
    const kind = this.kind = isWalk && supported() ? "walk" : "columns";
    this.light.hidden = kind !== "walk";
    this.how.textContent = (isWalk && kind === "columns" ? "This browser lacks WebGL2, so the page shows the city from outside, without a walk through the streets. " : "") + HOW[kind];
    while (this.views.length < listed.length) this.views.push(new View(this.pair));
    this.views.forEach((view, place) => view.show(listed[place], kind, listed.length > 1));
    this.shown = this.views.slice(0, listed.length);
    const Hand = kind === "walk" ? Stroll : Orbit, was = this.hands[kind];
    if (was) was.detach();
    const all = highestOfAll(listed.map((one) => one.city)), make = (camera) => new Hand(all, () => this.draw(), camera);
    let hand = make(was ? was.hand.camera : {});
    if (kind === "walk" && listed.length > 1 && !hand.isFree(...hand.camera.position)) hand = make({}); // within a wall of one
    const ends = this.shown.map((view) => hand.attach(view.canvases[kind]));
    this.hands[kind] = { hand, detach: () => ends.forEach((end) => end()) };
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
    const { camera } = this.hands[kind].hand;
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
    for (const [one, canvas] of Object.entries(this.canvases)) canvas.hidden = one !== kind;
    this.canvases[kind].setAttribute("aria-label", `${title} in three dimensions. ${HOW[kind]}`);
    if (this.drawers[kind]) this.drawers[kind].show(city);
    else this.drawers[kind] = new (kind === "walk" ? Walk : Axonometry)(this.canvases[kind], city);
  }

  setSolids(bytes) { this.drawers.walk.show(this.city, bytes); }

  draw(kind, camera, sun) {
    if (!this.canvases[kind].clientWidth) return;
    if (kind === "columns") this.drawers.columns.draw(camera);
    else this.drawers.walk.draw(camera, sun);
  }
}

/** The higher of all cities at each place: a walker on it is inside no city. */
function highestOfAll(cities) {
  if (cities.length < 2) return cities[0];
  return { ...cities[0], heights: cities[0].heights.map((one, k) => Math.max(one, ...cities.slice(1).map((other) => other.heights[k]))) };
}
