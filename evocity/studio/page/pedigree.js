import { Born } from "./born.js";
import { COLOURS, made, sized } from "./made.js";

const STEPS = 6, LARGEST = 56, BETWEEN = 22, CAPTION = 14;

/** From whom a birth descends, a row of pictures a step; lines lead from parents to children. `on`:
 * wake(id). */
export class Pedigree {
  constructor(parent, server, small, on) {
    [this.server, this.small, this.on] = [server, small, on];
    this.root = made(parent, "div", "pedigree");
    this.canvas = made(this.root, "canvas", "", "", { "aria-hidden": "true" });
    this.more = made(parent, "p", "faint");
    this.born = new Born(made(parent, "div"));
    this.nodes = this.links = [];  // of one birth, also while another one is told to a hidden tab
    new ResizeObserver(() => this.lay()).observe(this.root);
  }

  async show(id) {
    this.id = id;
    const told = await this.server.asked("pedigree", { id, steps: STEPS });
    if (id !== this.id) return;
    this.told = told;
    this.born.show(told.born);
    this.lay();
  }

  lay() {
    if (!this.told || !this.root.clientWidth) return;
    const width = this.width = this.root.clientWidth, { steps, cities, more } = this.told;
    const widest = Math.max(...steps.map((ids) => ids.length));
    this.size = Math.min(LARGEST, Math.floor(width / widest) - 4);
    this.links = this.told.links;
    const tall = this.size + CAPTION + BETWEEN;
    for (const { button } of this.nodes) button.remove();
    this.nodes = steps.flatMap((ids, step) => ids.map((id, place) => {
      const x = ((place + 0.5) * width) / ids.length - this.size / 2, y = (steps.length - 1 - step) * tall;
      const city = Object.hasOwn(cities, id) ? `, ${cities[id]}` : "";
      const button = made(this.root, "button", "node", "", {
        type: "button", title: `birth ${id}${city}`, "aria-label": `birth ${id}${city}, ${step} steps back`,
      });
      Object.assign(button.style, { left: `${x}px`, top: `${y}px`, width: `${this.size}px`, height: `${this.size + CAPTION}px` });
      const picture = made(button, "canvas", "", "", { "aria-hidden": "true" });
      made(button, "span", "", this.size < 34 ? "" : String(id));
      button.addEventListener("click", () => this.on.wake(id));
      return { id, x: x + this.size / 2, y, button, picture };
    }));
    this.root.style.height = `${steps.length * tall - BETWEEN}px`;
    const left = more.reduce((sum, one) => sum + one, 0);
    this.more.textContent = left ? `${left} more of these steps are not shown.` : "";
    this.more.hidden = !left;
    this.small.want(this.nodes.map((one) => one.id), 96);
    this.draw();
  }

  draw() {
    if (!this.width) return;
    const context = sized(this.canvas, this.width, parseFloat(this.root.style.height));
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
      const paper = sized(picture, this.size, this.size), tile = this.small.get(id, 96);
      paper.fillStyle = "#efeae0";
      paper.fillRect(0, 0, this.size, this.size);
      if (tile) paper.drawImage(tile.image, tile.x, tile.y, tile.width, tile.height, 0, 0, this.size, this.size);
      paper.strokeStyle = id === this.id ? COLOURS.chosen : COLOURS.line;
      paper.lineWidth = id === this.id ? 4 : 1;
      paper.strokeRect(0, 0, this.size, this.size);
    }
  }
}
