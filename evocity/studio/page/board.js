import { keepChildren, showValues, unchangedText } from "./breed.js";
import { announce, attempt, pause, readyWorkers, SEEDS, showBlob } from "./controls.js";
import { Export } from "./export.js";
import { drawLayers, frame, loadLock } from "./overlay.js";
import { FIELD, Layers } from "./layers.js";
import { imageOf } from "./live_map.js";
import { button, choice, element, field, fitCanvas, offer, tick } from "./elements.js";

/** Milliseconds between a change of the drawing and its child, and between two looks at the child. */
const SOON = 250, LOOK = 120;
/** Operators that breed by a drawing: macro-blocks, or a λ painted in cells. */
const OPERATORS = [
  ["pavement_fusion", "macro-blocks", "You place squares on the map, and the second parent replaces the first parent inside these squares."],
  ["region_fusion", "regions", "You place squares of the second parent; each square grows to include every building that it touches."],
  ["interpolation", "share λ of the second parent in each lifs", "The number λ that you paint sets the share of the second parent in each lifs (affine map)."],
  ["stepwise", "share λ of the second parent in each decoding step", "The number λ that you paint sets the share of the second parent in each step of decoding."],
  ["lambda_field", "share λ of street blocks from the second parent", "The number λ that you paint sets the share of street blocks with buildings from the second parent."],
];
/** Tools that mark cells: the layer and an explanation. */
const MARKS = { lock: ["locked", "In the cells that you mark, the child keeps the building heights of the first parent."],
  mask: ["within", "The measures use only the cells that you mark, or the whole map if you mark no cell."] };
const BRUSHES = [1, 3, 7, 15];
const WAYS = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] };

/** The drawing board: two picked parents on the `stage`; their child is bred during drawing. `on`: ids(), births(),
 * highest(), trouble(error). */
export class Board {
  constructor(parent, stage, server, on) {
    [this.server, this.on, this.stage] = [server, on, stage];
    this.emptyText = element(parent, "p", "faint", "Pick two births, then draw on the map of the first birth. Wherever you draw, the child gets the map of the second birth.");
    this.form = element(parent, "form");
    this.form.addEventListener("submit", (event) => event.preventDefault());
    const first = element(this.form, "div", "row");
    this.parents = ["first", "second"].map((text) => choice(first, `${text} parent`, []));
    for (const one of this.parents) one.addEventListener("change", () => this.load());
    button(first, "swap", () => this.swap());
    this.operator = choice(element(this.form, "div", "row"), "method", OPERATORS.map(([name, text]) => [name, text]));
    this.words = element(this.form, "p", "faint");
    const tools = element(this.form, "div", "row", "", { role: "group", "aria-label": "drawing tools" });
    this.tools = new Map([["lay", ""], ["lock", "lock"], ["mask", "mask"]].map(([tool, text]) =>
      [tool, button(tools, text, () => this.use(tool))]));
    this.eraser = tick(tools, "erase");
    this.toolText = element(this.form, "p", "faint");
    this.sizes = element(this.form, "div", "row");
    this.side = choice(this.sizes, "side", []);
    this.tolerance = choice(this.sizes, "height difference along the outline of a square", [["1000", "any"], ["12", "at most 12 m"],
      ["6", "at most 6 m"], ["3", "at most 3 m"]]);
    this.paints = element(this.form, "div", "row");
    this.brush = choice(this.paints, "brush", BRUSHES.map((one) => [String(one), `squares of ${one} × ${one} cells`]));
    this.brush.value = "3";
    this.level = field(this.paints, "λ, share of the second", "number", "1", { min: "0", max: "1", step: "0.1" });
    this.files = element(this.form, "div", "row");
    this.file = field(this.files, "mark from a picture", "file", "", { accept: "image/*" });
    this.file.addEventListener("change", () => this.mark());
    const last = element(this.form, "div", "row");
    this.undo = button(last, "undo", () => this.back());
    this.clear = button(last, "clear all", () => this.change(() => this.layers.blank()));
    this.seed = field(last, "seed", "number", "0", SEEDS);
    for (const one of [this.operator, this.tolerance, this.seed]) one.addEventListener("change", () => this.changed());
    for (const one of [this.side, this.brush]) one.addEventListener("change", () => (one === this.side ? this.changed() : this.draw()));
    element(this.form, "p", "faint", "Keys on the map: arrows move, with Shift four times as far; Enter draws, Delete erases.");
    this.state = element(parent, "p", "faint", "", { role: "status" });
    this.facts = element(parent, "div");
    this.keep = button(parent, "save the child and a recipe", () => this.keepIt());
    this.message = element(parent, "p", "", "", { role: "status" });
    this.export = new Export(parent, server, {
      what: () => this.bred && { brood: this.bred.brood, children: [0], board: true }, words: () => "the child",
    });
    const figure = element(stage, "figure");
    this.title = element(figure, "figcaption");
    this.canvas = element(figure, "canvas", "", "", { tabindex: "0", role: "application", "aria-label": "map to draw on" });
    this.announcement = element(figure, "p", "faint", "", { "aria-live": "polite" });
    this.child = element(stage, "figure");
    element(this.child, "figcaption", "", "child");
    this.image = element(this.child, "img", "", "", { alt: "map of heights of the child, north up" });
    this.listen();
    this.inform();
  }

