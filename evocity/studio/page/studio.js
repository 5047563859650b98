import { readAddress, writeAddress } from "./address.js";
import { Desk } from "./desk.js";
import { made } from "./made.js";
import { Run } from "./run.js";
import { asked } from "./server.js";

/** Milliseconds between two looks for runs: while the page is seen, and while it is not. */
const SEEN = 5000, UNSEEN = 30000;
/** The address of the desk. */
const DESK = "#desk";

/** The page: a run, or two beside each other; at their side what is told of the one that was
 * touched last. */
class Studio {
  constructor() {
    this.news = document.getElementById("news");
    this.trouble = document.getElementById("trouble");
    this.places = ["births", "side"].map((id) => document.getElementById(id));
    this.faults = new Map();
    this.known = [];
    this.runs = []; // those that are shown
    this.told = new Map(); // what was told of those that were
    this.chooser = document.getElementById("runs");
    this.choosers = ["run", "beside it"].map((text) => made(made(this.chooser, "label", "", `${text} `), "select"));
    for (const one of this.choosers) one.addEventListener("change", () => this.choose());
    this.pressed = new Set();
    for (const name of ["pointerdown", "pointerup", "pointercancel"]) {
      window.addEventListener(name, ({ pointerId }) => {
        if (name === "pointerdown") this.pressed.add(pointerId);
        else this.pressed.delete(pointerId);
      }, true);
    }
    this.shown = document.getElementById("shown");
    this.fresh = document.getElementById("new");
    this.fresh.addEventListener("click", () => { location.hash = this.desk.isShown ? "" : DESK; });
    this.desk = new Desk(document.getElementById("desk"), {
      trouble: (error, of) => this.tell(error, of),
      show: (run) => this.showRun(run),
    });
    window.addEventListener("hashchange", () => this.go());
    document.addEventListener("visibilitychange", () => {
      if (!document.hidden) this.look();
    });
    if (location.search) history.replaceState(null, "", `/${location.hash}`); // no token stays in the address
    this.search();
  }

  /** What is at fault with what was asked, or with the looks for what is new; nothing for null. */
  tell(error, of = "asked") {
    this.faults.set(of, error ? error.message || String(error) : "");
    const text = [...new Set(this.faults.values())].filter(Boolean).join(" ");
    if (this.trouble.textContent !== text) this.trouble.textContent = text;
    this.trouble.hidden = !text;
  }

  /** Whether the hand is at something that new births would change. */
  get isHeld() {
    return this.pressed.size > 0 || Boolean(document.activeElement.closest(".evocity-panel"));
  }

  // -- which runs ------------------------------------------------------------------------------

  isRun(run) { return this.known.some((one) => one.run === run); }

  /** Look for runs, again and again; show those that the address tells once there are some. */
  async search() {
    clearTimeout(this.timer);
    if (this.searching) return;
    this.searching = true;
    try {
      const { runs, more } = await asked("runs");
      this.list(runs, more);
      if (!this.runs.length && !this.desk.isShown) this.go();
      if (!runs.length) this.news.textContent = "there is no run yet";
      this.tell(null, "runs");
    } catch (error) {
      this.tell(error, "runs");
    }
    this.searching = false;
    this.timer = setTimeout(() => this.search(), document.hidden ? UNSEEN : SEEN);
  }

  /** Show what the address says: the desk, where there is no run too, or runs. */
  go() {
    const isDesk = location.hash === DESK || !this.known.length;
    if (isDesk !== this.desk.isShown) this.desk.show(isDesk);
    this.shown.hidden = isDesk;
    this.tellFresh();
    if (isDesk) document.title = "new run – evocity studio";
    else this.open(readAddress((run) => this.isRun(run)));
    if (!isDesk) for (const of of ["desk", "desk looked"]) this.tell(null, of);
  }

  tellFresh() {
    this.fresh.textContent = this.desk.isShown ? "back to the runs" : "new run";
    this.fresh.hidden = this.desk.isShown && !this.known.length;
  }

