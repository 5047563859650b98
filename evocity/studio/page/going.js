import { made } from "./made.js";

/** Exit codes of a process that was asked to end, by Ctrl-C or a closed terminal too; those of one
 * that was killed, as for want of memory, or crashed are none of these. */
const STOPPED = [129, 130, 143, -1, -2, -15];

/** Whether a process ended by a fault. */
export const isFailed = ({ at, code }) => !at && code !== null && code !== 0 && !STOPPED.includes(code);

/** Whether a run goes on, to be stopped; or has ended, to be taken up. `on`: trouble(error), look(). */
export class Going {
  constructor(parent, server, on) {
    [this.server, this.on] = [server, on];
    const row = made(parent, "div", "row", "", { role: "group", "aria-label": "the run" });
    this.stop = made(row, "button", "", "stop the run", { type: "button" });
    this.stop.addEventListener("click", () => this.ask("stop-run", {}, "It stops after this generation."));
    this.resume = made(row, "button", "", "go on with the run", { type: "button" });
    this.resume.addEventListener("click", () => {
      if (!this.count.reportValidity()) return;
      const generations = this.count.value.trim() === "" ? null : Number(this.count.value);
      this.ask("resume", { generations }, "It is taken up …");
    });
    const label = this.label = made(row, "label", "", "to generation ");
    this.count = made(label, "input", "", "", { type: "number", min: 1, max: 99999999, step: 1, placeholder: "all" });
    this.state = made(parent, "p", "faint", "", { role: "status" });
    this.inform({ going: false });
  }

  async ask(name, body, text) {
    try {
      await this.server.told(name, body);
      this.on.trouble(null);
      this.state.textContent = text;
      this.on.look();
    } catch (error) {
      this.on.trouble(error);
    }
  }

  /** What is new of it. */
  inform({ going, process }) {
    const isAt = going || Boolean(process && process.at);
    if (isAt !== this.isAt) this.state.textContent = "";
    this.isAt = isAt;
    this.stop.hidden = !isAt;
    this.resume.hidden = this.label.hidden = isAt;
    if (process && isFailed(process)) {
      const { code, said } = process, place = said.lastIndexOf("Error: ");
      const text = said.slice(Math.max(0, place)).split("\n").slice(-8).join(" ");
      this.state.textContent = place < 0 ? `It failed, with exit code ${code}. It said last: ${text}` : text;
    }
  }
}
