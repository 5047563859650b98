import { announce, attempt, pause, readyWorkers, SEEDS, showBlob } from "./controls.js";
import { paintTile, Tiles } from "./tiles.js";
import { button, choice, element, field, number, offer, tick } from "./elements.js";
import { Export } from "./export.js";
import { loadLock } from "./overlay.js";

const SIZE = 72, SOON = 120;
const ANY = "several in turn", MOST_PARENTS = 16, MOST_OPERATORS = 12;
/** Stages of a child that has a picture. */
const BRED = ["bred", "measured"];
const plain = (name) => name.replaceAll("_", " ");

/** The pane that breeds children of the picks and keeps some. `on`: ids(), births(), trouble(error). */
export class Breed {
  constructor(parent, server, on) {
    [this.server, this.on, this.pane] = [server, on, parent];
    this.operators = [];
    this.children = [];
    this.kept = new Set();
    this.shown = null;
    this.isReady = this.following = false;
    this.parentsText = element(parent, "p", "faint");
    const form = this.form = element(parent, "form");
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.begin();
    });
    const first = element(form, "div", "row");
    this.operator = choice(first, "operator", [[ANY, ANY]]);
    this.operator.addEventListener("change", () => this.choose());
    this.vary = tick(first, "vary the shares of the parents", true);
    this.words = element(form, "p", "faint");
    this.more = element(form, "details");
    element(this.more, "summary", "", "parameters");
    this.parameters = element(this.more, "div", "parameters");
    const second = element(form, "div", "row");
    this.count = field(second, "children", "number", "12", { min: "1", max: "24", step: "1", required: "" });
    this.seed = field(second, "seed", "number", "0", SEEDS);
    this.go = element(second, "button", "", "breed", { type: "submit" });
    this.stop = button(second, "stop", () => this.send("stop", {}));
    this.state = element(second, "span", "faint", "", { role: "status" });
    this.leftOut = element(parent, "details");
    element(this.leftOut, "summary", "", "measures that children do not have");
    this.reasons = element(this.leftOut, "ul");
    this.grid = element(parent, "div", "children", "", { role: "group", "aria-label": "children" });
    this.childDetail = element(parent, "div");
    this.keep = button(parent, "", () => this.keepThese());
    this.hint = element(parent, "span", "faint", " To keep a child, click it and tick “keep this child”, or double-click it.");
    this.message = element(parent, "p", "", "", { role: "status" });
    this.files = new Export(parent, server, {
      what: () => (this.exported.length ? { brood: this.brood, children: this.exported } : null),
      words: () => (this.exported.length === 1 ? `child ${this.exported[0]}` : `${this.exported.length} children`),
    });
    this.inform();
    this.showState({ brood: 0, busy: false, error: null, left: {}, children: [] });
  }

  get parents() { return this.on.ids().slice(0, MOST_PARENTS); }

  /** The pane is visible: load the operators, and prepare workers. */
  async open() {
    this.isReady = false; // until the workers answer
    this.inform();
    await attempt(this.on.trouble, async () => {
      this.lock ||= await loadLock(this.server);
      const state = await readyWorkers(this.server, { parents: this.parents }, (text) => announce(this.state, text), () => !this.pane.hidden);
      if (state) this.showState(state);
    });
    this.isReady = true;
    this.showGo();
    this.follow();
  }

  /** Show the parts that depend on the picks. */
  inform() {
    const { parents } = this, more = this.on.ids().length > parents.length ? " …" : "";
    this.parentsText.textContent = parents.length ? `The parents are your picks: ${parents.join(", ")}${more}.` :
      "Pick one or more births to breed from.";
    if (!this.pane.hidden) this.loadOperators();
    this.showGo();
  }

  showGo() { this.go.disabled = this.isBusy || !this.isReady || !this.parents.length || !this.operatorNames.length; }

  /** Load the operators, and which of them suit the picks. */
  async loadOperators() {
    const key = this.parents.join();
    if (key === this.operatorsKey) return;
    this.operatorsKey = key;
    const isLoaded = await attempt(this.on.trouble, async () => {
      const { operators } = await this.server.getJson("operators", key ? { ids: key } : {});
      if (key !== this.operatorsKey) return;
      this.operators = operators;
      offer(this.operator, [ANY, ...this.suiting.map((one) => one.name)].map((name) => [name, plain(name)]));
      const others = element(this.operator, "optgroup", "", "", { label: "These operators do not suit the picks" });
      for (const one of operators.filter(({ reason }) => reason)) {
        element(others, "option", "", `${plain(one.name)}: ${one.reason}`, { value: one.name, disabled: "" });
      }
      this.choose();
      this.showGo();
    });
    if (!isLoaded) this.operatorsKey = null;
  }

  /** Operators that suit the picks. */
  get suiting() { return this.operators.filter((one) => !one.reason); }

  /** Operators that take turns. */
  get operatorNames() {
    if (this.operator.value !== ANY) return [this.operator.value];
    return this.suiting.filter((one) => one.turns).map(({ name }) => name).slice(0, MOST_OPERATORS);
  }

  choose() {
    const one = this.operators.find(({ name }) => name === this.operator.value);
    if (this.words.textContent && one === this.chosenOperator) return;
    this.chosenOperator = one;
    this.words.textContent = one ? one.told : "The operators take turns to breed the children, so that you can compare the children of different operators.";
    this.more.hidden = !one;
    this.parameters.replaceChildren();
    for (const { name, default: usual } of one ? one.parameters : []) {
      field(this.parameters, name, "text", "", { name, placeholder: usual, spellcheck: "false" });
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
      operators: this.operatorNames, parameters: this.parameterValues, parents: this.parents,
      count: Number(this.count.value), seed: Number(this.seed.value), vary: this.vary.checked,
    });
  }

  async send(name, body) {
    if (await attempt(this.on.trouble, async () => this.showState(await this.server.postJson(name, body)))) this.follow();
  }

  /** Look at the children until all are bred and measured. */
  async follow() {
    if (this.following || !this.isBusy) return;
    this.following = true;
    await attempt(this.on.trouble, async () => {
      while (this.isBusy) {
        await pause(SOON);
        this.showState(await this.server.getJson("brood"));
      }
    });
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
    const same = children.filter((one) => one.unchanged).length;
    const bred = count("bred") + count("measured");
    const text = error || (busy && !children.length ? "starting workers …" : !children.length ? "" :
      `Studio has bred ${bred} of ${children.length} children, and has measured ${count("measured")} of them` +
      (count("failed") ? `, ${count("failed")} failed` : "") + (same ? `, ${same} ${same > 1 ? "equal" : "equals"} a parent` : "") + (busy ? " …" : ".") +
      (count("failed") === children.length ? ` ${children[0].error}` : ""));
    announce(this.state, text);
    this.stop.hidden = !busy || !children.length;
    const reasons = Object.entries(left);
    this.leftOut.hidden = !reasons.length || !children.length;
    if (this.reasons.children.length !== reasons.length) {
      this.reasons.replaceChildren(...reasons.map(([name, why]) => element(null, "li", "", `${name}: ${why}.`)));
    }
    this.small.request(children.filter((one) => BRED.includes(one.stage)).map((one) => one.number), 96);
    this.draw();
    this.detail();
    this.showKeepButton();
    this.showGo();
  }

  button({ number: place, operator }) {
    const made = button(null, "", () => {
      this.shown = place;
      this.picture();
      this.detail();
      this.draw();
      this.files.inform();
    });
    made.className = "evocity-node";
    element(made, "canvas", "", "", { "aria-hidden": "true" });
    element(made, "span", "", `${place}, bred by ${plain(operator)}`);
    made.addEventListener("dblclick", () => this.mark(place, !this.kept.has(place)));
    return made;
  }

  draw() {
    for (const { number: place, operator, stage, unchanged } of this.children) {
      const node = this.grid.children[place], tile = this.small.get(place, 96), isKept = this.kept.has(place);
      const context = paintTile(node.firstChild, tile, SIZE);
      if (tile && this.lock) context.drawImage(this.lock, 0, 0, SIZE, SIZE);
      node.classList.toggle("evocity-marked", isKept);
      node.classList.toggle("evocity-failed", stage === "failed");
      node.setAttribute("aria-pressed", String(place === this.shown));
      node.setAttribute("aria-label", `child ${place}, bred by ${plain(operator)}, ${stage}${unchanged ? ", equal to a parent" : ""}${isKept ? ", marked" : ""}`);
    }
  }

  async picture() {
    const place = this.shown, { brood } = this;
    if (!BRED.includes(this.children[place].stage)) return;
    await attempt(this.on.trouble, async () => {
      const blob = await this.server.getBlob("brood-picture", { brood, id: place });
      if (place === this.shown && brood === this.brood) showBlob(this.image, blob);
    });
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
    const box = this.box = tick(head, "keep this child", this.kept.has(child.number));
    box.disabled = !BRED.includes(child.stage);
    box.addEventListener("change", () => this.mark(child.number, box.checked));
    if (hadFocus) box.focus();
    element(this.childDetail, "p", "faint", `${plain(child.operator)} of ${child.parents.join(", ")}`);
    if (child.error) element(this.childDetail, "p", "lack", child.error);
    if (child.unchanged) element(this.childDetail, "p", "lack", unchangedText(child));
    this.image = element(this.childDetail, "img", "", "", { alt: `map of heights of child ${child.number}, north up` });
    if (source) this.image.src = source;
    else this.image.hidden = true;
    this.image.addEventListener("load", () => { this.image.hidden = false; });
    showValues(this.childDetail, child, this.on.births());
  }

  /** Mark a child to keep it, or unmark it. */
  mark(place, isKept) {
    if (!BRED.includes(this.children[place].stage)) return;
    this.kept[isKept ? "add" : "delete"](place);
    this.showKeepButton();
    this.draw();
    if (place === this.shown) this.box.checked = isKept;
  }

  /** The children to export: those that are marked, or else the shown one. */
  get exported() { return this.kept.size ? [...this.kept] : this.children.filter(({ number: place, stage }) => place === this.shown && BRED.includes(stage)).map((one) => one.number); }

  showKeepButton() {
    this.files.root.hidden = !this.children.length;
    this.files.inform();
    this.keep.hidden = !this.children.length;
    this.hint.hidden = this.keep.hidden || this.kept.size > 0;
    this.keep.disabled = !this.kept.size || this.isBusy;
    this.keep.textContent = `save ${this.kept.size} ${this.kept.size === 1 ? "child" : "children"} and a recipe`;
  }

  keepThese() { return keepChildren(this, { brood: this.brood, children: [...this.kept], picks: this.parents }); }
}

/** Why a child shows nothing new. */
export const unchangedText = ({ unchanged, parents }) => `The child equals its parent ${parents[0]}: ${unchanged}.`;

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

/** Keep children, and show their folder and the command that goes on from them, as the message of a `pane`. */
export const keepChildren = ({ server, message, on }, body) => attempt(on.trouble, async () => showKept(message, await server.postJson("keep", body)));

export function showKept(parent, { folder, recipe, left, ours }) {
  parent.replaceChildren();
  element(parent, "span", "", `Studio saved the children in the folder ${folder}. To breed from the children and your picks, run this command:`);
  element(parent, "code", "command", `evocity run ${recipe}`);
  if (!left.length) return;
  element(parent, "span", "", `The recipe leaves out: ${left.join(", ")}.` +
    (ours ? "" : " The run was not started on this machine, so the recipe takes no settings that execute or read files."));
}
