import { axisPanel } from "./axis.js";
import { Births, Column, brushOf } from "./births.js";
import { Cells } from "./cells.js";
import { Gallery } from "./gallery.js";
import { counted, made, number } from "./made.js";
import { Parallel } from "./parallel.js";
import { Scatter } from "./scatter.js";
import { Tiles } from "./tiles.js";

/** What is chosen, brushed and ordered: the same for all views and for the host. */
const STATE = ["chosen", "brushes", "order", "axes"];
/** What shows births above the gallery; the last where the run fills a grid. */
const VIEWS = ["axes", "scatter", "grid"];
/** Orders by how births differ, and by what; so many are compared where each takes long. */
const DIFFERING = [["", "…"], ["likeness", "likeness to the chosen"], ["spread", "spread: what differs most first"]];
const BY = [["looks", "how they look"], ["scores", "scores"], ["kin", "stones"]], MOST_COMPARED = 400;

/** The page of a host: `about` and `buffer` of the births; `state`, see STATE, and `view`, which of
 * VIEWS, and `pair`, the two columns of a scatter, if it keeps them; `save(changes)` of
 * it; `tiles(ids, side)`, a promise of pictures, see Tiles; if it has them, `compare({ids, to, by})`, a promise of
 * how far `ids` are from `to`, or of their places where that is null, and `trouble(error)`; and if it has it, `woken(id)`, told of the
 * birth whose numbers are shown, null for none. */
export class Viewer {
  constructor(element, host) {
    this.host = host;
    this.state = { chosen: [], brushes: {}, order: { name: "id" }, axes: [], view: VIEWS[0], pair: null, ...host.state };
    this.root = made(element, "section", "view");
    this.tiles = new Tiles(host.tiles, () => this.arrived());
    const top = made(this.root, "div", "row");
    this.title = made(top, "b");
    this.count = made(top, "output", "count");
    this.button(top, "clear filter", () => this.change({ brushes: {} }));
    this.button(top, "choose all that pass", () =>
      this.change({ chosen: Array.from(this.rows, (row) => this.births.ids[row]) }));
    this.button(top, "choose none", () => this.change({ chosen: [] }));
    const seen = made(top, "div", "row", "", { role: "group", "aria-label": "view" });
    this.seen = new Map(VIEWS.map((name) => [name, this.button(seen, name, () => this.change({ view: name }))]));
    this.parallel = new Parallel(this.root, {
      brushed: (brushes, ended) => (ended ? this.change({ brushes }) : this.later({ brushes })),
      axed: (axes) => this.change({ axes }),
      opened: (name) => this.open(this.parallel.open === name ? null : name, true),
    });
    const touched = (row, isBesides) => this.touch(row, isBesides);
    this.scatter = new Scatter(this.root, {
      brushed: (brushes, ended) => (ended ? this.change({ brushes }) : this.later({ brushes })),
      placed: (...pair) => this.change({ pair }),
      opened: (name) => this.open(this.parallel.open === name ? null : name, true),
      touched,
    });
    this.cells = new Cells(this.root, new Tiles(host.tiles, () => this.cells.draw()), { touched });
    this.panel = made(this.root, "div", "panel", "", { role: "group" });
    this.controls();
    this.compared = made(this.root, "p", "faint", "", { role: "status" });
    this.gallery = new Gallery(this.root, this.tiles, {
      choose: (chosen) => this.change({ chosen }),
      wake: (row) => this.detail(row),
    });
    this.nobody = made(this.root, "p", "faint", "No birth passes the filter.");
    this.about = made(this.root, "div", "detail");
    this.credit = made(this.root, "p", "faint");
    this.load(host.about, host.buffer);
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(this.root);
  }

  button(parent, text, act) {
    const found = made(parent, "button", "", text, { type: "button" });
    found.addEventListener("click", act);
    return found;
  }

