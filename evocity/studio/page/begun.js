import { isFailed } from "./going.js";
import { made } from "./made.js";

/** The runs that were begun at the desk. `waits`: the folder of the one that is shown as soon as it
 * has a generation. `on`: show(run); stop(place), of the list. */
export class Begun {
  constructor(parent, on) {
    this.on = on;
    this.head = made(parent, "h3", "", "Runs begun here");
    this.list = made(parent, "ul", "begun", "", { "aria-label": "runs begun here" });
    this.runs = new Map();
    this.waits = null;
  }

  tell(started) {
    for (const [place, one] of started.entries()) {
      const { folder, has, at, code } = one;
      if (!this.runs.has(folder)) this.runs.set(folder, this.start(one, place));
      const item = this.runs.get(folder), failed = isFailed(one);
      item.how.textContent = ` ${at ? (has ? "goes on" : "begins …") : failed ? "failed" : code ? "was stopped" : "has ended"} `;
      item.how.classList.toggle("evocity-lack", failed);
      item.run = one.run;
      item.show.hidden = !has;
      item.stop.hidden = has || !at;
      item.said.hidden = has && !failed;
      const text = failed ? one.said : one.said.split("\n").at(-1) || "…";
      if (item.said.textContent !== text) item.said.textContent = text;
    }
    this.head.hidden = !started.length;
    const last = started.find((one) => one.folder === this.waits);
    if (!last || !last.has) return;
    this.waits = null;
    this.on.show(last.run);
  }

  start({ name, folder, recipe }, place) {
    const item = made(this.list, "li"), found = {};
    made(item, "b", "", name);
    found.how = made(item, "span", "", "", { role: "status" });
    found.show = made(item, "button", "", `show ${name}`, { type: "button" });
    found.show.addEventListener("click", () => this.on.show(found.run));
    found.stop = made(item, "button", "", `stop ${name}`, { type: "button" });
    found.stop.addEventListener("click", () => this.on.stop(place));
    made(item, "p", "faint", `Its recipe is ${recipe}, its folder ${folder}.`);
    found.said = made(item, "pre", "toml", "", { tabindex: "0", role: "group", "aria-label": `what ${name} says` });
    return found;
  }
}
