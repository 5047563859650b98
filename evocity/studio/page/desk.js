import { Begun } from "./begun.js";
import { bytes, tellFound } from "./found.js";
import { counted, made, number } from "./made.js";
import { Fault, asked, brought, told } from "./server.js";

/** Milliseconds between two looks at what is under way. */
const SOON = 400;
const WANTS = [["max", "as high as can be"], ["min", "as low as can be"], ["target", "a target"], ["first", "as the first has it"]];
/** What may be typed for how long a run goes, of generations and of minutes. */
const LENGTHS = { generations: { max: 1000000, step: 1 }, minutes: { max: 525600, step: "any" } };
/** Of a name, as a folder can have it. */
const NAME = { pattern: '[^.\\/\\\\:*?"<>\\|][^\\/\\\\:*?"<>\\|]*', title: 'no / \\ : * ? " < > | in it, and no dot before it' };
/** Metres. */
const LENGTH = { min: 0.000001, max: 1000000 };
/** In words, of each rule by which a building got its height. */
const RULES = { height: "told", levels: "by storeys", default: "not told" };

const said = ({ found, expected, remedy }) => `${found} (expected: ${expected}; what to do: ${remedy})`;
const numeral = ({ value }) => (value.trim() === "" ? null : Number(value));

/** The recipe desk: from maps to a run that goes on. What is chosen is held by the server. `on`:
 * trouble(error, of), show(run), a run is to be seen. */
export class Desk {
  constructor(parent, on) {
    [this.parent, this.on] = [parent, on];
    this.cards = new Map();
    this.rows = new Map();
    this.coming = []; // files that are still to be brought
  }

  get isShown() { return !this.parent.hidden; }

  /** Show it, or no longer. */
  async show(isShown) {
    this.parent.hidden = !isShown;
    if (!isShown && this.begun) this.begun.waits = null;
    if (!isShown) return;
    if (!this.form) this.build();
    try {
      if (!this.measures) {
        this.measures = (await asked("desk-measures")).measures;
        this.known = new Map(this.measures.map((one) => [one.name, one]));
      }
      const state = await asked("desk");
      if (this.isShown) this.take(state);
    } catch (error) {
      this.on.trouble(error, "desk");
    }
  }

  // -- what there is -----------------------------------------------------------------------------

