import { tellKept, tellValues } from "./breed.js";
import { drawLayers, frame } from "./drawn.js";
import { FIELD, Layers } from "./layers.js";
import { made, sized } from "./made.js";
import { ramp } from "./ramp.js";

/** Milliseconds after which a drawing is bred, and between two looks at its child. */
const SOON = 250, LOOK = 120;
/** What breeds by a drawing: macro-blocks, or a λ painted in cells. */
const OPERATORS = [
  ["pavement_fusion", "macro-blocks", "Squares of the second parent, laid into the first where you put them."],
  ["region_fusion", "regions", "As macro-blocks, but each grows over the buildings that it touches."],
  ["interpolation", "λ, lifs by lifs", "A painted λ: how much of each lifs is the second parent's."],
  ["stepwise", "λ, step by step", "A painted λ that mixes both decodings at every step."],
  ["lambda_field", "λ, by street blocks", "A painted λ tells how many street blocks of each part get the second parent's fabric."],
];
/** What is marked in cells, its layer, and in words. */
const MARKS = { lock: ["locked", "Where you mark, the child has the first parent's heights."],
  mask: ["within", "Measures are taken of what you mark alone, of child and parents; of the whole where nothing is marked."] };
const BRUSHES = [1, 3, 7, 15];
const WAYS = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] };

/** Two picked parents, drawn over on the `stage`; their child is bred while one draws. `on`: ids(),
 * births(), highest(), trouble(error). */
export class Board {
  constructor(parent, stage, server, on) {
    [this.server, this.on, this.stage] = [server, on, stage];
    this.nobody = made(parent, "p", "faint", "Pick two births: you draw on the map of one where the other shall be.");
    this.form = made(parent, "form");
    this.form.addEventListener("submit", (event) => event.preventDefault());
    const first = made(this.form, "div", "row");
    this.parents = ["on", "of"].map((text) => made(made(first, "label", "", `${text} birth `), "select"));
    for (const one of this.parents) one.addEventListener("change", () => this.load());
    this.button(first, "swap", () => this.swap());
    this.operator = this.select(made(this.form, "div", "row"), "the child has ", OPERATORS.map(([name, text]) => [name, text]));
    this.words = made(this.form, "p", "faint");
    const tools = made(this.form, "div", "row", "", { role: "group", "aria-label": "what is drawn" });
    this.tools = new Map([["lay", ""], ["lock", "lock"], ["mask", "mask"]].map(([tool, text]) =>
      [tool, this.button(tools, text, () => this.use(tool))]));
    this.eraser = made(made(tools, "label", "", "take away "), "input", "", "", { type: "checkbox" });
    this.meant = made(this.form, "p", "faint");
    this.sizes = made(this.form, "div", "row");
    this.side = this.select(this.sizes, "side ", []);
    this.tolerance = this.select(this.sizes, "where outlines differ by ", [["1000", "any step"], ["12", "12 m at most"],
      ["6", "6 m at most"], ["3", "3 m at most"]]);
    this.paints = made(this.form, "div", "row");
    this.brush = this.select(this.paints, "brush ", BRUSHES.map((one) => [String(one), `${one} × ${one} cells`]));
    this.brush.value = "3";
    this.level = made(made(this.paints, "label", "", "λ of the second "), "input", "", "", { type: "number", min: "0", max: "1", step: "0.1" });
    this.level.value = "1";
    this.files = made(this.form, "div", "row");
    this.file = made(made(this.files, "label", "", "or mark from a picture "), "input", "", "", { type: "file", accept: "image/*" });
    this.file.addEventListener("change", () => this.mark());
    const last = made(this.form, "div", "row");
    this.undo = this.button(last, "undo", () => this.back());
    this.clear = this.button(last, "clear all", () => this.change(() => this.layers.blank()));
    this.seed = made(made(last, "label", "", "seed "), "input", "", "", { type: "number", min: "0", max: "9007199254740991", step: "1" });
    this.seed.value = "0";
    for (const one of [this.operator, this.tolerance, this.seed]) one.addEventListener("change", () => this.changed());
    for (const one of [this.side, this.brush]) one.addEventListener("change", () => (one === this.side ? this.changed() : this.draw()));
    made(this.form, "p", "faint", "By keys: go on the map by the arrows, with Shift by four; Enter draws, Delete takes away.");
    this.state = made(parent, "p", "faint", "", { role: "status" });
    this.facts = made(parent, "div");
    this.keep = this.button(parent, "keep the child with a recipe", () => this.keepIt());
    this.said = made(parent, "p", "", "", { role: "status" });
    const drawn = made(stage, "figure");
    this.title = made(drawn, "figcaption");
    this.canvas = made(drawn, "canvas", "", "", { tabindex: "0", role: "application", "aria-label": "the map that you draw on" });
    this.spoken = made(drawn, "p", "faint", "", { "aria-live": "polite" });
    this.child = made(stage, "figure");
    made(this.child, "figcaption", "", "their child");
    this.image = made(this.child, "img", "", "", { alt: "map of heights of the child, north up" });
    this.hands();
    this.inform();
  }

