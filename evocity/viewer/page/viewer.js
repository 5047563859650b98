import { axisPanel } from "./axis.js";
import { Births, Column, brushOf } from "./births.js";
import { Cells } from "./cells.js";
import { Gallery } from "./gallery.js";
import { countText, element, number } from "./elements.js";
import { Parallel } from "./parallel.js";
import { Scatter } from "./scatter.js";
import { Tiles } from "./tiles.js";

/** The state that all views and the host share: the choice, the filter, the order, the axes. */
const STATE = ["chosen", "brushes", "order", "axes"];
/** The views above the gallery; the last one for a run with a grid. */
const VIEWS = ["axes", "scatter", "grid"];
/** Orders by difference, and the measures of difference; births in a slow comparison, at most. */
const DIFFERENCES = [["", "…"], ["likeness", "likeness to the chosen birth"], ["spread", "spread: most different first"]];
const BY = [["looks", "looks"], ["scores", "scores"], ["kin", "ancestry"]], MOST_COMPARED = 400;

/** The page for a host, which has: `about` and `buffer` of the births; `state`, see STATE, with a `view` of VIEWS and the
 * `pair` of columns of the scatter, if it keeps them; `save(changes)` for the state; `tiles(ids, side)`, a promise of
 * pictures, see Tiles. A host may also have `compare({ids, to, by})`, a promise of distances from `to`, or of places if
 * `to` is null; `trouble(error)`; `activate(id)` for the birth with visible numbers, null for none. */
export class Viewer {
  constructor(parent, host) {
    this.host = host;
    this.state = { chosen: [], brushes: {}, order: { name: "id" }, axes: [], view: VIEWS[0], pair: null, ...host.state };
    this.root = element(parent, "section", "view");
    this.tiles = new Tiles(host.tiles, () => this.drawTiles());
    const top = element(this.root, "div", "row");
    this.title = element(top, "b");
    this.count = element(top, "output", "count");
    this.button(top, "clear filter", () => this.change({ brushes: {} }));
    this.button(top, "choose all births that pass the filter", () =>
      this.change({ chosen: Array.from(this.rows, (row) => this.births.ids[row]) }));
    this.button(top, "choose none", () => this.change({ chosen: [] }));
    const views = element(top, "div", "row", "", { role: "group", "aria-label": "view" });
    this.viewButtons = new Map(VIEWS.map((name) => [name, this.button(views, name, () => this.change({ view: name }))]));
    const brush = (brushes, isFinal) => (isFinal ? this.change({ brushes }) : this.changeSoon({ brushes }));
    const open = (name) => this.open(this.parallel.open === name ? null : name, true);
    const choose = (row, isAdded) => this.choose(row, isAdded);
    this.parallel = new Parallel(this.root, { brush, open, setAxes: (axes) => this.change({ axes }) });
    this.scatter = new Scatter(this.root, { brush, open, choose, setPair: (...pair) => this.change({ pair }) });
    this.cells = new Cells(this.root, new Tiles(host.tiles, () => this.cells.draw()), { choose });
    this.panel = element(this.root, "div", "panel", "", { role: "group" });
    this.controls();
    this.comparison = element(this.root, "p", "faint", "", { role: "status" });
    this.gallery = new Gallery(this.root, this.tiles, {
      choose: (chosen) => this.change({ chosen }),
      activate: (row) => this.detail(row),
    });
    this.emptyText = element(this.root, "p", "faint", "No birth passes the filter.");
    this.about = element(this.root, "div", "detail");
    this.credit = element(this.root, "p", "faint");
    this.load(host.about, host.buffer);
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(this.root);
  }

  button(parent, text, act) {
    const button = element(parent, "button", "", text, { type: "button" });
    button.addEventListener("click", act);
    return button;
  }

  controls() {
    const row = element(this.root, "div", "row");
    const order = element(row, "label", "", "order ");
    this.order = element(order, "select");
    this.order.addEventListener("change", () => this.change({ order: { name: this.order.value, reversed: false } }));
    this.reverseButton = this.button(row, "", () =>
      this.change({ order: { ...this.state.order, reversed: !this.state.order.reversed } }));
    this.orderButton = this.button(row, "", () => (this.arrangement ? this.arrange() : this.change({ order: this.state.order })));
    if (this.host.compare) {
      const choice = (text, listed) => {
        const select = element(element(row, "label", "", text), "select");
        for (const [value, label] of listed) element(select, "option", "", label, { value });
        select.addEventListener("change", () => this.arrange());
        return select;
      };
      [this.kind, this.way] = [choice("or by ", DIFFERENCES), choice("of ", BY)];
    }
    const size = element(row, "label", "", "size ");
    this.size = element(size, "input", "", "", { type: "range", min: "48", max: "192", step: "16", value: "96" });
    this.size.addEventListener("input", () => {
      this.gallery.size = Number(this.size.value);
      this.gallery.resize();
    });
    const add = element(row, "label", "", "add axis ");
    this.add = element(add, "select");
    this.add.addEventListener("change", () => {
      if (this.add.value) this.change({ axes: [...this.state.axes, { name: this.add.value, turned: false }] });
    });
  }

