import { brushOf } from "../births.js";
import { COLOURS, FONT, button, choice, element, fitCanvas, number, offer, shortenText } from "../elements.js";

const TALL = 282, EDGE_LEFT = 64, EDGE = 12, EDGE_LOW = 34, NEAR = 9;
/** Above this number, births are drawn as a density; words at an axis, at most. */
const DOTS = 4000, MOST_WORDS = 8;

/** A scatter plot of births by two columns, with the brushes of all views. */
class Scatter {
  constructor(parent, page, hands) {
    [this.page, this.hands] = [page, hands];
    this.root = element(parent, "div", "scatter");
    const row = element(this.root, "div", "row");
    this.selects = ["x axis", "y axis"].map((text) => {
      const select = choice(row, text, [], () => hands.change({ pair: this.selects.map((one) => one.value) }));
      button(row, "filter", () => hands.open(select.value), { "aria-label": `filter the ${text}` });
      return select;
    });
    element(row, "span", "faint", "Drag a box to filter the births. Click a dot to choose the birth that the dot shows. Click an empty part of the plot to clear the filter.");
    this.canvas = element(this.root, "canvas", "dots", "", { "aria-hidden": "true" });
    this.canvas.addEventListener("pointerdown", (event) => this.press(event));
  }

  get births() { return this.page.births; }

  get brushes() { return this.page.state.brushes; }

  get mask() { return this.page.mask; }

  /** The two columns: the chosen ones, or the first two axes. */
  get pair() {
    const { pair, axes } = this.page.state;
    const names = [...(pair || []), ...axes.map((one) => one.name), "generation", "id"];
    return [...new Set(names)].filter((name) => this.births.byName.has(name)).slice(0, 2);
  }

  update() {
    const { births } = this;
    this.columns = this.pair.map((name) => births.byName.get(name));
    this.selects.forEach((select, k) => {
      offer(select, births.columns.map((one) => one.name));
      select.value = this.columns[k].name;
    });
  }

  /** The button that opens the filter of a column. */
  headOf(name) {
    const place = this.columns.findIndex((one) => one.name === name);
    return place < 0 ? null : this.root.querySelectorAll("button")[place];
  }

  get width() { return this.root.clientWidth; }

  /** The px of a share of an axis, and the shares at a place in px. */
  x(share) { return EDGE_LEFT + share * (this.width - EDGE_LEFT - EDGE); }
  y(share) { return TALL - EDGE_LOW - share * (TALL - EDGE_LOW - EDGE); }
  shares(x, y) {
    return [(x - EDGE_LEFT) / (this.width - EDGE_LEFT - EDGE), (TALL - EDGE_LOW - y) / (TALL - EDGE_LOW - EDGE)]
      .map((one) => Math.min(1, Math.max(0, one)));
  }

  at(row) {
    const [x, y] = this.columns.map((column) => column.share(column.values[row]));
    return [this.x(x), this.y(y)];
  }

  draw() {
    const { mask, rows: { length: count }, active } = this.page;
    if (!this.width) return;
    const context = fitCanvas(this.canvas, this.width, TALL);
    this.drawDots(context, mask, 0, COLOURS.pale, this.births.count - count > DOTS);
    this.drawBrushes(context);
    this.drawDots(context, mask, 1, COLOURS.passing, count > DOTS);
    context.lineWidth = 2;
    context.strokeStyle = COLOURS.chosen;
    for (const row of this.page.chosen) this.ring(context, row, 4.5);
    context.strokeStyle = COLOURS.ink;
    if (active >= 0) this.ring(context, active, 7);
    this.drawAxes(context);
  }

  /** Draw the births where the mask is `which`: as dots, or many as a density. */
  drawDots(context, mask, which, colour, isMany) {
    const [across, up] = this.columns, radius = which ? 2 : 1.5;
    const wide = Math.ceil(this.width), counts = isMany ? new Uint32Array(wide * TALL) : null;
    context.fillStyle = `rgb(${colour.join(" ")} / ${which ? 80 : 45}%)`;
    for (let row = 0; row < mask.length; row++) {
      if (mask[row] !== which) continue;
      const x = this.x(across.share(across.values[row])), y = this.y(up.share(up.values[row]));
      if (Number.isNaN(x) || Number.isNaN(y)) continue;
      if (!isMany) context.fillRect(x - radius, y - radius, 2 * radius, 2 * radius);
      else counts[Math.round(y) * wide + Math.round(x)]++;
    }
    if (!isMany) return;
    let most = 1;
    for (const count of counts) if (count > most) most = count;
    const unit = 1 / Math.log1p(most), steps = 24;
    for (let step = 1; step <= steps; step++) { // a colour for each step, from few to many
      context.fillStyle = `rgb(${colour.join(" ")} / ${(which ? 25 : 12) + ((which ? 70 : 40) * step) / steps}%)`;
      for (let k = 0; k < counts.length; k++) {
        if (counts[k] && Math.ceil(Math.log1p(counts[k]) * unit * steps) === step) {
          context.fillRect((k % wide) - 1, Math.floor(k / wide) - 1, 2, 2);
        }
      }
    }
  }

  ring(context, row, radius) {
    const [x, y] = this.at(row);
    if (Number.isNaN(x) || Number.isNaN(y)) return;
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    context.stroke();
  }