  controls() {
    const row = made(this.root, "div", "row");
    const order = made(row, "label", "", "order ");
    this.order = made(order, "select");
    this.order.addEventListener("change", () => this.change({ order: { name: this.order.value, reversed: false } }));
    this.turn = this.button(row, "", () =>
      this.change({ order: { ...this.state.order, reversed: !this.state.order.reversed } }));
    this.fresh = this.button(row, "", () => (this.arranged ? this.arrange() : this.change({ order: this.state.order })));
    if (this.host.compare) {
      const choice = (text, listed) => {
        const select = made(made(row, "label", "", text), "select");
        for (const [value, told] of listed) made(select, "option", "", told, { value });
        select.addEventListener("change", () => this.arrange());
        return select;
      };
      [this.kind, this.way] = [choice("or by ", DIFFERING), choice("of ", BY)];
    }
    const size = made(row, "label", "", "size ");
    this.size = made(size, "input", "", "", { type: "range", min: "48", max: "192", step: "16", value: "96" });
    this.size.addEventListener("input", () => {
      this.gallery.size = Number(this.size.value);
      this.gallery.resize();
    });
    const add = made(row, "label", "", "add an axis ");
    this.add = made(add, "select");
    this.add.addEventListener("change", () => {
      if (this.add.value) this.change({ axes: [...this.state.axes, { name: this.add.value, turned: false }] });
    });
  }

  close() {
    this.observer.disconnect();
    this.root.remove();
  }

  // -- what is shown -----------------------------------------------------------------------------

  /** Other births. */
  load(about, buffer) {
    this.births = new Births(about, buffer);
    this.tiles.forget();
    this.cells.tiles.forget();
    this.tell(about);
    this.update(this.state);
  }

  /** The same births, and more, which come last until they are put in order: nothing that is seen
   * goes elsewhere. */
  grow(about, buffer) {
    const { births: before, ordered: was } = this;
    this.births = new Births(about, buffer);
    const kept = Array.from(was, (row) => this.births.row(before.ids[row])).filter((row) => row >= 0);
    const isKnown = new Uint8Array(this.births.count);
    for (const row of kept) isKnown[row] = 1;
    const more = this.births.ordered(this.state.order).filter((row) => !isKnown[row]);
    this.ordered = Uint32Array.from([...kept, ...more]);
    this.unordered = (this.unordered || 0) + more.length;
    if (this.arranged) this.arranged = this.differing(this.arranged.name, before.ids, this.arranged.values);
    this.tell(about);
    const { chosen, brushes, axes } = this.state;
    this.update({ chosen, brushes, axes });
  }

  /** By what the gallery is in order. */
  get by() { return this.arranged || this.births.byName.get(this.state.order.name); }

  /** A column of what some births have, by id; the others have nothing. */
  differing(name, ids, numbers) {
    const values = new Float32Array(this.births.count).fill(NaN);
    ids.forEach((id, k) => {
      const row = this.births.row(id);
      if (row >= 0) values[row] = numbers[k];
    });
    const told = { name, words: [], unit: "", sign: "", wanted: "", goal: null, target: null };
    return new Column(told, values);
  }

  /** Put those that pass in order by how they differ; the first of them, in the order that there
   * was, where all are too many. */
  async arrange() {
    const kind = this.kind.value, by = this.way.value, to = kind === "likeness" ? this.state.chosen.at(-1) : null;
    if (!kind) {
      this.change({ order: this.state.order });
      return;
    }
    if (to === undefined) {
      this.kind.value = "";
      this.host.trouble(new Error("Choose a birth first: the others are put in order by how like it they are."));
      return;
    }
    const { births } = this, passing = this.births.ordered(this.state.order).filter((row) => this.mask[row]);
    const isQuick = kind === "likeness" && by === "scores", kept = isQuick ? passing : passing.slice(0, MOST_COMPARED);
    if (!kept.length) return;
    const ids = Array.from(kept, (row) => births.ids[row]);
    try {
      this.compared.textContent = "comparing …";
      const numbers = await this.host.compare({ ids, to, by });
      if (this.kind.value !== kind || this.way.value !== by) return;
      this.arranged = this.differing(kind === "spread" ? kind : `distance to ${to}`, ids, numbers);
      this.compared.textContent = kept.length < passing.length ?
        `The first ${kept.length} of ${counted(passing.length)} that pass are compared; the others come after.` : "";
      this.ordered = this.births.sorted(this.arranged);
      this.unordered = 0;
      this.gallery.root.scrollTop = 0;
      this.update({ brushes: this.state.brushes });
      this.host.trouble(null);
    } catch (error) {
      this.compared.textContent = "";
      this.kind.value = "";
      this.host.trouble(error);
    }
  }

