import { brushOf } from "../births.js";
import { crossings, levels, shade } from "../density.js";
import { COLOURS, FONT, choice, element, fitCanvas, number, offer, shortenText } from "../elements.js";

const HEIGHT = 232, TOP = 20, LOW = HEIGHT - 20, NARROWEST = 66, WIDEST = 132;
/** Above this number, lines are drawn as a density; chosen lines, at most. */
const STROKES = 1200, MOST_CHOSEN = 300;

const ruler = document.createElement("canvas").getContext("2d");

function textOf(column) { return column.name.replaceAll("_", " ") + (column.unit ? `, ${column.unit}` : ""); }

function signOf(column, turned) { return `${column.sign}${turned ? " ⇵" : ""}`.trim(); }

/** The least width of an axis, px: its head has a name of two lines and a sign, both whole unless they are very long. */
function neededWidth(column, turned) {
  ruler.font = `12px ${FONT}`;
  const wide = (...texts) => Math.max(...texts.map((one) => ruler.measureText(one).width));
  const words = textOf(column).split(" ");
  const ofName = Math.min(...words.map((_, k) => wide(words.slice(0, k + 1).join(" "), words.slice(k + 1).join(" "))));
  const longest = Math.max(ofName, wide(signOf(column, turned)));
  return Math.min(WIDEST, Math.max(NARROWEST, Math.ceil(longest) + 11));
}

/** Parallel coordinates: an upright axis for each column, a line for each birth, brushes on the axes. */
class Axes {
  constructor(parent, page, hands) {
    [this.page, this.hands] = [page, hands];
    this.root = element(parent, "div", "axes");
    this.inner = element(this.root, "div", "inner");
    this.heads = element(this.inner, "div", "heads");
    this.canvas = element(this.inner, "canvas", "lines", "", { "aria-hidden": "true" });
    this.back = document.createElement("canvas");
    this.gap = document.createElement("canvas");
    this.canvas.addEventListener("pointerdown", (event) => this.press(event));
    this.canvas.addEventListener("pointermove", (event) => this.hover(event));
    this.add = choice(element(parent, "div", "row"), "add axis", [], () => {
      if (this.add.value) this.setAxes([...this.axes, { name: this.add.value, turned: false }]);
    });
  }

  get births() { return this.page.births; }

  get brushes() { return this.page.state.brushes; }

  setAxes(axes) { this.hands.change({ axes }); }

  update(changes) {
    if (!("axes" in changes || "births" in changes)) return;
    const { births } = this, { axes } = this.page.state;
    this.axes = axes.filter((one) => births.byName.has(one.name));
    this.columns = this.axes.map((one) => births.byName.get(one.name));
    this.levels = this.columns.map((column, k) => levels(column, this.axes[k].turned));
    this.everyone = new Uint8Array(births.count).fill(1);
    const shown = new Set(axes.map((one) => one.name));
    offer(this.add, [["", "…"], ...births.columns.map((one) => one.name).filter((name) => !shown.has(name))]);
    this.resize();
    if (this.page.open && !shown.has(this.page.open)) this.hands.open(this.page.open);
  }

  headOf(name) { return this.heads.children[this.place(name)]; }

  place(name) { return this.axes.findIndex((one) => one.name === name); }

  /** The actions of the panel of an axis. */
  actionsOf(name) {
    const move = (by) => this.move(name, this.place(name) + by);
    return [
      ["reverse", () => this.setAxes(this.axes.map((one) => (one.name === name ? { ...one, turned: !one.turned } : one)))],
      ["move left", () => move(-1)], ["move right", () => move(1)],
      ["hide", () => this.setAxes(this.axes.filter((one) => one.name !== name))],
    ];
  }

  resize() {
    const needs = this.columns.map((one, place) => neededWidth(one, this.axes[place].turned));
    const needed = needs.reduce((sum, one) => sum + one, 0);
    this.width = Math.max(this.root.clientWidth, needed, NARROWEST);
    const even = this.width / needs.length, spare = (this.width - needed) / needs.length;
    this.widths = needs.map((one) => (Math.max(...needs) <= even ? even : one + spare));
    this.lefts = this.widths.map((_, place) => this.widths.slice(0, place).reduce((sum, one) => sum + one, 0));
    this.inner.style.width = `${this.width}px`;
    this.putHeads();
    this.drawBack();
  }