  close() {
    this.observer.disconnect();
    this.root.remove();
  }

  // -- births -----------------------------------------------------------------------------------

  /** Show other births. */
  load(about, buffer) {
    this.births = new Births(about, buffer);
    this.tiles.forget();
    this.cells.tiles.forget();
    this.showFacts(about);
    this.update(this.state);
  }

  /** Show the same births and more, which come last until a user sorts them, so that no visible birth moves. */
  grow(about, buffer) {
    const { births: before, sortedRows: was } = this;
    this.births = new Births(about, buffer);
    const kept = Array.from(was, (row) => this.births.row(before.ids[row])).filter((row) => row >= 0);
    const isKnown = new Uint8Array(this.births.count);
    for (const row of kept) isKnown[row] = 1;
    const more = this.births.rowOrder(this.state.order).filter((row) => !isKnown[row]);
    this.sortedRows = Uint32Array.from([...kept, ...more]);
    this.newCount = (this.newCount || 0) + more.length;
    if (this.arrangement) this.arrangement = this.differenceColumn(this.arrangement.name, before.ids, this.arrangement.values);
    this.showFacts(about);
    const { chosen, brushes, axes } = this.state;
    this.update({ chosen, brushes, axes });
  }

  /** The column of the gallery's order. */
  get by() { return this.arrangement || this.births.byName.get(this.state.order.name); }

  /** A column with values of some births, by id. */
  differenceColumn(name, ids, numbers) {
    const values = new Float32Array(this.births.count).fill(NaN);
    ids.forEach((id, k) => {
      const row = this.births.row(id);
      if (row >= 0) values[row] = numbers[k];
    });
    const about = { name, words: [], unit: "", sign: "", wanted: "", goal: null, target: null };
    return new Column(about, values);
  }

  /** Sort the passing births by difference; only the first ones in the present order where all are too many. */
  async arrange() {
    const kind = this.kind.value, by = this.way.value, to = kind === "likeness" ? this.state.chosen.at(-1) : null;
    if (!kind) {
      this.change({ order: this.state.order });
      return;
    }
    if (to === undefined) {
      this.kind.value = "";
      this.host.trouble(new Error("First choose a birth, so that the page can order the maps by likeness to this birth."));
      return;
    }
    const { births } = this, passing = this.births.rowOrder(this.state.order).filter((row) => this.mask[row]);
    const isQuick = kind === "likeness" && by === "scores", kept = isQuick ? passing : passing.slice(0, MOST_COMPARED);
    if (!kept.length) return;
    const ids = Array.from(kept, (row) => births.ids[row]);
    try {
      this.comparison.textContent = "comparing …";
      const numbers = await this.host.compare({ ids, to, by });
      if (this.kind.value !== kind || this.way.value !== by) return;
      this.arrangement = this.differenceColumn(kind === "spread" ? kind : `distance to ${to}`, ids, numbers);
      this.comparison.textContent = kept.length < passing.length ?
        `Only the first ${kept.length} of ${countText(passing.length)} births are compared; the other births follow.` : "";
      this.sortedRows = this.births.sortRows(this.arrangement);
      this.newCount = 0;
      this.gallery.root.scrollTop = 0;
      this.update({ brushes: this.state.brushes });
      this.host.trouble(null);
    } catch (error) {
      this.comparison.textContent = "";
      this.kind.value = "";
      this.host.trouble(error);
    }
  }

  /** The two columns of the scatter: the chosen ones, or the first two axes. */
  get pair() {
    const names = [...(this.state.pair || []), ...this.state.axes.map((one) => one.name), "generation", "id"];
    return [...new Set(names)].filter((name) => this.births.byName.has(name)).slice(0, 2);
  }

  /** Draw the view above the gallery. */
  drawView() {
    if (this.state.view === "axes") this.parallel.draw(this.mask, this.rows.length);
    else if (this.state.view === "scatter") this.scatter.draw(this.mask, this.rows.length);
  }

  /** Choose a birth of another view (`isAdded`: with the others), and bring it into view in the gallery. */
  choose(row, isAdded) {
    const id = this.births.ids[row], others = isAdded ? this.state.chosen.filter((one) => one !== id) : [];
    this.change({ chosen: isAdded && this.state.chosen.includes(id) ? others : [...others, id] });
    this.gallery.activate(this.rows.indexOf(row));
  }

