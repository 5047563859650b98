import { Births } from "./births.js";
import { counted, made } from "./made.js";
import { Tiles } from "./tiles.js";
import { Viewer } from "./viewer.js";
import { checked, pythonOf } from "./address.js";
import { Board } from "./board.js";
import { Breed } from "./breed.js";
import { Going } from "./going.js";
import { One } from "./one.js";
import { Picks } from "./picks.js";
import { ofRun } from "./server.js";
import { Tabs } from "./tabs.js";

/** Milliseconds between two looks for what is new: while the page is seen, and while it is not. */
const SEEN = 1500, UNSEEN = 15000;

/** One run: all its births in `main`; one of them, and what is picked, in `side`. `told`, what the
 * address says of it. `on`: isHeld(), saved(), inform(), tell(error, of), turn(), there is something
 * to see at its side. */
export class Run {
  constructor(number, main, side, told, on) {
    [this.number, this.on, this.told] = [number, on, told];
    this.server = ofRun(number);
    this.main = made(main, "section", "births", "", { "aria-label": "all births" });
    this.births = made(this.main, "div");
    this.stage = made(this.main, "div", "stage");
    this.stage.hidden = true;
    this.side = made(side, "section", "side", "", { "aria-label": "one birth, picks, children" });
    this.going = new Going(this.side, this.server, {
      look: () => this.look(), trouble: (error) => !this.isClosed && on.tell(error, "asked"),
    });
    const list = made(this.side, "div", "tabs", "", { role: "tablist", "aria-label": "what is shown here" });
    this.tabs = new Tabs(list, this.side, ["birth", "picks", "breed", "draw"], number);
    this.small = new Tiles((ids, size) => this.sheet(ids, size), () => this.arrived());
    const hear = {
      wake: (id) => this.wake(id),
      pick: (ids) => this.picks.change({ change: "pick", ids }),
      drop: (ids) => this.picks.change({ change: "drop", ids }),
      pin: (id) => this.pin(id),
      chosen: () => (this.state ? this.state.chosen : []),
      choose: (chosen) => this.viewer.change({ chosen }),
      picked: (ids) => this.picked(ids),
      python: () => (this.state ? pythonOf(this.about.folder, this.state) : ""),
      trouble: (error) => !this.isClosed && on.tell(error, "asked"),
    };
    this.one = new One(this.tabs.panes.birth, this.server, this.small, hear);
    this.breed = new Breed(this.tabs.panes.breed, this.server, {
      ids: () => (this.picks ? this.picks.ids : []), births: () => this.viewer.births, trouble: hear.trouble,
    });
    this.board = new Board(this.tabs.panes.draw, this.stage, this.server, {
      ids: () => (this.picks ? this.picks.ids : []), births: () => this.viewer.births,
      highest: () => this.one.seen.highest, trouble: hear.trouble,
    });
    this.picks = new Picks(this.tabs.panes.picks, this.server, this.small, hear);
    this.tabs.seen = (name) => {
      this.stage.hidden = name !== "draw";
      this.births.hidden = name === "draw";
      if (name === "breed" && this.about) this.breed.open();
      if (name === "draw" && this.about) this.board.open();
    };
    for (const part of [this.main, this.side]) part.addEventListener("keydown", (event) => this.press(event));
    for (const name of ["pointerdown", "focusin"]) this.main.addEventListener(name, () => on.turn(), true);
    this.look();
  }

  sheet(ids, side) { return this.server.tiles("tiles", { ids, side }); }

  close() {
    this.isClosed = true;
    clearTimeout(this.timer);
    if (this.viewer) this.viewer.close();
    this.main.remove();
    this.side.remove();
  }

  // -- births ----------------------------------------------------------------------------------

  /** Look for what is new, again and again, one look at a time. */
  async look() {
    clearTimeout(this.timer);
    if (this.looking || this.isClosed) return;
    this.looking = true;
    const began = performance.now();
    try {
      const after = this.about ? this.about.generation : -1;
      const news = await this.server.asked("changes", { after });
      if (this.isClosed) return;
      const isOther = this.about && news.run !== this.about.run;
      if (!this.about) await this.picks.load();
      if ((news.more || isOther) && !news.problem && !(this.about && this.on.isHeld())) await this.renew();
      this.inform(news);
      this.on.tell(news.problem, "looked");
    } catch (error) {
      if (!this.isClosed) this.on.tell(error, "looked");
    }
    this.looking = false;
    if (this.isClosed) return;
    const wait = document.hidden ? UNSEEN : SEEN;
    this.timer = setTimeout(() => this.look(), Math.max(wait, 5 * (performance.now() - began)));
  }

