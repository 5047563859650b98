import { Tiles } from "./tiles.js";
import { element, number, fitCanvas } from "./elements.js";
import { getJson } from "./server.js";

const SIZE = 72, SOON = 120;
/** Operators that take turns where none is chosen: one of each kind. */
const VARIETY = ["quarter_fusion", "region_fusion", "lambda_crossover", "quarter_refill", "relocation",
  "height_scaling", "interpolation", "mutation"];
const ANY = "several in turn";

/** The pane that breeds children of the picks and keeps some. `on`: ids(), births(), trouble(error). */
export class Breed {
  constructor(parent, server, on) {
    [this.server, this.on] = [server, on];
    this.operators = [];
    this.children = [];
    this.kept = new Set();
    this.shown = null;
    this.parentsText = element(parent, "p", "faint");
    const form = this.form = element(parent, "form");
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.begin();
    });
    const first = element(form, "div", "row");
    this.operator = element(element(first, "label", "", "operator "), "select");
    this.operator.addEventListener("change", () => this.choose());
    const vary = element(first, "label");
    this.vary = element(vary, "input", "", "", { type: "checkbox" });
    this.vary.checked = true;
    vary.append("vary the shares of the parents");
    this.words = element(form, "p", "faint");
    this.more = element(form, "details");
    element(this.more, "summary", "", "parameters");
    this.parameters = element(this.more, "div", "parameters");
    const second = element(form, "div", "row");
    this.count = this.field(second, "children", "12", { min: "1", max: "24" });
    this.seed = this.field(second, "seed", "0", { min: "0", max: "9007199254740991" });
    this.go = element(second, "button", "", "breed", { type: "submit" });
    this.stop = element(second, "button", "", "stop", { type: "button" });
    this.stop.addEventListener("click", () => this.send("stop", {}));
    this.state = element(parent, "p", "faint", "", { role: "status" });
    this.leftOut = element(parent, "details");
    element(this.leftOut, "summary", "", "measures that children do not have");
    this.reasons = element(this.leftOut, "ul");
    this.grid = element(parent, "div", "children", "", { role: "group", "aria-label": "children" });
    this.childDetail = element(parent, "div");
    this.keep = element(parent, "button", "", "", { type: "button" });
    this.keep.addEventListener("click", () => this.keepThese());
    this.hint = element(parent, "span", "faint", " To keep a child, click it and tick “keep this child”, or double-click it.");
    this.message = element(parent, "p", "", "", { role: "status" });
    this.inform();
    this.showState({ brood: 0, busy: false, error: null, left: {}, children: [] });
  }

  field(parent, text, value, limits) {
    const input = element(element(parent, "label", "", `${text} `), "input", "", "", { type: "number", step: "1", required: "", ...limits });
    input.value = value;
    return input;
  }

  /** The pane is visible: load the operators, and prepare workers. */
  async open() {
    try {
      if (!this.operators.length) this.operators = (await getJson("operators")).operators;
      this.inform();
      this.go.disabled = true; // until the workers answer
      this.showState(await this.server.postJson("ready", { parents: this.on.ids().slice(0, 16) }));
      this.follow();
    } catch (error) {
      this.inform();
      this.on.trouble(error);
    }
  }

  /** Show the parts that depend on the picks. */
  inform() {
    const ids = this.on.ids();
    this.parentsText.textContent = ids.length ? `The parents are your picks: ${ids.slice(0, 16).join(", ")}${ids.length > 16 ? " …" : ""}.` :
      "Pick one or more births to breed from.";
    const { fittingOperators } = this, was = this.operator.value || ANY;
    this.operator.replaceChildren(...[ANY, ...fittingOperators.map((one) => one.name)].map((name) =>
      element(null, "option", "", name.replaceAll("_", " "), { value: name })));
    this.operator.value = fittingOperators.some((one) => one.name === was) ? was : ANY;
    if (this.operator.value !== was || !this.words.textContent) this.choose();
    this.go.disabled = !ids.length || !this.operators.length || this.isBusy;
  }

  /** Operators for which the picks are enough. */
  get fittingOperators() { return this.operators.filter((one) => one.fewest <= this.on.ids().length); }

  /** Operators that take turns. */
  get operatorNames() {
    if (this.operator.value !== ANY) return [this.operator.value];
    return VARIETY.filter((name) => this.fittingOperators.some((one) => one.name === name));
  }

  choose() {
    const one = this.operators.find(({ name }) => name === this.operator.value);
    this.words.textContent = one ? one.told : "The operators take turns to breed the children, so that you can compare the children of different operators.";
    this.more.hidden = !one;
    this.parameters.replaceChildren();
    for (const { name, default: usual } of one ? one.parameters : []) {
      const label = element(this.parameters, "label", "", `${name} `);
      element(label, "input", "", "", { type: "text", name, placeholder: usual, spellcheck: "false" });
    }
  }

  /** The values in the fields: numbers and lists as JSON, otherwise texts. */
  get parameterValues() {
    const values = {};
    for (const { name, value } of this.parameters.querySelectorAll("input")) {
      if (!value.trim()) continue;
      try {
        values[name] = JSON.parse(value);
      } catch {
        values[name] = value.trim();
      }
    }
    return values;
  }

  begin() {
    this.kept.clear();
    this.shown = null;
    this.message.replaceChildren();
    return this.send("breed", {
      operators: this.operatorNames, parameters: this.parameterValues, parents: this.on.ids().slice(0, 16),
      count: Number(this.count.value), seed: Number(this.seed.value), vary: this.vary.checked,
    });
  }

  async send(name, body) {
    try {
      this.showState(await this.server.postJson(name, body));
      this.on.trouble(null);
      this.follow();
    } catch (error) {
      this.on.trouble(error);
    }
  }

  /** Look at the children until all are bred and measured. */
  async follow() {
    if (this.following) return;
    this.following = true;
    try {
      while (this.isBusy) {
        await new Promise((resolve) => setTimeout(resolve, SOON));
        this.showState(await this.server.getJson("brood"));
      }
    } catch (error) {
      this.on.trouble(error);
    }
    this.following = false;
  }

  // -- children ----------------------------------------------------------------------------------

  showState({ brood, busy, error, left, children }) {
    if (brood !== this.brood) {
      this.brood = brood;
      this.small = new Tiles((ids) => this.server.getTiles("brood-tiles", { brood, ids }), () => this.draw());
      this.grid.replaceChildren(...children.map((child) => this.button(child)));
    }
    this.isBusy = busy;
    this.children = children;
    const count = (stage) => children.filter((one) => one.stage === stage).length;
    const bred = count("bred") + count("measured");
    const text = error || (busy && !children.length ? "starting workers …" : !children.length ? "" :
      `Studio has bred ${bred} of ${children.length} children, and has measured ${count("measured")}` +
      (count("failed") ? `, ${count("failed")} failed` : "") + (busy ? " …" : ".") +
      (count("failed") === children.length ? ` ${children[0].error}` : ""));
    if (this.state.textContent !== text) this.state.textContent = text;
    this.stop.hidden = !busy || !children.length;
    const reasons = Object.entries(left);
    this.leftOut.hidden = !reasons.length || !children.length;
    if (this.reasons.children.length !== reasons.length) {
      this.reasons.replaceChildren(...reasons.map(([name, why]) => element(null, "li", "", `${name}: ${why}.`)));
    }
    this.small.request(children.filter((one) => ["bred", "measured"].includes(one.stage)).map((one) => one.number), 96);
    this.draw();
    this.detail();
    this.showKeepButton();
    this.go.disabled = busy || !this.on.ids().length || !this.operators.length;
  }

  button({ number: place, operator }) {
    const button = element(null, "button", "node", "", { type: "button" });
    element(button, "canvas", "", "", { "aria-hidden": "true" });
    element(button, "span", "", operator.replaceAll("_", " "));
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
      const context = fitCanvas(button.firstChild, SIZE, SIZE);
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
      button.setAttribute("aria-label", `child ${place}, bred by ${operator.replaceAll("_", " ")}, ${stage}${isKept ? ", marked" : ""}`);
    }
  }

  async picture() {
    const place = this.shown, { brood } = this;
    if (!["bred", "measured"].includes(this.children[place].stage)) return;
    try {
      const blob = await this.server.getBlob("brood-picture", { brood, id: place });
      if (place !== this.shown || brood !== this.brood) return;
      if (this.address) URL.revokeObjectURL(this.address);
      this.address = URL.createObjectURL(blob);
      this.image.src = this.address;
    } catch (error) {
      this.on.trouble(error);
    }
  }

  /** Show the details of the chosen child, again after each change. */
  detail() {
    const child = this.shown === null ? null : this.children[this.shown];
    const key = child && JSON.stringify([this.brood, child]);
    if (key === this.detailKey) return;
    this.detailKey = key;
    const hadFocus = this.childDetail.contains(document.activeElement);
    const source = this.image && this.image.src;
    this.childDetail.replaceChildren();
    if (!child) return;
    const head = element(this.childDetail, "div", "row");
    element(head, "h2", "", `child ${child.number}`);
    const label = element(head, "label");
    const box = this.box = element(label, "input", "", "", { type: "checkbox" });
    box.checked = this.kept.has(child.number);
    box.disabled = !["bred", "measured"].includes(child.stage);
    label.append("keep this child");
    box.addEventListener("change", () => this.mark(child.number, box.checked));
    if (hadFocus) box.focus();
    element(this.childDetail, "p", "faint", `${child.operator.replaceAll("_", " ")} of ${child.parents.join(", ")}`);
    if (child.error) element(this.childDetail, "p", "lack", child.error);
    this.image = element(this.childDetail, "img", "", "", { alt: `map of heights of child ${child.number}, north up` });
    if (source) this.image.src = source;
    else this.image.hidden = true;
    this.image.addEventListener("load", () => { this.image.hidden = false; });
    showValues(this.childDetail, child, this.on.births());
  }

  /** Mark a child to keep it, or unmark it. */
  mark(place, isKept) {
    if (!["bred", "measured"].includes(this.children[place].stage)) return;
    this.kept[isKept ? "add" : "delete"](place);
    this.showKeepButton();
    this.draw();
    if (place === this.shown) this.box.checked = isKept;
  }

  showKeepButton() {
    this.keep.hidden = !this.children.length;
    this.hint.hidden = this.keep.hidden || this.kept.size > 0;
    this.keep.disabled = !this.kept.size || this.isBusy;
    this.keep.textContent = `save ${this.kept.size} ${this.kept.size === 1 ? "child" : "children"} and a recipe`;
  }

  async keepThese() {
    try {
      showKept(this.message, await this.server.postJson("keep", {
        brood: this.brood, children: [...this.kept], picks: this.on.ids().slice(0, 16),
      }));
      this.on.trouble(null);
    } catch (error) {
      this.on.trouble(error);
    }
  }
}

