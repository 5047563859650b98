import { Buildings } from "./buildings.js";
import { made, number } from "./made.js";
import { Pedigree } from "./pedigree.js";
import { Seen } from "./seen.js";

/** All that is told of one birth, by the `server` of its run, beside another that is pinned. `on`: wake(id),
 * pick(ids), drop(ids), pin(id), trouble(error). */
export class One {
  constructor(parent, server, small, on) {
    [this.server, this.on] = [server, on];
    this.id = this.pinned = null;
    this.marks = new Set();
    this.nobody = made(parent, "p", "faint", "Click a birth, or go to one with the arrow keys, to see all that is told of it.");
    this.root = made(parent, "div");
    this.root.hidden = true;
    const head = made(this.root, "div", "row");
    this.title = made(head, "h2");
    this.pick = made(head, "button", "", "", { type: "button" });
    this.pick.addEventListener("click", () => (this.marks.has(this.id) ? on.drop : on.pick)([this.id]));
    this.pin = made(head, "button", "", "", { type: "button", "aria-keyshortcuts": "p" });
    this.pin.addEventListener("click", () => this.turnPin());
    this.beside = made(this.root, "div", "row", "", { role: "status" });
    this.origin = made(this.root, "p", "faint");
    this.seen = new Seen(made(this.root, "div"), server);
    this.image = this.seen.figures[0].image;
    this.facts = made(this.root, "div");
    this.buildings = new Buildings(this.root, server);
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

  /** Who stands beside it; null while it is pinned itself, or nobody is. */
  get other() { return this.pinned === this.id ? null : this.pinned; }

  /** Pin what is shown, or take that pin off. */
  turnPin() {
    if (this.id !== null) this.on.pin(this.pinned === this.id ? null : this.id);
  }

  /** Who is pinned, null for nobody. */
  pinTo(id) {
    if (id === this.pinned) return;
    this.pinned = id;
    this.renew(true);
  }

  /** Look anew at what may have changed: whether it lives, who was bred from it; `isOther`, its
   * picture too. */
  async renew(isOther = false) {
    const { id, other } = this;
    if (id === null) return;
    this.tellPin();
    try {
      const ids = other === null ? [id] : [id, other];
      const told = await Promise.all(ids.map((one) => this.server.asked("one", { id: one })));
      if (id !== this.id || other !== this.other) return;
      this.tell(...told);
      if (!isOther) return;
      this.seen.show(id, told[1]?.pictured ? other : null, told[0].pictured);
      this.buildings.show(id, other);
    } catch (error) {
      if (id === this.id) this.on.trouble(error);
    }
  }

  tellPin() {
    const { other } = this, isPinned = this.id === this.pinned;
    this.pin.textContent = isPinned ? "pinned: take the pin off" : "pin it";
    this.pin.title = "others are shown beside the one that is pinned (key p)";
    this.pin.setAttribute("aria-pressed", String(isPinned));
    this.root.classList.toggle("evocity-pinned", this.pinned !== null);
    this.beside.replaceChildren();
    if (other === null) {
      if (isPinned) made(this.beside, "span", "faint", "Others are shown beside it: go to another one.");
      return;
    }
    made(this.beside, "span", "faint", "beside it is");
    made(this.beside, "button", "link", `birth ${other}`, { type: "button" }).addEventListener("click", () => this.on.wake(other));
    made(this.beside, "button", "", "take its pin off", { type: "button" }).addEventListener("click", () => {
      this.on.pin(null);
      this.pin.focus();
    });
  }

  picked(ids) {
    this.marks = new Set(ids);
    const isPicked = this.marks.has(this.id);
    this.pick.textContent = isPicked ? "★ picked: drop it" : "pick it";
    this.pick.setAttribute("aria-pressed", String(isPicked));
  }

  arrived() { this.pedigree.draw(); }

  /** Of a birth, and of the `other` beside it, if there is one. */
  tell(told, other) {
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
    this.measures(told, other);
    this.stones(told.stones);
    this.links("bred from", told.parents);
    this.links("parent of", told.children);
    this.made(told);
  }

  measures(told, other) {
    const table = made(this.facts, "table", "values");
    made(table, "caption", "", other ? "what each has, and what was wanted" : "what it has, and what was wanted");
    if (other) {
      const head = made(table, "tr");
      for (const text of ["", `birth ${told.id}`, `birth ${other.id}, pinned`, "it has more", "wanted"]) {
        made(head, text ? "th" : "td", text && text !== "wanted" ? "number" : "", text, text ? { scope: "col" } : {});
      }
    }
    const others = other ? other.measures : [];
    told.measures.forEach((one, place) => {
      const row = made(table, "tr", "", "", one.summary ? { title: one.summary } : {});
      made(row, "th", "", one.name.replaceAll("_", " "), { scope: "row" });
      const value = (of) => {
        const isBroken = of.value !== null && !of.kept;
        made(row, "td", "number", `${isBroken && other ? "✕ " : ""}${number(of.value ?? NaN)} ${of.unit}`.trimEnd());
        return isBroken;
      };
      const isBroken = value(one), beside = others[place];
      if (beside) {
        value(beside);
        const more = one.value === null || beside.value === null ? NaN : one.value - beside.value;
        made(row, "td", "number", `${more > 0 ? "+" : more < 0 ? "−" : ""}${number(Math.abs(more))}`);
      }
      made(row, "td", "faint", `${isBroken && !other ? "✕ " : ""}${one.wanted}`);
    });
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
