import { Buildings } from "./buildings.js";
import { button, element, number } from "./elements.js";
import { FilterDesk } from "./filter.js";
import { Growth } from "./growth.js";
import { Pictures } from "./pictures.js";

/** The pane of one birth, from the `server` of its run, with the pinned birth beside it. `on`: showBirth(id),
 * pick(ids), drop(ids), pin(id), trouble(error). */
export class BirthPane {
  constructor(parent, server, on) {
    [this.server, this.on] = [server, on];
    this.id = this.pinned = null;
    this.marks = new Set();
    this.emptyText = element(parent, "p", "faint", "To see the details of a birth, click the birth or select it with the arrow keys.");
    this.root = element(parent, "div");
    this.root.hidden = true;
    const head = element(this.root, "div", "row");
    this.title = element(head, "h2");
    this.pick = button(head, "", () => (this.marks.has(this.id) ? on.drop : on.pick)([this.id]));
    this.pin = button(head, "", () => this.turnPin());
    this.pin.setAttribute("aria-keyshortcuts", "p");
    this.pinRow = element(this.root, "div", "row", "", { role: "status" });
    this.origin = element(this.root, "p", "faint");
    this.pictures = new Pictures(element(this.root, "div"), server);
    this.image = this.pictures.figures[0].image;
    const hear = { picks: () => [...this.marks], highest: () => this.pictures.highest };
    this.filter = new FilterDesk(this.root, server, hear);
    this.growth = new Growth(this.root, server, hear);
    this.facts = element(this.root, "div");
    this.buildings = new Buildings(this.root, server);
    this.record = element(this.root, "div");
  }

  /** Show the birth of an id. */
  show(id) {
    this.id = id;
    this.emptyText.hidden = true;
    this.root.hidden = false;
    this.title.textContent = `birth ${id}`;
    this.markPicks([...this.marks]);
    this.renew(true);
  }

  /** The pinned birth beside it; null without one, or if it is pinned itself. */
  get other() { return this.pinned === this.id ? null : this.pinned; }

  /** Pin the visible birth, or unpin it. */
  turnPin() {
    if (this.id !== null) this.on.pin(this.pinned === this.id ? null : this.id);
  }

  /** Pin a birth, null for none. */
  pinTo(id) {
    if (id === this.pinned) return;
    this.pinned = id;
    this.renew(true);
  }

  /** Load the facts that may have changed: whether it is alive, its children; for another birth (`isOther`) also
   * its pictures. */
  async renew(isOther = false) {
    const { id, other } = this;
    if (id === null) return;
    this.showPin();
    try {
      const ids = other === null ? [id] : [id, other];
      const births = await Promise.all(ids.map((one) => this.server.getJson("one", { id: one })));
      if (id !== this.id || other !== this.other) return;
      this.showFacts(...births);
      if (!isOther) return;
      this.pictures.show(id, births[1]?.pictured ? other : null, births[0].pictured, births[0].fabric);
      this.buildings.show(id, other);
      for (const one of [this.filter, this.growth]) {
        one.root.hidden = !(births[0].pictured && births[0].fabric);
        if (!one.root.hidden) one.show(id, births[1]?.pictured ? other : null);
      }
    } catch (error) {
      if (id === this.id) this.on.trouble(error);
    }
  }

  showPin() {
    const { other } = this, isPinned = this.id === this.pinned;
    this.pin.textContent = isPinned ? "unpin this birth" : "pin this birth";
    this.pin.title = "Press p to pin this birth: a pinned birth stays visible beside any birth that you select.";
    this.pin.setAttribute("aria-pressed", String(isPinned));
    this.root.classList.toggle("evocity-pinned", this.pinned !== null);
    this.pinRow.replaceChildren();
    if (other === null) {
      if (isPinned) element(this.pinRow, "span", "faint", "This birth is pinned. Click another birth to compare it with the pinned birth.");
      return;
    }
    element(this.pinRow, "span", "faint", "pinned birth:");
    this.link(this.pinRow, other, `birth ${other}`);
    button(this.pinRow, `unpin birth ${other}`, () => {
      this.on.pin(null);
      this.pin.focus();
    });
  }

