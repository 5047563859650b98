import { button, element, number } from "../elements.js";
import { Tiles, paintTile } from "../tiles.js";

const SIDE = 192, SHOWN = 160;

/** The births to keep, with pictures, reasons, shares of the source cities, values of goals and bounds, and commands. */
class Keep {
  constructor(root, page, hands) {
    [this.page, this.hands, this.cards] = [page, hands, []];
    const row = element(root, "div", "row");
    this.again = button(row, "consider the newer births too", () => this.load());
    this.all = button(row, "choose these births", () => hands.choose(this.cards.map((one) => one.id)));
    this.words = element(row, "span", "faint", "", { role: "status" });
    this.list = element(root, "ul", "kept");
    this.tiles = new Tiles(hands.pictures, () => this.draw());
    this.load();
  }

  async load() {
    this.births = this.page.births;
    this.again.hidden = true;
    this.words.textContent = "choosing the births to keep …";
    const request = this.request = {};
    try {
      const cards = await this.hands.part("keep");
      if (request !== this.request) return;
      this.cards = cards;
      this.words.textContent = !cards.length ? "No birth keeps the constraints, so there is nothing to keep yet."
        : cards.some((one) => one.feasible) ? "" : "No birth keeps all bounds. These are the best births of the last generation.";
    } catch (error) {
      this.words.textContent = `There are no births to keep: ${error.message}`;
    }
    this.all.hidden = !this.cards.length;
    this.list.replaceChildren(...this.cards.map((card) => this.item(card)));
    this.draw();
  }

  item(card) {
    const item = element(null, "li"), { births } = this.page;
    const picture = element(item, "button", "node", "", { type: "button", "aria-label": `show birth ${card.id}` });
    picture.addEventListener("click", () => this.hands.show(card.id));
    element(picture, "canvas", "", "", { "aria-hidden": "true" });
    const text = element(item, "div");
    const named = births.columns.map(({ name }) => name).filter((name) => name.includes("_"));
    const plain = (sentence) => named.reduce((line, name) => line.replaceAll(name, name.replaceAll("_", " ")), sentence);
    element(text, "h2", "", `${plain(card.role)}, birth ${card.id}`);
    for (const sentence of [card.why, card.gave_up, card.scarce]) if (sentence) element(text, "p", "", plain(sentence));
    const share = (value) => `${(100 * value).toFixed(value > 0 && value < 0.1 ? 1 : 0)} %`;
    const shares = card.shares.map((one) => `${one.city} ${share(one.share)} of the map, ${share(one.built)} of the buildings`);
    if (shares.length) element(text, "p", "faint", shares.join("; "));
    const facts = element(text, "div", "facts");
    const columns = births.columns.filter(({ name }) => Object.hasOwn(card.values, name));
    const isSought = ({ goal, target }) => goal !== null || target !== null;
    const aims = [...columns.filter(isSought), ...columns.filter((one) => !isSought(one) && one.sign)]; // then bounds
    for (const { name, sign, unit } of aims.length ? aims : columns) {
      const value = card.values[name], fact = element(facts, "div", "fact");
      element(fact, "span", "faint", `${name.replaceAll("_", " ")} ${sign}`.trimEnd());
      element(fact, "span", "", `${number(value === null ? NaN : value)} ${unit}`.trimEnd());
    }
    const code = element(element(text, "p", "faint", "for QGIS: "), "code");
    card.command.split(" ").forEach((word, k) => { // a line breaks between words only
      if (k) code.append(" ");
      element(code, "span", "", word);
    });
    return item;
  }

  update(changes) {
    if (this.births === this.page.births) return;
    if (changes.ended) this.load();
    else this.again.hidden = false;
  }

  draw() {
    const { ratio } = this.page.about, ids = this.cards.map((one) => one.id);
    this.tiles.request(ids, SIDE);
    [...this.list.children].forEach((item, place) => paintTile(
      item.querySelector("canvas"), this.tiles.get(ids[place], SIDE), SHOWN * Math.min(1, ratio), SHOWN / Math.max(1, ratio)));
  }
}

export const view = {
  name: "keep", title: "which to keep", place: 10, suits: () => true, open: (root, page, hands) => new Keep(root, page, hands),
};