  x(place) { return this.lefts[place] + this.widths[place] / 2; }

  /** The place of the axis at an x; negative at the left of all axes. */
  placeAt(x) { return this.lefts.findLastIndex((left) => left <= x); }

  /** The y of a value on an axis. */
  y(place, value) {
    const share = this.columns[place].share(value);
    return LOW - (this.axes[place].turned ? 1 - share : share) * (LOW - TOP);
  }

  share(place, y) {
    const share = Math.min(1, Math.max(0, (LOW - y) / (LOW - TOP)));
    return this.axes[place].turned ? 1 - share : share;
  }

  // -- drawing -------------------------------------------------------------------------------

  drawBack() {
    if (!this.births) return;
    const context = fitCanvas(this.back, this.width, HEIGHT);
    this.drawLines(context, this.everyone, this.births.count, COLOURS.pale, 0.4);
  }

  draw() {
    const { mask, rows: { length: count }, chosen, active } = this.page;
    if (!this.width) return;
    for (const [k, head] of [...this.heads.children].entries()) {
      head.setAttribute("aria-expanded", String(this.columns[k].name === this.page.open));
    }
    const context = fitCanvas(this.canvas, this.width, HEIGHT);
    context.drawImage(this.back, 0, 0, this.width, HEIGHT);
    if (count < this.births.count) this.fade(context);
    this.drawLines(context, mask, count, COLOURS.passing, 0.95);
    const shown = chosen.slice(-MOST_CHOSEN);
    for (const [colour, wide] of [[COLOURS.paper, 6], [COLOURS.chosen, 2.5]]) { // a pale border, for eyes that see no red
      [context.strokeStyle, context.lineWidth] = [colour, wide];
      this.stroke(context, shown);
    }
    if (active >= 0) {
      context.strokeStyle = COLOURS.ink;
      context.lineWidth = 2.5;
      context.setLineDash([6, 3]);
      this.stroke(context, [active]);
      context.setLineDash([]);
    }
    this.columns.forEach((_, place) => this.drawAxis(context, place));
  }

  /** Fade the births that do not pass the filter. */
  fade(context) {
    context.globalAlpha = 0.45;
    context.fillStyle = COLOURS.paper;
    context.fillRect(0, 0, this.width, HEIGHT);
    context.globalAlpha = 1;
  }

  drawLines(context, mask, count, colour, most) {
    if (count <= STROKES) {
      const rows = [];
      for (let row = 0; row < mask.length; row++) if (mask[row]) rows.push(row);
      context.strokeStyle = `rgb(${colour.join(" ")})`;
      context.lineWidth = count > 200 ? 1 : 1.4;
      context.globalAlpha = most * Math.min(1, Math.max(0.25, 8 / Math.sqrt(count + 1)));
      this.stroke(context, rows);
      context.globalAlpha = 1;
      return;
    }
    const tall = LOW - TOP + 1, gap = this.gap.getContext("2d");
    for (let place = 0; place + 1 < this.columns.length; place++) {
      const between = this.x(place + 1) - this.x(place), wide = Math.max(1, Math.round(between));
      [this.gap.width, this.gap.height] = [wide, tall];
      const counts = crossings(this.levels[place], this.levels[place + 1], mask, wide, tall);
      gap.putImageData(shade(counts, wide, tall, colour, most), 0, 0);
      context.drawImage(this.gap, this.x(place), TOP - 0.5, between, tall);
    }
  }

  /** Draw a line for each row, with a gap where a birth has no value. */
  stroke(context, rows) {
    const values = this.columns.map((column) => column.values);
    const tops = this.columns.map((_, place) => [this.x(place), place]);
    for (const row of rows) {
      context.beginPath();
      let drawing = false;
      for (const [x, place] of tops) {
        const y = this.y(place, values[place][row]);
        if (Number.isNaN(y)) drawing = false;
        else if (drawing) context.lineTo(x, y);
        else {
          context.moveTo(x, y);
          drawing = true;
        }
      }
      context.stroke();
    }
  }