  button(parent, text, act) {
    const found = made(parent, "button", "", text, { type: "button" });
    found.addEventListener("click", act);
    return found;
  }

  select(parent, text, options) {
    const found = made(made(parent, "label", "", text), "select");
    for (const [value, label] of options) made(found, "option", "", label, { value });
    return found;
  }

  // -- parents -----------------------------------------------------------------------------------

  /** The pane is seen. */
  async open() {
    this.inform();
    try {
      if (this.on.ids().length > 1) await this.server.told("ready", { parents: this.pair, board: true });
    } catch (error) {
      this.on.trouble(error);
    }
    if (!this.about) await this.load();
    else this.draw();
  }

  get pair() { return this.parents.map((one) => Number(one.value)); }

  /** What depends on who is picked. */
  inform() {
    const ids = this.on.ids();
    const isAble = ids.length > 1;
    this.nobody.hidden = isAble;
    this.form.hidden = !isAble;
    this.stage.classList.toggle("evocity-idle", !isAble);
    this.parents.forEach((select, place) => {
      const was = Number(select.value);
      select.replaceChildren(...ids.map((id) => made(null, "option", "", String(id), { value: id })));
      if (isAble) select.value = String(ids.includes(was) && select.dataset.chosen ? was : ids[place]);
      if (isAble) select.dataset.chosen = "1";
    });
    if (!isAble) this.about = null;
    else if (!this.stage.hidden && (!this.about || this.drawnOn !== this.pair.join())) this.load();
    this.tell();
  }

  swap() {
    const [first, second] = this.pair;
    [this.parents[0].value, this.parents[1].value] = [String(second), String(first)];
    this.load();
  }

