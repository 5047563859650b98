import { made, number } from "./made.js";
import { Pedigree } from "./pedigree.js";

/** Pictures of a birth, by what the server calls them. */
const PICTURES = [["map", "map"], ["stones", "whose stones"]];
/** Maps of how often its own parts are called, by what the server calls them, and in words. */
const COUNTS = [["ranges", "usage", "how many lifs call the domain block that each range block is made of"],
  ["pixels", "µ", "how many lifs call each pixel"]];
/** What the page draws itself, in three dimensions. */
const SPACES = [["columns", "in space"], ["walk", "walk"]];

/** All that is told of one birth, by the `server` of its run. `on`: wake(id), pick(ids), drop(ids), trouble(error). */
export class One {
  constructor(parent, server, small, on) {
    [this.server, this.on] = [server, on];
    this.id = null;
    this.kind = "map";
    this.marks = new Set();
    this.nobody = made(parent, "p", "faint", "Click a birth, or go to one with the arrow keys, to see all that is told of it.");
    this.root = made(parent, "div");
    this.root.hidden = true;
    const head = made(this.root, "div", "row");
    this.title = made(head, "h2");
    this.pick = made(head, "button", "", "", { type: "button" });
    this.pick.addEventListener("click", () => (this.marks.has(this.id) ? on.drop : on.pick)([this.id]));
    this.origin = made(this.root, "p", "faint");
    const kinds = made(this.root, "div", "row", "", { role: "group", "aria-label": "picture" });
    this.kinds = new Map([...PICTURES, ...COUNTS, ...SPACES].map(([kind, text]) => {
      const button = made(kinds, "button", "", text, { type: "button" });
      button.addEventListener("click", () => this.picture(kind));
      return [kind, button];
    }));
    this.image = made(this.root, "img");
    this.legend = made(this.root, "p", "faint");
    this.within = made(this.root, "div", "space");
    this.within.hidden = true;
    this.lack = made(this.root, "p", "lack");
    this.facts = made(this.root, "div");
    made(this.root, "h3", "", "from whom it descends");
    this.pedigree = new Pedigree(this.root, server, small, { wake: (id) => on.wake(id) });
    this.making = made(this.root, "div");
  }

  /** Show the birth of an id. */
  show(id) {
    this.id = id;
    this.nobody.hidden = true;
    this.root.hidden = false;
    this.title.textContent = `birth ${id}`;
    this.picked([...this.marks]);
    this.renew(true);
    this.pedigree.show(id).catch(this.on.trouble);
  }

  /** Look anew at what may have changed: whether it lives, who was bred from it; `isOther`, its
   * picture too. */
  async renew(isOther = false) {
    const { id } = this;
    if (id === null) return;
    try {
      const told = await this.server.asked("one", { id });
      if (id !== this.id) return;
      this.tell(told);
      if (isOther) this.picture(told.pictured ? this.kind : null);
    } catch (error) {
      if (id === this.id) this.on.trouble(error);
    }
  }

  picked(ids) {
    this.marks = new Set(ids);
    const isPicked = this.marks.has(this.id);
    this.pick.textContent = isPicked ? "★ picked: drop it" : "pick it";
    this.pick.setAttribute("aria-pressed", String(isPicked));
  }

  arrived() { this.pedigree.draw(); }

  async picture(kind) {
    const { id } = this;
    for (const button of this.kinds.values()) button.disabled = !kind;
    if (!kind) {
      this.image.hidden = this.within.hidden = true;
      this.lack.hidden = false;
      this.lack.textContent = "It has no picture.";
      return;
    }
    this.kind = kind;
    for (const [one, button] of this.kinds) button.setAttribute("aria-pressed", String(one === kind));
    this.legend.textContent = "";
    const isMeant = () => id === this.id && kind === this.kind;
    const isDrawn = SPACES.some(([one]) => one === kind);
    try {
      if (isDrawn) {
        await this.draw(id, kind, isMeant);
        return;
      }
      this.within.hidden = true;
      const count = COUNTS.find(([one]) => one === kind);
      let blob, words = { map: `map of heights of birth ${id}, north up`, stones: `which city each stone of birth ${id} is from` }[kind];
      if (count) {
        const { about, content } = await this.server.framed("calls", { id, count: kind });
        if (!isMeant()) return;
        blob = new Blob([content], { type: "image/png" });
        words = `birth ${id}: ${count[2]}`;
        const more = about.most > about.end ? `; a few up to ${about.most}` : "";
        this.legend.textContent = `${count[2]}: the bar goes from 0 to ${number(about.end)}${more}.`;
      } else blob = await this.server.blobOf("picture", { id, kind });
      if (!isMeant()) return;
      if (this.address) URL.revokeObjectURL(this.address);
      this.address = URL.createObjectURL(blob);
      this.image.src = this.address;
      this.image.alt = words;
      this.image.classList.toggle("evocity-pixels", Boolean(count));
      this.image.hidden = false;
      this.lack.hidden = true;
    } catch (error) {
      if (!isMeant()) return;
      this.image.hidden = this.within.hidden = true;
      this.lack.hidden = false;
      this.lack.textContent = `It has no picture: ${error.message}`;
    }
  }

