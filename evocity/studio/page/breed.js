import { Tiles } from "./tiles.js";
import { made, number, sized } from "./made.js";
import { asked } from "./server.js";

const SIZE = 72, SOON = 120;
/** What takes turns where no operator is named: one of each kind. */
const VARIETY = ["quarter_fusion", "region_fusion", "lambda_crossover", "quarter_refill", "relocation",
  "height_scaling", "interpolation", "mutation"];
const ANY = "several in turn";

/** Children of the picks, one by one; those that are kept. `on`: ids(), births(), trouble(error). */
export class Breed {
  constructor(parent, server, on) {
    [this.server, this.on] = [server, on];
    this.operators = [];
    this.children = [];
    this.kept = new Set();
    this.shown = null;
    this.whose = made(parent, "p", "faint");
    const form = this.form = made(parent, "form");
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.begin();
    });
    const first = made(form, "div", "row");
    this.operator = made(made(first, "label", "", "operator "), "select");
    this.operator.addEventListener("change", () => this.choose());
    const vary = made(first, "label");
    this.vary = made(vary, "input", "", "", { type: "checkbox" });
    this.vary.checked = true;
    vary.append("vary how much is whose");
    this.words = made(form, "p", "faint");
    this.more = made(form, "details");
    made(this.more, "summary", "", "parameters");
    this.parameters = made(this.more, "div", "parameters");
    const second = made(form, "div", "row");
    this.count = this.field(second, "children", "12", { min: "1", max: "24" });
    this.seed = this.field(second, "seed", "0", { min: "0", max: "9007199254740991" });
    this.go = made(second, "button", "", "breed", { type: "submit" });
    this.stop = made(second, "button", "", "stop", { type: "button" });
    this.stop.addEventListener("click", () => this.ask("stop", {}));
    this.state = made(parent, "p", "faint", "", { role: "status" });
    this.left = made(parent, "details");
    made(this.left, "summary", "", "measures that children are not given");
    this.reasons = made(this.left, "ul");
    this.grid = made(parent, "div", "children", "", { role: "group", "aria-label": "children" });
    this.one = made(parent, "div");
    this.keep = made(parent, "button", "", "", { type: "button" });
    this.keep.addEventListener("click", () => this.keepThese());
    this.unmarked = made(parent, "span", "faint", " Click a child and tick “keep it”, or click it twice.");
    this.said = made(parent, "p", "", "", { role: "status" });
    this.inform();
    this.tell({ brood: 0, busy: false, error: null, left: {}, children: [] });
  }

  field(parent, text, value, limits) {
    const found = made(made(parent, "label", "", `${text} `), "input", "", "", { type: "number", step: "1", required: "", ...limits });
    found.value = value;
    return found;
  }

  /** The pane is seen: what there is, and workers, are asked for. */
  async open() {
    try {
      if (!this.operators.length) this.operators = (await asked("operators")).operators;
      this.inform();
      this.go.disabled = true; // until it is known whether workers are made ready
      this.tell(await this.server.told("ready", { parents: this.on.ids().slice(0, 16) }));
      this.follow();
    } catch (error) {
      this.inform();
      this.on.trouble(error);
    }
  }

  /** What depends on who is picked. */
  inform() {
    const ids = this.on.ids();
    this.whose.textContent = ids.length ? `Parents are the picks: ${ids.slice(0, 16).join(", ")}${ids.length > 16 ? " …" : ""}.` :
      "Children are bred from your picks: pick one birth or more.";
    const { fits } = this, was = this.operator.value || ANY;
    this.operator.replaceChildren(...[ANY, ...fits.map((one) => one.name)].map((name) =>
      made(null, "option", "", name.replaceAll("_", " "), { value: name })));
    this.operator.value = fits.some((one) => one.name === was) ? was : ANY;
    if (this.operator.value !== was || !this.words.textContent) this.choose();
    this.go.disabled = !ids.length || !this.operators.length || this.isBusy;
  }

  /** Operators that so few parents are enough for. */
  get fits() { return this.operators.filter((one) => one.fewest <= this.on.ids().length); }

  /** Those that take turns. */
  get names() {
    if (this.operator.value !== ANY) return [this.operator.value];
    return VARIETY.filter((name) => this.fits.some((one) => one.name === name));
  }

  choose() {
    const one = this.operators.find(({ name }) => name === this.operator.value);
    this.words.textContent = one ? one.told : "Operators take turns, one a child, so that you see what there is.";
    this.more.hidden = !one;
    this.parameters.replaceChildren();
    for (const { name, default: usual } of one ? one.parameters : []) {
      const label = made(this.parameters, "label", "", `${name} `);
      made(label, "input", "", "", { type: "text", name, placeholder: usual, spellcheck: "false" });
    }
  }

  /** What is written in the fields, numbers and lists as JSON has them, else words. */
  get written() {
    const found = {};
    for (const { name, value } of this.parameters.querySelectorAll("input")) {
      if (!value.trim()) continue;
      try {
        found[name] = JSON.parse(value);
      } catch {
        found[name] = value.trim();
      }
    }
    return found;
  }

  begin() {
    this.kept.clear();
    this.shown = null;
    this.said.replaceChildren();
    return this.ask("breed", {
      operators: this.names, parameters: this.written, parents: this.on.ids().slice(0, 16),
      count: Number(this.count.value), seed: Number(this.seed.value), vary: this.vary.checked,
    });
  }

  async ask(name, body) {
    try {
      this.tell(await this.server.told(name, body));
      this.on.trouble(null);
      this.follow();
    } catch (error) {
      this.on.trouble(error);
    }
  }

  /** Look at the children until all are there. */
  async follow() {
    if (this.following) return;
    this.following = true;
    try {
      while (this.isBusy) {
        await new Promise((resolve) => setTimeout(resolve, SOON));
        this.tell(await this.server.asked("brood"));
      }
    } catch (error) {
      this.on.trouble(error);
    }
    this.following = false;
  }

  // -- children ----------------------------------------------------------------------------------

  tell({ brood, busy, error, left, children }) {
    if (brood !== this.brood) {
      this.brood = brood;
      this.small = new Tiles((ids) => this.server.tiles("brood-tiles", { brood, ids }), () => this.draw());
      this.grid.replaceChildren(...children.map((child) => this.button(child)));
    }
    this.isBusy = busy;
    this.children = children;
    const count = (stage) => children.filter((one) => one.stage === stage).length;
    const there = count("bred") + count("measured");
    const text = error || (busy && !children.length ? "Workers are made ready …" : !children.length ? "" :
      `${there} of ${children.length} children bred, ${count("measured")} measured` +
      (count("failed") ? `, ${count("failed")} failed` : "") + (busy ? " …" : ".") +
      (count("failed") === children.length ? ` ${children[0].error}` : ""));
    if (this.state.textContent !== text) this.state.textContent = text;
    this.stop.hidden = !busy || !children.length;
    const reasons = Object.entries(left);
    this.left.hidden = !reasons.length || !children.length;
    if (this.reasons.children.length !== reasons.length) {
      this.reasons.replaceChildren(...reasons.map(([name, why]) => made(null, "li", "", `${name}: ${why}.`)));
    }
    this.small.want(children.filter((one) => ["bred", "measured"].includes(one.stage)).map((one) => one.number), 96);
    this.draw();
    this.detail();
    this.tellMarked();
    this.go.disabled = busy || !this.on.ids().length || !this.operators.length;
  }

  button({ number: place, operator }) {
    const button = made(null, "button", "node", "", { type: "button" });
    made(button, "canvas", "", "", { "aria-hidden": "true" });
    made(button, "span", "", operator.replaceAll("_", " "));
    button.addEventListener("click", () => {
      this.shown = place;
      this.picture();
      this.detail();
      this.draw();
    });
    button.addEventListener("dblclick", () => this.mark(place, !this.kept.has(place)));
    return button;
  }

  draw() {
    for (const { number: place, operator, stage } of this.children) {
      const button = this.grid.children[place], tile = this.small.get(place, 96);
      const context = sized(button.firstChild, SIZE, SIZE);
      context.fillStyle = "#efeae0";
      context.fillRect(0, 0, SIZE, SIZE);
      if (tile) context.drawImage(tile.image, tile.x, tile.y, tile.width, tile.height, 0, 0, SIZE, SIZE);
      context.fillStyle = "#34302e";
      context.font = "12px system-ui, sans-serif";
      context.textAlign = "center";
      if (!tile) context.fillText(stage === "failed" ? "failed" : "…", SIZE / 2, SIZE / 2 + 4);
      const wide = context.measureText(place).width + 6;
      context.fillStyle = "#f9f8f5";
      context.fillRect(0, SIZE - 16, wide, 16);
      context.fillStyle = "#34302e";
      context.fillText(place, wide / 2, SIZE - 4);
      const isKept = this.kept.has(place);
      if (isKept) {
        context.fillStyle = "#b0403f";
        context.fillRect(SIZE - 18, 0, 18, 18);
        context.fillStyle = "#fff";
        context.fillText("✓", SIZE - 9, 13);
      }
      context.lineWidth = 4;
      context.strokeStyle = "#34302e";
      if (place === this.shown) context.strokeRect(0, 0, SIZE, SIZE);
      button.setAttribute("aria-pressed", String(place === this.shown));
      button.setAttribute("aria-label", `child ${place}, ${operator.replaceAll("_", " ")}, ${stage}${isKept ? ", to be kept" : ""}`);
    }
  }

  async picture() {
    const place = this.shown, { brood } = this;
    if (!["bred", "measured"].includes(this.children[place].stage)) return;
    try {
      const blob = await this.server.blobOf("brood-picture", { brood, id: place });
      if (place !== this.shown || brood !== this.brood) return;
      if (this.address) URL.revokeObjectURL(this.address);
      this.address = URL.createObjectURL(blob);
      this.image.src = this.address;
    } catch (error) {
      this.on.trouble(error);
    }
  }

  /** All that is told of the child that is shown, made anew when that changes. */
  detail() {
    const child = this.shown === null ? null : this.children[this.shown];
    const key = child && JSON.stringify([this.brood, child]);
    if (key === this.told) return;
    this.told = key;
    const hadFocus = this.one.contains(document.activeElement);
    const source = this.image && this.image.src;
    this.one.replaceChildren();
    if (!child) return;
    const head = made(this.one, "div", "row");
    made(head, "h2", "", `child ${child.number}`);
    const label = made(head, "label");
    const box = this.box = made(label, "input", "", "", { type: "checkbox" });
    box.checked = this.kept.has(child.number);
    box.disabled = !["bred", "measured"].includes(child.stage);
    label.append("keep it");
    box.addEventListener("change", () => this.mark(child.number, box.checked));
    if (hadFocus) box.focus();
    made(this.one, "p", "faint", `${child.operator.replaceAll("_", " ")} of ${child.parents.join(", ")}`);
    if (child.error) made(this.one, "p", "lack", child.error);
    this.image = made(this.one, "img", "", "", { alt: `map of heights of child ${child.number}, north up` });
    if (source) this.image.src = source;
    else this.image.hidden = true;
    this.image.addEventListener("load", () => { this.image.hidden = false; });
    tellValues(this.one, child, this.on.births());
  }

  /** Whether a child is to be kept. */
  mark(place, isKept) {
    if (!["bred", "measured"].includes(this.children[place].stage)) return;
    this.kept[isKept ? "add" : "delete"](place);
    this.tellMarked();
    this.draw();
    if (place === this.shown) this.box.checked = isKept;
  }

  tellMarked() {
    this.keep.hidden = !this.children.length;
    this.unmarked.hidden = this.keep.hidden || this.kept.size > 0;
    this.keep.disabled = !this.kept.size || this.isBusy;
    this.keep.textContent = `keep ${this.kept.size} with a recipe`;
  }

  async keepThese() {
    try {
      tellKept(this.said, await this.server.told("keep", {
        brood: this.brood, children: [...this.kept], picks: this.on.ids().slice(0, 16),
      }));
      this.on.trouble(null);
    } catch (error) {
      this.on.trouble(error);
    }
  }
}