  build() {
    const { parent } = this;
    made(parent, "h2", "", "Begin a run");
    this.intro = made(parent, "p", "faint");
    this.given = made(parent, "section", "", "", { "aria-label": "the recipe that was named" });
    this.form = made(parent, "form");
    this.form.addEventListener("submit", (event) => event.preventDefault());
    this.fields = made(this.form, "fieldset", "", "", { "aria-label": "what the recipe is made of" });

    made(this.fields, "h3", "", "1. Cities to breed from");
    made(this.fields, "p", "faint", "Choose two or more. Most children keep the streets of the first one. A target that you do not write is what the first one has.");
    const row = made(this.fields, "div", "row");
    const file = this.file = made(made(row, "label", "file", "your own files "), "input", "", "", { type: "file", multiple: "" });
    file.addEventListener("change", () => this.bring([...file.files]));
    made(row, "span", "faint", "or drop them here: GeoJSON, CityJSON, GeoPackage, OSM, GeoTIFF, PNG, NPY; of a Shapefile, save a GeoPackage");
    this.brought = made(this.fields, "p", "", "", { role: "status" });
    this.table = made(this.fields, "ul", "cards", "", { "aria-label": "cities" });
    for (const name of ["dragover", "drop"]) {
      parent.addEventListener(name, (event) => {
        if (![...event.dataTransfer.types].includes("Files")) return;
        event.preventDefault();
        if (name === "drop" && !this.fields.disabled) this.bring([...event.dataTransfer.files]);
      });
    }
    const window = made(this.fields, "div", "row");
    this.pixels = this.field(window, "window, pixels a side", { min: 8, max: 32767, step: 1, required: "" });
    this.metres = this.field(window, "metres a pixel", { ...LENGTH, step: "any", required: "" });
    this.side = made(window, "span", "faint");

    made(this.fields, "h3", "", "2. What is wanted of them");
    this.goals = made(this.fields, "ul", "goals", "", { "aria-label": "goals" });
    const more = made(this.fields, "div", "row");
    this.other = made(made(more, "label", "", "another measure "), "select");
    const add = made(more, "button", "", "add", { type: "button" });
    add.addEventListener("click", () => this.add(this.other.value));
    this.words = made(this.fields, "p", "faint");
    this.other.addEventListener("change", () => this.explain());

    made(this.fields, "h3", "", "3. How long, and how it is called");
    const long = made(this.fields, "div", "row");
    this.population = this.field(long, "individuals alive", { min: 2, max: 1000000, step: 1, required: "" });
    this.length = this.field(long, "so many", { min: 1, required: "" });
    this.unit = made(made(long, "label", "", ""), "select", "", "", { "aria-label": "generations or minutes" });
    for (const text of ["generations", "minutes"]) made(this.unit, "option", "", text);
    this.unit.addEventListener("change", () => this.limit());
    this.seed = this.field(long, "seed", { min: 0, max: 9007199254740991, step: 1, required: "" });
    this.name = made(made(long, "label", "", "name of the run "), "input", "", "", { type: "text", maxlength: 100, spellcheck: "false", ...NAME });
    this.fields.addEventListener("change", ({ target }) => target !== file && target !== this.other && this.change());

    made(parent, "h3", "", "4. The recipe");
    made(parent, "p", "faint", "The cities are coded and measured, and bounds are laid that their codes keep and a heap of rubble does not; a few births are timed.");
    const go = made(parent, "div", "row");
    this.calibrate = made(go, "button", "", "make the recipe", { type: "button" });
    this.calibrate.addEventListener("click", async () => {
      if (await this.change()) this.ask("desk-calibrate", {});
    });
    this.stop = made(go, "button", "", "stop", { type: "button" });
    this.stop.addEventListener("click", () => this.ask("desk-stop", {}));
    this.state = made(parent, "p", "", "", { role: "status" });
    this.found = made(parent, "section", "", "", { "aria-label": "the recipe" });
    this.begun = new Begun(parent, { show: (run) => this.on.show(run), stop: (map) => this.ask("desk-end", { map }) });
  }

  field(parent, text, limits) { return made(made(parent, "label", "", `${text} `), "input", "", "", { type: "number", ...limits }); }

  /** As the unit has it. */
  limit() { Object.assign(this.length, LENGTHS[this.unit.value]); }

  // -- what the server tells -----------------------------------------------------------------------

  /** All that it holds, also what is in the fields. */
  take(state) {
    const { draft } = state;
    this.longest = state.longest;
    this.placed = new Map(draft.maps.map((one) => [one.map, one]));
    this.chosen = draft.maps.filter((one) => one.chosen).map((one) => one.map);
    this.wanted = draft.goals;
    [this.pixels.value, this.metres.value] = [draft.window.pixels, draft.window.metres_per_pixel];
    [this.population.value, this.seed.value, this.name.value] = [draft.population, draft.seed, draft.name];
    this.unit.value = draft.minutes === null ? "generations" : "minutes";
    this.length.value = draft.minutes === null ? draft.generations : draft.minutes;
    this.limit();
    this.tellGoals();
    const last = state.started.at(-1);
    if (last && last.at && !last.has) this.begun.waits = last.folder;
    this.tell(state);
  }

