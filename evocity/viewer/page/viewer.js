import { axisPanel } from "./axis.js";
import { Births, Column, brushOf } from "./births.js";
import { button, choice, countText, element, field, number, offer } from "./elements.js";
import { Gallery } from "./gallery.js";
import { Tabs } from "./tabs.js";
import { Tiles } from "./tiles.js";
import { FAULTS, VIEWS } from "./views.js";

/** The state that all views and the host share: the choice, the filter, the order, the axes. */
const STATE = ["chosen", "brushes", "order", "axes"];
/** Orders by difference, and the measures of difference; births in a slow comparison, at most. */
const DIFFERENCES = [["", "…"], ["likeness", "likeness to the chosen birth"], ["spread", "spread: most different first"]];
const BY = [["looks", "looks"], ["scores", "scores"], ["kin", "ancestry"]], MOST_COMPARED = 400;
/** The number of viewers so far, for ids. */
let viewers = 0;

/** The frame around the views of a page: the filter, the order, the gallery, a tab for each view. The host has: `about`
 * and `buffer` of the births; `state`, see STATE, with the name of a `view` and the `pair` of columns of the scatter, if
 * it keeps them; `save(changes)` for the state; `tiles(ids, side)`, a promise of pictures, see Tiles; `part(name)`, a
 * promise of a part of the page's document. A host may also have `ask(name, body)`, a promise of a server's answer;
 * `compare({ids, to, by})`, a promise of distances from `to`, or of places if `to` is null; `trouble(error)`;
 * `activate(id)` for the birth with visible numbers, null for none. */
export class Viewer {
  constructor(parent, host) {
    this.host = host;
    this.state = { chosen: [], brushes: {}, order: { name: "id" }, axes: [], view: "axes", pair: null, ...host.state };
    this.root = element(parent, "section", "view");
    this.tiles = new Tiles(host.tiles, () => this.drawTiles());
    /** What a view reads: `births`, their `about`, the `state`, the `mask` of passing rows, the passing `rows` in their
     * order `by` a column, the `chosen` rows, the `active` row and the `row` with visible numbers, -1 for none; the
     * column with an `open` panel. */
    this.page = { state: this.state, active: -1, row: -1, open: null };
    this.hands = {
      choose: (...ids) => this.change({ chosen: ids.flat() }),
      show: (id, isAdded = false) => this.show(id, isAdded),
      brush: (brushes, isFinal = true) => (isFinal ? this.change({ brushes }) : this.changeSoon({ brushes })),
      change: (changes) => this.change(changes),
      open: (name) => this.open(this.page.open === name ? null : name, true),
      pictures: host.tiles,
      part: host.part,
      ask: host.ask || null,
    };
    const top = element(this.root, "div", "row");
    this.title = element(top, "b");
    this.count = element(top, "output", "count");
    button(top, "clear filter", () => this.change({ brushes: {} }));
    button(top, "choose all births that pass the filter", () =>
      this.change({ chosen: Array.from(this.rows, (row) => this.births.ids[row]) }));
    button(top, "choose none", () => this.change({ chosen: [] }));
    const list = element(this.root, "div", "tabs", "", { role: "tablist", "aria-label": "views" });
    this.views = new Map();
    this.tabs = new Tabs(list, element(this.root, "div"), VIEWS.map(({ name, title }) => [name, title]), `view-${++viewers}`);
    this.tabs.onShow = (view) => this.change({ view });
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
    for (const fault of FAULTS) element(this.root, "p", "faint", fault);
    this.load(host.about, host.buffer);
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(this.root);
  }

  controls() {
    const row = element(this.root, "div", "row");
    this.order = choice(row, "order", [], () => this.change({ order: { name: this.order.value, reversed: false } }));
    this.reverseButton = button(row, "", () =>
      this.change({ order: { ...this.state.order, reversed: !this.state.order.reversed } }));
    this.orderButton = button(row, "", () => (this.arrangement ? this.arrange() : this.change({ order: this.state.order })));
    if (this.host.compare) {
      [this.kind, this.way] = [["or by", DIFFERENCES], ["of", BY]].map(([text, listed]) => choice(row, text, listed, () => this.arrange()));
    }
    this.size = field(row, "size", "range", "96", { min: "48", max: "192", step: "16" });
    this.size.addEventListener("input", () => {
      this.gallery.size = Number(this.size.value);
      this.gallery.resize();
    });
  }

