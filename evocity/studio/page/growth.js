import { pause } from "./controls.js";
import { button, choice, element, field, tick } from "./elements.js";
import { LiveMap } from "./live_map.js";
import { pollJob, ProgressRow } from "./progress.js";

/** Growth of a birth around its window, larger than the window. `on`: highest(), the end of the colours in metres. */
export class Growth {
  constructor(parent, server, on) {
    [this.server, this.on] = [server, on];
    this.root = element(parent, "details");
    element(this.root, "summary", "", "growth around the window");
    const row = element(this.root, "div", "row");
    this.times = choice(row, "side of the map", [["2", "2 × the window"], ["3", "3 × the window"]]);
    this.seed = field(row, "seed", "number", "0", { min: "0" });
    this.streets = tick(row, "continuous streets");
    this.straight = tick(row, "keep directions");
    button(row, "grow", () => this.begin());
    this.files = [["parquet", "save the genome"], ["glb", "save the scene (.glb)"]].map(([suffix, text]) => button(row, text, () => this.save(suffix)));
    this.progress = new ProgressRow(this.root, "growing", () => this.stop());
    this.map = new LiveMap(this.root, "grown map");
    this.command = element(this.root, "p");
    this.message = element(this.root, "p", "", "", { role: "status" });
    this.clear();
  }

  show(id) {
    if (id === this.id) return;
    this.id = id;
    this.clear();
  }

  clear() {
    this.job = {};
    this.shown = null;
    this.map.clear();
    this.progress.hide();
    this.command.textContent = this.message.textContent = "";
    for (const one of this.files) one.disabled = true;
  }

  get request() {
    return {
      id: this.id, times: Number(this.times.value), seed: Number(this.seed.value),
      streets: this.streets.checked, straight: this.straight.checked,
    };
  }

  async begin() {
    this.clear();
    const { request, job } = this, isCurrent = () => job === this.job;
    try {
      const { ready, command } = await pollJob(() => this.server.postJson("grow", request), this.progress, isCurrent);
      if (!ready || !isCurrent()) return;
      const { about, content } = await this.server.getFramed("grown", { request: JSON.stringify(request) });
      if (!isCurrent()) return;
      const [height, width] = about.window;
      this.map.show(about, content, this.on.highest(), [about.left, about.top, width, height]);
      element(this.command, "code", "command", command);
      this.shown = request;
      for (const one of this.files) one.disabled = false;
    } catch (error) {
      if (!isCurrent()) return;
      this.progress.hide();
      this.map.showLack(error.message);
    }
  }

  stop() {
    this.clear();
    this.message.textContent = "You stopped the growth.";
    this.server.postJson("grow-stop", {}).catch(() => {});
  }

  /** Save the visible fabric by the command. */
  async save(suffix) {
    const { job } = this;
    try {
      let state = await this.server.postJson("grow-save", { ...this.shown, suffix });
      this.message.textContent = `The command writes ${state.path} …`;
      while (state.at) {
        await pause(300);
        state = await this.server.getJson("growth-file");
      }
      if (job === this.job) this.message.textContent = state.code ? `The command failed: ${state.said}` : `Studio saved ${state.path}.`;
    } catch (error) {
      if (job === this.job) this.message.textContent = error.message;
    }
  }
}