  tell(state) {
    this.known && this.explain();
    const key = JSON.stringify(state);
    if (key !== this.told) {
      this.told = key;
      this.intro.textContent = `The run and its recipe go into ${state.home}.`;
      this.fields.disabled = this.calibrate.disabled = state.busy;
      this.calibrate.disabled ||= !this.chosen.length || !this.wanted.length;
      this.stop.hidden = !state.busy;
      this.name.placeholder = state.usual;
      this.side.textContent = `a window of ${number(this.pixels.value * this.metres.value)} m a side`;
      this.tellMaps(state.maps);
      const text = state.fault ? said(state.fault) : state.busy ? `${state.said.at(-1) || "beginning"} …` : state.found ? "The recipe is made." : state.said.at(-1) || "";
      if (this.state.textContent !== text) this.state.textContent = text;
      this.state.classList.toggle("evocity-lack", Boolean(state.fault));
      this.tellFound(state.found);
      this.tellGiven(state.given);
      this.begun.tell(state.started);
    }
    clearTimeout(this.timer);
    const isUnderWay = state.busy || state.maps.some((one) => one.reading) || state.started.some((one) => one.at && !one.has);
    if (this.isShown) this.timer = setTimeout(() => this.look(), isUnderWay ? SOON : 10 * SOON);
  }

  async look() {
    if (!this.isShown) return;
    try {
      this.tell(await asked("desk"));
      this.on.trouble(null, "desk looked");
    } catch (error) {
      this.on.trouble(error, "desk looked");
      this.timer = setTimeout(() => this.look(), 10 * SOON);
    }
  }

  /** What the server tells once it is done; null where it is not. */
  async ask(name, body) {
    try {
      const state = await told(name, body);
      this.tell(state);
      this.on.trouble(null, "desk");
      return state;
    } catch (error) {
      this.on.trouble(error, "desk");
      return null;
    }
  }

  // -- maps ----------------------------------------------------------------------------------------

  tellMaps(maps) {
    for (const [one, card] of this.cards) {
      if (maps.some(({ map }) => map === one)) continue;
      card.item.remove();
      this.cards.delete(one);
    }
    for (const one of maps) {
      if (!this.cards.has(one.map)) this.cards.set(one.map, this.card(one));
      const card = this.cards.get(one.map), place = this.chosen.indexOf(one.map);
      card.box.checked = place >= 0;
      card.place.textContent = place < 0 ? "" : place ? `parent ${place + 1}` : "first parent";
      card.item.classList.toggle("evocity-on", place >= 0);
      if (one.about && card.turn !== one.turn) {
        card.image.src = `/api/desk-picture?map=${one.map}&turn=${one.turn}`;
        card.turn = one.turn;
      }
      card.image.hidden = !one.about;
      const fault = one.fault && said(one.fault);
      card.text.textContent = one.reading ? "being read …" : fault || aboutOf(one.about);
      card.text.classList.toggle("evocity-lack", Boolean(one.fault) && !one.reading);
      card.thanks.textContent = one.about ? one.about.attribution || "whom to thank: not told in the file" : "";
      if (fault && fault !== card.fault) card.more.open = true;
      card.fault = fault;
    }
  }

