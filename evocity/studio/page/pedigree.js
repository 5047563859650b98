import { Ancestors } from "./ancestors.js";
import { COLOURS, element, fitCanvas } from "./elements.js";

const STEPS = 6, LARGEST = 56, BETWEEN = 22, CAPTION = 14;

/** The pedigree of a birth: a row of pictures for each step back; lines lead from parents to children. `on`:
 * showBirth(id). */
export class Pedigree {
  constructor(parent, server, small, on) {
    [this.server, this.small, this.on] = [server, small, on];
    this.root = element(parent, "div", "pedigree");
    this.canvas = element(this.root, "canvas", "", "", { "aria-hidden": "true" });
    this.more = element(parent, "p", "faint");
    this.ancestors = new Ancestors(element(parent, "div"));
    this.nodes = this.links = [];  // of one birth, also while a hidden tab gets another one
    new ResizeObserver(() => this.lay()).observe(this.root);
  }

  async show(id) {
    this.id = id;
    const state = await this.server.getJson("pedigree", { id, steps: STEPS });
    if (id !== this.id) return;
    this.state = state;
    this.ancestors.show(state.born);
    this.lay();
  }

  lay() {
    if (!this.state || !this.root.clientWidth) return;
    const width = this.width = this.root.clientWidth, { steps, cities, more } = this.state;
    const widest = Math.max(...steps.map((ids) => ids.length));
    this.size = Math.min(LARGEST, Math.floor(width / widest) - 4);
    this.links = this.state.links;
    const tall = this.size + CAPTION + BETWEEN;
    for (const { button } of this.nodes) button.remove();
    this.nodes = steps.flatMap((ids, step) => ids.map((id, place) => {
      const x = ((place + 0.5) * width) / ids.length - this.size / 2, y = (steps.length - 1 - step) * tall;
      const city = Object.hasOwn(cities, id) ? `, ${cities[id]}` : "";
      const button = element(this.root, "button", "node", "", {
        type: "button", title: `birth ${id}${city}`, "aria-label": `birth ${id}${city}, ${step} child-to-parent steps before the selected birth`,
      });
      Object.assign(button.style, { left: `${x}px`, top: `${y}px`, width: `${this.size}px`, height: `${this.size + CAPTION}px` });
      const picture = element(button, "canvas", "", "", { "aria-hidden": "true" });
      element(button, "span", "", this.size < 34 ? "" : String(id));
      button.addEventListener("click", () => this.on.showBirth(id));
      return { id, x: x + this.size / 2, y, button, picture };
    }));
    this.root.style.height = `${steps.length * tall - BETWEEN}px`;
    const left = more.reduce((sum, one) => sum + one, 0);
    this.more.textContent = left ? `The picture leaves out ${left} ancestors.` : "";
    this.more.hidden = !left;
    this.small.request(this.nodes.map((one) => one.id), 96);
    this.draw();
  }

  draw() {
    if (!this.width) return;
    const context = fitCanvas(this.canvas, this.width, parseFloat(this.root.style.height));
    const at = new Map(this.nodes.map((one) => [one.id, one]));
    context.strokeStyle = COLOURS.faint;
    for (const [parent, child] of this.links) {
      const [from, to] = [at.get(parent), at.get(child)];
      context.beginPath();
      context.moveTo(from.x, from.y + this.size + CAPTION);
      context.lineTo(to.x, to.y);
      context.stroke();
    }
    for (const { id, picture } of this.nodes) {
      const paper = fitCanvas(picture, this.size, this.size), tile = this.small.get(id, 96);
      paper.fillStyle = "#efeae0";
      paper.fillRect(0, 0, this.size, this.size);
      if (tile) paper.drawImage(tile.image, tile.x, tile.y, tile.width, tile.height, 0, 0, this.size, this.size);
      paper.strokeStyle = id === this.id ? COLOURS.chosen : COLOURS.line;
      paper.lineWidth = id === this.id ? 4 : 1;
      paper.strokeRect(0, 0, this.size, this.size);
    }
  }
}
