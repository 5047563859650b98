import { COLOURS, FONT, countText, element, fitCanvas } from "../elements.js";
import { Tiles, paintTile } from "../tiles.js";

const STEPS = 6, IN_A_STEP = 12, LARGEST = 72, BETWEEN = 22, CAPTION = 14;
/** The drawing of all ancestors: px; bars, at most. */
const TALL = 62, BELOW = 16, ABOVE = 12, MOST_BARS = 240;

/** The parents of all births, by id. */
class Lineage {
  constructor({ ids, generations, counts, parents }) {
    Object.assign(this, { generations, parents });
    this.rows = new Map(ids.map((id, row) => [id, row]));
    let start = 0;
    this.starts = [0, ...counts.map((count) => (start += count))];
  }

  of(id) {
    const row = this.rows.get(id);
    return row === undefined ? [] : this.parents.slice(this.starts[row], this.starts[row + 1]);
  }

  born(id) { return this.generations[this.rows.get(id)]; }

  /** The ancestors of a birth: `steps` of ids, each birth in the last step that reaches it, so that links lead down;
   * `more`: hidden births. */
  steps(id) {
    const depth = new Map([[id, 0]]);
    let last = [id];
    for (let step = 1; step <= STEPS; step++) {
      last = [...new Set(last.flatMap((one) => this.of(one)))];
      for (const one of last) depth.set(one, step);
    }
    const steps = Array.from({ length: STEPS + 1 }, (_, step) => [...depth.keys()].filter((one) => depth.get(one) === step).sort((a, b) => a - b));
    return { steps: steps.filter((ids) => ids.length).map((ids) => ids.slice(0, IN_A_STEP)),
      more: steps.reduce((sum, ids) => sum + Math.max(0, ids.length - IN_A_STEP), 0) };
  }

  /** The ids of all ancestors of a birth. */
  ancestors(id) {
    const known = new Set(), open = [id];
    while (open.length) {
      for (const parent of this.of(open.pop())) {
        if (known.has(parent)) continue;
        known.add(parent);
        open.push(parent);
      }
    }
    return [...known];
  }
}

/** The pedigree of the birth with visible numbers: a row of pictures for each step back, lines from parents to
 * children, and bars for all ancestors by the generation of their birth. */
class Pedigree {
  constructor(root, page, hands) {
    [this.page, this.hands] = [page, hands];
    this.words = element(root, "p", "faint");
    this.root = element(root, "div", "pedigree");
    this.canvas = element(this.root, "canvas", "", "", { "aria-hidden": "true" });
    this.bars = element(root, "canvas", "", "", { role: "img" });
    this.tiles = new Tiles(hands.pictures, () => this.paint());
    this.nodes = this.links = [];
  }

  update() {
    if (this.births === this.page.births) return;
    this.births = this.page.births;
    const request = this.request = {};
    this.hands.part("lineage").then((lineage) => {
      if (request !== this.request) return;
      this.lineage = new Lineage(lineage);
      this.id = undefined; // draw again
      this.draw();
    }, (error) => { this.words.textContent = `There is no pedigree: ${error.message}`; });
  }

  draw() {
    const id = this.page.row < 0 ? null : this.page.births.ids[this.page.row];
    if (!this.lineage || id === this.id) return;
    this.id = id;
    this.resize();
  }