  card({ map, title, own, takes }) {
    const item = made(this.table, "li"), card = { item };
    if (own) this.table.insertBefore(item, this.first); // own ones before those that come with evocity
    else this.first ||= item;
    const label = made(item, "label");
    card.box = made(label, "input", "", "", { type: "checkbox" });
    made(label, "b", "", title);
    card.box.addEventListener("change", () => {
      this.chosen = this.chosen.filter((one) => one !== map);
      if (card.box.checked) this.chosen.push(map);
    });
    card.place = made(item, "span", "place");
    card.image = made(item, "img", "", "", { alt: `map of heights of ${title}, north up`, width: 160, height: 160 });
    card.text = made(item, "p");
    card.thanks = made(item, "p", "faint");
    card.more = made(item, "details");
    made(card.more, "summary", "", "how it is read");
    const options = this.placed.get(map) || {};
    const option = (text, name, limits) => {
      const found = made(made(card.more, "label", "", `${text} `), "input", "", "", limits ? { type: "number", step: "any", ...limits } : { type: "text", maxlength: 100 });
      const value = name === "lon" || name === "lat" ? (options.center || [])[Number(name === "lat")] : options[name];
      found.value = value ?? "";
      return (card[name] = found);
    };
    option("centre, longitude", "lon", { min: -180, max: 180 });
    option("latitude", "lat", { min: -89.999999, max: 89.999999 });
    option("height where none is told, m", "default_height", LENGTH).placeholder = 6;
    if (takes.includes("layer")) option("layer of the buildings", "layer");
    if (takes.includes("height_scale")) option("metres of a grey level or unit", "height_scale", LENGTH);
    if (own) {
      const gone = made(item, "button", "", `take ${title} away`, { type: "button" });
      gone.addEventListener("click", async () => {
        this.chosen = this.chosen.filter((one) => one !== map);
        await this.change();
        this.ask("desk-drop", { map });
        this.file.focus();
      });
    }
    return card;
  }

  async bring(files) {
    this.coming.push(...files);
    if (this.bringing) return; // these follow
    this.bringing = true;
    const lacks = [];
    let count = 0;
    while (this.coming.length) {
      const file = this.coming.shift();
      count += 1;
      this.brought.textContent = `bringing ${file.name}, ${count} of ${count + this.coming.length} …`;
      try {
        if (file.size > this.longest) throw new Fault({ found: `${file.name} has ${bytes(file.size)}`, expected: `${bytes(this.longest)} at most`, remedy: "cut a part out of it, or save it as GeoPackage" });
        this.chosen.push((await brought("desk-file", file)).map);
        if (!(await this.change())) await this.look(); // it is chosen at once
      } catch (error) {
        lacks.push(error.message);
      }
    }
    this.bringing = false;
    this.file.value = "";
    this.brought.textContent = lacks.join(" ") || `${count === 1 ? "one file is" : `${count} files are`} on the desk`;
    this.brought.classList.toggle("evocity-lack", lacks.length > 0);
  }

  // -- goals ---------------------------------------------------------------------------------------

  tellGoals() {
    for (const row of this.rows.values()) row.item.remove();
    this.rows.clear();
    for (const one of this.wanted) this.rows.set(one.measure, this.row(one));
    const others = this.measures.filter(({ name }) => !this.rows.has(name));
    const was = this.other.value;
    this.other.replaceChildren(...others.map(({ name }) => made(null, "option", "", name.replaceAll("_", " "), { value: name })));
    if (others.some(({ name }) => name === was)) this.other.value = was;
    this.explain();
  }

  row({ measure, want, target }) {
    const item = made(this.goals, "li"), { unit, told: text, goal } = this.known.get(measure), title = measure.replaceAll("_", " ");
    made(item, "b", "", title);
    const select = made(item, "select", "", "", { "aria-label": `what is wanted of ${title}` });
    for (const [value, words] of WANTS) if (value !== "first" || !goal) made(select, "option", "", words, { value });
    select.value = want;
    const field = made(item, "input", "", "", { type: "number", step: "any", "aria-label": `target of ${title}` });
    field.value = target ?? "";
    const turn = () => { field.hidden = field.disabled = select.value !== "target"; };
    turn();
    select.addEventListener("change", turn);
    const gone = made(item, "button", "", `leave ${title} out`, { type: "button" });
    gone.addEventListener("click", () => {
      this.read();
      this.wanted = this.wanted.filter((one) => one.measure !== measure);
      this.tellGoals();
      this.change();
      this.other.focus();
    });
    made(item, "span", "faint", `${text}${unit ? ` In ${unit}.` : ""}`);
    return { item, select, field };
  }

  add(measure) {
    if (!measure) return;
    this.read();
    this.wanted.push({ measure, want: this.known.get(measure).goal || "first", target: null });
    this.tellGoals();
    this.change();
  }

