import { byteText, showCalibration } from "./calibration.js";
import { countText, element, number } from "./elements.js";
import { Fault, getJson, postJson, uploadFile } from "./server.js";
import { Starts } from "./starts.js";

/** Milliseconds between two looks at a calibration or a reading. */
const SOON = 400;
const WANTS = [["max", "as high as possible"], ["min", "as low as possible"], ["target", "a target"], ["first", "the value of the first parent"],
  ["parents", "the mean of the parents"]];
/** Limits of the length of a run, in generations and in minutes. */
const LENGTHS = { generations: { max: 1000000, step: 1 }, minutes: { max: 525600, step: "any" } };
/** A name that a folder can have. */
const NAME = { pattern: '[^.\\/\\\\:*?"<>\\|][^\\/\\\\:*?"<>\\|]*', title: 'without / \\ : * ? " < > | and without a dot at its start' };
/** Metres. */
const LENGTH = { min: 0.000001, max: 1000000 };
/** The sources of the heights of buildings, by rule. */
const RULES = { height: "in the file", levels: "from storeys", default: "missing" };

const faultText = ({ found, expected, remedy }) => `${found} (expected: ${expected}; what to do: ${remedy})`;
const numberIn = ({ value }) => (value.trim() === "" ? null : Number(value));

/** The recipe desk: from maps to a running search. The server holds all choices. `on`: trouble(error, of),
 * show(run). */
export class Desk {
  constructor(parent, on) {
    [this.parent, this.on] = [parent, on];
    this.cards = new Map();
    this.rows = new Map();
    this.queue = []; // files to upload
  }

  get isShown() { return !this.parent.hidden; }

  /** Show or hide the desk. */
  async show(isShown) {
    this.parent.hidden = !isShown;
    if (!isShown && this.starts) this.starts.waits = null;
    if (!isShown) return;
    if (!this.form) this.build();
    try {
      if (!this.measures) {
        this.measures = (await getJson("desk-measures")).measures;
        this.measureOf = new Map(this.measures.map((one) => [one.name, one]));
      }
      const state = await getJson("desk");
      if (this.isShown) this.load(state);
    } catch (error) {
      this.on.trouble(error, "desk");
    }
  }

  // -- elements -------------------------------------------------------------------------------------