  // -- parents -----------------------------------------------------------------------------------

  /** The pane is visible. */
  async open() {
    this.inform();
    if (this.about) this.draw();
    if (this.about && this.isNew) this.breed();
    if (this.on.ids().length > 1 && !this.isBusy) await attempt(this.on.trouble, () => this.ready());
  }

  /** Prepare workers; wait while studio breeds elsewhere. Whether the board is still visible. */
  async ready() {
    const show = (text) => announce(this.state, text);
    return (await readyWorkers(this.server, { parents: this.pair, board: true }, show, () => !this.stage.hidden)) !== null;
  }

  get pair() { return this.parents.map((one) => Number(one.value)); }

  /** Show the parts that depend on the picks. */
  inform() {
    const ids = this.on.ids();
    const isAble = ids.length > 1;
    this.emptyText.hidden = isAble;
    this.form.hidden = !isAble;
    this.stage.classList.toggle("evocity-idle", !isAble);
    this.parents.forEach((select, place) => {
      const was = Number(select.value);
      offer(select, ids.map((id) => [id, String(id)]));
      if (isAble) select.value = String(ids.includes(was) && select.dataset.chosen ? was : ids[place]);
      if (isAble) select.dataset.chosen = "1";
    });
    if (!isAble) this.about = null;
    else if (!this.stage.hidden && (!this.about || this.loadedPair !== this.pair.join())) this.load();
    this.showState();
  }

  swap() {
    const [first, second] = this.pair;
    [this.parents[0].value, this.parents[1].value] = [String(second), String(first)];
    this.load();
  }

  /** Load both parents; other maps begin an empty drawing. */
  async load() {
    const ids = this.pair, key = ids.join();
    if (this.on.ids().length < 2) return;
    this.loadedPair = key;
    try {
      const { about, content } = await this.server.getFramed("board", { ids: key });
      const [lock, ...maps] = await Promise.all([this.lock || loadLock(this.server), ...ids.map((id) => this.server.getFramed("heights", { id }))]);
      if (key !== this.pair.join()) return;
      const isNew = !this.about || ["height", "width", "cell", "grid"].some((one) => this.about[one] !== about[one]);
      [this.about, this.lock] = [about, lock];
      this.lifs = new Int32Array(content.slice().buffer);
      this.maps = maps.map((one) => this.picture(one));
      this.title.textContent = `map of birth ${ids[0]}, with parts of birth ${ids[1]}`;
      if (isNew) this.begin();
      this.on.trouble(null);
      this.changed();
    } catch (error) {
      if (key !== this.pair.join()) return;
      this.about = null;
      this.on.trouble(error);
    }
  }

  picture({ about: { height, width }, content }) {
    const canvas = element(null, "canvas"), heights = new Float32Array(content.slice().buffer);
    [canvas.width, canvas.height] = [width, height];
    canvas.getContext("2d").putImageData(imageOf({ heights, rows: height, columns: width, highest: this.on.highest() }), 0, 0);
    return canvas;
  }

  begin() {
    const { height, width, cell, grid, metres } = this.about;
    this.layers = new Layers({ height, width, cell });
    const most = Math.floor(Math.min(height, width) / grid);
    const sides = [2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128].filter((one) => one < most);
    sides.push(most);
    offer(this.side, sides.map((one) => [one, `${+(one * grid * metres).toFixed(2)} m`]));
    const usual = sides.filter((one) => one <= Math.min(most / 2, 32));
    this.side.value = String(usual[Math.min(usual.length - 1, Math.floor(usual.length / 2))] ?? sides[0]);
    this.at = [height / 2, width / 2];
    this.use("lay");
  }

  // -- drawing -----------------------------------------------------------------------------------

  /** The layer that the tool changes. */
  get layer() { return this.tool in MARKS ? this.layers[MARKS[this.tool][0]] : this.layers.painted; }
  get isPainted() { return !["pavement_fusion", "region_fusion"].includes(this.operator.value); }
  get inCells() { return this.isPainted || this.tool in MARKS; }

  use(tool) {
    this.tool = tool;
    this.draw();
    this.showState();
  }