  drawAxis(context, place) {
    const column = this.columns[place], x = this.x(place), { turned } = this.axes[place];
    context.strokeStyle = COLOURS.ink;
    context.lineWidth = 1;
    context.beginPath();
    context.moveTo(x, TOP);
    context.lineTo(x, LOW);
    context.stroke();
    context.font = `11px ${FONT}`;
    for (const [top, low] of this.spansOf(place)) {
      context.fillStyle = "rgb(176 64 63 / 22%)";
      context.strokeStyle = COLOURS.chosen;
      context.lineWidth = 1.5;
      context.fillRect(x - 8, top, 16, low - top);
      context.strokeRect(x - 8, top, 16, Math.max(1, low - top));
    }
    if (column.isWords) this.drawWords(context, place);
    else {
      context.textAlign = "center";
      context.fillStyle = COLOURS.ink;
      context.fillText(number(turned ? column.low : column.high), x, TOP - 7);
      context.fillText(number(turned ? column.high : column.low), x, LOW + 14);
    }
    if (!column.isWords && column.target !== null && column.target >= column.low && column.target <= column.high) {
      const y = this.y(place, column.target);
      context.fillStyle = COLOURS.ink; // an arrowhead at the target
      context.beginPath();
      context.moveTo(x + 1, y);
      context.lineTo(x + 9, y - 4.5);
      context.lineTo(x + 9, y + 4.5);
      context.fill();
    }
  }

  drawWords(context, place) {
    const { words } = this.columns[place];
    const isLast = place > 0 && place + 1 === this.columns.length; // there is no room at its right
    const room = this.widths[place] - 20, x = this.x(place) + (isLast ? -11 : 11);
    const apart = (LOW - TOP) / words.length, every = Math.ceil(11 / apart);
    context.textAlign = isLast ? "right" : "left";
    context.lineWidth = 3;
    context.strokeStyle = COLOURS.paper;
    context.fillStyle = COLOURS.ink;
    words.forEach((word, k) => {
      if (k % every) return;
      const text = shortenText(context, word.replaceAll("_", " ") || "none", room), y = this.y(place, k) + 4;
      context.strokeText(text, x, y);
      context.fillText(text, x, y);
    });
  }

  /** The top and low end of each brush on an axis, px. */
  spansOf(place) {
    const column = this.columns[place], brush = brushOf(this.brushes, column.name);
    if (!column.isWords) {
      return brush.map(([low, high]) => [this.y(place, low), this.y(place, high)]
        .map((y) => Math.min(LOW, Math.max(TOP, y))).sort((a, b) => a - b));
    }
    const half = (LOW - TOP) / column.words.length / 2 - 1;
    return brush.map((word) => this.y(place, column.words.indexOf(word))).map((y) => [y - half, y + half]);
  }

  // -- heads: the names of the axes; a drag moves the axis ----------------------------------------

  putHeads() {
    this.heads.replaceChildren(...this.columns.map((column, place) => {
      const head = element(null, "button", "head", "", {
        type: "button", title: [column.name, column.wanted].filter(Boolean).join(": "),
        "aria-expanded": String(this.page.open === column.name),
      });
      element(head, "span", "name", textOf(column));
      element(head, "span", "sign", signOf(column, this.axes[place].turned));
      head.style.left = `${this.lefts[place] + 2}px`;
      head.style.width = `${this.widths[place] - 4}px`;
      head.addEventListener("pointerdown", (event) => this.drag(event, head, column.name));
      head.addEventListener("click", () => {
        if (!this.isDragged) this.hands.open(column.name);
      });
      return head;
    }));
  }

  drag(event, head, name) {
    const from = event.clientX, left = parseFloat(head.style.left);
    this.isDragged = false;
    head.setPointerCapture(event.pointerId);
    head.onpointermove = (at) => {
      if (Math.abs(at.clientX - from) > 5) this.isDragged = true;
      if (this.isDragged) head.style.left = `${left + at.clientX - from}px`;
    };
    head.onpointerup = head.onpointercancel = (at) => {
      head.onpointermove = head.onpointerup = head.onpointercancel = null;
      if (!this.isDragged) return;
      setTimeout(() => { this.isDragged = false; }); // after a possible click
      this.move(name, this.placeAt(left + at.clientX - from + parseFloat(head.style.width) / 2));
    };
  }

  /** Put an axis at a place. */
  move(name, place) {
    const others = this.axes.filter((one) => one.name !== name);
    const own = this.axes.find((one) => one.name === name);
    others.splice(Math.min(others.length, Math.max(0, place)), 0, own);
    this.setAxes(others);
  }