  showFacts(about) {
    this.title.textContent = about.title;
    this.credit.textContent =
      `The colour scale of all maps covers heights from 0 to ${number(about.highest)} m. ${about.credit}`;
    this.order.replaceChildren(...this.births.columns.map((one) =>
      element(null, "option", "", one.name, { value: one.name })));
    this.order.value = this.state.order.name;
  }

  /** Change the state, and save it with the host. */
  change(changes) {
    if (changes.brushes) {
      const kept = Object.entries(changes.brushes).filter(([, brush]) => brush.length);
      changes = { ...changes, brushes: Object.fromEntries(kept) };
    }
    this.update(changes);
    this.host.save(changes);
  }

  /** Change the state at the next frame, without saving it: for a moving hand. */
  changeSoon(changes) {
    const isWaiting = this.pending;
    this.pending = { ...this.pending, ...changes };
    if (!isWaiting) {
      requestAnimationFrame(() => {
        const pending = this.pending;
        this.pending = null;
        if (pending) this.update(pending);
      });
    }
  }

  /** Show changes of the state. */
  update(changes) {
    this.pending = null;
    Object.assign(this.state, changes);
    const { chosen, brushes, order, axes } = this.state;
    if (!this.births.about.grid && this.state.view === "grid") this.state.view = "axes";
    const { view } = this.state;
    for (const [name, button] of this.viewButtons) {
      button.setAttribute("aria-pressed", String(name === view));
      button.hidden = name === "grid" && !this.births.about.grid;
    }
    this.add.parentNode.hidden = view !== "axes";
    [this.parallel, this.scatter, this.cells].forEach((one, place) => { one.root.hidden = VIEWS[place] !== view; });
    if ("axes" in changes) {
      this.parallel.show(this.births, axes);
      const shown = new Set(axes.map((one) => one.name));
      this.add.replaceChildren(element(null, "option", "", "…", { value: "" }), ...this.births.columns
        .filter((one) => !shown.has(one.name)).map((one) => element(null, "option", "", one.name, { value: one.name })));
      if (view === "axes" && !shown.has(this.parallel.open)) this.open(null);
    }
    if ("brushes" in changes) {
      this.parallel.brushes = this.scatter.brushes = brushes;
      this.mask = this.births.matches(brushes);
      if (this.parallel.open && !this.isFromPanel) this.open(this.parallel.open);
    }
    if ("order" in changes) {
      this.order.value = order.name;
      this.reverseButton.textContent = this.births.byName.get(order.name).orderName(order.reversed);
      this.gallery.root.scrollTop = 0;
      this.sortedRows = this.births.rowOrder(order);
      this.newCount = 0;
      this.arrangement = null;
      this.comparison.textContent = "";
      if (this.kind) this.kind.value = "";
    }
    this.orderButton.hidden = !this.newCount;
    if (this.newCount) this.orderButton.textContent = `sort the ${countText(this.newCount)} new births into the list`;
    if ("brushes" in changes || "order" in changes) {
      this.rows = this.sortedRows.filter((row) => this.mask[row]);
    }
    if ("chosen" in changes) {
      this.gallery.chosen = new Set(chosen);
      this.parallel.chosen = this.scatter.chosen = chosen.map((id) => this.births.row(id)).filter((row) => row >= 0);
      this.cells.chosen = this.gallery.chosen;
    }
    if (view === "scatter") this.scatter.show(this.births, ...this.pair);
    if (view === "grid") this.cells.show(this.births, this.rows, this.by);
    if ("view" in changes) {
      this.open(null);
      this.parallel.resize();
    }
    if ("brushes" in changes || "order" in changes) {
      this.gallery.anchor = -1;
      this.gallery.show(this.births, this.rows, this.by);
    } else if ("chosen" in changes) this.gallery.draw();
    this.emptyText.hidden = this.rows.length > 0;
    const parts = [`${countText(this.rows.length)} of ${countText(this.births.count)} births pass the filter`];
    parts.push(`${countText(this.parallel.chosen.length)} chosen`);
    this.count.textContent = parts.join(", ");
    const awake = this.gallery.active < 0 ? this.parallel.chosen.at(-1) : this.rows[this.gallery.active];
    this.detail(awake === undefined ? -1 : awake);
  }

  resize() {
    const width = this.root.clientWidth;
    if (!width || width === this.width) return;
    this.width = width;
    this.parallel.resize();
    this.gallery.resize();
    this.cells.lay();
    this.drawView();
  }

  drawTiles() {
    this.gallery.drawSoon();
    if (this.awake >= 0) this.detail(this.awake);
  }

  // -- one axis, one birth -------------------------------------------------------------------------