  explain() {
    const one = this.known.get(this.other.value);
    this.words.textContent = one ? `${one.told}${one.unit ? ` In ${one.unit}.` : ""}` : "";
  }

  // -- what is chosen ------------------------------------------------------------------------------

  /** Take what stands in the fields. */
  read() {
    this.wanted = [...this.rows].map(([measure, { select, field }]) => {
      const want = select.value, target = numeral(field);
      return { measure, want, target: want === "target" ? target : null };
    });
    const maps = [...this.chosen, ...[...this.cards.keys()].filter((map) => !this.chosen.includes(map))].map((map) => {
      const card = this.cards.get(map), found = { map, chosen: this.chosen.includes(map) };
      if (!card) return found;
      const [lon, lat] = [numeral(card.lon), numeral(card.lat)];
      if (lon !== null && lat !== null) found.center = [lon, lat];
      for (const name of ["default_height", "height_scale"]) if (card[name] && numeral(card[name]) !== null) found[name] = numeral(card[name]);
      if (card.layer && card.layer.value.trim()) found.layer = card.layer.value.trim();
      return found;
    });
    const length = numeral(this.length), isTimed = this.unit.value === "minutes";
    return {
      name: this.name.value.trim(), seed: numeral(this.seed), population: numeral(this.population),
      ...(isTimed ? { minutes: length } : { generations: length }),
      window: { pixels: numeral(this.pixels), metres_per_pixel: numeral(this.metres) }, maps, goals: this.wanted,
    };
  }

  /** Tell the server what is chosen, one telling after another; nothing where a field is at fault,
   * which is shown. */
  change() {
    for (const one of this.form.querySelectorAll("details:not([open]) input:invalid")) one.closest("details").open = true;
    if (!this.form.reportValidity()) return Promise.resolve(null);
    const draft = this.read();
    this.saving = (this.saving || Promise.resolve()).then(() => this.ask("desk-change", draft));
    return this.saving;
  }

  // -- the recipe, and runs ------------------------------------------------------------------------

  tellFound(found) {
    const key = found && found.text;
    if (key === this.text) return;
    this.text = key;
    this.found.replaceChildren();
    this.found.hidden = !found;
    if (!found) return;
    tellFound(this.found, found);
    this.recipe(this.found, found.text, "as it is written", { given: false });
  }

  recipe(parent, text, title, body) {
    const go = made(parent, "button", "go", "begin the run", { type: "button" });
    go.addEventListener("click", async () => {
      go.disabled = true;
      const { started } = (await this.ask("desk-begin", body)) || {};
      go.disabled = false;
      if (started && this.isShown) this.begun.waits = started.at(-1).folder;
    });
    const more = made(parent, "details");
    more.open = true;
    made(more, "summary", "", `recipe.toml, ${title}`);
    made(more, "pre", "toml", text, { tabindex: "0", role: "group", "aria-label": "text of the recipe" });
  }

  tellGiven(given) {
    const key = JSON.stringify(given);
    if (key === this.isGiven) return;
    this.isGiven = key;
    this.given.replaceChildren();
    this.given.hidden = !given;
    if (!given) return;
    made(this.given, "p", "", `The recipe ${given.path} is begun as it is. Or make another below.`);
    this.recipe(this.given, given.text, "as it is", { given: true });
  }
}

/** What is told of a map in a line. */
function aboutOf(about) {
  if (!about) return "";
  const [wide, tall] = about.metres, rules = Object.entries(about.rules);
  const count = rules.reduce((sum, [, of]) => sum + of, 0);
  const heights = rules.map(([rule, of]) => `${counted(of)} ${RULES[rule] || rule}`).join(", ");
  return `${number(wide)} × ${number(tall)} m, ${Math.round(100 * about.built)} % built, up to ${number(about.highest)} m` +
    (count ? `; ${counted(count)} buildings, heights: ${heights}.` : "; a raster of heights.");
}