  // -- brushes -------------------------------------------------------------------------------

  at(event) {
    const box = this.canvas.getBoundingClientRect();
    const x = event.clientX - box.left, y = event.clientY - box.top;
    const place = Math.max(0, this.placeAt(x));
    const near = this.columns.length && Math.abs(x - this.x(place)) <= Math.max(16, Math.min(28, this.widths[place] / 4));
    return { place: near ? place : -1, y };
  }

  hover(event) {
    const { place, y } = this.at(event);
    const grip = place < 0 ? null : this.grip(place, y);
    this.canvas.style.cursor = !grip ? "default" : { new: "crosshair", move: "grab" }[grip.part] || "ns-resize";
  }

  /** The part at a y: a brush, one of its ends, or a new brush. */
  grip(place, y) {
    const spans = this.spansOf(place);
    for (let k = 0; k < spans.length; k++) {
      const [top, low] = spans[k], edge = Math.min(5, (low - top) / 4);
      if (y < top - 5 || y > low + 5) continue;
      if (this.columns[place].isWords) return { part: "move", k };
      if (Math.abs(y - top) <= Math.max(edge, y < top ? 5 : 0)) return { part: "top", k };
      if (Math.abs(y - low) <= Math.max(edge, y > low ? 5 : 0)) return { part: "low", k };
      return { part: "move", k };
    }
    return { part: "new", k: spans.length };
  }

  press(event) {
    const { place, y } = this.at(event);
    if (place < 0 || event.button !== 0) return;
    event.preventDefault();
    const column = this.columns[place], before = [...brushOf(this.brushes, column.name)];
    const grip = this.grip(place, y), spans = this.spansOf(place);
    let moved = false, brush = before;
    const send = (isFinal) => this.hands.brush({ ...this.brushes, [column.name]: brush }, isFinal);
    this.canvas.setPointerCapture(event.pointerId);
    this.canvas.onpointermove = (to) => {
      const now = this.at(to).y;
      if (!moved && Math.abs(now - y) < 3) return;
      moved = true;
      brush = column.isWords ? this.wordsBetween(place, before, y, now) :
        this.movedBrush(place, before, grip, spans[grip.k], y, now);
      send(false);
    };
    this.canvas.onpointerup = this.canvas.onpointercancel = () => {
      this.canvas.onpointermove = this.canvas.onpointerup = this.canvas.onpointercancel = null;
      if (!moved && column.isWords) { // a click adds a word, or drops it
        const word = column.words[Math.min(column.words.length - 1, Math.floor(this.share(place, y) * column.words.length))];
        brush = before.includes(word) ? before.filter((one) => one !== word) : [...before, word];
      } else if (!moved && grip.part !== "new") brush = before.filter((_, k) => k !== grip.k);
      if (!column.isWords) brush = joinSpans(brush);
      send(true);
    };
  }

  movedBrush(place, before, { part, k }, span, from, to) {
    const [top, low] = part === "new" ? [from, to] :
      [part === "low" ? span[0] : span[0] + to - from, part === "top" ? span[1] : span[1] + to - from];
    let ends = [top, low];
    if (part === "move") { // of the same length, within the axis
      const shift = Math.max(TOP - span[0], Math.min(LOW - span[1], to - from));
      ends = [span[0] + shift, span[1] + shift];
    }
    const values = ends.map((y) => this.columns[place].value(this.share(place, y)));
    const brush = [...before];
    brush[k] = values.sort((a, b) => a - b);
    return brush;
  }

  wordsBetween(place, before, from, to) {
    const { words } = this.columns[place], [top, low] = [Math.min(from, to), Math.max(from, to)];
    return words.filter((word, k) => {
      const y = this.y(place, k);
      return before.includes(word) || (y >= top && y <= low);
    });
  }
}

/** Sort spans, and join those that overlap. */
function joinSpans(spans) {
  const joined = [];
  for (const [low, high] of [...spans].sort((a, b) => a[0] - b[0])) {
    const last = joined[joined.length - 1];
    if (last && low <= last[1]) last[1] = Math.max(last[1], high);
    else joined.push([low, high]);
  }
  return joined;
}

export const view = {
  name: "axes", title: "axes", place: 20, suits: () => true, open: (root, page, hands) => new Axes(root, page, hands),
};
