import { attempt } from "./controls.js";
import { button, element, field } from "./elements.js";

/** Exit codes of a process that was stopped, also by Ctrl-C or a closed terminal. A process that crashed, or
 * was killed, for example for its memory, has other codes. */
const STOPPED = [129, 130, 143, -1, -2, -15];

/** The state of a run that has ended, while its process goes on. */
const ENDED = "The run has ended. Evocity writes its report …";

/** Whether a process failed. */
export const isFailed = ({ at, code }) => !at && code !== null && code !== 0 && !STOPPED.includes(code);

/** Buttons that stop a running run and resume a finished one. `on`: trouble(error), look(). */
export class RunControl {
  constructor(parent, server, on) {
    [this.server, this.on, this.wasGoing] = [server, on, false];
    const row = element(parent, "div", "row", "", { role: "group", "aria-label": "run control" });
    this.stop = button(row, "stop the run", () => this.send("stop-run", {}, "The run will stop after the current generation."));
    this.resume = button(row, "resume the run", () => {
      const isWhole = this.planned !== null && this.generation >= this.planned, number = Number(this.count.value);
      const lack = `The run has all of its ${this.planned} generations. Type a larger number.`;
      this.count.setCustomValidity(isWhole && number <= this.generation ? lack : "");
      if (!this.count.reportValidity()) return;
      const generations = this.count.value.trim() === "" ? null : Number(this.count.value);
      this.send("resume", { generations }, "The run resumes now …");
    });
    this.count = field(row, "to generation", "number", "", { min: 1, max: 99999999, step: 1, placeholder: "all" });
    this.count.addEventListener("input", () => this.count.setCustomValidity(""));
    this.left = element(row, "span", "faint");
    this.state = element(parent, "p", "faint", "", { role: "status" });
    this.more = element(parent, "p", "faint");
    this.missed = element(parent, "ul", "lack", "", { "aria-label": "goals out of reach" });
    this.inform({ going: false });
  }

  async send(name, body, text) {
    if (!await attempt(this.on.trouble, () => this.server.postJson(name, body))) return;
    this.state.textContent = text;
    this.on.look();
  }

  /** Show the news of the run. */
  inform(news) {
    const { going, process, generation = -1, planned = null, time_left: left, unreachable, more_births: more } = news;
    [this.generation, this.planned] = [generation, planned];
    this.left.textContent = going && left ? `about ${left} left` : "";
    this.more.textContent = more || "";
    this.more.hidden = !more;
    const missed = unreachable || [], key = missed.join("\n");
    this.missed.hidden = !key;
    if (key !== this.missedKey) this.missed.replaceChildren(...missed.map((text) => element(null, "li", "", text)));
    this.missedKey = key;
    const isBusy = going || Boolean(process && process.at), isEnding = isBusy && !going && this.wasGoing;
    if (isBusy !== this.isBusy) this.state.textContent = "";
    if (isEnding) this.state.textContent = ENDED;
    else if (this.state.textContent === ENDED) this.state.textContent = "";
    this.isBusy = isBusy;
    this.wasGoing = isBusy && (going || this.wasGoing);
    this.stop.hidden = !isBusy || isEnding;
    this.resume.hidden = this.count.parentElement.hidden = isBusy;
    if (process && isFailed(process)) {
      const { code, said } = process, place = said.lastIndexOf("Error: ");
      const text = said.slice(Math.max(0, place)).split("\n").slice(-8).join(" ");
      this.state.textContent = place < 0 ? `The run failed with exit code ${code}. The last messages of the run were: ${text}` : text;
    }
  }
}
