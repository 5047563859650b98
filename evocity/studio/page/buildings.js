import { choice, COLOURS, countText, element, number } from "./elements.js";

/** Quantities of buildings, by their names for the server, and in words. */
const QUANTITIES = [["area", "footprint"], ["height", "height"], ["perimeter", "perimeter"], ["volume", "volume"]];
const TALL = 180, LEFT = 42, LOW = 150, TOP = 6, MARGIN = 10;
/** Styles of lines: width, dashes. */
const STYLES = { source: [1.3, ""], reference: [1, "1 2"], pinned: [2, "7 2 1 2"], individual: [2.2, ""] };
const DASHES = ["5 3", "5 2 1 2", "2 2", "8 2 2 2 2 2"];

/** The distribution of the buildings of a birth, beside those of its parents, of the pinned birth and of the cities
 * of the run. */
export class Buildings {
  constructor(parent, server) {
    this.server = server;
    this.root = element(parent, "details");
    element(this.root, "summary", "", "distribution of its buildings");
    this.of = choice(element(this.root, "div", "row"), "by", QUANTITIES);
    this.of.addEventListener("change", () => this.load());
    this.chart = element(this.root, "div");
    this.table = element(this.root, "table", "values");
    this.lack = element(this.root, "p", "lack");
    this.lack.hidden = true;
    this.root.addEventListener("toggle", () => this.load());
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
    this.chart.hidden = this.table.hidden = !this.state;
    if (!this.state) return;
    this.list();
    this.draw();
  }

  /** The table: numbers, each with its line. */
  list() {
    const { what, unit, listed } = this.state, parents = listed.filter((one) => one.role === "parent");
    this.table.replaceChildren();
    element(this.table, "caption", "", `${what} of a building, ${unit}`);
    const head = element(this.table, "tr");
    for (const text of ["birth or city", "buildings", "median", "middle half"]) element(head, "th", text === "birth or city" ? "" : "number", text, { scope: "col" });
    for (const one of listed.toReversed()) {
      const [width, dashes] = STYLES[one.role] || [1.2, DASHES[parents.indexOf(one) % DASHES.length]];
      one.line = { fill: "none", stroke: one.colour || { individual: COLOURS.chosen, pinned: COLOURS.ink }[one.role] || COLOURS.faint,
        "stroke-width": width, "stroke-dasharray": dashes };
      const row = element(this.table, "tr"), name = element(row, "th", "", "", { scope: "row" });
      svg(svg(name, "svg", { width: 30, height: 8, "aria-hidden": "true" }), "path", { d: "M0 4H26", ...one.line });
      name.append(one.role === "individual" ? `birth ${this.id}` : one.role === "pinned" ? `${one.name}, pinned` : one.name);
      const [low, middle, high] = one.quartiles.map(number);
      for (const text of [countText(one.count), middle ?? "–", one.count ? `${low} to ${high}` : "–"]) element(row, "td", "number", text);
    }
  }

  /** The drawing, as wide as the pane. */
  draw() {
    const { listed, powers, unit, what } = this.state, wide = this.root.clientWidth || 400, right = wide - MARGIN;
    const values = listed.flatMap((one) => one.values), scale = powers ? (one) => Math.log10(Math.max(one, 1e-6)) : (one) => one;
    this.chart.replaceChildren();
    const chart = svg(this.chart, "svg", { viewBox: `0 0 ${wide} ${TALL}`, role: "img", "font-size": 11, fill: COLOURS.faint,
      "aria-label": `the share of buildings up to each ${what}; the table below has the numbers` });
    const write = (x, y, text, anchor = "middle") => svg(chart, "text", { x, y, "text-anchor": anchor }).append(text);
    if (!values.length) {
      write(wide / 2, TALL / 2, "no buildings");
      return;
    }
    const low = scale(Math.min(...values)), high = scale(Math.max(...values));
    const x = (one) => LEFT + ((scale(one) - low) / (high - low || 1)) * (right - LEFT), y = (share) => LOW - share * (LOW - TOP);
    const grid = [0, 0.5, 1].map((share) => `M${LEFT} ${y(share)}H${right}`);
    for (const share of [0, 0.5, 1]) write(LEFT - 4, y(share) + 4, `${100 * share} %`, "end");
    for (const one of ticks(low, high, powers, (wide - LEFT) / 60)) {
      grid.push(`M${x(one)} ${TOP}V${LOW + 3}`);
      write(Math.min(x(one), wide - 16), LOW + 14, number(one));
    }
    write((LEFT + wide) / 2, TALL - 3, `${what} of a building, ${unit}`);
    svg(chart, "path", { d: grid.join(""), fill: "none", stroke: COLOURS.line });
    for (const { count, line, values: own, shares } of listed) {
      if (count) svg(chart, "path", { d: `M${LEFT} ${LOW}${own.map((value, k) => `H${x(value)}V${y(shares[k])}`).join("")}H${right}`, ...line });
    }
  }
}

/** Make an element of a drawing within a parent. */
function svg(parent, tag, attributes) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  parent.append(made);
  return made;
}

/** About `most` round values between two ends; powers of ten for ends that are logarithms. */
function ticks(low, high, powers, most) {
  if (powers) {
    const parts = high - low < 1.5 ? [1, 2, 5] : high - low < 3 ? [1, 3] : [1];
    const tens = Array.from({ length: Math.ceil(high) - Math.floor(low) + 1 }, (_, k) => 10 ** (Math.floor(low) + k));
    return tens.flatMap((ten) => parts.map((part) => part * ten)).filter((one) => Math.log10(one) >= low && Math.log10(one) <= high);
  }
  const rough = (high - low || 1) / most, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].find((one) => one * power >= rough) * power, first = Math.ceil(low / step);
  return Array.from({ length: Math.floor(high / step) - first + 1 }, (_, k) => (first + k) * step);
}
