import { made } from "./made.js";

/** Whether a run goes on, to be stopped; or has ended, to be taken up. `on`: trouble(error), look(). */
export class Going {
  constructor(parent, server, on) {
    [this.server, this.on] = [server, on];
    const row = made(parent, "div", "row", "", { role: "group", "aria-label": "the run" });
    this.stop = made(row, "button", "", "stop the run", { type: "button" });
    this.stop.addEventListener("click", () => this.ask("stop-run", {}, "It stops after this generation."));
    this.resume = made(row, "button", "", "go on with the run", { type: "button" });
    this.resume.addEventListener("click", () => {
      const generations = this.count.value.trim() === "" ? null : Number(this.count.value);
      this.ask("resume", { generations }, "It is taken up …");
    });
    const label = this.label = made(row, "label", "", "to generation ");
    this.count = made(label, "input", "", "", { type: "number", min: 1, step: 1, placeholder: "all" });
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
    if (process && process.code > 0 && process.code < 128) {
      this.state.textContent = process.said.slice(Math.max(0, process.said.lastIndexOf("Error: "))).split("\n").slice(-8).join(" ");
    }
  }
}