  markPicks(ids) {
    this.marks = new Set(ids);
    const isPicked = this.marks.has(this.id);
    this.pick.textContent = isPicked ? "★ drop from picks" : "pick this birth";
    this.pick.setAttribute("aria-pressed", String(isPicked));
  }

  /** Show the facts of a birth, and of the `other` beside it, if there is one. */
  showFacts(birth, other) {
    const words = (text) => text.replaceAll("_", " ");
    const lived = birth.lived ? `survived ${birth.lived} generation${birth.lived > 1 ? "s" : ""}` : "never survived selection";
    const origin = [`generation ${birth.generation}`, words(birth.operator), birth.alive ? "alive" : lived];
    if (birth.island !== null) origin.splice(1, 0, `island ${birth.island}`);
    this.origin.textContent = origin.join(" · ");
    this.facts.replaceChildren();
    if (birth.status !== "ok") {
      element(this.facts, "p", "lack", `This birth failed: ${words(birth.status)}. ${birth.error || ""}`);
    } else if (birth.error) element(this.facts, "p", "faint", birth.error);
    if (birth.status === "ok" && !birth.feasible) element(this.facts, "p", "lack", "✕ This birth breaks a bound.");
    this.showMeasures(birth, other);
    this.showShares(birth.stones);
    if (birth.scarce) element(this.facts, "p", "lack", birth.scarce);
    this.showLinks("parents", birth.parents);
    this.showLinks("children", birth.children);
    this.showRecord(birth);
  }

  showMeasures(birth, other) {
    const table = element(this.facts, "table", "values");
    element(table, "caption", "", "measures and goals");
    if (other) {
      const head = element(table, "tr");
      for (const text of ["", `birth ${birth.id}`, `birth ${other.id}, pinned`, "difference", "goal"]) {
        element(head, text ? "th" : "td", text && text !== "goal" ? "number" : "", text, text ? { scope: "col" } : {});
      }
    }
    const others = other ? other.measures : [];
    birth.measures.forEach((one, place) => {
      const row = element(table, "tr", "", "", one.summary ? { title: one.summary } : {});
      element(row, "th", "", one.name.replaceAll("_", " "), { scope: "row" });
      const value = (of) => {
        const isBroken = of.value !== null && !of.kept;
        element(row, "td", "number", `${isBroken && other ? "✕ " : ""}${number(of.value ?? NaN)} ${of.unit}`.trimEnd());
        return isBroken;
      };
      const isBroken = value(one), beside = others[place];
      if (beside) {
        value(beside);
        const more = one.value === null || beside.value === null ? NaN : one.value - beside.value;
        element(row, "td", "number", `${more > 0 ? "+" : more < 0 ? "−" : ""}${number(Math.abs(more))}`);
      }
      element(row, "td", "faint", `${isBroken && !other ? "✕ " : ""}${one.wanted}`);
    });
  }

  showShares(shares) {
    const listed = Object.entries(shares).sort((a, b) => b[1] - a[1]);
    if (!listed.length) return;
    const table = element(this.facts, "table", "values");
    element(table, "caption", "", "shares of the cities");
    for (const [city, share] of listed) {
      const row = element(table, "tr");
      element(row, "th", "", city, { scope: "row" });
      element(row, "td", "number", `${(100 * share).toFixed(share < 0.01 ? 1 : 0)} %`);
      const bar = element(element(row, "td", "share"), "div", "bar");
      bar.style.width = `${Math.max(1, 100 * share)}%`;
    }
  }

  showLinks(text, ids) {
    if (!ids.length) return;
    const row = element(this.facts, "div", "row");
    element(row, "span", "faint", text);
    for (const id of ids) this.link(row, id, String(id)).setAttribute("aria-label", `birth ${id}`);
  }

  link(parent, id, text) {
    const made = button(parent, text, () => this.on.showBirth(id));
    made.className = "evocity-link";
    return made;
  }

  showRecord(birth) {
    this.record.replaceChildren();
    if (!birth.made.length) return;
    const more = element(this.record, "details");
    element(more, "summary", "", "record of its operator");
    const list = element(more, "dl");
    for (const [key, text] of birth.made) {
      element(list, "dt", "", key.replaceAll("_", " "));
      element(list, "dd", "", text);
    }
  }
}
