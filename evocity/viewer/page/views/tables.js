import { countText, element, number } from "../elements.js";

/** Births in the table, at most. */
const MOST = 100;

/** The tables of the run, and the births that pass the filter as a table; a click on a heading sorts the births. */
class Tables {
  constructor(root, page, hands) {
    [this.page, this.hands] = [page, hands];
    this.births = element(root, "section");
    this.run = element(root, "section");
  }

  update(changes) {
    if (["births", "brushes", "order"].some((name) => name in changes)) this.showBirths();
    if (this.shown !== this.page.births) this.load();
  }

  async load() {
    this.shown = this.page.births;
    try {
      const tables = await this.hands.part("tables");
      this.run.replaceChildren(...tables.flatMap(({ title, headings, rows, note }) => {
        const part = element(null, "section");
        element(part, "h2", "", title);
        if (note) element(part, "p", "faint", note);
        table(part, title, headings, rows.map((row) => row.map((cell) => (typeof cell === "number" ? number(cell) : cell ?? "–"))));
        return [part];
      }));
    } catch (error) {
      this.run.replaceChildren(element(null, "p", "faint", `There are no tables: ${error.message}`));
    }
  }

  showBirths() {
    const { births, rows, state: { order } } = this.page, id = births.byName.get("id"), columns = [id, ...births.columns.filter((one) => one !== id)], shown = Array.from(rows.slice(0, MOST));
    const left = rows.length - shown.length, focused = [...this.births.querySelectorAll("button")].indexOf(document.activeElement);
    this.births.replaceChildren(element(null, "h2", "", "births that pass the filter"));
    if (left) element(this.births, "p", "faint", `The table has the first ${MOST} births. ${countText(left)} more births pass the filter.`);
    const heads = table(this.births, "births", columns.map((one) => one.name), shown.map((row) => columns.map((one) => one.text(row))), true);
    heads.forEach((head, k) => {
      const button = head.querySelector("button"), { name } = columns[k], isSorted = name === order.name;
      if (isSorted) head.setAttribute("aria-sort", columns[k].orderName(order.reversed).match(/highest|Z to A/) ? "descending" : "ascending");
      button.addEventListener("click", () => this.hands.change({ order: { name, reversed: isSorted && !order.reversed } }));
      if (k === focused) button.focus();
    });
  }
}

/** A table that scrolls by itself; its headings, as buttons if it `isSortable`. */
function table(parent, title, headings, rows, isSortable = false) {
  const wide = element(parent, "div", "wide", "", { tabindex: "0", role: "region", "aria-label": title });
  const whole = element(wide, "table"), heads = element(element(whole, "thead"), "tr"), body = element(whole, "tbody");
  const made = headings.map((text) => {
    const head = element(heads, "th", "", isSortable ? "" : text, { scope: "col" });
    if (isSortable) element(head, "button", "", text.replaceAll("_", " "), { type: "button" });
    return head;
  });
  for (const row of rows) {
    const line = element(body, "tr");
    for (const cell of row) element(line, "td", "", String(cell));
  }
  return made;
}

export const view = {
  name: "tables", title: "tables", place: 70, suits: () => true, open: (root, page, hands) => new Tables(root, page, hands),
};