  close() {
    this.observer.disconnect();
    for (const name of this.views.keys()) this.call("close", name);
    this.root.remove();
  }

  // -- births -----------------------------------------------------------------------------------

  /** Show other births. */
  load(about, buffer) {
    for (const name of this.views.keys()) {
      this.call("close", name);
      this.tabs.panes[name].replaceChildren();
    }
    this.views.clear();
    this.births = new Births(about, buffer);
    this.tiles.forget();
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
    this.update({ chosen, brushes, axes, births: true });
  }

  /** Sort the new births into the list, and tell the view that no more births come. */
  settle() {
    const { order } = this.state;
    this.update(this.newCount && !this.arrangement ? { order, ended: true } : { ended: true });
    if (this.gallery.active >= 0) this.gallery.activate(this.gallery.active);
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

  /** Choose a birth (`isAdded`: with the others), and bring it into view; it may not pass the filter. */
  show(id, isAdded) {
    const others = isAdded ? this.state.chosen.filter((one) => one !== id) : [];
    this.change({ chosen: isAdded && this.state.chosen.includes(id) ? others : [...others, id] });
    const place = this.rows.indexOf(this.births.row(id));
    if (place >= 0) this.gallery.activate(place);
    else {
      this.gallery.active = -1;
      this.detail(this.births.row(id));
    }
  }

  showFacts(about) {
    this.title.textContent = about.title;
    this.credit.textContent =
      `The colour scale of all maps covers heights from 0 to ${number(about.highest)} m. ${about.credit}`;
    offer(this.order, this.births.columns.map((one) => one.name));
    this.order.value = this.state.order.name;
  }

  // -- state ------------------------------------------------------------------------------------

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

  /** Show changes of the state; `births`: there are more; `ended`: no more come. */
  update({ births, ended, ...changes }) {
    this.pending = null;
    Object.assign(this.state, changes);
    const { chosen, brushes, order } = this.state;
    if ("brushes" in changes) {
      this.mask = this.births.matches(brushes);
      if (this.page.open && !this.isFromPanel) this.open(this.page.open);
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
    const isOther = "brushes" in changes || "order" in changes;
    if (isOther) this.rows = this.sortedRows.filter((row) => this.mask[row]);
    if ("chosen" in changes) {
      this.gallery.chosen = new Set(chosen);
      this.page.chosen = chosen.map((id) => this.births.row(id)).filter((row) => row >= 0);
    }
    Object.assign(this.page, { births: this.births, about: this.births.about, mask: this.mask, rows: this.rows, by: this.by });
    if ("view" in changes) this.turn();
    else this.call("update", this.state.view, { ...changes, ...(births && { births }), ...(ended && { ended }) });
    if (isOther) {
      this.gallery.anchor = -1;
      this.gallery.show(this.births, this.rows, this.by);
    } else if ("chosen" in changes) this.gallery.draw();
    this.emptyText.hidden = this.rows.length > 0;
    const parts = [`${countText(this.rows.length)} of ${countText(this.births.count)} births pass the filter`];
    parts.push(`${countText(this.page.chosen.length)} chosen`);
    this.count.textContent = parts.join(", ");
    const awake = this.gallery.active < 0 ? this.page.chosen.at(-1) : this.rows[this.gallery.active];
    this.detail(awake === undefined ? -1 : awake);
  }

  resize() {
    const width = this.root.clientWidth;
    if (!width || width === this.width) return;
    this.width = width;
    this.gallery.resize();
    this.call("resize", this.state.view);
    this.call("draw", this.state.view);
  }

  drawTiles() {
    this.gallery.drawSoon();
    if (this.page.row >= 0) this.detail(this.page.row);
  }

  // -- the views --------------------------------------------------------------------------------

  /** Show the view of the state, opened at first use; the first suitable view in place of an unsuitable one. */
  turn() {
    const suits = VIEWS.filter((view) => this.attempt(view.name, () => view.suits(this.page)));
    const view = suits.find(({ name }) => name === this.state.view) || suits.find(({ name }) => name === "axes") || suits[0];
    this.state.view = view.name;
    this.tabs.offer(suits.map(({ name }) => name), view.name);
    this.open(null);
    const isNew = !this.views.has(view.name), pane = this.tabs.panes[view.name];
    if (isNew) this.views.set(view.name, this.attempt(view.name, () => view.open(pane, this.page, this.hands)) || {});
    this.call("update", view.name, { ...this.state, births: true });
    if (!isNew) this.call("resize", view.name);
  }

  /** Call a method of a view, if it has the method; a fault of a view stays in its pane. */
  call(method, name, ...given) {
    const view = this.views.get(name);
    return view && view[method] ? this.attempt(name, () => view[method](...given)) : undefined;
  }

  attempt(name, act) {
    try {
      return act();
    } catch (error) {
      const pane = this.tabs.panes[name], text = `The view ${name} failed: ${error.message}`;
      if (!pane.textContent.includes(text)) element(pane, "p", "", text, { role: "alert" });
      return undefined;
    }
  }

  // -- one axis, one birth -------------------------------------------------------------------------

  /** Open the panel of a column, in the terms of the view; none for null. */
  open(name, isByUser = false) {
    const was = document.activeElement, { view } = this.state;
    this.page.open = name;
    this.panel.hidden = !name;
    this.panel.setAttribute("aria-label", name ? `axis ${name}` : "axis");
    if (isByUser) this.call("draw", view);
    if (!name) return;
    const kept = this.panel.contains(was) ? [...this.panel.querySelectorAll("input, button")].indexOf(was) : -1;
    const first = axisPanel(this.panel, this.births.byName.get(name), brushOf(this.state.brushes, name), {
      brush: (brush) => {
        this.isFromPanel = true; // which then stays as it is under the hand
        this.change({ brushes: { ...this.state.brushes, [name]: brush } });
        this.isFromPanel = false;
      },
      clear: () => this.change({ brushes: { ...this.state.brushes, [name]: [] } }),
      actions: this.call("actionsOf", view, name) || [],
      close: () => {
        const head = this.call("headOf", view, name);
        this.open(null, true);
        if (head) head.focus();
      },
    });
    if (isByUser) first.focus();
    else if (kept >= 0) ([...this.panel.querySelectorAll("input, button")][kept] || first).focus();
  }

  /** Show the numbers of a birth, and draw it in the view. */
  detail(row) {
    this.page.row = row;
    this.page.active = this.gallery.active >= 0 ? row : -1;
    this.call("draw", this.state.view);
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
      const pair = element(list, "div", "fact", "", column.wanted ? { title: column.wanted } : {});
      element(pair, "span", "faint", column.name.replaceAll("_", " "));
      element(pair, "span", "", column.text(row));
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
  const send = (message) => new Promise((resolve, reject) => {
    const request = `${own}-${++count}`;
    waiting.set(request, { resolve, reject });
    model.send({ ...message, request });
  });
  const receive = (answer, buffers) => {
    const one = answer && waiting.get(answer.request);
    if (!one) return; // an answer to another view
    waiting.delete(answer.request);
    if (answer.error) one.reject(new Error(answer.error));
    else one.resolve("value" in answer ? answer.value : { ...answer, image: new Blob([buffers[0]], { type: answer.kind }) });
  };
  const viewer = new Viewer(el, {
    about: model.get("about"),
    buffer: model.get("births"),
    state: Object.fromEntries(STATE.map((name) => [name, model.get(name)])),
    save(changes) {
      for (const name of STATE) if (name in changes) model.set(name, changes[name]);
      model.save_changes();
    },
    tiles: (tiles, side) => send({ tiles, side }),
    part: (part) => send({ part }),
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