  /** In three dimensions; what draws is loaded when it is first asked for. */
  async draw(id, kind, isMeant) {
    if (!this.drawn) {
      const { Space } = await import("./space.js");
      this.drawn = new Space(this.within);
    }
    const { about, content } = await this.server.framed("heights", { id });
    if (!isMeant()) return;
    this.image.hidden = this.lack.hidden = true;
    this.within.hidden = false;
    this.drawn.show({
      heights: new Float32Array(content.slice().buffer), rows: about.height, columns: about.width,
      metresPerPixel: about.metres, highest: this.highest,
    }, kind === "walk", `birth ${id}`);
  }

  tell(told) {
    const words = (text) => text.replaceAll("_", " ");
    const lived = told.lived ? `lived in ${told.lived} generation${told.lived > 1 ? "s" : ""}` : "never lived on";
    const origin = [`generation ${told.generation}`, words(told.operator), told.alive ? "alive" : lived];
    if (told.island !== null) origin.splice(1, 0, `island ${told.island}`);
    this.origin.textContent = origin.join(" · ");
    this.facts.replaceChildren();
    if (told.status !== "ok") {
      made(this.facts, "p", "lack", `It failed: ${words(told.status)}. ${told.error || ""}`);
    } else if (told.error) made(this.facts, "p", "faint", told.error);
    if (told.status === "ok" && !told.feasible) made(this.facts, "p", "lack", "✕ It breaks a bound.");
    this.measures(told.measures);
    this.stones(told.stones);
    this.links("bred from", told.parents);
    this.links("parent of", told.children);
    this.made(told);
  }

  measures(listed) {
    const table = made(this.facts, "table", "values");
    made(table, "caption", "", "what it has, and what was wanted");
    for (const one of listed) {
      const row = made(table, "tr", "", "", one.summary ? { title: one.summary } : {});
      made(row, "th", "", one.name.replaceAll("_", " "), { scope: "row" });
      made(row, "td", "number", `${number(one.value ?? NaN)} ${one.unit}`.trimEnd());
      const isBroken = one.value !== null && !one.kept;
      made(row, "td", "faint", `${isBroken ? "✕ " : ""}${one.wanted}`);
    }
  }

  stones(shares) {
    const listed = Object.entries(shares).sort((a, b) => b[1] - a[1]);
    if (!listed.length) return;
    const table = made(this.facts, "table", "values");
    made(table, "caption", "", "whose stones it is made of");
    for (const [city, share] of listed) {
      const row = made(table, "tr");
      made(row, "th", "", city, { scope: "row" });
      made(row, "td", "number", `${(100 * share).toFixed(share < 0.01 ? 1 : 0)} %`);
      const bar = made(made(row, "td", "share"), "div", "bar");
      bar.style.width = `${Math.max(1, 100 * share)}%`;
    }
  }

  links(text, ids) {
    if (!ids.length) return;
    const row = made(this.facts, "div", "row");
    made(row, "span", "faint", text);
    for (const id of ids) {
      made(row, "button", "link", String(id), { type: "button", "aria-label": `birth ${id}` })
        .addEventListener("click", () => this.on.wake(id));
    }
  }

  made(told) {
    this.making.replaceChildren();
    if (!told.made.length) return;
    const more = made(this.making, "details");
    made(more, "summary", "", "what its operator recorded");
    const list = made(more, "dl");
    for (const [key, text] of told.made) {
      made(list, "dt", "", key.replaceAll("_", " "));
      made(list, "dd", "", text);
    }
  }
}