  inform(news) {
    const told = [];
    if (!this.about) told.push("no whole generation yet");
    else told.push(`generation ${counted(this.about.generation)}`, `${counted(this.about.count)} births`);
    told.push(news.going ? "it goes on" : "nothing is at work on it");
    this.picks.going = news.going;
    this.going.inform(news);
    this.news = told.join(" · ");
    this.on.inform();
  }

  /** Whole generations anew, in place of those that are here: none can come twice. */
  async renew() {
    const { about, content } = await this.server.framed("births");
    if (this.isClosed) return;
    const before = this.about;
    this.about = about;
    this.one.seen.highest = about.highest; // metres at which all colours end
    if (!before || before.run !== about.run) this.begin(about, content);
    else this.viewer.grow(about, content);
    this.one.renew();
  }

  begin(about, content) {
    if (this.viewer) this.viewer.close();
    this.small.forget();
    const order = { name: about.axes.length ? about.axes[0].name : "id", reversed: false };
    this.usual = { chosen: [], brushes: {}, order, axes: about.axes };
    const { one, pinned, ...state } = checked(this.told, new Births(about, content), this.usual);
    this.state = { ...state, one, pinned };
    this.main.setAttribute("aria-label", `all births of ${about.title}`);
    this.side.setAttribute("aria-label", `one birth, picks, children of ${about.title}`);
    this.viewer = new Viewer(this.births, {
      about, buffer: content, state,
      save: (changes) => this.save(changes),
      tiles: (ids, side) => this.sheet(ids, side),
      woken: (id) => this.woken(id),
      compare: (asked) => this.server.numbers("compare", asked),
      trouble: (error) => this.on.tell(error, "asked"),
    });
    this.picked(this.picks.ids);
    this.one.pinTo(pinned);
    if (one !== null) this.wake(one);
    this.save({});
  }

  save(changes) {
    Object.assign(this.state, changes);
    this.on.saved();
    this.picks.inform();
  }

  /** The address says something else of it. */
  change(told) {
    this.told = told;
    if (!this.viewer) return;
    const { one, pinned, ...state } = checked(told, this.viewer.births, this.usual);
    this.viewer.change(state);
    this.pin(pinned);
    if (one !== null && one !== this.one.id) this.wake(one);
  }

  /** What the address holds of it. */
  get held() { return { run: this.number, ...(this.state || { ...this.told, beside: undefined }) }; }

  /** Who is picked has a star. */
  picked(ids) {
    this.one.picked(ids);
    if (this.picks) {
      this.breed.inform();
      this.board.inform();
    }
    if (!this.viewer) return;
    this.viewer.gallery.marked = new Set(ids);
    this.viewer.gallery.draw();
  }

  arrived() {
    this.one.arrived();
    this.picks.arrived();
  }

  // -- one birth -------------------------------------------------------------------------------

  /** What the gallery says of the birth that is awake there. */
  woken(id) {
    if (id === null || !this.state || id === this.one.id) return;
    this.state.one = id;
    this.on.saved();
    this.one.show(id);
  }

  /** Have a birth stand beside the others, or none (null). */
  pin(id) {
    if (!this.state) return;
    this.state.pinned = id;
    this.on.saved();
    this.one.pinTo(id);
  }

  /** Keys that go everywhere but where one writes or draws. */
  press({ key, target, ctrlKey, metaKey, altKey }) {
    if (key !== "p" || ctrlKey || metaKey || altKey || target.closest("input, select, textarea, [role=application]")) return;
    this.one.turnPin();
  }

  /** Show a birth, wherever it is: also one that does not pass the filter. */
  wake(id) {
    this.tabs.show("birth");
    const row = this.viewer.births.row(id), place = this.viewer.rows.indexOf(row);
    if (place >= 0) this.viewer.gallery.wake(place);
    this.state.one = id;
    this.on.saved();
    this.one.show(id);
  }
}
