import { COLOURS, FONT, countText, element, number, fitCanvas } from "./elements.js";

const TALL = 62, BELOW = 16, ABOVE = 12;

/** All ancestors of a birth by the generation of their birth: a bar for each generation, its lower part for
 * ancestors with a visible picture. */
export class Ancestors {
  constructor(parent) {
    this.words = element(parent, "p", "faint");
    this.canvas = element(parent, "canvas", "", "", { role: "img" });
    new ResizeObserver(() => this.draw()).observe(parent);
  }

  /** The counts of `every` ancestor and of the `shown` ones, for each `span` of generations from 0. */
  show({ span, every, shown }) {
    this.counts = { span, every, shown };
    const count = every.reduce((sum, one) => sum + one, 0), pictured = shown.reduce((sum, one) => sum + one, 0);
    this.canvas.hidden = this.words.hidden = !count;
    if (!count) return;
    const most = Math.max(...every), place = every.indexOf(most), when = span > 1 ? `generations ${place * span} to ${place * span + span - 1}` : `generation ${place}`;
    this.words.textContent = `The bars count all ${countText(count)} ancestors by the generation of their birth. The red part of the bars counts the ${countText(pictured)} ancestors whose pictures appear above the bars.`;
    this.canvas.setAttribute("aria-label", `${this.words.textContent} The highest bar stands for ${countText(most)} ancestors that were born in ${when}.`);
    this.draw();
  }

  draw() {
    const wide = this.canvas.parentElement.clientWidth;
    if (!this.counts || !wide || this.canvas.hidden) return;
    const { span, every, shown } = this.counts, context = fitCanvas(this.canvas, wide, TALL);
    const most = Math.max(...every), room = TALL - BELOW - ABOVE, step = Math.min(24, wide / every.length);
    const tall = (one) => (one ? Math.max(1.5, (one / most) * room) : 0);
    context.font = `11px ${FONT}`;
    every.forEach((one, k) => {
      const gap = step > 4 ? 1 : 0;
      for (const [count, colour] of [[one, "#b9b1a4"], [shown[k], COLOURS.chosen]]) {
        context.fillStyle = colour;
        context.fillRect(k * step, TALL - BELOW - tall(count), step - gap, tall(count));
      }
    });
    context.fillStyle = COLOURS.faint;
    context.fillRect(0, TALL - BELOW, every.length * step, 1);
    const last = every.length * span - 1, end = every.length * step;
    context.fillText("0", 0, TALL - 4);
    context.textAlign = end > 60 ? "right" : "left";
    if (last) context.fillText(number(last), end > 60 ? end : end - step, TALL - 4);
    context.textAlign = "left";
    context.fillText(countText(most), Math.min(every.indexOf(most) * step, wide - 30), TALL - BELOW - room - 2);
  }
}