/** Show the measures of a child beside those of its parents. */
export function showValues(parent, { values, parents }, births, marked = null) {
  const rows = parents.map((id) => births.row(id));
  if (!Object.keys(values).length) return;
  const table = element(parent, "table", "values");
  if (marked) element(table, "caption", "", "in the marked part only");
  const head = element(table, "tr");
  element(head, "td");
  for (const text of ["child", "parents"]) element(head, "th", "faint", text, { scope: "col" });
  for (const [name, value] of Object.entries(values)) {
    const column = births.byName.get(name), row = element(table, "tr");
    element(row, "th", "", `${name.replaceAll("_", " ")} ${column ? column.sign : ""}`, { scope: "row" });
    element(row, "td", "number", number(value));
    const others = element(row, "td", "faint");
    for (const [place, one] of (column ? rows : []).entries()) {
      element(others, "div", "number", number(marked ? marked[parents[place]]?.[name] ?? NaN : column.values[one]));
    }
  }
}

/** Show the folder of kept children, and the command that goes on from them. */
export function showKept(parent, { folder, recipe, left, ours }) {
  parent.replaceChildren();
  element(parent, "span", "", `Studio saved the children in the folder ${folder}. To breed from the children and your picks, run this command:`);
  element(parent, "code", "command", `evocity run ${recipe}`);
  if (!left.length) return;
  element(parent, "span", "", `The recipe leaves out: ${left.join(", ")}.` +
    (ours ? "" : " The run was not started on this machine, so the recipe takes no settings that execute or read files."));
}