  build() {
    const { parent } = this;
    element(parent, "h2", "", "New run");
    this.intro = element(parent, "p", "faint");
    this.givenRecipe = element(parent, "section", "", "", { "aria-label": "the recipe of the command line" });
    this.form = element(parent, "form");
    this.form.addEventListener("submit", (event) => event.preventDefault());
    this.fields = element(this.form, "fieldset", "", "", { "aria-label": "choices for the recipe" });

    element(this.fields, "h3", "", "1. Cities to breed from");
    element(this.fields, "p", "faint", "Choose two or more cities as parents. Most children keep the streets of the first parent.");
    const row = element(this.fields, "div", "row");
    const file = this.file = element(element(row, "label", "file", "your own files "), "input", "", "", { type: "file", multiple: "" });
    file.addEventListener("change", () => this.upload([...file.files]));
    element(row, "span", "faint", "To add files, drop them here: GeoJSON, GeoPackage, GeoParquet, FlatGeobuf, OSM, KML, CityJSON, GML, DXF, GeoTIFF, ASCII grid, PNG, NPY. If your map is a Shapefile or a File GDB, pack its files into a zip.");
    this.uploadStatus = element(this.fields, "p", "", "", { role: "status" });
    this.cardList = element(this.fields, "ul", "cards", "", { "aria-label": "cities" });
    for (const name of ["dragover", "drop"]) {
      parent.addEventListener(name, (event) => {
        if (![...event.dataTransfer.types].includes("Files")) return;
        event.preventDefault();
        if (name === "drop" && !this.fields.disabled) this.upload([...event.dataTransfer.files]);
      });
    }
    const window = element(this.fields, "div", "row");
    this.pixels = this.field(window, "width of the square map in pixels", { min: 8, max: 32767, step: 1, required: "" });
    this.metres = this.field(window, "metres per pixel", { ...LENGTH, step: "any", required: "" });
    this.side = element(window, "span", "faint");

    element(this.fields, "h3", "", "2. Goals");
    this.goals = element(this.fields, "ul", "goals", "", { "aria-label": "goals" });
    const more = element(this.fields, "div", "row");
    this.other = element(element(more, "label", "", "another measure "), "select");
    const add = element(more, "button", "", "add", { type: "button" });
    add.addEventListener("click", () => this.add(this.other.value));
    this.words = element(this.fields, "p", "faint");
    this.other.addEventListener("change", () => this.explain());

    element(this.fields, "h3", "", "3. Length and name");
    const long = element(this.fields, "div", "row");
    this.population = this.field(long, "individuals alive", { min: 2, max: 1000000, step: 1, required: "" });
    this.length = this.field(long, "length", { min: 1, required: "" });
    this.unit = element(element(long, "label", "", ""), "select", "", "", { "aria-label": "generations or minutes" });
    for (const text of ["generations", "minutes"]) element(this.unit, "option", "", text);
    this.unit.addEventListener("change", () => this.limit());
    this.seed = this.field(long, "seed", { min: 0, max: 9007199254740991, step: 1, required: "" });
    this.name = element(element(long, "label", "", "name of the run "), "input", "", "", { type: "text", maxlength: 100, spellcheck: "false", ...NAME });
    this.fields.addEventListener("change", ({ target }) => target !== file && target !== this.other && this.change());

    element(parent, "h3", "", "4. The recipe");
    element(parent, "p", "faint", "Evocity measures the cities and sets bounds that exclude maps unlike these cities. Evocity breeds a few trial children to estimate the duration of the run.");
    const go = element(parent, "div", "row");
    this.calibrate = element(go, "button", "", "make the recipe", { type: "button" });
    this.calibrate.addEventListener("click", async () => {
      if (await this.change()) this.send("desk-calibrate", {});
    });
    this.stop = element(go, "button", "", "stop", { type: "button" });
    this.stop.addEventListener("click", () => this.send("desk-stop", {}));
    this.state = element(parent, "p", "", "", { role: "status" });
    this.result = element(parent, "section", "", "", { "aria-label": "the recipe" });
    this.starts = new Starts(parent, { show: (run) => this.on.show(run), stop: (map) => this.send("desk-end", { map }) });
  }

  field(parent, text, limits) { return element(element(parent, "label", "", `${text} `), "input", "", "", { type: "number", ...limits }); }

  /** Set the limits of the length by its unit. */
  limit() { Object.assign(this.length, LENGTHS[this.unit.value]); }

  // -- state -----------------------------------------------------------------------------------

  /** Show the state of the server, also in the fields. */
  load(state) {
    const { draft } = state;
    this.longest = state.longest;
    this.placed = new Map(draft.maps.map((one) => [one.map, one]));
    this.chosen = draft.maps.filter((one) => one.chosen).map((one) => one.map);
    this.goalChoices = draft.goals;
    [this.pixels.value, this.metres.value] = [draft.window.pixels, draft.window.metres_per_pixel];
    [this.population.value, this.seed.value, this.name.value] = [draft.population, draft.seed, draft.name];
    this.unit.value = draft.minutes === null ? "generations" : "minutes";
    this.length.value = draft.minutes === null ? draft.generations : draft.minutes;
    this.limit();
    this.showGoals();
    const last = state.started.at(-1);
    if (last && last.at && !last.has) this.starts.waits = last.folder;
    this.showState(state);
  }

