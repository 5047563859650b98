import { Axonometry } from "./axonometry.js";
import { Orbit, Stroll } from "./camera.js";
import { made } from "./made.js";
import { sunAt } from "./sun.js";
import { Walk, supported } from "./walk.js";

const HOW = {
  columns: "Drag turns and tilts, with Shift it moves; wheel, plus and minus zoom; arrows turn; 0 shows the whole.",
  walk: "W A S D or arrows walk, with Shift faster; drag, Q and E look about; Page Up and Page Down rise and sink.",
};

/** A city in three dimensions: exact columns seen along parallel lines, or walked through in the
 * light of a date and an hour; or two cities of one size, from the same place. The next city is
 * seen from where the last one was. */
export class Space {
  constructor(parent) {
    this.pair = made(parent, "div", "pair");
    this.views = [];
    this.how = made(parent, "p", "faint");
    this.light = made(parent, "div", "row");
    const field = (text, type, value, limits) => {
      const found = made(made(this.light, "label", "", `${text} `), "input", "", "", { type, ...limits });
      found.value = value;
      found.addEventListener("input", () => this.draw());
      return found;
    };
    this.date = field("date", "date", "2026-06-21", { min: "1950-01-01", max: "2050-12-31" });
    this.hour = field("hour", "range", "15", { min: "0", max: "24", step: "0.25" });
    this.latitude = field("latitude", "number", "45", { min: "-90", max: "90", step: "1" });
    this.hands = {};
    new ResizeObserver(() => this.draw()).observe(parent);
  }

  /** The first city's. */
  get drawers() { return this.views[0].drawers; }

  /** One city or two, {city, called}, walked through where `isWalk` and the browser can. Through
   * two one walks where both are open. */
  show(listed, isWalk) {
    const kind = this.kind = isWalk && supported() ? "walk" : "columns";
    this.light.hidden = kind !== "walk";
    this.how.textContent = (isWalk && kind === "columns" ? "This browser has no WebGL2: seen from outside instead. " : "") + HOW[kind];
    while (this.views.length < listed.length) this.views.push(new View(this.pair));
    this.views.forEach((view, place) => view.show(listed[place], kind, listed.length > 1));
    this.shown = this.views.slice(0, listed.length);
    const Hand = kind === "walk" ? Stroll : Orbit, was = this.hands[kind];
    if (was) was.detach();
    const all = ofAll(listed.map((one) => one.city)), make = (camera) => new Hand(all, () => this.draw(), camera);
    let hand = make(was ? was.hand.camera : {});
    if (kind === "walk" && listed.length > 1 && !hand.isFree(...hand.camera.position)) hand = make({}); // within a wall of one
    const ends = this.shown.map((view) => hand.attach(view.canvases[kind]));
    this.hands[kind] = { hand, detach: () => ends.forEach((end) => end()) };
    this.draw();
  }

  /** The city at a place among those that are walked through gets straight walls: `bytes`, as `Walk` takes
   * its solids. */
  stand(place, bytes) {
    this.shown[place].stand(bytes);
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

/** One of the cities, with a canvas of each kind. */
class View {
  constructor(parent) {
    this.root = made(parent, "figure");
    this.caption = made(this.root, "figcaption");
    const canvas = (kind) => made(this.root, "canvas", "", "", { role: "img", "data-kind": kind });
    this.canvases = { columns: canvas("columns"), walk: canvas("walk") };
    this.drawers = {};
  }

  show(told, kind, isOneOfTwo) {
    this.root.hidden = !told;
    if (!told) return;
    const { city, called } = told;
    this.city = city;
    this.caption.textContent = called;
    this.caption.hidden = !isOneOfTwo;
    for (const [one, canvas] of Object.entries(this.canvases)) canvas.hidden = one !== kind;
    this.canvases[kind].setAttribute("aria-label", `${called} in three dimensions. ${HOW[kind]}`);
    if (this.drawers[kind]) this.drawers[kind].show(city);
    else this.drawers[kind] = new (kind === "walk" ? Walk : Axonometry)(this.canvases[kind], city);
  }

  stand(bytes) { this.drawers.walk.show(this.city, bytes); }

  draw(kind, camera, sun) {
    if (!this.canvases[kind].clientWidth) return;
    if (kind === "columns") this.drawers.columns.draw(camera);
    else this.drawers.walk.draw(camera, sun);
  }
}

/** The higher of all cities at each place: who stands on it stands in none of them. */
function ofAll(cities) {
  if (cities.length < 2) return cities[0];
  return { ...cities[0], heights: cities[0].heights.map((one, k) => Math.max(one, ...cities.slice(1).map((other) => other.heights[k]))) };
}