  /** A run that was begun at the desk, or another, in place of the desk. */
  async showRun(run) {
    if (!this.isRun(run)) await this.search();
    if (!this.isRun(run)) return;
    history.pushState(null, "", `/#${encodeURIComponent(JSON.stringify(this.told.get(run) || { run }))}`);
    this.go();
  }

  /** Those there are, to choose from; the rest stays under the hand that chooses. */
  list(runs, more) {
    const key = JSON.stringify([runs, more]);
    if (key === this.listed) return;
    this.listed = key;
    this.known = runs;
    this.chooser.hidden = runs.length < 2;
    this.tellFresh();
    const options = runs.map(({ run, name, going }) => [String(run), going ? `${name}, goes on` : name]);
    const left = more ? [["", `${more} more are not listed`]] : [];
    this.choosers.forEach((select, place) => {
      const was = select.value, none = place ? [["", "none"]] : [];
      select.replaceChildren(...[...none, ...options, ...left].map(([value, text]) => made(null, "option", "", text, { value })));
      if (left.length) select.lastChild.disabled = true;
      select.value = was;
    });
    this.inform();
  }

  /** What is chosen in the head. */
  choose() {
    if (this.desk.isShown) history.pushState(null, "", "/#");
    this.desk.show(false);
    this.shown.hidden = false;
    this.tellFresh();
    const [first, second] = this.choosers.map((one) => one.value);
    const runs = [first, second].filter((one, place) => one !== "" && (!place || one !== first)).map(Number);
    this.open(runs.map((run) => this.told.get(run) || { run }));
    if (this.runs.length > 1) this.turn(this.runs[1]);
  }

  /** Show the runs of which something is told, one or two, each {run, …}; the others are closed. */
  open(told) {
    for (const one of this.runs) this.told.set(one.number, one.held);
    const kept = new Map(this.runs.map((one) => [one.number, one]));
    this.runs = told.map((one) => {
      const here = kept.get(one.run);
      kept.delete(one.run);
      if (!here) return this.opened(one);
      if (JSON.stringify(one) !== JSON.stringify(here.held)) here.change(one);
      return here;
    });
    for (const one of kept.values()) {
      one.close();
      for (const of of this.faults.keys()) if (of.startsWith(`${one.number} `)) this.tell(null, of);
    }
    this.places[0].append(...this.runs.map((one) => one.main)); // in this order
    this.places[0].classList.toggle("evocity-two", this.runs.length > 1);
    this.turn(this.runs.includes(this.run) ? this.run : this.runs[0]);
    this.saved();
  }

  opened(told) {
    const found = new Run(told.run, ...this.places, told, {
      isHeld: () => this.isHeld,
      saved: () => this.saved(),
      inform: () => this.inform(),
      tell: (error, of) => this.tell(error, `${told.run} ${of}`),
      turn: () => this.turn(found),
    });
    return found;
  }

  /** The run of which is told at the side. */
  turn(run) {
    this.run = run;
    for (const one of this.runs) {
      one.side.hidden = one !== run;
      one.main.classList.toggle("evocity-turned", one === run && this.runs.length > 1);
    }
    this.inform();
  }

  saved() {
    if (!this.desk.isShown && this.runs.every((one) => one.state)) writeAddress(this.runs.map((one) => one.held));
  }

  /** What is told of the runs in the head. */
  inform() {
    this.choosers.forEach((select, place) => {
      const run = this.runs[place];
      select.value = run ? String(run.number) : "";
      for (const option of select.options) {
        if (place && this.runs.length) option.disabled = option.value === String(this.runs[0].number);
      }
    });
    const texts = this.runs.map((one) => [one.about ? one.about.title : "", one.news || "opening the run …"]);
    const text = texts.map(([title, news]) => (texts.length > 1 && title ? `${title}: ${news}` : news)).join(" | ");
    if (this.runs.length && this.news.textContent !== text) this.news.textContent = text;
    const about = this.run && this.run.about;
    if (about && !this.desk.isShown) document.title = `${about.title} – evocity studio`;
  }

  /** Look for what is new now. */
  look() {
    this.search();
    for (const one of this.runs) one.look();
  }
}

window.studio = new Studio();
