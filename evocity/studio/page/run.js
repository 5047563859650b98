import { Births } from "./births.js";
import { countText, element } from "./elements.js";
import { Tiles } from "./tiles.js";
import { Viewer } from "./viewer.js";
import { checkState, pythonOf } from "./address.js";
import { Breed } from "./breed.js";
import { RunControl } from "./control.js";
import { attempt } from "./controls.js";
import { BirthPane } from "./birth.js";
import { Picks } from "./picks.js";
import { Fault, serverOfRun } from "./server.js";
import { Tabs } from "./tabs.js";

/** Milliseconds between two looks for news: on a visible page, and on a hidden one. */
const VISIBLE = 1500, HIDDEN = 15000;

/** One run: all births in `main`; one birth, the picks and the children in `side`. `saved`: its state in the
 * address. `on`: isHeld(), save(), inform(), report(error, of), turn(), which shows its side. */
export class Run {
  constructor(number, main, side, saved, on) {
    [this.number, this.on, this.saved] = [number, on, saved];
    this.server = serverOfRun(number);
    this.main = element(main, "section", "births", "", { "aria-label": "all births" });
    this.births = element(this.main, "div");
    this.stage = element(this.main, "div", "stage");
    this.stage.hidden = true;
    this.side = element(side, "section", "side", "", { "aria-label": "one birth, picks, children" });
    this.control = new RunControl(this.side, this.server, {
      look: () => this.look(), trouble: (error) => !this.isClosed && on.report(error, "request"),
    });
    const list = element(this.side, "div", "tabs", "", { role: "tablist", "aria-label": "panes" });
    this.tabs = new Tabs(list, this.side, ["birth", "picks", "breed", "draw"], number);
    this.small = new Tiles((ids, size) => this.sheet(ids, size), () => this.picks.drawTiles());
    const hear = {
      showBirth: (id) => this.showBirth(id),
      pick: (ids) => this.picks.change({ change: "pick", ids }),
      drop: (ids) => this.picks.change({ change: "drop", ids }),
      pin: (id) => this.pin(id),
      chosen: () => (this.state ? this.state.chosen : []),
      choose: (chosen) => this.viewer.change({ chosen }),
      picked: (ids) => this.markPicks(ids),
      python: () => (this.state ? pythonOf(this.about.folder, this.state) : ""),
      trouble: (error) => !this.isClosed && on.report(error, "request"),
    };
    this.birth = new BirthPane(this.tabs.panes.birth, this.server, hear);
    this.breed = new Breed(this.tabs.panes.breed, this.server, {
      ids: () => (this.picks ? this.picks.ids : []), births: () => this.viewer.births, trouble: hear.trouble,
    });
    this.board = null; // until the tab "draw" is open for the first time
    this.picks = new Picks(this.tabs.panes.picks, this.server, this.small, hear);
    this.tabs.onShow = (name) => {
      this.stage.hidden = name !== "draw";
      this.births.hidden = name === "draw";
      if (name === "breed" && this.about) this.breed.open();
      if (name === "draw") this.draw(hear.trouble);
    };
    for (const part of [this.main, this.side]) part.addEventListener("keydown", (event) => this.press(event));
    for (const name of ["pointerdown", "focusin"]) this.main.addEventListener(name, () => on.turn(), true);
    this.look();
  }

  /** Open the drawing board, whose modules load at its first use. */
  async draw(trouble) {
    await attempt(trouble, async () => {
      const { Board } = await import("./board.js");
      this.board ||= new Board(this.tabs.panes.draw, this.stage, this.server, {
        ids: () => (this.picks ? this.picks.ids : []), births: () => this.viewer.births,
        highest: () => this.birth.pictures.highest, trouble,
      });
      if (!this.stage.hidden && this.about) await this.board.open();
    });
  }

  sheet(ids, side) { return this.server.getTiles("tiles", { ids, side }); }

  close() {
    this.isClosed = true;
    clearTimeout(this.timer);
    if (this.viewer) this.viewer.close();
    this.main.remove();
    this.side.remove();
  }

  // -- births ----------------------------------------------------------------------------------

  /** Look for news from time to time, one look at a time. */
  async look() {
    clearTimeout(this.timer);
    if (this.looking || this.isClosed) return;
    this.looking = true;
    const began = performance.now();
    try {
      const after = this.about ? this.about.generation : -1;
      const news = await this.server.getJson("changes", { after });
      if (this.isClosed) return;
      const isOther = this.about && news.run !== this.about.run;
      if (!this.about) await this.picks.load();
      this.isGoing = news.going;
      if ((news.more || isOther) && !news.problem && !(this.about && this.on.isHeld())) await this.renew();
      this.inform(news);
      this.on.report(news.problem && new Fault(news.problem), "news");
    } catch (error) {
      if (!this.isClosed) this.on.report(error, "news");
    }
    this.looking = false;
    if (this.isClosed) return;
    const wait = document.hidden ? HIDDEN : VISIBLE;
    this.timer = setTimeout(() => this.look(), Math.max(wait, 5 * (performance.now() - began)));
  }

