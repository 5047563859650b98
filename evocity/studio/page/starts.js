import { isFailed } from "./control.js";
import { announce } from "./controls.js";
import { button, element } from "./elements.js";

/** The runs that began at the desk. `waits`: the folder of the run that is shown at its first generation. `on`:
 * show(run); stop(place), in the list. */
export class Starts {
  constructor(parent, on) {
    this.on = on;
    this.head = element(parent, "h3", "", "Runs that began here");
    this.list = element(parent, "ul", "starts", "", { "aria-label": "runs that began here" });
    this.items = new Map();
    this.waits = null;
  }

  /** Show the run at its first generation; until then show its progress in an element `beside` the button, too. */
  follow({ folder, name }, beside) {
    [this.waits, this.beside] = [folder, beside];
    beside.textContent = `${name}: starting …`;
  }

  show(started) {
    for (const [place, run] of started.entries()) {
      const { folder, has, at, code } = run;
      if (!this.items.has(folder)) this.items.set(folder, this.item(run, place));
      const item = this.items.get(folder), failed = isFailed(run);
      item.state.textContent = ` ${at ? (has ? "running" : "starting …") : failed ? "failed" : code ? "stopped" : "finished"} `;
      item.state.classList.toggle("evocity-lack", failed);
      item.run = run.run;
      item.show.hidden = !has;
      item.stop.hidden = has || !at;
      item.output.hidden = has && !failed;
      const text = failed ? run.said : run.said.split("\n").at(-1) || "…";
      announce(item.output, text);
      if (folder === this.waits && this.beside) announce(this.beside, has ? "" : `${run.name}: ${failed ? "failed; the list of runs shows its output" : text}`);
    }
    this.head.hidden = !started.length;
    const last = started.find((run) => run.folder === this.waits);
    if (!last || !last.has) return;
    this.waits = null;
    this.on.show(last.run);
  }

  item({ name, folder, recipe }, place) {
    const root = element(this.list, "li"), item = {};
    element(root, "b", "", name);
    item.state = element(root, "span", "", "", { role: "status" });
    item.show = button(root, `show ${name}`, () => this.on.show(item.run));
    item.stop = button(root, `stop ${name}`, () => this.on.stop(place));
    element(root, "p", "faint", `Recipe: ${recipe}. Folder: ${folder}.`);
    item.output = element(root, "pre", "toml", "", { tabindex: "0", role: "group", "aria-label": `output of ${name}` });
    return item;
  }
}