  showState(state) {
    if (this.measureOf) this.explain();
    const text = JSON.stringify(state);
    if (text !== this.stateText) {
      this.stateText = text;
      this.intro.textContent = `Studio saves the run and its recipe in the folder ${state.home}.`;
      this.fields.disabled = this.calibrate.disabled = state.busy;
      this.calibrate.disabled ||= !this.chosen.length || !this.goalChoices.length;
      this.stop.hidden = !state.busy;
      this.name.placeholder = state.usual;
      this.side.textContent = `the map is a square with sides of ${number(this.pixels.value * this.metres.value)} m`;
      this.showMaps(state.maps);
      const progress = state.fault ? faultText(state.fault) : state.busy ? `${state.said.at(-1) || "starting"} …` : state.found ? "The recipe is ready." : state.said.at(-1) || "";
      if (this.state.textContent !== progress) this.state.textContent = progress;
      this.state.classList.toggle("evocity-lack", Boolean(state.fault));
      this.showResult(state.found);
      this.showGiven(state.given);
      this.starts.show(state.started);
    }
    clearTimeout(this.timer);
    const isUnderWay = state.busy || state.maps.some((one) => one.reading) || state.started.some((one) => one.at && !one.has);
    if (this.isShown) this.timer = setTimeout(() => this.look(), isUnderWay ? SOON : 10 * SOON);
  }

  async look() {
    if (!this.isShown) return;
    try {
      this.showState(await getJson("desk"));
      this.on.trouble(null, "desk news");
    } catch (error) {
      this.on.trouble(error, "desk news");
      this.timer = setTimeout(() => this.look(), 10 * SOON);
    }
  }

  /** Send a change; the new state, null after an error. */
  async send(name, body) {
    try {
      const state = await postJson(name, body);
      this.showState(state);
      this.on.trouble(null, "desk");
      return state;
    } catch (error) {
      this.on.trouble(error, "desk");
      return null;
    }
  }

  // -- maps ----------------------------------------------------------------------------------------