  /** Look at both parents; begin anew on other ones. */
  async load() {
    const ids = this.pair, key = ids.join();
    if (this.on.ids().length < 2) return;
    this.drawnOn = key;
    try {
      const { about, content } = await this.server.framed("board", { ids: key });
      const maps = await Promise.all(ids.map((id) => this.server.framed("heights", { id })));
      if (key !== this.pair.join()) return;
      const isNew = !this.about || ["height", "width", "cell", "grid"].some((one) => this.about[one] !== about[one]);
      this.about = about;
      this.lifs = new Int32Array(content.slice().buffer);
      this.maps = maps.map((one) => this.picture(one));
      this.title.textContent = `birth ${ids[0]}, drawn over with birth ${ids[1]}`;
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
    const colours = ramp(new Float32Array(content.slice().buffer), this.on.highest());
    const canvas = made(null, "canvas");
    [canvas.width, canvas.height] = [width, height];
    const image = new ImageData(width, height);
    for (let k = 0; k < height * width; k++) {
      image.data.set(colours.subarray(3 * k, 3 * k + 3), 4 * k);
      image.data[4 * k + 3] = 255;
    }
    canvas.getContext("2d").putImageData(image, 0, 0);
    return canvas;
  }

  begin() {
    const { height, width, cell, grid, metres } = this.about;
    this.layers = new Layers({ height, width, cell });
    const most = Math.floor(Math.min(height, width) / grid / 2);
    const sides = [2, 3, 4, 6, 8, 12, 16, 24, 32].filter((one) => one <= most);
    if (!sides.length) sides.push(1);
    this.side.replaceChildren(...sides.map((one) => made(null, "option", "", `${+(one * grid * metres).toFixed(2)} m`, { value: one })));
    this.side.value = String(sides[Math.min(sides.length - 1, Math.floor(sides.length / 2))]);
    this.at = [height / 2, width / 2];
    this.use("lay");
  }

  // -- the hand ----------------------------------------------------------------------------------

  /** What the hand marks, or paints. */
  get layer() { return this.tool in MARKS ? this.layers[MARKS[this.tool][0]] : this.layers.painted; }
  get isPainted() { return !["pavement_fusion", "region_fusion"].includes(this.operator.value); }
  get inCells() { return this.isPainted || this.tool in MARKS; }

  use(tool) {
    this.tool = tool;
    this.draw();
    this.tell();
  }

  /** Where the hand is, in cells or in squares of the grid: row, column, side, px of one. */
  get spot() {
    const { height, width, cell, grid } = this.about, unit = this.inCells ? cell : grid;
    const side = Number((this.inCells ? this.brush : this.side).value);
    const [row, column] = this.at.map((px, axis) => {
      const there = Math.floor((axis ? width : height) / unit) - (this.inCells ? 1 : side);
      return Math.max(this.inCells ? -side : 0, Math.min(there, Math.round(px / unit - side / 2)));
    });
    return { row, column, side, unit };
  }

  hands() {
    const { canvas } = this;
    const go = (event) => {
      const box = canvas.getBoundingClientRect();
      this.at = [((event.clientY - box.top) / box.height) * this.about.height, ((event.clientX - box.left) / box.width) * this.about.width];
    };
    canvas.addEventListener("pointerdown", (event) => {
      if (!this.about || event.button) return;
      canvas.setPointerCapture(event.pointerId);
      this.layers.remember();
      this.held = true;
      go(event);
      this.lay(this.eraser.checked);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!this.about) return;
      go(event);
      if (this.held && (this.inCells || this.eraser.checked)) this.lay(this.eraser.checked);
      else this.draw();
    });
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => { this.held = false; });
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
        this.say("");
      } else if (["Enter", " ", "Delete", "Backspace"].includes(event.key)) {
        this.layers.remember();
        const isTaken = ["Delete", "Backspace"].includes(event.key) || this.eraser.checked;
        this.lay(isTaken);
        this.say(isTaken ? "taken away" : "drawn");
      } else return;
      event.preventDefault();
    });
    new ResizeObserver(() => this.about && this.draw()).observe(this.canvas.parentElement);
  }

  /** Tell where the cursor is, and what is there. */
  say(done) {
    const { row, column, unit } = this.spot, metres = unit * this.about.metres;
    const [y, x] = this.at.map((px) => Math.floor(px / this.about.cell));
    const { columns, painted, blocks, locked, within } = this.layers, here = y * columns + x;
    const told = [`${Math.round(row * metres)} m from the north, ${Math.round(column * metres)} m from the west`];
    if (this.isPainted) told.push(`λ ${+painted[here].toFixed(2)}`);
    else told.push(`${blocks.length} macro-blocks`);
    if (locked[here]) told.push("locked");
    if (within.includes(1)) told.push(within[here] ? "measured" : "not measured");
    if (done) told.unshift(done);
    this.spoken.textContent = told.join(", ");
  }

  lay(isTaken) {
    const spot = this.spot, { row, column, side } = spot, { blocks } = this.layers;
    if (!this.inCells) {
      const [y, x] = this.at.map((px) => px / this.about.grid);
      const isHere = ([top, left]) => y >= top && y < top + side && x >= left && x < left + side;
      const last = blocks.findLastIndex(isHere);
      if (isTaken && last >= 0) blocks.splice(last, 1);
      if (!isTaken && !blocks.some(([top, left]) => top === row && left === column)) blocks.push([row, column]);
    } else {
      const level = this.tool in MARKS ? 1 : Math.max(0, Math.min(1, Number(this.level.value) || 0));
      this.layers.fill(this.layer, spot, isTaken ? 0 : level);
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

  /** Mark by a file, in place of what is marked. */
  async mark() {
    const [file] = this.file.files, { layers, tool } = this;
    if (!file || !layers || !(tool in MARKS)) return;
    const layer = new Uint8Array(layers.painted.length);
    try {
      const count = await layers.mark(layer, file);
      this.change(() => { layers[MARKS[tool][0]] = layer; });
      this.spoken.textContent = `${tool}: ${count} of ${layer.length} cells are marked by ${file.name}`;
      this.on.trouble(null);
    } catch (error) {
      this.on.trouble(error);
    }
    this.file.value = "";
  }

  // -- what is seen ------------------------------------------------------------------------------

  draw() {
    if (!this.about || this.stage.hidden) return;
    const { height, width, grid } = this.about, [ours, theirs] = this.maps;
    const wide = Math.max(120, Math.min(this.canvas.parentElement.clientWidth, 720)), scale = wide / width;
    const context = sized(this.canvas, wide, height * scale), side = Number(this.side.value) * grid;
    drawLayers(context, this.layers, { ours, theirs, grid, side, scale, isPainted: this.isPainted });
    const spot = this.spot, size = spot.side * spot.unit * scale;
    frame(context, spot.column * spot.unit * scale, spot.row * spot.unit * scale, size, size, 2);
  }

  // -- the child ---------------------------------------------------------------------------------

  /** Something is drawn: it is seen at once, and bred soon. */
  changed() {
    this.draw();
    this.tell();
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
      const found = { side_min: side, side_max: side, fill: 0.5, margin: 0, tolerance: Number(this.tolerance.value), places };
      return name === "region_fusion" ? { ...found, tries: null } : found;
    }
    if (name === "lambda_field") return { side: FIELD, values: this.layers.field() };
    const share = Array.from({ length: lifs }, (_, k) => +(1 - this.layers.mean(...this.lifs.subarray(3 * k, 3 * k + 3))).toFixed(4));
    return { share, stepwise: name === "stepwise" };
  }

  /** A child of what is drawn now, and then of what was drawn meanwhile. */
  async breed() {
    if (this.isBusy) return;
    this.isBusy = true;
    this.tell();
    try {
      while (this.isNew && this.about && !this.stage.hidden) {
        this.isNew = false;
        const [locked, within] = [this.layers.locked, this.layers.within].map((layer) => this.layers.marked(layer));
        await this.rested();
        let told = await this.server.told("breed", {
          operators: [this.operator.value === "stepwise" ? "interpolation" : this.operator.value],
          parameters: this.parameters, parents: this.pair, count: 1, seed: Number(this.seed.value) || 0, board: true,
          drawing: (locked || within) && { locked, within },
        });
        this.seen = null;
        while (true) {
          await this.see(told);
          if (!told.busy) break;
          await new Promise((resolve) => setTimeout(resolve, LOOK));
          told = await this.server.asked("brood", { board: 1 });
        }
        this.on.trouble(null);
      }
    } catch (error) {
      this.on.trouble(error);
    }
    this.isBusy = false;
    this.tell();
  }

  /** Until workers are ready. */
  async rested() {
    while ((await this.server.asked("brood", { board: 1 })).busy) await new Promise((resolve) => setTimeout(resolve, LOOK));
  }

  async see({ brood, children: [child], error, marked }) {
    this.marked = marked;
    this.bred = child && ["bred", "measured"].includes(child.stage) ? { brood, child } : null;
    if (this.bred && this.seen !== brood) {
      this.seen = brood;
      const blob = await this.server.blobOf("brood-picture", { board: 1, brood, id: 0 });
      if (this.address) URL.revokeObjectURL(this.address);
      this.address = URL.createObjectURL(blob);
      this.image.src = this.address;
    }
    this.tell(error || (child && child.error) || "");
  }

  tell(error = this.fault) {
    this.fault = error;
    const found = OPERATORS.find(([name]) => name === this.operator.value);
    this.words.textContent = found[2] + (this.isPainted ? "" : " They take half of the map at most: swap the parents for more.");
    this.tools.get("lay").textContent = this.isPainted ? "paint λ" : found[1];
    for (const [tool, button] of this.tools) button.setAttribute("aria-pressed", String(tool === this.tool));
    this.sizes.hidden = this.isPainted;
    this.paints.hidden = !this.inCells;
    this.files.hidden = this.meant.hidden = !(this.tool in MARKS);
    this.meant.textContent = this.meant.hidden ? "" : MARKS[this.tool][1];
    this.level.parentElement.hidden = !this.isPainted || this.tool in MARKS;
    this.undo.disabled = !this.layers?.steps.length;
    this.image.hidden = !this.image.src;
    this.keep.hidden = !this.bred;
    this.keep.disabled = this.isBusy;
    const text = error || (this.isBusy && !this.bred ? "The child is bred …" : this.bred ? `child ${this.bred.child.stage}` : "");
    if (this.state.textContent !== text) this.state.textContent = text;
    this.facts.replaceChildren();
    if (this.bred) tellValues(this.facts, this.bred.child, this.on.births(), this.marked);
  }

  async keepIt() {
    try {
      tellKept(this.said, await this.server.told("keep", { brood: this.bred.brood, children: [0], picks: this.on.ids().slice(0, 16), board: true }));
      this.on.trouble(null);
    } catch (error) {
      this.on.trouble(error);
    }
  }
}
