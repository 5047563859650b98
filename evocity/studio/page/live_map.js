import { element, tick } from "./elements.js";
import { frame } from "./overlay.js";
import { cityOf } from "./pictures.js";
import { ramp } from "./ramp.js";

/** A map from heights of the server, as a plan, and in three dimensions if a box is checked. */
export class LiveMap {
  constructor(parent, title) {
    this.title = title;
    this.box = tick(element(parent, "div", "row"), "3D");
    this.box.addEventListener("change", () => this.draw());
    this.canvas = element(parent, "canvas", "plan", "", { role: "img", "aria-label": `${title}, north up` });
    this.space = element(parent, "div", "space");
    this.facts = element(parent, "p", "faint");
    this.lack = element(parent, "p", "lack");
    this.clear();
  }

  clear() {
    this.city = null;
    this.canvas.hidden = this.space.hidden = this.lack.hidden = true;
    this.facts.textContent = "";
  }

  /** Show heights with colours up to `highest` metres; `window`: [left, top, width, height] of a frame, px. */
  show(about, content, highest, window = null) {
    [this.city, this.window] = [cityOf(about, content, highest), window];
    this.lack.hidden = true;
    const { rows, columns, metresPerPixel } = this.city, metres = (side) => Math.round(side * metresPerPixel);
    this.facts.textContent = `${columns} × ${rows} px, ${metres(columns)} × ${metres(rows)} m; colours from 0 to ${highest} m`;
    return this.draw();
  }

  async draw() {
    if (!this.city) return;
    const { city, canvas } = this, { rows, columns } = city;
    this.space.hidden = !(canvas.hidden = this.box.checked);
    if (this.box.checked) {
      const { Space } = await import("./space.js");
      this.view ||= new Space(this.space);
      if (city === this.city) this.view.show([{ city, title: this.title }], "columns");
      return;
    }
    canvas.width = columns;
    canvas.height = rows;
    const context = canvas.getContext("2d");
    context.putImageData(imageOf(city), 0, 0);
    if (this.window) frame(context, ...this.window, Math.max(1, columns / 300));
  }

  showLack(text) {
    this.clear();
    this.lack.textContent = text;
    this.lack.hidden = false;
  }
}

/** The colours of a city's heights. */
export function imageOf({ heights, rows, columns, highest }) {
  const colours = ramp(heights, highest), image = new ImageData(columns, rows);
  const { data } = image;
  data.fill(255);
  for (let from = 0, to = 0; from < colours.length; to++) for (let c = 0; c < 3; c++) data[to++] = colours[from++];
  return image;
}