  inform(news) {
    const parts = [];
    if (!this.about) parts.push("the first generation is not complete yet");
    else parts.push(`generation ${countText(this.about.generation)}`, `${countText(this.about.count)} births`);
    parts.push(news.going ? "running" : "finished");
    this.picks.going = news.going;
    if (news.going) this.wasGoing = true;
    else if (this.viewer && (this.wasGoing || this.viewer.newCount) && !news.more && !this.on.isHeld()) this.end();
    this.control.inform(news);
    this.news = parts.join(" · ");
    this.on.inform();
  }

  /** Settle the births of a run that ended, and show the births to keep, unless a user has chosen a view. */
  end() {
    this.wasGoing = false;
    this.viewer.settle();
    if (!this.state.view) this.viewer.change({ view: "keep" });
  }

  /** Load all whole generations again, so that no birth comes twice. */
  async renew() {
    const { about, content } = await this.server.getFramed("births");
    if (this.isClosed) return;
    const before = this.about;
    this.about = about;
    this.birth.pictures.highest = about.highest; // metres at the end of the colours
    if (!before || before.run !== about.run) this.begin(about, content);
    else this.viewer.grow(about, content);
    this.birth.renew();
  }

  begin(about, content) {
    if (this.viewer) this.viewer.close();
    this.small.forget();
    this.usual = { chosen: [], brushes: {}, order: about.order, axes: about.axes };
    const { one, pinned, ...state } = checkState(this.saved, new Births(about, content), this.usual);
    this.state = { ...state, one, pinned };
    this.main.setAttribute("aria-label", `all births of ${about.title}`);
    this.side.setAttribute("aria-label", `details of ${about.title}, with tabs for births, picks and children`);
    this.viewer = new Viewer(this.births, {
      about, buffer: content, state: { ...state, view: state.view || (this.isGoing ? "axes" : "keep") },
      save: (changes) => this.save(changes),
      tiles: (ids, side) => this.sheet(ids, side),
      part: (name) => this.server.getJson("part", { name }).then(({ value }) => value),
      ask: (name, body) => this.server.postJson(name, body),
      activate: (id) => this.activate(id),
      compare: (body) => this.server.postNumbers("compare", body),
      trouble: (error) => this.on.report(error, "request"),
    });
    this.markPicks(this.picks.ids);
    this.birth.pinTo(pinned);
    if (one !== null) this.showBirth(one);
    this.save({});
  }

  save(changes) {
    Object.assign(this.state, changes);
    this.on.save();
    this.picks.inform();
  }

  /** Show another state of the address. */
  change(saved) {
    this.saved = saved;
    if (!this.viewer) return;
    const { one, pinned, ...state } = checkState(saved, this.viewer.births, this.usual);
    this.viewer.change(state);
    this.pin(pinned);
    if (one !== null && one !== this.birth.id) this.showBirth(one);
  }

  /** Its state for the address. */
  get held() { return { run: this.number, ...(this.state || { ...this.saved, beside: undefined }) }; }

  /** Mark the picks with a star. */
  markPicks(ids) {
    this.birth.markPicks(ids);
    if (this.picks) {
      this.breed.inform();
      this.board?.inform();
    }
    if (!this.viewer) return;
    this.viewer.gallery.marked = new Set(ids);
    this.viewer.gallery.draw();
  }

  // -- one birth -------------------------------------------------------------------------------

  /** Show the active birth of the gallery. */
  activate(id) {
    if (id === null || !this.state || id === this.birth.id) return;
    this.state.one = id;
    this.on.save();
    this.birth.show(id);
  }

  /** Pin a birth, or none (null). */
  pin(id) {
    if (!this.state) return;
    this.state.pinned = id;
    this.on.save();
    this.birth.pinTo(id);
  }

  /** Keys that work everywhere except in fields and on the drawing board. */
  press({ key, target, ctrlKey, metaKey, altKey }) {
    if (key !== "p" || ctrlKey || metaKey || altKey || target.closest("input, select, textarea, [role=application]")) return;
    this.birth.turnPin();
  }

  /** Show a birth, also one that does not pass the filter. */
  showBirth(id) {
    this.tabs.show("birth");
    const row = this.viewer.births.row(id), place = this.viewer.rows.indexOf(row);
    if (place >= 0) this.viewer.gallery.activate(place);
    this.state.one = id;
    this.on.save();
    this.birth.show(id);
  }
}