  resize() {
    const width = this.width = this.root.parentElement.clientWidth, { id, lineage } = this;
    for (const { button } of this.nodes) button.remove();
    this.nodes = [];
    const isEmpty = id === null || !lineage || !width;
    this.root.hidden = this.bars.hidden = isEmpty;
    if (isEmpty) {
      this.words.textContent = "Choose a birth to see its parents and their parents.";
      return;
    }
    const { steps, more } = lineage.steps(id), { births, about } = this.page, shown = new Set(steps.flat());
    this.size = Math.min(LARGEST, Math.floor(width / Math.max(...steps.map((ids) => ids.length))) - 4);
    this.links = [...shown].flatMap((child) => lineage.of(child).filter((one) => shown.has(one)).map((parent) => [parent, child]));
    const tall = this.size + CAPTION + BETWEEN, operator = births.byName.get("operator");
    const cityOf = (one) => {
      const row = births.row(one);
      return row >= 0 && operator && operator.text(row) === "source" && about.cities[one] ? `, ${about.cities[one]}` : "";
    };
    this.nodes = steps.flatMap((ids, step) => ids.map((one, place) => {
      const x = ((place + 0.5) * width) / ids.length - this.size / 2, y = (steps.length - 1 - step) * tall, city = cityOf(one);
      const button = element(this.root, "button", "node", "", {
        type: "button", title: `birth ${one}${city}`, "aria-label": `birth ${one}${city}, ${step} child-to-parent steps before the selected birth`,
      });
      Object.assign(button.style, { left: `${x}px`, top: `${y}px`, width: `${this.size}px`, height: `${this.size + CAPTION}px` });
      const picture = element(button, "canvas", "", "", { "aria-hidden": "true" });
      element(button, "span", "", this.size < 34 ? "" : String(one));
      button.addEventListener("click", () => this.hands.show(one));
      return { id: one, x: x + this.size / 2, y, button, picture };
    }));
    this.root.style.height = `${steps.length * tall - BETWEEN}px`;
    this.drawBars(lineage.ancestors(id).map((one) => lineage.born(one)), [...shown].slice(1).map((one) => lineage.born(one)), more);
    this.tiles.request(this.nodes.map((one) => one.id), 96);
    this.paint();
  }

  /** Count ancestors, and those with a picture, by the generation of their birth. */
  drawBars(every, shown, more) {
    const last = Math.max(0, ...every), span = Math.ceil((last + 1) / MOST_BARS), count = Math.floor(last / span) + 1;
    const counts = [every, shown].map((born) => {
      const bins = new Array(count).fill(0);
      for (const one of born) bins[Math.floor(one / span)]++;
      return bins;
    });
    this.bars.hidden = !every.length;
    const left = more ? ` The pictures leave out ${countText(more)} ancestors.` : "";
    this.words.textContent = every.length ? `Birth ${this.id} has ${countText(every.length)} ancestors. The bars count all ancestors by the generation of their birth; the dark part counts the ${countText(shown.length)} ancestors with pictures.${left}` :
      `Birth ${this.id} has no parents.`;
    if (!every.length) return;
    const most = Math.max(...counts[0]), place = counts[0].indexOf(most), room = TALL - BELOW - ABOVE, step = Math.min(24, this.width / count);
    this.bars.setAttribute("aria-label", `The highest bar stands for ${countText(most)} ancestors that were born in generation ${place * span}${span > 1 ? ` to ${place * span + span - 1}` : ""}.`);
    const context = fitCanvas(this.bars, this.width, TALL), tallOf = (one) => (one ? Math.max(1.5, (one / most) * room) : 0);
    counts.forEach((bins, k) => bins.forEach((one, bar) => {
      context.fillStyle = k ? COLOURS.chosen : "#b9b1a4";
      context.fillRect(bar * step, TALL - BELOW - tallOf(one), step - (step > 4 ? 1 : 0), tallOf(one));
    }));
    context.fillStyle = COLOURS.faint;
    context.font = `11px ${FONT}`;
    context.fillRect(0, TALL - BELOW, count * step, 1);
    context.fillText("0", 0, TALL - 4);
    if (last) context.fillText(countText(last), Math.max(12, (count - 1) * step), TALL - 4);
    context.fillText(countText(most), Math.min(place * step, this.width - 30), ABOVE - 2);
  }

  paint() {
    if (this.root.hidden || !this.width) return;
    const context = fitCanvas(this.canvas, this.width, parseFloat(this.root.style.height));
    const at = new Map(this.nodes.map((one) => [one.id, one]));
    context.strokeStyle = COLOURS.faint;
    for (const [parent, child] of this.links) {
      const [from, to] = [at.get(parent), at.get(child)];
      if (from.y >= to.y) continue;
      context.beginPath();
      context.moveTo(from.x, from.y + this.size + CAPTION);
      context.lineTo(to.x, to.y);
      context.stroke();
    }
    for (const { id, picture } of this.nodes) {
      const paper = paintTile(picture, this.tiles.get(id, 96), this.size);
      paper.strokeStyle = id === this.id ? COLOURS.chosen : COLOURS.line;
      paper.lineWidth = id === this.id ? 4 : 1;
      paper.strokeRect(0, 0, this.size, this.size);
    }
  }
}

export const view = {
  name: "pedigree", title: "pedigree", place: 60, suits: () => true, open: (root, page, hands) => new Pedigree(root, page, hands),
};
