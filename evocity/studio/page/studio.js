import { readAddress, writeAddress } from "./address.js";
import { choice, offer } from "./elements.js";
import { Run } from "./run.js";
import { getJson } from "./server.js";

/** Milliseconds between two looks for runs: on a visible page, and on a hidden one. */
const VISIBLE = 5000, HIDDEN = 30000;
/** The addresses of the desk and of the modeller. */
const DESK = "#desk", MODELLER = "#modeller";
/** The class of each; its modules load at its first use, and it is UNLOADED before. */
const CLASSES = {
  desk: async () => (await import("./desk.js")).Desk,
  modeller: async () => (await import("./modeller.js")).Modeller,
};
const UNLOADED = { isShown: false, async show() {} };

/** The page: one run, or two side by side; at the right, details of the run that was used last. */
class Studio {
  constructor() {
    this.news = document.getElementById("news");
    this.trouble = document.getElementById("trouble");
    this.places = ["births", "side"].map((id) => document.getElementById(id));
    this.faults = new Map();
    this.listed = [];
    this.runs = []; // the visible runs
    this.states = new Map(); // of all runs that were visible
    this.chooser = document.getElementById("runs");
    this.choosers = ["run", "second run"].map((text) => choice(this.chooser, text, [], () => this.choose()));
    this.pressed = new Set();
    this.desk = this.modeller = UNLOADED;
    for (const name of ["pointerdown", "pointerup", "pointercancel"]) {
      window.addEventListener(name, ({ pointerId }) => {
        if (name === "pointerdown") this.pressed.add(pointerId);
        else this.pressed.delete(pointerId);
      }, true);
    }
    this.shown = document.getElementById("shown");
    this.deskButton = document.getElementById("new");
    this.deskButton.addEventListener("click", () => { location.hash = this.isAt("desk") ? "" : DESK; });
    document.getElementById("shapes").addEventListener("click", () => { location.hash = MODELLER; });
    window.addEventListener("hashchange", () => this.go());
    document.addEventListener("visibilitychange", () => {
      if (!document.hidden) this.look();
    });
    if (location.search) history.replaceState(null, "", `/${location.hash}`); // no token stays in the address
    this.search();
  }

  /** Show the error of a request (`of`), or clear it with null. */
  report(error, of = "request") {
    this.faults.set(of, error ? error.message || String(error) : "");
    const text = [...new Set(this.faults.values())].filter(Boolean).join(" ");
    if (this.trouble.textContent !== text) this.trouble.textContent = text;
    this.trouble.hidden = !text;
  }

  /** Whether a hand holds something that new births would move. */
  get isHeld() {
    return this.pressed.size > 0 || Boolean(document.activeElement.closest(".evocity-panel"));
  }

  // -- which runs ------------------------------------------------------------------------------

  isRun(run) { return this.listed.some((one) => one.run === run); }

  /** Look for runs, once at a time. */
  search() {
    this.searching ||= this.searchOnce().finally(() => { this.searching = null; });
    return this.searching;
  }

  /** Look for runs now and from time to time; show those in the address once there are some. */
  async searchOnce() {
    clearTimeout(this.timer);
    try {
      const { runs, more } = await getJson("runs");
      this.list(runs, more);
      if (!this.runs.length && !this.isAt("desk") && !this.isAt("modeller")) this.go();
      if (!runs.length) this.news.textContent = "no runs yet";
      this.report(null, "runs");
    } catch (error) {
      this.report(error, "runs");
    }
    this.timer = setTimeout(() => this.search(), document.hidden ? HIDDEN : VISIBLE);
  }

  /** Show the contents of the address: runs, or the desk, also without any run. */
  go() {
    const isModeller = location.hash === MODELLER, isDesk = !isModeller && (location.hash === DESK || !this.listed.length);
    if (isModeller !== this.isAt("modeller")) this.showPart("modeller", isModeller);
    if (isDesk !== this.isAt("desk")) this.showPart("desk", isDesk);
    this.shown.hidden = isDesk || isModeller;
    this.nameDeskButton();
    if (!isModeller) this.report(null, "modeller");
    if (isModeller) document.title = "modeller – evocity studio";
    else if (isDesk) document.title = "new run – evocity studio";
    else if (location.hash.length < 2 && this.runs.length) this.open(this.runs.map((one) => one.held)); // back from the desk
    else this.open(readAddress((run) => this.isRun(run)));
    if (!isDesk) for (const of of ["desk", "desk news"]) this.report(null, of);
  }

  /** Whether the page shows the desk or the modeller. */
  isAt(name) { return !document.getElementById(name).hidden; }

