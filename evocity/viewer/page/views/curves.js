import { element, number } from "../elements.js";

const WIDE = 300, TALL = 150, LEFT = 66, RIGHT = 8, TOP = 10, LOW = 22;
/** The headings of groups of curves, in their order. */
const GROUPS = [["goal", "best of each goal"], ["hypervolume", "all goals together"],
  ["guard", "births that break a bound"], ["figure", "figures of the algorithm"], ["island", "islands"]];

/** Values by generation: a small drawing for each goal, bound, figure and island. */
class Curves {
  constructor(root, page, hands) {
    [this.root, this.page, this.hands] = [root, page, hands];
    this.words = element(root, "p", "faint", "", { role: "status" });
    this.groups = element(root, "div");
  }

  update() {
    if (this.births !== this.page.births) this.load();
  }

  async load() {
    this.births = this.page.births;
    try {
      const curves = await this.hands.part("curves"), isShort = !curves.length || curves[0].generations.length < 2;
      this.words.textContent = isShort ? "This run has only the first population, so there are no curves over generations." : "";
      const never = curves.filter(({ group, values }) => group === "guard" && values.every((value) => !value));
      if (never.length && !isShort) this.words.textContent = `No birth broke the bounds of ${never.map(({ name }) => name.replaceAll("_", " ")).join(", ")}.`;
      const known = GROUPS.map(([group, title]) => [title, curves.filter((one) => one.group === group && !never.includes(one))]);
      this.groups.replaceChildren(...(isShort ? [] : known.filter(([, listed]) => listed.length).map(([title, listed]) => {
        const part = element(null, "section");
        element(part, "h2", "", title);
        element(part, "div", "curves").append(...listed.map(drawCurve));
        return part;
      })));
    } catch (error) {
      this.words.textContent = `There are no curves: ${error.message}`;
    }
  }
}

const svg = (parent, tag, attributes, text = "") => {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text) made.textContent = text;
  if (parent) parent.append(made);
  return made;
};

/** A figure with one curve: ends and target in numbers, the last value as a dot. */
function drawCurve({ title: name, unit, target, generations, values }) {
  const title = name.replaceAll("_", " ");
  const figure = element(null, "figure"), known = values.map((value, k) => [generations[k], value]).filter(([, value]) => value !== null);
  element(figure, "figcaption", "", unit ? `${title}, ${unit}` : title);
  if (!known.length) {
    element(figure, "p", "faint", "no values");
    return figure;
  }
  const heights = known.map(([, value]) => value), [first, last] = [known[0], known.at(-1)];
  const low = Math.min(...heights, target ?? Infinity), high = Math.max(...heights, target ?? -Infinity), range = high - low || 1;
  const end = generations.at(-1) || 1, right = WIDE - RIGHT, bottom = TALL - LOW;
  const x = (generation) => LEFT + (generation / end) * (right - LEFT);
  const y = (value) => bottom - (high > low ? (value - low) / range : 0.5) * (bottom - TOP);
  const words = target === null ? "" : `; the target is ${number(target)}`;
  const drawing = svg(figure, "svg", { viewBox: `0 0 ${WIDE} ${TALL}`, role: "img",
    "aria-label": `${title}: ${number(first[1])} in generation ${first[0]}, ${number(last[1])} in generation ${last[0]}${words}` });
  svg(drawing, "path", { class: "evocity-frame", d: `M${LEFT} ${TOP}V${bottom}H${right}` });
  for (const value of new Set([low, high])) svg(drawing, "text", { x: LEFT - 5, y: y(value) + 4, "text-anchor": "end" }, number(value));
  svg(drawing, "text", { x: LEFT, y: TALL - 6 }, "0");
  svg(drawing, "text", { x: right, y: TALL - 6, "text-anchor": "end" }, `generation ${end}`);
  if (target !== null) {
    svg(drawing, "path", { class: "evocity-target", d: `M${LEFT} ${y(target)}H${right}` });
    if (Math.min(Math.abs(y(target) - y(low)), Math.abs(y(target) - y(high))) > 12) {
      svg(drawing, "text", { x: LEFT - 5, y: y(target) + 4, "text-anchor": "end" }, number(target));
    }
  }
  const line = values.map((value, k) => (value === null ? "" : `${k && values[k - 1] !== null ? "L" : "M"}${x(generations[k]).toFixed(1)} ${y(value).toFixed(1)}`));
  svg(drawing, "path", { class: "evocity-curve", d: line.join("") });
  svg(drawing, "circle", { cx: x(last[0]), cy: y(last[1]), r: 3 });
  return figure;
}

export const view = {
  name: "curves", title: "curves", place: 50, suits: () => true, open: (root, page, hands) => new Curves(root, page, hands),
};
