import { numberIn } from "./desk_cards.js";
import { button, choice, element, field, number, offer } from "./elements.js";

const WANTS = [["max", "as high as possible"], ["min", "as low as possible"], ["target", "a target"], ["first", "the value of the first parent"],
  ["parents", "the mean of the parents"], ["band", "a band around a target"], ["bounds", "only bounds"]];
/** Fields of numbers: key, text before it, and label. */
const FIELDS = [["target", "", "target of"], ["tolerance", "±", "tolerance of"], ["min", "at least", "lower bound of"], ["max", "at most", "upper bound of"]];
const titleOf = (measure) => measure.replaceAll("_", " ");

/** The goals: a row for each measure, and a list of the others. `on`: changed(). */
export class Goals {
  constructor(parent, on) {
    [this.on, this.rows, this.choices] = [on, new Map(), []]; // `site`: unknown before `bound`
    this.list = element(parent, "ul", "goals", "", { "aria-label": "goals" });
    const more = element(parent, "div", "row");
    this.other = choice(more, "another measure", [], (event) => { event.stopPropagation(); this.explain(); });
    button(more, "add", () => this.add(this.other.value));
    this.none = button(more, "drop all goals", () => this.take([]));
    this.usual = button(more, "take the default goals", () => this.take(this.usualGoals));
    this.words = element(parent, "p", "faint");
  }

  /** The goals of a new desk. */
  get usualGoals() { return this.measures.filter(({ usual }) => usual).map(({ name, usual }) => ({ measure: name, want: usual })); }

  /** Take other goals in the place of all. */
  take(choices) {
    this.load(choices);
    this.on.changed();
    this.other.focus();
  }

  /** Offer the `measures`. */
  offer(measures) {
    this.measures = measures;
    this.measureOf = new Map(measures.map((one) => [one.name, one]));
  }

  load(choices) {
    this.choices = choices;
    for (const row of this.rows.values()) row.item.remove();
    this.rows = new Map(choices.map((one) => [one.measure, this.row(one)]));
    this.bound(this.site, false);
    const others = this.measures.filter(({ name }) => !this.rows.has(name));
    offer(this.other, others.map(({ name }) => [name, titleOf(name)]));
    [this.none.hidden, this.usual.hidden] = [choices.length < 2, choices.length > 0];
    this.explain();
  }

  row(chosen) {
    const { measure } = chosen, { unit, told: text, goal, range: [low, high], site } = this.measureOf.get(measure), title = titleOf(measure);
    const item = element(this.list, "li"), row = { item, site };
    element(item, "b", "", title);
    row.want = element(item, "select", "", "", { "aria-label": `goal of ${title}` });
    offer(row.want, WANTS.filter(([value]) => value !== "first" || !goal));
    row.want.value = chosen.want;
    for (const [name, words, label] of FIELDS) {
      const input = row[name] = field(item, words, "number", chosen[name] ?? "", { step: "any", "aria-label": `${label} ${title}` });
      if (name === "tolerance") input.min = 0;
      else for (const [key, end] of [["min", low], ["max", high]]) if (end !== null) input[key] = end;
    }
    row.within = field(item, "inside the boundary", "checkbox", "on", { "aria-label": `${title} inside the boundary` });
    row.within.checked = Boolean(chosen.within);
    const turn = () => {
      const isBand = row.want.value === "band";
      const shown = { target: isBand || row.want.value === "target", tolerance: isBand, min: !isBand, max: !isBand };
      for (const [name, isShown] of Object.entries(shown)) row[name].parentNode.hidden = row[name].disabled = !isShown;
      const least = numberIn(row.min), most = numberIn(row.max), [target, wide] = [numberIn(row.target), numberIn(row.tolerance)];
      row.max.setCustomValidity(least !== null && most !== null && least > most ? `The lower bound ${number(least)} is above the upper bound. Type another bound.` : "");
      const isBeyond = isBand && ((low !== null && target - wide < low) || (high !== null && target + wide > high));
      row.tolerance.setCustomValidity(isBeyond ? `The band leaves the values of the measure, ${low ?? "−∞"} to ${high ?? "∞"}. Type a narrower band.` : "");
    };
    turn();
    item.addEventListener("change", turn);
    button(item, `drop ${title}`, () => {
      this.load(this.read().filter((one) => one.measure !== measure));
      this.on.changed();
      this.other.focus();
    });
    element(item, "span", "faint", `${text}${unit ? ` Unit: ${unit}.` : ""}`);
    row.note = element(item, "p", "lack", "", { role: "status" });
    row.note.hidden = true;
    return row;
  }

  /** Show the notes of a recipe on a measure at its goal. */
  showNotes(notes) {
    for (const [measure, { note }] of this.rows) {
      const text = notes.filter((one) => one.startsWith(`${measure}: `)).map((one) => one.slice(measure.length + 2)).join(" ");
      if (note.textContent !== text) note.textContent = text;
      note.hidden = !text;
    }
  }

  add(measure) {
    if (!measure) return;
    this.load([...this.read(), { measure, want: this.measureOf.get(measure).goal || "first" }]);
    this.on.changed();
  }

  /** Offer the boundary `site` (null: none) to measures that can be limited to it; a `isNew` one is chosen by them. */
  bound(site, isNew) {
    this.site = site;
    for (const { within, site: kind } of this.rows.values()) {
      const isAble = Boolean(site) && (kind === "any" || (kind === "rectangle" && site.rectangle));
      within.parentNode.hidden = !site;
      within.disabled = !isAble;
      within.parentNode.title = isAble || !site ? "" : kind ? "This measure needs a rectangle." : "This measure describes the whole map.";
      if (isNew) within.checked = isAble;
    }
  }

  explain() {
    const one = this.measureOf && this.measureOf.get(this.other.value);
    this.words.textContent = one ? `${one.told}${one.unit ? ` Unit: ${one.unit}.` : ""}` : "";
  }

  /** Read all fields. */
  read() {
    this.choices = [...this.rows].map(([measure, row]) => {
      const choice = { measure, want: row.want.value, within: row.within.checked && (this.site === undefined || !row.within.disabled) };
      for (const [name] of FIELDS) if (!row[name].disabled && numberIn(row[name]) !== null) choice[name] = numberIn(row[name]);
      return choice;
    });
    return this.choices;
  }
}