  /** The place of the cursor, in cells or in squares of the grid: row, column, side, and the unit in px. */
  get spot() {
    const { height, width, cell, grid } = this.about, unit = this.inCells ? cell : grid;
    const side = Number((this.inCells ? this.brush : this.side).value);
    const [row, column] = this.at.map((px, axis) => {
      const there = Math.floor((axis ? width : height) / unit) - (this.inCells ? 1 : side);
      return Math.max(this.inCells ? -side : 0, Math.min(there, Math.round(px / unit - side / 2)));
    });
    return { row, column, side, unit };
  }

  listen() {
    const { canvas } = this;
    const move = (event) => {
      const box = canvas.getBoundingClientRect();
      this.at = [((event.clientY - box.top) / box.height) * this.about.height, ((event.clientX - box.left) / box.width) * this.about.width];
    };
    canvas.addEventListener("pointerdown", (event) => {
      if (!this.about || event.button) return;
      canvas.setPointerCapture(event.pointerId);
      this.layers.remember();
      this.isPressed = true;
      move(event);
      this.lay(this.eraser.checked);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!this.about) return;
      move(event);
      if (this.isPressed && (this.inCells || this.eraser.checked)) this.lay(this.eraser.checked);
      else this.draw();
    });
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => { this.isPressed = false; });
    canvas.addEventListener("focus", () => this.about && this.draw());
    canvas.addEventListener("blur", () => this.about && this.draw());
    canvas.addEventListener("keydown", (event) => {
      if (!this.about || event.ctrlKey || event.metaKey || event.altKey) return;
      const way = WAYS[event.key], { side, unit } = this.spot;
      if (way) {
        const step = unit * (this.inCells ? side : Math.max(1, Math.floor(side / 2))) * (event.shiftKey ? 4 : 1);
        const most = [this.about.height - 1, this.about.width - 1];
        this.at = this.at.map((px, axis) => Math.max(0, Math.min(most[axis], px + step * way[axis])));
        this.draw();
        this.announce("");
      } else if (["Enter", " ", "Delete", "Backspace"].includes(event.key)) {
        this.layers.remember();
        const isErased = ["Delete", "Backspace"].includes(event.key) || this.eraser.checked;
        this.lay(isErased);
        this.announce(isErased ? "erased" : "drawn");
      } else return;
      event.preventDefault();
    });
    new ResizeObserver(() => this.about && this.draw()).observe(this.canvas.parentElement);
  }

  /** Announce the place of the cursor, and the drawing there. */
  announce(done) {
    const { row, column, unit } = this.spot, metres = unit * this.about.metres;
    const [y, x] = this.at.map((px) => Math.floor(px / this.about.cell));
    const { columns, painted, blocks, locked, within } = this.layers, here = y * columns + x;
    const parts = [`${Math.round(row * metres)} m from the north edge and ${Math.round(column * metres)} m from the west edge of the map`];
    if (this.isPainted) parts.push(`λ ${+painted[here].toFixed(2)}`);
    else parts.push(`${blocks.length} macro-block${blocks.length === 1 ? "" : "s"}`);
    if (locked[here]) parts.push("locked");
    if (within.includes(1)) parts.push(within[here] ? "measured" : "not measured");
    if (done) parts.unshift(done);
    this.announcement.textContent = parts.join(", ");
  }

  lay(isErased) {
    const spot = this.spot, { row, column, side } = spot, { blocks } = this.layers;
    if (!this.inCells) {
      const [y, x] = this.at.map((px) => px / this.about.grid);
      const isHere = ([top, left]) => y >= top && y < top + side && x >= left && x < left + side;
      const last = blocks.findLastIndex(isHere);
      if (isErased && last >= 0) blocks.splice(last, 1);
      if (!isErased && !blocks.some(([top, left]) => top === row && left === column)) blocks.push([row, column]);
    } else {
      const level = this.tool in MARKS ? 1 : Math.max(0, Math.min(1, Number(this.level.value) || 0));
      this.layers.fill(this.layer, spot, isErased ? 0 : level);
    }
    this.changed();
  }

  change(act) {
    this.layers.remember();
    act();
    this.changed();
  }

  back() {
    if (!this.layers?.steps.length) return;
    this.layers.back();
    this.changed();
  }

  /** Replace the marks by those of a picture. */
  async mark() {
    const [file] = this.file.files, { layers, tool } = this;
    if (!file || !layers || !(tool in MARKS)) return;
    const layer = new Uint8Array(layers.painted.length);
    await attempt(this.on.trouble, async () => {
      const count = await layers.mark(layer, file);
      this.change(() => { layers[MARKS[tool][0]] = layer; });
      this.announcement.textContent = `${tool}: the picture ${file.name} marks ${count} of ${layer.length} cells`;
    });
    this.file.value = "";
  }

  // -- picture -----------------------------------------------------------------------------------

  draw() {
    if (!this.about || this.stage.hidden) return;
    const { height, width, grid } = this.about, [ours, theirs] = this.maps;
    const wide = Math.max(120, Math.min(this.canvas.parentElement.clientWidth, 720)), scale = wide / width;
    const context = fitCanvas(this.canvas, wide, height * scale), side = Number(this.side.value) * grid;
    drawLayers(context, this.layers, { ours, theirs, grid, side, scale, isPainted: this.isPainted, lock: this.lock });
    const spot = this.spot, size = spot.side * spot.unit * scale;
    frame(context, spot.column * spot.unit * scale, spot.row * spot.unit * scale, size, size, 2);
  }

  // -- the child ---------------------------------------------------------------------------------

  /** The drawing changed: draw it at once, and breed soon. */
  changed() {
    this.draw();
    this.showState();
    if (!this.about) return;
    clearTimeout(this.timer);
    this.isNew = true;
    this.timer = setTimeout(() => this.breed(), SOON);
  }

  get parameters() {
    const { grid, metres, lifs } = this.about, side = Number(this.side.value) * grid * metres;
    const name = this.operator.value;
    if (!this.isPainted) {
      const places = this.layers.blocks.map((corner) => corner.map((one) => one * grid * metres));
      const values = { side_min: side, side_max: side, fill: 1, base: 1, margin: 0, tolerance: Number(this.tolerance.value), places };
      return name === "region_fusion" ? { ...values, tries: null } : values;
    }
    if (name === "lambda_field") return { side: FIELD, values: this.layers.field() };
    const share = Array.from({ length: lifs }, (_, k) => +(1 - this.layers.mean(...this.lifs.subarray(3 * k, 3 * k + 3))).toFixed(4));
    return { share, stepwise: name === "stepwise" };
  }

  /** Breed a child of the drawing, and another one if the drawing changed meanwhile. */
  async breed() {
    if (this.isBusy) return;
    this.isBusy = true;
    this.showState();
    await attempt(this.on.trouble, async () => {
      while (this.isNew && this.about && !this.stage.hidden) {
        if (!await this.ready()) break; // the board is hidden
        while ((await this.server.getJson("brood", { board: 1 })).busy) await pause(LOOK);
        this.isNew = false;
        const [locked, within] = [this.layers.locked, this.layers.within].map((layer) => this.layers.marked(layer));
        let state = await this.server.postJson("breed", {
          operators: [this.operator.value === "stepwise" ? "interpolation" : this.operator.value],
          parameters: this.parameters, parents: this.pair, count: 1, seed: Number(this.seed.value) || 0, board: true,
          drawing: (locked || within) && { locked, within },
        });
        this.shownBrood = null;
        while (true) {
          await this.showChild(state);
          if (!state.busy) break;
          await pause(LOOK);
          state = await this.server.getJson("brood", { board: 1 });
        }
      }
    });
    this.isBusy = false;
    this.showState();
  }

  async showChild({ brood, children: [child], error, marked }) {
    this.marked = marked;
    this.bred = child && ["bred", "measured"].includes(child.stage) ? { brood, child } : null;
    if (this.bred && this.shownBrood !== brood) {
      this.shownBrood = brood;
      showBlob(this.image, await this.server.getBlob("brood-picture", { board: 1, brood, id: 0 }));
    }
    this.showState(error || (child && child.error) || "");
  }

  showState(error = this.fault) {
    this.fault = error;
    const operator = OPERATORS.find(([name]) => name === this.operator.value);
    this.words.textContent = operator[2];
    this.tools.get("lay").textContent = this.isPainted ? "paint λ" : operator[1];
    for (const [tool, button] of this.tools) button.setAttribute("aria-pressed", String(tool === this.tool));
    this.sizes.hidden = this.isPainted;
    this.paints.hidden = !this.inCells;
    this.files.hidden = this.toolText.hidden = !(this.tool in MARKS);
    this.toolText.textContent = this.toolText.hidden ? "" : MARKS[this.tool][1];
    this.level.parentElement.hidden = !this.isPainted || this.tool in MARKS;
    this.undo.disabled = !this.layers?.steps.length;
    this.image.hidden = !this.image.src;
    this.keep.hidden = !this.bred;
    this.keep.disabled = this.isBusy;
    this.export.root.hidden = !this.bred;
    this.export.inform();
    const child = this.bred?.child, state = child ? `child ${child.stage}` : this.isBusy ? "breeding the child …" : "";
    const isEmpty = !this.isPainted && this.layers && !this.layers.blocks.length;
    announce(this.state, error || (child?.unchanged ? (isEmpty ? "Nothing is drawn yet, so the child is the first parent." : unchangedText(child)) : state));
    this.facts.replaceChildren();
    if (this.bred) showValues(this.facts, this.bred.child, this.on.births(), this.marked);
  }

  keepIt() { return keepChildren(this, { brood: this.bred.brood, children: [0], picks: this.on.ids().slice(0, 16), board: true }); }
}