/** What a child has of each measure, beside what its parents have. */
export function tellValues(parent, { values, parents }, births, marked = null) {
  const rows = parents.map((id) => births.row(id));
  if (!Object.keys(values).length) return;
  const table = made(parent, "table", "values");
  if (marked) made(table, "caption", "", "of what is marked alone");
  const head = made(table, "tr");
  made(head, "td");
  for (const text of ["child", "parents"]) made(head, "th", "faint", text, { scope: "col" });
  for (const [name, value] of Object.entries(values)) {
    const column = births.byName.get(name), row = made(table, "tr");
    made(row, "th", "", `${name.replaceAll("_", " ")} ${column ? column.sign : ""}`, { scope: "row" });
    made(row, "td", "number", number(value));
    const others = made(row, "td", "faint");
    for (const [place, one] of (column ? rows : []).entries()) {
      made(others, "div", "number", number(marked ? marked[parents[place]]?.[name] ?? NaN : column.values[one]));
    }
  }
}

/** Where children are kept, and how to go on from them. */
export function tellKept(parent, { folder, recipe, left, ours }) {
  parent.replaceChildren();
  made(parent, "span", "", `Kept in ${folder}. Go on from them and the picks:`);
  made(parent, "code", "command", `evocity run ${recipe}`);
  if (!left.length) return;
  made(parent, "span", "", `Left out of the recipe: ${left.join(", ")}.` +
    (ours ? "" : " The run was not begun on this machine: what would execute or read files is not taken from it."));
}
