import { Births } from "./births.js";
import { counted } from "./made.js";
import { Tiles } from "./tiles.js";
import { Viewer } from "./viewer.js";
import { pythonOf, readAddress, writeAddress } from "./address.js";
import { Breed } from "./breed.js";
import { One } from "./one.js";
import { Picks } from "./picks.js";
import { asked, framed, tiles } from "./server.js";
import { Tabs } from "./tabs.js";

/** Milliseconds between two looks for what is new: while the page is seen, and while it is not. */
const SEEN = 1500, UNSEEN = 15000;

/** The page: all births on one side; one of them, and what is picked, on the other. */
class Studio {
  constructor() {
    this.news = document.getElementById("news");
    this.trouble = document.getElementById("trouble");
    const side = document.getElementById("side");
    this.tabs = new Tabs(document.getElementById("tabs"), side, ["birth", "picks", "breed"]);
    this.small = new Tiles((ids, side) => tiles("tiles", { ids, side }), () => this.arrived());
    const on = {
      wake: (id) => this.wake(id),
      pick: (ids) => this.picks.change({ change: "pick", ids }),
      drop: (ids) => this.picks.change({ change: "drop", ids }),
      chosen: () => (this.state ? this.state.chosen : []),
      choose: (chosen) => this.viewer.change({ chosen }),
      picked: (ids) => this.picked(ids),
      python: () => (this.state ? pythonOf(this.about.folder, this.state) : ""),
      trouble: (error) => this.tell(error),
    };
    this.one = new One(this.tabs.panes.birth, this.small, on);
    this.breed = new Breed(this.tabs.panes.breed, {
      ids: () => (this.picks ? this.picks.ids : []), births: () => this.viewer.births, trouble: on.trouble,
    });
    this.picks = new Picks(this.tabs.panes.picks, this.small, on);
    this.tabs.seen = (name) => {
      if (name === "breed" && this.about) this.breed.open();
    };
    this.pressed = new Set();
    for (const name of ["pointerdown", "pointerup", "pointercancel"]) {
      window.addEventListener(name, ({ pointerId }) => {
        if (name === "pointerdown") this.pressed.add(pointerId);
        else this.pressed.delete(pointerId);
      }, true);
    }
    window.addEventListener("hashchange", () => {
      if (this.viewer) this.viewer.change(readAddress(this.viewer.births, this.usual));
    });
    document.addEventListener("visibilitychange", () => {
      if (!document.hidden) this.look();
    });
    if (location.search) history.replaceState(null, "", `/${location.hash}`); // no token stays in the address
    this.look();
  }

  /** What is at fault with what was asked, or with the looks for what is new; nothing for null. */
  tell(error, of = "asked") {
    this.faults = { ...this.faults, [of]: error ? error.message || String(error) : "" };
    const text = Object.values(this.faults).filter(Boolean).join(" ");
    if (this.trouble.textContent !== text) this.trouble.textContent = text;
    this.trouble.hidden = !text;
  }

  // -- births ----------------------------------------------------------------------------------

  /** Whether the hand is at something that new births would change. */
  get isHeld() {
    return this.pressed.size > 0 || Boolean(document.activeElement.closest(".evocity-panel"));
  }

  /** Look for what is new, again and again, one look at a time. */
  async look() {
    clearTimeout(this.timer);
    if (this.looking) return;
    this.looking = true;
    const began = performance.now();
    try {
      const after = this.about ? this.about.generation : -1;
      const news = await asked("changes", { after });
      const isOther = this.about && news.run !== this.about.run;
      if (!this.about) await this.picks.load();
      if ((news.more || isOther) && !news.problem && !(this.about && this.isHeld)) await this.renew();
      this.inform(news);
      this.tell(news.problem, "looked");
    } catch (error) {
      this.tell(error, "looked");
    }
    this.looking = false;
    const wait = document.hidden ? UNSEEN : SEEN;
    this.timer = setTimeout(() => this.look(), Math.max(wait, 5 * (performance.now() - began)));
  }

  inform(news) {
    const told = [];
    if (!this.about) told.push("no whole generation yet");
    else told.push(`generation ${counted(this.about.generation)}`, `${counted(this.about.count)} births`);
    told.push(news.going ? "it goes on" : "nothing is at work on it");
    this.picks.going = news.going;
    const text = told.join(" · ");
    if (this.news.textContent !== text) this.news.textContent = text;
  }

  /** Whole generations anew, in place of those that are here: none can come twice. */
  async renew() {
    const { about, content } = await framed("births");
    const before = this.about;
    this.about = about;
    document.title = `${about.title} – evocity studio`;
    this.one.highest = about.highest; // metres at which all colours end
    if (!before || before.run !== about.run) this.begin(about, content);
    else this.viewer.grow(about, content);
    this.one.renew();
  }

  begin(about, content) {
    if (this.viewer) this.viewer.close();
    this.small.forget();
    const order = { name: about.axes.length ? about.axes[0].name : "id", reversed: false };
    this.usual = { chosen: [], brushes: {}, order, axes: about.axes };
    const { one, ...state } = readAddress(new Births(about, content), this.usual);
    this.state = { ...state, one };
    this.viewer = new Viewer(document.getElementById("births"), {
      about, buffer: content, state,
      save: (changes) => this.save(changes),
      tiles: (ids, side) => tiles("tiles", { ids, side }),
      woken: (id) => this.woken(id),
    });
    this.picked(this.picks.ids);
    if (one !== null) this.wake(one);
    this.save({});
  }

  save(changes) {
    Object.assign(this.state, changes);
    writeAddress(this.state);
    this.picks.inform();
  }

  /** Who is picked has a star. */
  picked(ids) {
    this.one.picked(ids);
    if (this.picks) this.breed.inform();
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
    writeAddress(this.state);
    this.one.show(id);
  }

  /** Show a birth, wherever it is: also one that does not pass the filter. */
  wake(id) {
    this.tabs.show("birth");
    const row = this.viewer.births.row(id), place = this.viewer.rows.indexOf(row);
    if (place >= 0) this.viewer.gallery.wake(place);
    this.state.one = id;
    writeAddress(this.state);
    this.one.show(id);
  }
}

window.studio = new Studio();
