import { COLOURS, FONT, countText, element, number, fitCanvas } from "./elements.js";

/** Quantities of buildings, by their names for the server, and in words. */
const QUANTITIES = [["area", "footprint"], ["height", "height"], ["perimeter", "perimeter"], ["volume", "volume"]];
const TALL = 180, LEFT = 42, BELOW = 30, ABOVE = 6, RIGHT = 10;
/** Styles of lines: width, dashes. */
const STYLES = { source: [1.3, []], reference: [1, [1, 2]], pinned: [2, [7, 2, 1, 2]], individual: [2.2, []] };
const DASHES = [[5, 3], [5, 2, 1, 2], [2, 2], [8, 2, 2, 2, 2, 2]];

/** The distribution of the buildings of a birth, beside those of its parents, of the pinned birth and of the cities
 * of the run. */
export class Buildings {
  constructor(parent, server, trouble) {
    [this.server, this.trouble] = [server, trouble];
    this.root = element(parent, "details");
    element(this.root, "summary", "", "distribution of its buildings");
    this.of = element(element(element(this.root, "div", "row"), "label", "", "by "), "select");
    for (const [value, text] of QUANTITIES) element(this.of, "option", "", text, { value });
    this.of.addEventListener("change", () => this.load());
    this.canvas = element(this.root, "canvas", "", "", { role: "img" });
    this.table = element(this.root, "table", "values");
    this.lack = element(this.root, "p", "lack");
    this.lack.hidden = true;
    this.root.addEventListener("toggle", () => this.load());
    new ResizeObserver(() => this.draw()).observe(this.root);
  }

  /** Show a birth, `beside` another or none (null). */
  show(id, beside) {
    [this.id, this.beside] = [id, beside];
    this.load();
  }

  /** Load the distribution of the visible birth, if the part is open. */
  async load() {
    const { id, beside } = this, of = this.of.value, key = `${of} ${id} ${beside}`;
    if (!this.root.open || id === undefined || key === this.key) return;
    this.key = key;
    try {
      const state = await this.server.getJson("buildings", { id, of, ...(beside === null ? {} : { beside }) });
      if (key !== this.key) return;
      this.state = state;
      this.lack.hidden = true;
    } catch (error) {
      if (key !== this.key) return;
      this.state = this.key = null;
      this.lack.textContent = `Studio cannot show the buildings: ${error.message}`;
      this.lack.hidden = false;
    }
    this.canvas.hidden = this.table.hidden = !this.state;
    if (this.state) this.list();
    this.draw();
  }

  /** The table: numbers, each with its line. */
  list() {
    const { what, unit, listed } = this.state, parents = listed.filter((one) => one.role === "parent");
    this.canvas.setAttribute("aria-label", `the share of buildings up to each ${what}; the table below has the numbers`);
    this.table.replaceChildren();
    element(this.table, "caption", "", `${what} of a building, ${unit}`);
    const head = element(this.table, "tr");
    for (const text of ["birth or city", "buildings", "median", "middle half"]) element(head, "th", text === "birth or city" ? "" : "number", text, { scope: "col" });
    for (const one of listed.toReversed()) {
      const dashes = DASHES[parents.indexOf(one) % DASHES.length];
      one.style = { colour: one.colour || { individual: COLOURS.chosen, pinned: COLOURS.ink }[one.role] || COLOURS.faint,
        line: STYLES[one.role] || [1.2, dashes] };
      const row = element(this.table, "tr"), name = element(row, "th", "", "", { scope: "row" });
      const line = element(name, "canvas", "line", "", { "aria-hidden": "true" });
      const context = fitCanvas(line, 26, 8);
      this.stroke(context, one.style, [[0, 4], [26, 4]]);
      element(name, "span", "", one.role === "individual" ? `birth ${this.id}` : one.role === "pinned" ? `${one.name}, pinned` : one.name);
      element(row, "td", "number", countText(one.count));
      const [low, middle, high] = one.quartiles.map(number);
      element(row, "td", "number", middle ?? "–");
      element(row, "td", "number", one.count ? `${low} to ${high}` : "–");
    }
  }

  stroke(context, { colour, line: [width, dashes] }, points) {
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.setLineDash(dashes);
    context.beginPath();
    for (const [x, y] of points) context.lineTo(x, y);
    context.stroke();
    context.setLineDash([]);
  }

  draw() {
    const wide = this.root.clientWidth;
    if (!this.state || !this.root.open || !wide) return;
    const { listed, powers, unit, what } = this.state, context = fitCanvas(this.canvas, wide, TALL);
    const values = listed.flatMap((one) => one.values);
    context.font = `11px ${FONT}`;
    context.fillStyle = COLOURS.faint;
    if (!values.length) {
      context.fillText("no buildings", LEFT, TALL / 2);
      return;
    }
    const scale = powers ? (one) => Math.log10(Math.max(one, 1e-6)) : (one) => one;
    const low = scale(Math.min(...values)), high = scale(Math.max(...values)), span = high - low || 1;
    const x = (one) => LEFT + ((scale(one) - low) / span) * (wide - LEFT - RIGHT);
    const y = (share) => ABOVE + (1 - share) * (TALL - ABOVE - BELOW);
    context.strokeStyle = COLOURS.line;
    context.lineWidth = 1;
    context.textAlign = "right";
    for (const share of [0, 0.5, 1]) {
      context.strokeRect(LEFT, y(share), wide - LEFT - RIGHT, 0);
      context.fillText(`${100 * share} %`, LEFT - 4, y(share) + 4);
    }
    context.textAlign = "center";
    for (const one of ticks(low, high, powers, (wide - LEFT) / 60)) {
      context.strokeRect(x(one), y(1), 0, y(0) - y(1) + 3);
      context.fillText(number(one), Math.min(x(one), wide - 16), y(0) + 14);
    }
    context.fillText(`${what} of a building, ${unit}`, (LEFT + wide) / 2, TALL - 3);
    for (const one of listed) {
      const points = [[LEFT, y(0)]];
      one.values.forEach((value, k) => points.push([x(value), points.at(-1)[1]], [x(value), y(one.shares[k])]));
      points.push([wide - RIGHT, points.at(-1)[1]]);
      if (one.count) this.stroke(context, one.style, points);
    }
  }
}

/** About `most` round values between two ends; powers of ten for ends that are logarithms. */
function ticks(low, high, powers, most) {
  const values = [];
  if (powers) {
    const parts = high - low < 1.5 ? [1, 2, 5] : high - low < 3 ? [1, 3] : [1];
    for (let power = Math.floor(low); power <= high; power++) {
      for (const part of parts) if (power + Math.log10(part) >= low && power + Math.log10(part) <= high) values.push(part * 10 ** power);
    }
    return values;
  }
  const rough = (high - low || 1) / most, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].find((one) => one * power >= rough) * power;
  for (let one = Math.ceil(low / step); one * step <= high; one++) values.push(one * step);
  return values;
}
