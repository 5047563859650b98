import { COLOURS, FONT, choice, element, fitCanvas, number, offer, shortenText } from "../elements.js";
import { Tiles } from "../tiles.js";

const CELL_LEFT = 64, CELL_LOW = 34, CELL_TOP = 6, LARGEST = 96, SMALLEST = 7, PICTURED = 22, TALLEST = 400;

/** The grid of a run of MAP-Elites: in each cell the first birth, in the order of the gallery, that passes and keeps all
 * bounds. Each cell is a button; arrow keys go to the next filled cell. */
class Cells {
  constructor(parent, page, hands) {
    [this.page, this.hands] = [page, hands];
    this.tiles = new Tiles(hands.pictures, () => this.draw());
    this.root = element(parent, "div", "grid");
    const row = element(this.root, "div", "row");
    this.slice = choice(row, "slice", [], () => this.update({}));
    this.summary = element(row, "span", "faint");
    this.inner = element(element(this.root, "div", "cells"), "div", "inner", "", { role: "group", "aria-label": "cells" });
    this.canvas = element(this.inner, "canvas", "", "", { "aria-hidden": "true" });
    this.active = null; // the cell that Tab reaches
    this.filled = new Map();
    this.inner.addEventListener("keydown", (event) => this.pressKey(event));
    this.inner.addEventListener("click", (event) => {
      const button = event.target.closest("button");
      if (button) this.press(Number(button.dataset.cell), event);
    });
  }

  get births() { return this.page.births; }

  get by() { return this.page.by; }

  get grid() { return this.page.about.grid; }

  /** Show the cells of the passing rows, in their order. */
  update(changes) {
    const { births, rows, by } = this.page, { grid } = this;
    if ("births" in changes) this.list(grid);
    this.chosen = new Set(this.page.state.chosen);
    const cell = births.byName.get(grid.column), feasible = births.byName.get("feasible");
    const third = grid.counts.length > 2 ? grid.counts[2] : 1, slice = Number(this.slice.value) || 0;
    this.filled = new Map();
    let count = 0;
    const seen = new Set();
    for (const row of rows) {
      const number = cell.values[row];
      if (Number.isNaN(number) || (feasible && !feasible.values[row]) || seen.has(number)) continue;
      seen.add(number);
      count++;
      if (number % third !== slice) continue;
      const place = Math.floor(number / third);
      this.filled.set(place, { row, across: Math.floor(place / grid.counts[1]), up: place % grid.counts[1] });
    }
    const whole = grid.counts.reduce((product, one) => product * one, 1);
    this.summary.textContent = `The grid has births in ${count} of ${whole} cells. In each cell, the page sorts the births by ${by.name.replaceAll("_", " ")} and shows the first birth that breaks no bound` +
      (grid.island ? `, in the grid of island ${grid.island}` : "");
    this.lay();
  }

  list({ counts, edges, descriptors }) {
    const slices = counts.length > 2 ? counts[2] : 0;
    this.slice.parentNode.hidden = !slices;
    offer(this.slice, Array.from({ length: slices }, (_, k) => [k, `${descriptors[2]} from ${number(edges[2][k])} to ${number(edges[2][k + 1])}`]));
  }

  get labels() { return this.grid.descriptors.map((one) => one.replaceAll("_", " ")); }

  lay() {
    if (!this.root.clientWidth) return;
    const [across, down] = this.grid.counts;
    const fits = Math.min(this.root.clientWidth - CELL_LEFT - 16, (TALLEST * across) / down);
    this.size = Math.max(SMALLEST, Math.min(LARGEST, Math.floor(fits / across)));
    this.wide = CELL_LEFT + across * this.size + 12;
    this.tall = CELL_TOP + down * this.size + CELL_LOW;
    Object.assign(this.inner.style, { width: `${this.wide}px`, height: `${this.tall}px` });
    if (!this.filled.has(this.active)) this.active = this.filled.size ? this.filled.keys().next().value : null;
    const hadFocus = this.inner.contains(document.activeElement), kept = new Map();
    for (const button of [...this.inner.querySelectorAll("button")]) kept.set(Number(button.dataset.cell), button);
    for (const [place, { row, across: x, up }] of this.filled) {
      const button = kept.get(place) || element(this.inner, "button", "cell", "", { type: "button" });
      kept.delete(place);
      button.dataset.cell = place;
      const [left, top] = this.corner(x, up);
      Object.assign(button.style, { left: `${left}px`, top: `${top}px`, width: `${this.size}px`, height: `${this.size}px` });
      button.tabIndex = place === this.active ? 0 : -1;
      const id = this.births.ids[row], [first, second] = this.labels;
      button.setAttribute("aria-label", `birth ${id}, ${first} ${this.span(0, x)}, ${second} ${this.span(1, up)}, ${this.by.name} ${this.value(row)}`);
      button.setAttribute("aria-pressed", String(this.chosen.has(id)));
      button.title = `birth ${id}: ${this.by.name} ${this.value(row)}`;
    }
    for (const button of kept.values()) button.remove();
    if (hadFocus && !this.inner.contains(document.activeElement) && this.active !== null) this.button(this.active).focus();
    this.draw();
  }

  resize() { this.lay(); }