  /** Show or hide the desk or the modeller. */
  async showPart(name, isShown) {
    const root = document.getElementById(name);
    root.hidden = !isShown;
    try {
      if (isShown && this[name] === UNLOADED) {
        const Part = await CLASSES[name]();
        if (this[name] === UNLOADED) {
          this[name] = new Part(root, { trouble: (error, of) => this.report(error, of), show: (run) => this.showRun(run) });
        }
      }
      await this[name].show(this.isAt(name));
    } catch (error) {
      this.report(error, name);
    }
  }

  nameDeskButton() {
    this.deskButton.textContent = this.isAt("desk") ? "back to the runs" : "new run";
    this.deskButton.hidden = this.isAt("desk") && !this.listed.length;
  }

  /** Show a run in place of the desk. */
  async showRun(run) {
    for (let tries = 0; tries < 2 && !this.isRun(run); tries++) await this.search(); // the first may be older than the run
    if (!this.isRun(run)) return;
    history.pushState(null, "", `/#${encodeURIComponent(JSON.stringify(this.states.get(run) || { run }))}`);
    this.go();
    window.scrollTo(0, 0); // the desk was longer
  }

  /** Offer all runs; an unchanged list stays as it is, so that an open menu does not close. */
  list(runs, more) {
    const key = JSON.stringify([runs, more]);
    if (key === this.listKey) return;
    this.listKey = key;
    this.listed = runs;
    this.chooser.hidden = runs.length < 2;
    this.nameDeskButton();
    const options = runs.map(({ run, name, going }) => [String(run), going ? `${name}, running` : name]);
    const left = more ? [["", `The list leaves out ${more} runs.`]] : [];
    this.choosers.forEach((select, place) => {
      const was = select.value;
      offer(select, [...(place ? [["", "none"]] : []), ...options, ...left]);
      if (left.length) select.lastChild.disabled = true;
      select.value = was;
    });
    this.inform();
  }

  /** Show the runs that are chosen in the head of the page. */
  choose() {
    if (this.shown.hidden) history.pushState(null, "", "/#");
    for (const name in CLASSES) this.showPart(name, false);
    this.shown.hidden = false;
    this.nameDeskButton();
    const [first, second] = this.choosers.map((one) => one.value);
    const runs = [first, second].filter((one, place) => one !== "" && (!place || one !== first)).map(Number);
    this.open(runs.map((run) => this.states.get(run) || { run }));
    if (this.runs.length > 1) this.turn(this.runs[1]);
  }

  /** Show the runs of one state or two, each {run, …}; close the others. */
  open(states) {
    for (const one of this.runs) this.states.set(one.number, one.held);
    const kept = new Map(this.runs.map((one) => [one.number, one]));
    this.runs = states.map((one) => {
      const here = kept.get(one.run);
      kept.delete(one.run);
      if (!here) return this.openRun(one);
      if (JSON.stringify(one) !== JSON.stringify(here.held)) here.change(one);
      return here;
    });
    for (const one of kept.values()) {
      one.close();
      for (const of of this.faults.keys()) if (of.startsWith(`${one.number} `)) this.report(null, of);
    }
    this.places[0].append(...this.runs.map((one) => one.main)); // in this order
    this.places[0].classList.toggle("evocity-two", this.runs.length > 1);
    this.turn(this.runs.includes(this.run) ? this.run : this.runs[0]);
    this.save();
  }

  openRun(state) {
    const run = new Run(state.run, ...this.places, state, {
      isHeld: () => this.isHeld,
      save: () => this.save(),
      inform: () => this.inform(),
      report: (error, of) => this.report(error, `${state.run} ${of}`),
      turn: () => this.turn(run),
    });
    return run;
  }

  /** Show the details of a run at the side. */
  turn(run) {
    this.run = run;
    for (const one of this.runs) {
      one.side.hidden = one !== run;
      one.main.classList.toggle("evocity-turned", one === run && this.runs.length > 1);
    }
    this.inform();
  }

  /** Write the state of the page into its address. */
  save() {
    if (!this.shown.hidden && this.runs.every((one) => one.state)) writeAddress(this.runs.map((one) => one.held));
  }

  /** Show the news of the runs in the head. */
  inform() {
    this.choosers.forEach((select, place) => {
      const run = this.runs[place];
      select.value = run ? String(run.number) : "";
      for (const option of select.options) {
        if (place && this.runs.length) option.disabled = option.value === String(this.runs[0].number);
      }
    });
    const texts = this.runs.map((one) => [one.about ? one.about.title : "", one.news || "loading the run …"]);
    const text = texts.map(([title, news]) => (texts.length > 1 && title ? `${title}: ${news}` : news)).join(" | ");
    if (this.runs.length && this.news.textContent !== text) this.news.textContent = text;
    const about = this.run && this.run.about;
    if (about && !this.shown.hidden) document.title = `${about.title} – evocity studio`;
  }

  /** Look for news now. */
  look() {
    this.search();
    for (const one of this.runs) one.look();
  }
}

window.studio = new Studio();
