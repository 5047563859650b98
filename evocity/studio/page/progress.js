import { pause } from "./controls.js";
import { button, countText, element } from "./elements.js";

/** Milliseconds between two looks at a job. */
const BETWEEN = 150;

/** The progress of a job with a button that stops it. */
export class ProgressRow {
  constructor(parent, text, stop) {
    this.text = text;
    this.root = element(parent, "div", "row", "", { role: "status" });
    this.label = element(this.root, "span", "faint");
    this.bar = element(this.root, "progress", "", "", { "aria-label": text });
    button(this.root, "stop", stop).setAttribute("aria-label", `stop ${text}`);
    this.hide();
  }

  show({ done, total }) {
    this.root.hidden = false;
    this.label.textContent = `${this.text} … ${total ? `${countText(Math.floor((100 * done) / total))} %` : ""}`;
    this.bar.value = total ? done / total : 0;
  }

  hide() { this.root.hidden = true; }
}

/** Ask for the state of a job until it ends; its last state. Ends early if it is no longer current. */
export async function pollJob(ask, row, isCurrent = () => true) {
  let state = await ask();
  while (state.at && isCurrent()) {
    row.show(state);
    await pause(BETWEEN);
    if (isCurrent()) state = await ask();
  }
  if (!isCurrent()) return state;
  row.hide();
  if (state.error) throw new Error(state.error);
  return state;
}