  showMaps(maps) {
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
      const fault = one.fault && faultText(one.fault);
      card.text.textContent = one.reading ? "reading …" : fault || aboutOf(one.about);
      card.text.classList.toggle("evocity-lack", Boolean(one.fault) && !one.reading);
      card.credit.textContent = one.about ? one.about.attribution || "the file states no attribution" : "";
      if (fault && fault !== card.fault) card.more.open = true;
      card.fault = fault;
      if (card.terrain_map) this.showRasters(one.map, card, maps);
    }
  }

  /** Offer the user's other rasters as ground of a map. */
  showRasters(map, card, maps) {
    const ofFootprints = (one) => one.about && Object.keys(one.about.rules).length > 0; // in a zip
    const isRaster = (one) => one.own && one.takes.includes("terrain") && !ofFootprints(one);
    const rasters = maps.filter((one) => one.map !== map && isRaster(one));
    const key = JSON.stringify(rasters.map((one) => one.map)), select = card.terrain_map;
    if (key === card.rasters) return;
    const value = card.rasters ? select.value : String((this.placed.get(map) || {}).terrain_map ?? "");
    card.rasters = key;
    select.replaceChildren();
    element(select, "option", "", "none", { value: "" });
    for (const one of rasters) element(select, "option", "", one.title, { value: one.map });
    select.value = value;
    if (select.selectedIndex < 0) select.value = "";
  }

  card({ map, title, own, takes }) {
    const item = element(this.cardList, "li"), card = { item };
    if (own) this.cardList.insertBefore(item, this.first); // a user's files before bundled districts
    else this.first ||= item;
    const label = element(item, "label");
    card.box = element(label, "input", "", "", { type: "checkbox" });
    element(label, "b", "", title);
    card.box.addEventListener("change", () => {
      this.chosen = this.chosen.filter((one) => one !== map);
      if (card.box.checked) this.chosen.push(map);
    });
    card.place = element(item, "span", "place");
    card.image = element(item, "img", "", "", { alt: `map of heights of ${title}, north up`, width: 160, height: 160 });
    card.text = element(item, "p");
    card.credit = element(item, "p", "faint");
    card.more = element(item, "details");
    element(card.more, "summary", "", "options for reading");
    const options = this.placed.get(map) || {};
    const option = (text, name, limits) => {
      const input = element(element(card.more, "label", "", `${text} `), "input", "", "", limits ? { type: "number", step: "any", ...limits } : { type: "text", maxlength: 100 });
      const value = name === "lon" || name === "lat" ? (options.center || [])[Number(name === "lat")] : options[name];
      input.value = value ?? "";
      return (card[name] = input);
    };
    option("centre, longitude", "lon", { min: -180, max: 180 });
    option("latitude", "lat", { min: -89.999999, max: 89.999999 });
    option("default height, m", "default_height", LENGTH).placeholder = 6;
    if (takes.includes("layer")) option("layer that contains the buildings", "layer");
    if (takes.includes("height_column")) option("column of heights, m", "height_column");
    if (takes.includes("levels_column")) option("column of storeys", "levels_column");
    if (takes.includes("height_scale")) option("height in metres of one grey level in a picture, or of one unit in a raster", "height_scale", LENGTH);
    if (takes.includes("nodata")) option("value of missing pixels", "nodata", {});
    if (takes.includes("terrain")) {
      option("elevation of the ground, m", "terrain", { min: -1000, max: 10000 });
      card.terrain_map = element(element(card.more, "label", "", "raster of the ground "), "select");
    }
    if (own) {
      const remove = element(item, "button", "", `remove ${title}`, { type: "button" });
      remove.addEventListener("click", async () => {
        this.chosen = this.chosen.filter((one) => one !== map);
        await this.change();
        this.send("desk-drop", { map });
        this.file.focus();
      });
    }
    return card;
  }

  async upload(files) {
    this.queue.push(...files);
    if (this.isUploading) return; // the loop below takes these too
    this.isUploading = true;
    const faults = [];
    let count = 0;
    while (this.queue.length) {
      const file = this.queue.shift();
      count += 1;
      this.uploadStatus.textContent = `uploading ${file.name}, ${count} of ${count + this.queue.length} …`;
      try {
        if (file.size > this.longest) throw new Fault({ found: `${file.name} has ${byteText(file.size)}`, expected: `${byteText(this.longest)} at most`, remedy: "upload a smaller part of the file, or convert the file to a GeoPackage" });
        this.chosen.push((await uploadFile("desk-file", file)).map);
        if (!(await this.change())) await this.look(); // a new map is chosen
      } catch (error) {
        faults.push(error.message);
      }
    }
    this.isUploading = false;
    this.file.value = "";
    this.uploadStatus.textContent = faults.join(" ") || `${count === 1 ? "one new file is" : `${count} new files are`} on the desk`;
    this.uploadStatus.classList.toggle("evocity-lack", faults.length > 0);
  }

  // -- goals ---------------------------------------------------------------------------------------

  showGoals() {
    for (const row of this.rows.values()) row.item.remove();
    this.rows.clear();
    for (const one of this.goalChoices) this.rows.set(one.measure, this.row(one));
    const others = this.measures.filter(({ name }) => !this.rows.has(name));
    const was = this.other.value;
    this.other.replaceChildren(...others.map(({ name }) => element(null, "option", "", name.replaceAll("_", " "), { value: name })));
    if (others.some(({ name }) => name === was)) this.other.value = was;
    this.explain();
  }

  row({ measure, want, target }) {
    const item = element(this.goals, "li"), { unit, told: text, goal } = this.measureOf.get(measure), title = measure.replaceAll("_", " ");
    element(item, "b", "", title);
    const select = element(item, "select", "", "", { "aria-label": `goal of ${title}` });
    for (const [value, words] of WANTS) if (value !== "first" || !goal) element(select, "option", "", words, { value });
    select.value = want;
    const field = element(item, "input", "", "", { type: "number", step: "any", "aria-label": `target of ${title}` });
    field.value = target ?? "";
    const turn = () => { field.hidden = field.disabled = select.value !== "target"; };
    turn();
    select.addEventListener("change", turn);
    const remove = element(item, "button", "", `drop ${title}`, { type: "button" });
    remove.addEventListener("click", () => {
      this.read();
      this.goalChoices = this.goalChoices.filter((one) => one.measure !== measure);
      this.showGoals();
      this.change();
      this.other.focus();
    });
    element(item, "span", "faint", `${text}${unit ? ` Unit: ${unit}.` : ""}`);
    return { item, select, field };
  }

  add(measure) {
    if (!measure) return;
    this.read();
    this.goalChoices.push({ measure, want: this.measureOf.get(measure).goal || "first", target: null });
    this.showGoals();
    this.change();
  }

  explain() {
    const one = this.measureOf.get(this.other.value);
    this.words.textContent = one ? `${one.told}${one.unit ? ` Unit: ${one.unit}.` : ""}` : "";
  }

  // -- choices ----------------------------------------------------------------------------------

  /** Read all fields as a draft. */
  read() {
    this.goalChoices = [...this.rows].map(([measure, { select, field }]) => {
      const want = select.value, target = numberIn(field);
      return { measure, want, target: want === "target" ? target : null };
    });
    const maps = [...this.chosen, ...[...this.cards.keys()].filter((map) => !this.chosen.includes(map))].map((map) => {
      const card = this.cards.get(map), choice = { map, chosen: this.chosen.includes(map) };
      if (!card) return choice;
      const [lon, lat] = [numberIn(card.lon), numberIn(card.lat)];
      if (lon !== null && lat !== null) choice.center = [lon, lat];
      for (const name of ["default_height", "height_scale", "nodata", "terrain"]) if (card[name] && numberIn(card[name]) !== null) choice[name] = numberIn(card[name]);
      for (const name of ["layer", "height_column", "levels_column"]) if (card[name] && card[name].value.trim()) choice[name] = card[name].value.trim();
      if (card.terrain_map && card.terrain_map.value) choice.terrain_map = Number(card.terrain_map.value);
      return choice;
    });
    const length = numberIn(this.length), isTimed = this.unit.value === "minutes";
    return {
      name: this.name.value.trim(), seed: numberIn(this.seed), population: numberIn(this.population),
      ...(isTimed ? { minutes: length } : { generations: length }),
      window: { pixels: numberIn(this.pixels), metres_per_pixel: numberIn(this.metres) }, maps, goals: this.goalChoices,
    };
  }

  /** Send the choices, one draft after another; a field with an error is shown instead. */
  change() {
    for (const one of this.form.querySelectorAll("details:not([open]) input:invalid")) one.closest("details").open = true;
    if (!this.form.reportValidity()) return Promise.resolve(null);
    const draft = this.read();
    this.saving = (this.saving || Promise.resolve()).then(() => this.send("desk-change", draft));
    return this.saving;
  }

  // -- recipe and runs -----------------------------------------------------------------------------

  showResult(result) {
    const text = result && result.text;
    if (text === this.recipeText) return;
    this.recipeText = text;
    this.result.replaceChildren();
    this.result.hidden = !result;
    if (!result) return;
    showCalibration(this.result, result);
    this.recipe(this.result, text, "new recipe.toml", { given: false });
  }

  recipe(parent, text, title, body) {
    const go = element(parent, "button", "go", "begin the run", { type: "button" });
    go.addEventListener("click", async () => {
      go.disabled = true;
      const { started } = (await this.send("desk-begin", body)) || {};
      go.disabled = false;
      if (started && this.isShown) this.starts.waits = started.at(-1).folder;
    });
    const more = element(parent, "details");
    more.open = true;
    element(more, "summary", "", title);
    element(more, "pre", "toml", text, { tabindex: "0", role: "group", "aria-label": "full text of the recipe" });
  }

  showGiven(given) {
    const key = JSON.stringify(given);
    if (key === this.givenKey) return;
    this.givenKey = key;
    this.givenRecipe.replaceChildren();
    this.givenRecipe.hidden = !given;
    if (!given) return;
    element(this.givenRecipe, "p", "", `Begin a run with the recipe ${given.path}, or make a new recipe below.`);
    this.recipe(this.givenRecipe, given.text, "recipe.toml without changes", { given: true });
  }
}

/** The facts of a map in a line. */
function aboutOf(about) {
  if (!about) return "";
  const [wide, tall] = about.metres, rules = Object.entries(about.rules);
  const count = rules.reduce((sum, [, of]) => sum + of, 0);
  const heights = rules.map(([rule, of]) => `${countText(of)} ${RULES[rule] || `from ${rule}`}`).join(", ");
  return `${number(wide)} × ${number(tall)} m, ${Math.round(100 * about.built)} % built, buildings up to ${number(about.highest)} m high` +
    (count ? `; ${countText(count)} buildings, heights: ${heights}.` : "; a raster of heights.");
}