  /** The shares of an axis that pass; the whole axis without a brush. */
  spans(column) {
    const brush = brushOf(this.brushes, column.name);
    if (!brush.length) return [[0, 1]];
    const half = 0.5 / Math.max(1, column.words.length);
    const spans = column.isWords ? brush.map((word) => column.share(column.words.indexOf(word))).map((one) => [one - half, one + half]) :
      brush.map((ends) => ends.map((value) => column.share(Math.min(column.high, Math.max(column.low, value)))));
    return spans.filter(([low, high]) => !Number.isNaN(low + high));
  }

  drawBrushes(context) {
    if (this.columns.every((one) => !brushOf(this.brushes, one.name).length)) return;
    context.fillStyle = "rgb(176 64 63 / 12%)";
    context.strokeStyle = COLOURS.chosen;
    context.lineWidth = 1.5;
    const [across, up] = this.columns.map((one) => this.spans(one));
    for (const [left, right] of across) {
      for (const [low, high] of up) {
        const box = [this.x(left), this.y(high), this.x(right) - this.x(left), this.y(low) - this.y(high)];
        context.fillRect(...box);
        context.strokeRect(...box);
      }
    }
  }

  drawAxes(context) {
    context.strokeStyle = COLOURS.ink;
    context.lineWidth = 1;
    context.strokeRect(this.x(0), this.y(1), this.x(1) - this.x(0), this.y(0) - this.y(1));
    context.font = `11px ${FONT}`;
    context.fillStyle = COLOURS.ink;
    this.columns.forEach((column, axis) => {
      const { words } = column, every = Math.ceil(words.length / MOST_WORDS);
      const ticks = column.isWords ? words.map((word, k) => [column.share(k), word.replaceAll("_", " ") || "none"])
        .filter((_, k) => k % every === 0) : [0, 0.5, 1].map((share) => [share, number(column.value(share))]);
      for (const [share, text] of ticks) {
        context.textAlign = axis ? "right" : column.isWords || share === 0.5 ? "center" : share ? "right" : "left";
        const room = axis ? EDGE_LEFT - 8 : (this.width - EDGE_LEFT) / ticks.length - 6;
        const label = shortenText(context, text, room);
        if (axis) context.fillText(label, EDGE_LEFT - 6, Math.max(EDGE + 8, this.y(share) + (share ? 4 : 0)));
        else context.fillText(label, this.x(share), this.y(0) + 14);
      }
    });
    context.fillStyle = COLOURS.faint;
    context.textAlign = "center";
    const nameOf = ({ name, unit }) => name.replaceAll("_", " ") + (unit ? `, ${unit}` : "");
    context.fillText(shortenText(context, `${nameOf(this.columns[0])}  →   ${nameOf(this.columns[1])}  ↑`, this.width - EDGE_LEFT), this.x(0.5), TALL - 4);
  }

  // -- pointer ---------------------------------------------------------------------------------

  press(event) {
    if (event.button !== 0) return;
    event.preventDefault();
    const place = (at) => {
      const box = this.canvas.getBoundingClientRect();
      return [at.clientX - box.left, at.clientY - box.top];
    };
    const from = place(event);
    let moved = false, brushes = this.brushes;
    this.canvas.setPointerCapture(event.pointerId);
    this.canvas.onpointermove = (at) => {
      const to = place(at);
      if (!moved && Math.hypot(to[0] - from[0], to[1] - from[1]) < 4) return;
      moved = true;
      brushes = this.brushesOfBox(this.shares(...from), this.shares(...to));
      this.hands.brush(brushes, false);
    };
    this.canvas.onpointerup = this.canvas.onpointercancel = (at) => {
      this.canvas.onpointermove = this.canvas.onpointerup = this.canvas.onpointercancel = null;
      if (moved) {
        this.hands.brush(brushes, true);
        return;
      }
      const row = this.nearest(...from);
      if (row >= 0) this.hands.show(this.births.ids[row], at.ctrlKey || at.metaKey || at.shiftKey);
      else this.hands.brush({ ...this.brushes, [this.columns[0].name]: [], [this.columns[1].name]: [] }, true);
    };
  }

  /** The brushes, with a box between two corners for these two columns. */
  brushesOfBox(...corners) {
    const brushes = { ...this.brushes };
    this.columns.forEach((column, axis) => {
      const [low, high] = corners.map((one) => one[axis]).sort((a, b) => a - b);
      brushes[column.name] = column.isWords ? column.words.filter((_, k) => column.share(k) >= low && column.share(k) <= high) :
        [[column.value(low), column.value(high)]];
    });
    return brushes;
  }

  /** The passing row with the nearest dot to a point, -1 without one nearby. */
  nearest(x, y) {
    let nearest = -1, least = NEAR ** 2;
    for (let row = 0; row < this.mask.length; row++) {
      if (!this.mask[row]) continue;
      const [left, top] = this.at(row), apart = (left - x) ** 2 + (top - y) ** 2;
      if (apart < least) [nearest, least] = [row, apart];
    }
    return nearest;
  }
}

export const view = {
  name: "scatter", title: "scatter", place: 30, suits: () => true, open: (root, page, hands) => new Scatter(root, page, hands),
};
