import { COLOURS, FONT, counted, made, number, sized } from "./made.js";

/** What is told of buildings, by what the server calls it, and in words. */
const QUANTITIES = [["area", "footprint"], ["height", "height"], ["perimeter", "perimeter"], ["volume", "volume"]];
const TALL = 180, LEFT = 42, BELOW = 30, ABOVE = 6, RIGHT = 10;
/** How lines look: width, dashes. */
const STYLES = { source: [1.3, []], reference: [1, [1, 2]], pinned: [2, [7, 2, 1, 2]], individual: [2.2, []] };
const DASHES = [[5, 3], [5, 2, 1, 2], [2, 2], [8, 2, 2, 2, 2, 2]];

/** How the buildings of a birth are distributed, beside those of its parents, of the run's cities, and
 * of the birth that is pinned. */
export class Buildings {
  constructor(parent, server, trouble) {
    [this.server, this.trouble] = [server, trouble];
    this.root = made(parent, "details");
    made(this.root, "summary", "", "its buildings, beside its parents'");
    this.of = made(made(made(this.root, "div", "row"), "label", "", "by "), "select");
    for (const [value, text] of QUANTITIES) made(this.of, "option", "", text, { value });
    this.of.addEventListener("change", () => this.ask());
    this.canvas = made(this.root, "canvas", "", "", { role: "img" });
    this.table = made(this.root, "table", "values");
    this.lack = made(this.root, "p", "lack");
    this.lack.hidden = true;
    this.root.addEventListener("toggle", () => this.ask());
    new ResizeObserver(() => this.draw()).observe(this.root);
  }

  /** Those of a birth, `beside` another or none (null). */
  show(id, beside) {
    [this.id, this.beside] = [id, beside];
    this.ask();
  }

  /** Of what is shown now, while it is seen. */
  async ask() {
    const { id, beside } = this, of = this.of.value, key = `${of} ${id} ${beside}`;
    if (!this.root.open || id === undefined || key === this.key) return;
    this.key = key;
    try {
      const told = await this.server.asked("buildings", { id, of, ...(beside === null ? {} : { beside }) });
      if (key !== this.key) return;
      this.told = told;
      this.lack.hidden = true;
    } catch (error) {
      if (key !== this.key) return;
      this.told = this.key = null;
      this.lack.textContent = `They are not known: ${error.message}`;
      this.lack.hidden = false;
    }
    this.canvas.hidden = this.table.hidden = !this.told;
    if (this.told) this.list();
    this.draw();
  }

  /** In numbers, each with its line. */
  list() {
    const { what, unit, listed } = this.told, parents = listed.filter((one) => one.role === "parent");
    this.canvas.setAttribute("aria-label", `which share of the buildings has at most so large a ${what}; the table beneath tells it in numbers`);
    this.table.replaceChildren();
    made(this.table, "caption", "", `${what} of a building, ${unit}`);
    const head = made(this.table, "tr");
    for (const text of ["whose", "buildings", "median", "middle half"]) made(head, "th", text === "whose" ? "" : "number", text, { scope: "col" });
    for (const one of listed.toReversed()) {
      const dashes = DASHES[parents.indexOf(one) % DASHES.length];
      one.style = { colour: one.colour || { individual: COLOURS.chosen, pinned: COLOURS.ink }[one.role] || COLOURS.faint,
        line: STYLES[one.role] || [1.2, dashes] };
      const row = made(this.table, "tr"), name = made(row, "th", "", "", { scope: "row" });
      const line = made(name, "canvas", "line", "", { "aria-hidden": "true" });
      const context = sized(line, 26, 8);
      this.stroke(context, one.style, [[0, 4], [26, 4]]);
      made(name, "span", "", one.role === "individual" ? `birth ${this.id}` : one.role === "pinned" ? `${one.name}, pinned` : one.name);
      made(row, "td", "number", counted(one.count));
      const [low, middle, high] = one.quartiles.map(number);
      made(row, "td", "number", middle ?? "–");
      made(row, "td", "number", one.count ? `${low} to ${high}` : "–");
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
    if (!this.told || !this.root.open || !wide) return;
    const { listed, powers, unit, what } = this.told, context = sized(this.canvas, wide, TALL);
    const values = listed.flatMap((one) => one.values);
    context.font = `11px ${FONT}`;
    context.fillStyle = COLOURS.faint;
    if (!values.length) {
      context.fillText("there are no buildings", LEFT, TALL / 2);
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

/** Round values between two ends, about so many; powers of ten where the ends are logarithms. */
function ticks(low, high, powers, most) {
  const found = [];
  if (powers) {
    const parts = high - low < 1.5 ? [1, 2, 5] : high - low < 3 ? [1, 3] : [1];
    for (let power = Math.floor(low); power <= high; power++) {
      for (const part of parts) if (power + Math.log10(part) >= low && power + Math.log10(part) <= high) found.push(part * 10 ** power);
    }
    return found;
  }
  const rough = (high - low || 1) / most, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].find((one) => one * power >= rough) * power;
  for (let one = Math.ceil(low / step); one * step <= high; one++) found.push(one * step);
  return found;
}