  /** Open the panel of an axis; none for null. */
  open(name, isByUser = false) {
    const was = document.activeElement;
    this.parallel.open = name;
    this.panel.hidden = !name;
    this.panel.setAttribute("aria-label", name ? `axis ${name}` : "axis");
    const isAxis = this.state.view === "axes";
    for (const [k, head] of [...this.parallel.heads.children].entries()) {
      head.setAttribute("aria-expanded", String(this.parallel.columns[k].name === name));
    }
    if (!name) return;
    const place = () => this.state.axes.findIndex((one) => one.name === name);
    const column = this.births.byName.get(name);
    const kept = this.panel.contains(was) ? [...this.panel.querySelectorAll("input, button")].indexOf(was) : -1;
    const first = axisPanel(this.panel, column, brushOf(this.state.brushes, name), {
      brush: (brush) => {
        this.isFromPanel = true; // which then stays as it is under the hand
        this.change({ brushes: { ...this.state.brushes, [name]: brush } });
        this.isFromPanel = false;
      },
      clear: () => this.change({ brushes: { ...this.state.brushes, [name]: [] } }),
      isAxis,
      move: (by) => this.parallel.move(name, place() + by),
      turn: () => this.change({ axes: this.state.axes.map((one) =>
        (one.name === name ? { ...one, turned: !one.turned } : one)) }),
      hide: () => this.change({ axes: this.state.axes.filter((one) => one.name !== name) }),
      close: () => {
        const head = isAxis ? this.parallel.heads.children[place()] : this.scatter.filterOf(name);
        this.open(null);
        if (head) head.focus();
      },
    });
    if (isByUser) first.focus();
    else if (kept >= 0) ([...this.panel.querySelectorAll("input, button")][kept] || first).focus();
  }

  /** Show the numbers of a birth, and draw its line. */
  detail(row) {
    this.awake = row;
    this.parallel.active = this.scatter.active = this.gallery.active >= 0 ? row : -1;
    this.drawView();
    this.about.replaceChildren();
    if (this.host.activate) this.host.activate(row < 0 ? null : this.births.ids[row]);
    if (row < 0) {
      element(this.about, "p", "faint", "To see the numbers of a birth, click the birth, or select it with the arrow keys and press space. To choose more births, hold Shift or Ctrl and click. " +
        "Drag along an axis to filter; click its name for more.");
      return;
    }
    const id = this.births.ids[row], reason = this.tiles.reason(id);
    element(this.about, "b", "", `birth ${id}`);
    if (reason) element(this.about, "p", "", reason);
    const list = element(this.about, "div", "facts");
    for (const column of this.births.columns) {
      if (column.name === "id") continue;
      const value = column.values[row];
      const pair = element(list, "div", "fact", "", column.wanted ? { title: column.wanted } : {});
      element(pair, "span", "faint", column.name.replaceAll("_", " "));
      const text = column.isWords ? column.words[value].replaceAll("_", " ") : `${number(value)} ${column.unit}`;
      element(pair, "span", "", text.trimEnd());
    }
  }
}

/** Show a widget's model in Jupyter; returns a function that ends the view. */
function render({ model, el }) {
  const own = Math.random().toString(36).slice(2), waiting = new Map();
  let count = 0;
  el.addEventListener("focusin", ({ target }) => { // otherwise Jupyter takes the keys as commands
    target.dataset.lmSuppressShortcuts = "true";
  });
  const receive = (answer, buffers) => {
    const resolve = answer && waiting.get(answer.request);
    if (!resolve) return; // an answer to another view
    waiting.delete(answer.request);
    resolve({ ...answer, image: new Blob([buffers[0]], { type: answer.kind }) });
  };
  const viewer = new Viewer(el, {
    about: model.get("about"),
    buffer: model.get("births"),
    state: Object.fromEntries(STATE.map((name) => [name, model.get(name)])),
    save(changes) {
      for (const name of STATE) if (name in changes) model.set(name, changes[name]);
      model.save_changes();
    },
    tiles: (tiles, side) => new Promise((resolve) => {
      const request = `${own}-${++count}`;
      waiting.set(request, resolve);
      model.send({ tiles, side, request });
    }),
  });
  const listeners = { "msg:custom": receive, "change:births": () => viewer.load(model.get("about"), model.get("births")) };
  for (const name of STATE) {
    listeners[`change:${name}`] = () => {
      const value = model.get(name);
      if (JSON.stringify(value) !== JSON.stringify(viewer.state[name])) viewer.update({ [name]: value });
    };
  }
  for (const [name, act] of Object.entries(listeners)) model.on(name, act);
  return () => {
    for (const [name, act] of Object.entries(listeners)) model.off(name, act);
    viewer.close();
  };
}

export default { render };
