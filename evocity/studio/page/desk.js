import { showCalibration } from "./calibration.js";
import { Cards, numberIn } from "./desk_cards.js";
import { Goals } from "./desk_goals.js";
import { button, choice, element, field, number } from "./elements.js";
import { faultText, getJson, postJson } from "./server.js";
import { Starts } from "./starts.js";

/** Milliseconds between two looks at a calibration or a reading. */
const SOON = 400;
/** Limits of the length of a run, in generations and in minutes. */
const LENGTHS = { generations: { max: 1000000, step: 1 }, minutes: { max: 525600, step: "any" } };
/** A name that a folder can have. */
const NAME = { pattern: '[^.\\/\\\\:*?"<>\\|][^\\/\\\\:*?"<>\\|]*', title: 'without / \\ : * ? " < > | and without a dot at its start' };
/** Metres. */
const LENGTH = { min: 0.000001, max: 1000000 };

/** The recipe desk: from maps to a running search. The server holds all choices. `on`: trouble(error, of),
 * show(run). */
export class Desk {
  constructor(parent, on) {
    [this.parent, this.on] = [parent, on];
  }

  get isShown() { return !this.parent.hidden; }

  /** Show or hide the desk. */
  async show(isShown) {
    this.parent.hidden = !isShown;
    if (!isShown && this.starts) this.starts.waits = null;
    if (!isShown) return;
    if (!this.form) this.build();
    try {
      if (!this.goals.measures) this.goals.offer((await getJson("desk-measures")).measures);
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
    element(this.fields, "p", "faint", "Choose two or more cities as parents. Most children keep the streets of one of these cities.");
    const window = element(this.fields, "div", "row");
    this.pixels = field(window, "width of the square map in pixels", "number", "", { min: 8, max: 32767, step: 1, required: "" });
    this.metres = field(window, "metres per pixel", "number", "", { ...LENGTH, step: "any", required: "" });
    this.side = element(window, "span", "faint");
    this.cards = new Cards(this.fields, {
      window: () => ({ pixels: numberIn(this.pixels) || 8, metres: numberIn(this.metres) || 1 }),
      resize: (about) => about && ([this.pixels.value, this.metres.value] = [about.pixels, about.metres_per_pixel]),
      changed: (use) => this.change(use), look: () => this.look(), drop: (map) => this.send("desk-drop", { map }), longest: () => this.longest,
    });
    for (const name of ["dragover", "drop"]) {
      parent.addEventListener(name, (event) => {
        if (![...event.dataTransfer.types].includes("Files")) return;
        event.preventDefault();
        if (name === "drop" && !this.fields.disabled) this.cards.upload([...event.dataTransfer.files]);
      });
    }
    element(this.fields, "h3", "", "2. Goals");
    this.goals = new Goals(this.fields, { changed: () => this.change() });

    element(this.fields, "h3", "", "3. Length and name");
    const long = element(this.fields, "div", "row");
    this.population = field(long, "individuals alive", "number", "", { min: 2, max: 1000000, step: 1, required: "" });
    this.length = field(long, "length", "number", "", { min: 1, required: "" });
    this.unit = choice(long, "", ["generations", "minutes"], () => this.limit(), { "aria-label": "generations or minutes" });
    this.seed = field(long, "seed", "number", "", { min: 0, max: 9007199254740991, step: 1, required: "" });
    this.name = field(long, "name of the run", "text", "", { maxlength: 100, size: 32, spellcheck: "false", ...NAME });
    this.fields.addEventListener("change", () => this.change());

    element(parent, "h3", "", "4. The recipe");
    element(parent, "p", "faint", "Evocity measures the cities and sets bounds that exclude maps unlike these cities. Evocity breeds a few trial children to estimate the duration of the run.");
    const go = element(parent, "div", "row");
    this.calibrate = button(go, "make the recipe", async () => {
      if (await this.change()) this.send("desk-calibrate", {});
    });
    this.stop = button(go, "stop", () => this.send("desk-stop", {}));
    this.state = element(parent, "p", "", "", { role: "status" });
    this.result = element(parent, "section", "", "", { "aria-label": "the recipe" });
    this.starts = new Starts(parent, { show: (run) => this.on.show(run), stop: (map) => this.send("desk-end", { map }) });
  }

  /** Set the limits of the length by its unit. */
  limit() { Object.assign(this.length, LENGTHS[this.unit.value]); }

  // -- state -----------------------------------------------------------------------------------

  /** Show the state of the server, also in the fields. */
  load(state) {
    const { draft } = state;
    this.longest = state.longest;
    this.cards.load(draft);
    this.goals.load(draft.goals);
    [this.pixels.value, this.metres.value] = [draft.window.pixels, draft.window.metres_per_pixel];
    [this.population.value, this.seed.value, this.name.value] = [draft.population, draft.seed, draft.name];
    this.unit.value = draft.minutes === null ? "generations" : "minutes";
    this.length.value = draft.minutes === null ? draft.generations : draft.minutes;
    this.limit();
    const last = state.started.at(-1);
    if (last && last.at && !last.has) this.starts.waits = last.folder;
    this.showState(state);
  }

  showState(state) {
    const text = JSON.stringify(state);
    if (text !== this.stateText) {
      this.stateText = text;
      this.intro.textContent = `Studio saves the run and its recipe in the folder ${state.home}.`;
      this.fields.disabled = this.calibrate.disabled = state.busy;
      const { chosen, areas } = this.cards, isReading = state.maps.some((one) => one.reading && chosen.includes(one.map));
      const lack = !chosen.length ? "To make a recipe, choose a city." : !this.goals.choices.length ? "To make a recipe, add a goal."
        : isReading && (areas.lock || areas.within) ? "Studio reads the lock and the boundary …" : "";
      this.calibrate.disabled ||= Boolean(lack);
      this.stop.hidden = !state.busy;
      this.name.placeholder = state.usual;
      this.side.textContent = `the map is a square with sides of ${number(this.pixels.value * this.metres.value)} m`;
      this.cards.show(state);
      this.showBoundary(state.maps);
      const progress = state.fault ? faultText(state.fault) : state.busy ? `${state.said.at(-1) || "starting"} …` : state.found ? "The recipe is ready." : lack || state.said.at(-1) || "";
      if (this.state.textContent !== progress) this.state.textContent = progress;
      this.state.classList.toggle("evocity-lack", Boolean(state.fault));
      this.goals.showNotes(state.found ? state.found.notes : []);
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

  /** Offer the boundary to the goals once it is read. */
  showBoundary(maps) {
    const area = this.cards.areas.within, map = area && maps.find((one) => one.map === area.map);
    const site = map && !map.reading && map.about && map.about.areas.within;
    if (area && !site) return; // it is being read
    this.goals.bound(area ? site : null, this.isNewBoundary);
    if (area && this.isNewBoundary) this.change();
    this.isNewBoundary = false;
  }

  // -- choices ----------------------------------------------------------------------------------

  /** Read all fields as a draft. */
  read() {
    const length = numberIn(this.length), isTimed = this.unit.value === "minutes";
    return {
      name: this.name.value.trim(), seed: numberIn(this.seed), population: numberIn(this.population),
      ...(isTimed ? { minutes: length } : { generations: length }),
      window: { pixels: numberIn(this.pixels), metres_per_pixel: numberIn(this.metres) }, ...this.cards.choices, goals: this.goals.read(),
    };
  }

  /** Send the choices, one draft after another; a field with an error is shown instead. `use`: of a new area. */
  change(use) {
    if (use === "within") this.isNewBoundary = true;
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
    const isNew = this.recipeText !== undefined; // the page was here while it was made
    this.recipeText = text;
    this.result.replaceChildren();
    this.result.hidden = !result;
    if (!result) return;
    showCalibration(this.result, result);
    this.recipe(this.result, text, "new recipe.toml", { given: false });
    if (isNew) this.result.scrollIntoView({ block: "nearest" });
  }

  recipe(parent, text, title, body) {
    const row = element(parent, "div", "row"), state = element(null, "span", "faint", "", { role: "status" });
    const go = button(row, "begin the run", async () => {
      go.disabled = true;
      state.textContent = "starting …";
      const { started } = (await this.send("desk-begin", body)) || {};
      go.disabled = false;
      state.textContent = "";
      if (started && this.isShown) this.starts.follow(started.at(-1), state);
    });
    go.className = "evocity-go";
    row.append(state);
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