  /** The two columns of the scatter: those that were asked for, or the first two axes. */
  get pair() {
    const names = [...(this.state.pair || []), ...this.state.axes.map((one) => one.name), "generation", "id"];
    return [...new Set(names)].filter((name) => this.births.byName.has(name)).slice(0, 2);
  }

  /** Draw the view that is shown above the gallery. */
  drawView() {
    if (this.state.view === "axes") this.parallel.draw(this.mask, this.rows.length);
    else if (this.state.view === "scatter") this.scatter.draw(this.mask, this.rows.length);
  }

  /** Choose a birth that is seen in another view than the gallery, and bring it into view there. */
  touch(row, isBesides) {
    const id = this.births.ids[row], others = isBesides ? this.state.chosen.filter((one) => one !== id) : [];
    this.change({ chosen: isBesides && this.state.chosen.includes(id) ? others : [...others, id] });
    this.gallery.wake(this.rows.indexOf(row));
  }

  tell(about) {
    this.title.textContent = about.title;
    this.credit.textContent =
      `Heights from 0 to ${number(about.highest)} m in all maps. ${about.credit}`;
    this.order.replaceChildren(...this.births.columns.map((one) =>
      made(null, "option", "", one.name, { value: one.name })));
    this.order.value = this.state.order.name;
  }

  /** What was changed here, and is told to the host. */
  change(changes) {
    if (changes.brushes) {
      const kept = Object.entries(changes.brushes).filter(([, brush]) => brush.length);
      changes = { ...changes, brushes: Object.fromEntries(kept) };
    }
    this.update(changes);
    this.host.save(changes);
  }

  /** What changes while the hand moves: seen at the next frame, not told. */
  later(changes) {
    const isWaiting = this.coming;
    this.coming = { ...this.coming, ...changes };
    if (!isWaiting) {
      requestAnimationFrame(() => {
        const coming = this.coming;
        this.coming = null;
        if (coming) this.update(coming);
      });
    }
  }