  span(axis, place) { return `${number(this.grid.edges[axis][place])} to ${number(this.grid.edges[axis][place + 1])}`; }

  value(row) {
    const value = this.by.values[row];
    return this.by.isWords ? this.by.words[value] : number(value);
  }

  button(place) { return this.inner.querySelector(`[data-cell="${place}"]`); }

  corner(across, up) { return [CELL_LEFT + across * this.size, CELL_TOP + (this.grid.counts[1] - 1 - up) * this.size]; }

  draw() {
    if (!this.wide) return;
    const context = fitCanvas(this.canvas, this.wide, this.tall), { size } = this, [across, down] = this.grid.counts;
    context.fillStyle = "#efeae0";
    context.fillRect(CELL_LEFT, CELL_TOP, across * size, down * size);
    const isPictured = size >= PICTURED, side = size * (window.devicePixelRatio || 1) > 120 ? 192 : 96, { ratio } = this.births.about;
    const wide = (size - 2) * Math.min(1, ratio), tall = (size - 2) / Math.max(1, ratio), places = [...this.filled.values()];
    places.forEach(({ row, across: x, up }, rank) => {
      const [left, top] = this.corner(x, up), id = this.births.ids[row];
      const tile = isPictured ? this.tiles.get(id, side) : null;
      if (tile) context.drawImage(tile.image, tile.x, tile.y, tile.width, tile.height, left + (size - wide) / 2, top + (size - tall) / 2, wide, tall);
      else if (!isPictured) { // darker for earlier births
        context.fillStyle = `rgb(${COLOURS.passing.join(" ")} / ${100 - (75 * rank) / places.length}%)`;
        context.fillRect(left, top, size, size);
      }
      if (!this.chosen.has(id)) return;
      context.strokeStyle = COLOURS.chosen;
      context.lineWidth = Math.min(4, size / 4);
      context.strokeRect(left + 2, top + 2, size - 4, size - 4);
      if (!isPictured) return;
      context.fillStyle = COLOURS.chosen;
      context.fillRect(left + size - 14, top, 14, 14);
      context.fillStyle = "#fff";
      context.textAlign = "center";
      context.font = `11px ${FONT}`;
      context.fillText("✓", left + size - 7, top + 11);
    });
    context.strokeStyle = COLOURS.paper;
    context.lineWidth = 1;
    context.beginPath();
    for (let x = 0; x <= across; x++) [[x, 0], [x, down]].forEach(([a, b], k) => context[k ? "lineTo" : "moveTo"](CELL_LEFT + a * size, CELL_TOP + b * size));
    for (let y = 0; y <= down; y++) [[0, y], [across, y]].forEach(([a, b], k) => context[k ? "lineTo" : "moveTo"](CELL_LEFT + a * size, CELL_TOP + b * size));
    context.stroke();
    this.drawAxes(context);
    this.tiles.request(isPictured ? places.map(({ row }) => this.births.ids[row]) : [], side);
  }

  drawAxes(context) {
    const { size } = this, [across, down] = this.grid.counts, [first, second] = this.labels;
    context.font = `11px ${FONT}`;
    context.fillStyle = COLOURS.ink;
    for (const [axis, count, apart] of [[0, across, 52], [1, down, 18]]) {
      const every = Math.ceil(apart / size);
      for (let place = 0; place <= count; place += every) {
        const text = number(this.grid.edges[axis][place]);
        context.textAlign = axis ? "right" : "center";
        if (axis) context.fillText(shortenText(context, text, CELL_LEFT - 6), CELL_LEFT - 6, CELL_TOP + (count - place) * size + (place === count ? 8 : 4));
        else context.fillText(text, CELL_LEFT + place * size, CELL_TOP + down * size + 14);
      }
    }
    context.fillStyle = COLOURS.faint;
    context.textAlign = "left";
    context.fillText(shortenText(context, `${first}  →   ${second}  ↑`, this.wide - CELL_LEFT), CELL_LEFT, this.tall - 4);
  }

  press(place, event) {
    this.active = place;
    this.hands.show(this.births.ids[this.filled.get(place).row], event.ctrlKey || event.metaKey || event.shiftKey);
  }

  /** Go to the nearest filled cell in the direction of an arrow key. */
  pressKey(event) {
    const by = { ArrowRight: [1, 0], ArrowLeft: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (!by || this.active === null) return;
    event.preventDefault();
    event.stopPropagation();
    const from = this.filled.get(this.active);
    let next = null, least = Infinity;
    for (const [place, { across, up }] of this.filled) {
      const ahead = (across - from.across) * by[0] + (up - from.up) * by[1];
      const aside = Math.abs((across - from.across) * by[1]) + Math.abs((up - from.up) * by[0]);
      if (ahead > 0 && ahead + 3 * aside < least) [next, least] = [place, ahead + 3 * aside];
    }
    if (next === null) return;
    this.button(this.active).tabIndex = -1;
    this.active = next;
    this.button(next).tabIndex = 0;
    this.button(next).focus();
  }
}

export const view = {
  name: "grid", title: "grid", place: 40, suits: ({ about }) => Boolean(about.grid), open: (root, page, hands) => new Cells(root, page, hands),
};
