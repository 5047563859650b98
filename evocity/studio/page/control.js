import { attempt } from "./controls.js";
import { button, element, field } from "./elements.js";

/** Exit codes of a process that was stopped, also by Ctrl-C or a closed terminal. A process that crashed, or
 * was killed, for example for its memory, has other codes. */
const STOPPED = [129, 130, 143, -1, -2, -15];

/** Whether a process failed. */
export const isFailed = ({ at, code }) => !at && code !== null && code !== 0 && !STOPPED.includes(code);

/** Buttons that stop a running run and resume a finished one. `on`: trouble(error), look(). */
export class RunControl {
  constructor(parent, server, on) {
    [this.server, this.on] = [server, on];
    const row = element(parent, "div", "row", "", { role: "group", "aria-label": "run control" });
    this.stop = button(row, "stop the run", () => this.send("stop-run", {}, "The run will stop after the current generation."));
    this.resume = button(row, "resume the run", () => {
      if (!this.count.reportValidity()) return;
      const generations = this.count.value.trim() === "" ? null : Number(this.count.value);
      this.send("resume", { generations }, "The run resumes now …");
    });
    this.count = field(row, "to generation", "number", "", { min: 1, max: 99999999, step: 1, placeholder: "all" });
    this.left = element(row, "span", "faint");
    this.state = element(parent, "p", "faint", "", { role: "status" });
    this.missed = element(parent, "ul", "lack", "", { "aria-label": "goals out of reach" });
    this.inform({ going: false });
  }

  async send(name, body, text) {
    if (!await attempt(this.on.trouble, () => this.server.postJson(name, body))) return;
    this.state.textContent = text;
    this.on.look();
  }

  /** Show the news of the run. */
  inform({ going, process, time_left: left, unreachable }) {
    this.left.textContent = going && left ? `about ${left} left` : "";
    const missed = unreachable || [], key = missed.join("\n");
    this.missed.hidden = !key;
    if (key !== this.missedKey) this.missed.replaceChildren(...missed.map((text) => element(null, "li", "", text)));
    this.missedKey = key;
    const isBusy = going || Boolean(process && process.at);
    if (isBusy !== this.isBusy) this.state.textContent = "";
    this.isBusy = isBusy;
    this.stop.hidden = !isBusy;
    this.resume.hidden = this.count.parentElement.hidden = isBusy;
    if (process && isFailed(process)) {
      const { code, said } = process, place = said.lastIndexOf("Error: ");
      const text = said.slice(Math.max(0, place)).split("\n").slice(-8).join(" ");
      this.state.textContent = place < 0 ? `The run failed with exit code ${code}. The last messages of the run were: ${text}` : text;
    }
  }
}