  /** Show what is changed of the state. */
  update(changes) {
    this.coming = null;
    Object.assign(this.state, changes);
    const { chosen, brushes, order, axes } = this.state;
    if (!this.births.about.grid && this.state.view === "grid") this.state.view = "axes";
    const { view } = this.state;
    for (const [name, button] of this.seen) {
      button.setAttribute("aria-pressed", String(name === view));
      button.hidden = name === "grid" && !this.births.about.grid;
    }
    this.add.parentNode.hidden = view !== "axes";
    [this.parallel, this.scatter, this.cells].forEach((one, place) => { one.root.hidden = VIEWS[place] !== view; });
    if ("axes" in changes) {
      this.parallel.show(this.births, axes);
      const shown = new Set(axes.map((one) => one.name));
      this.add.replaceChildren(made(null, "option", "", "…", { value: "" }), ...this.births.columns
        .filter((one) => !shown.has(one.name)).map((one) => made(null, "option", "", one.name, { value: one.name })));
      if (view === "axes" && !shown.has(this.parallel.open)) this.open(null);
    }
    if ("brushes" in changes) {
      this.parallel.brushes = this.scatter.brushes = brushes;
      this.mask = this.births.passing(brushes);
      if (this.parallel.open && !this.isFromPanel) this.open(this.parallel.open);
    }
    if ("order" in changes) {
      this.order.value = order.name;
      this.turn.textContent = this.births.byName.get(order.name).order(order.reversed);
      this.gallery.root.scrollTop = 0;
      this.ordered = this.births.ordered(order);
      this.unordered = 0;
      this.arranged = null;
      this.compared.textContent = "";
      if (this.kind) this.kind.value = "";
    }
    this.fresh.hidden = !this.unordered;
    if (this.unordered) this.fresh.textContent = `${counted(this.unordered)} new ones come last: put in order`;
    if ("brushes" in changes || "order" in changes) {
      this.rows = this.ordered.filter((row) => this.mask[row]);
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
    this.nobody.hidden = this.rows.length > 0;
    const told = [`${counted(this.rows.length)} of ${counted(this.births.count)} births pass`];
    told.push(`${counted(this.parallel.chosen.length)} chosen`);
    this.count.textContent = told.join(", ");
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

  arrived() {
    this.gallery.later();
    if (this.awake >= 0) this.detail(this.awake);
  }

  // -- one axis, one birth -------------------------------------------------------------------------

  /** Open the panel of an axis; none for null. */
  open(name, isAsked = false) {
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
        this.isFromPanel = true; // which need not be made anew under the hand
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
    if (isAsked) first.focus();
    else if (kept >= 0) ([...this.panel.querySelectorAll("input, button")][kept] || first).focus();
  }

  /** All that is known of a birth; draws its line. */
  detail(row) {
    this.awake = row;
    this.parallel.active = this.scatter.active = this.gallery.active >= 0 ? row : -1;
    this.drawView();
    this.about.replaceChildren();
    if (this.host.woken) this.host.woken(row < 0 ? null : this.births.ids[row]);
    if (row < 0) {
      made(this.about, "p", "faint", "Choose a birth to see its numbers: click, Shift or Ctrl and click, " +
        "or arrows and space. Draw along an axis to filter; its name opens more.");
      return;
    }
    const id = this.births.ids[row], reason = this.tiles.reason(id);
    made(this.about, "b", "", `birth ${id}`);
    if (reason) made(this.about, "p", "", reason);
    const list = made(this.about, "div", "facts");
    for (const column of this.births.columns) {
      if (column.name === "id") continue;
      const value = column.values[row];
      const pair = made(list, "div", "fact", "", column.wanted ? { title: column.wanted } : {});
      made(pair, "span", "faint", column.name.replaceAll("_", " "));
      const told = column.isWords ? column.words[value].replaceAll("_", " ") : `${number(value)} ${column.unit}`;
      made(pair, "span", "", told.trimEnd());
    }
  }
}

/** A view of a widget's model, as Jupyter asks for it; returns what ends it. */
function render({ model, el }) {
  const own = Math.random().toString(36).slice(2), waiting = new Map();
  let asked = 0;
  el.addEventListener("focusin", ({ target }) => { // else keys pressed here are commands of Jupyter's
    target.dataset.lmSuppressShortcuts = "true";
  });
  const answered = (told, buffers) => {
    const resolve = told && waiting.get(told.request);
    if (!resolve) return; // another view's
    waiting.delete(told.request);
    resolve({ ...told, image: new Blob([buffers[0]], { type: told.kind }) });
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
      const request = `${own}-${++asked}`;
      waiting.set(request, resolve);
      model.send({ tiles, side, request });
    }),
  });
  const heard = { "msg:custom": answered, "change:births": () => viewer.load(model.get("about"), model.get("births")) };
  for (const name of STATE) {
    heard[`change:${name}`] = () => {
      const value = model.get(name);
      if (JSON.stringify(value) !== JSON.stringify(viewer.state[name])) viewer.update({ [name]: value });
    };
  }
  for (const [name, act] of Object.entries(heard)) model.on(name, act);
  return () => {
    for (const [name, act] of Object.entries(heard)) model.off(name, act);
    viewer.close();
  };
}

export default { render };
