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
 * light of a date and an hour. The next city is seen from where the last one was. */
export class Space {
  constructor(parent) {
    const canvas = (kind) => made(parent, "canvas", "", "", { role: "img", "data-kind": kind });
    this.canvases = { columns: canvas("columns"), walk: canvas("walk") };
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

  /** A city, walked through where `isWalk` and the browser can; what it is `called`. */
  show(city, isWalk, called) {
    const kind = this.kind = isWalk && supported() ? "walk" : "columns";
    for (const [one, canvas] of Object.entries(this.canvases)) canvas.hidden = one !== kind;
    this.light.hidden = kind !== "walk";
    this.how.textContent = (isWalk && kind === "columns" ? "This browser has no WebGL2: seen from outside instead. " : "") + HOW[kind];
    const canvas = this.canvases[kind], Hand = kind === "walk" ? Stroll : Orbit;
    canvas.setAttribute("aria-label", `${called} in three dimensions. ${HOW[kind]}`);
    const was = this.hands[kind];
    if (was) was.detach();
    const hand = new Hand(city, () => this.draw(), was ? was.hand.camera : {});
    this.hands[kind] = { hand, detach: hand.attach(canvas) };
    const drawer = kind === "walk" ? Walk : Axonometry;
    const known = this.drawers ||= {};
    if (known[kind]) known[kind].show(city);
    else known[kind] = new drawer(canvas, city);
    this.draw();
  }

  draw() {
    const { kind } = this, canvas = kind && this.canvases[kind];
    if (!canvas || !canvas.clientWidth) return;
    const { camera } = this.hands[kind].hand;
    if (kind === "columns") this.drawers.columns.draw(camera);
    else this.drawers.walk.draw(camera, sunAt(Number(this.latitude.value) || 0, this.date.value || "2026-06-21", Number(this.hour.value)));
  }
}
