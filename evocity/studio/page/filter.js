import { showKept } from "./breed.js";
import { button, choice, element, number } from "./elements.js";
import { LiveMap } from "./live_map.js";

/** Steps of a slider of f_c, in even shares of its logarithm. */
const STEPS = 200;
const COUNTS = [["pixels", "pixel"], ["domains", "most copied domain block of a pixel"], ["ranges", "domain block of a range block"]];

/** Sliders that filter a birth by calls, mix it with the pinned birth, and zoom. The map is drawn again while a slider
 * moves. `on`: picks(), the ids of the picks; highest(), the end of the colours in metres. */
export class FilterDesk {
  constructor(parent, server, on) {
    [this.server, this.on, this.most] = [server, on, 0];
    this.root = element(parent, "details");
    element(this.root, "summary", "", "filter, zoom and interpolation");
    const slider = (text, value, limits) => {
      const row = element(this.root, "label", "slider"), words = element(row, "span", "", text);
      const input = element(row, "input", "", "", { type: "range", ...limits, "aria-label": text });
      input.value = value;
      input.addEventListener("input", () => this.load());
      return { input, words, value: String(value), text, row };
    };
    this.sliders = {
      low: slider("low-pass f_c", STEPS, { min: 0, max: STEPS }), high: slider("high-pass f_c", 0, { min: 0, max: STEPS }),
      zoom: slider("zoom", 1, { min: 0.25, max: 2, step: 0.25 }), share: slider("λ", 1, { min: 0, max: 1, step: 0.02 }),
    };
    const row = element(this.root, "div", "row");
    this.count = choice(row, "calls of the", COUNTS);
    this.count.addEventListener("change", () => this.load());
    button(row, "reset", () => this.reset());
    button(row, "save the genome and a recipe", () => this.save());
    element(this.root, "p", "faint", "The low-pass filter turns parts with more than f_c calls into ground; the high-pass filter, parts with fewer. λ is the share of the visible birth.");
    this.map = new LiveMap(this.root, "filtered map");
    this.message = element(this.root, "p", "", "", { role: "status" });
    this.root.addEventListener("toggle", () => this.load());
  }

  /** Show a birth, `beside` another or none (null). */
  show(id, beside) {
    [this.id, this.beside] = [id, beside];
    this.message.replaceChildren();
    this.load();
  }

  reset() {
    for (const { input, value } of Object.values(this.sliders)) input.value = value;
    this.load();
  }

  /** The request that the sliders describe. */
  get request() {
    const { low, high, zoom, share } = this.sliders, f_c = ({ input }) => Math.round((this.most + 1) ** (input.value / STEPS) - 1);
    return {
      id: this.id, beside: this.beside ?? null, share: this.beside === null ? 1 : Number(share.input.value), count: this.count.value,
      low: Number(low.input.value) === STEPS ? null : f_c(low), high: f_c(high), zoom: Number(zoom.input.value),
    };
  }

  /** Load the map; while a request is on its way, only the newest request waits. */
  async load() {
    if (!this.root.open || this.id === undefined) return;
    this.isStale = true;
    if (this.isLoading) return;
    this.isLoading = true;
    while (this.isStale) {
      this.isStale = false;
      const { request } = this;
      this.describe(request);
      try {
        const { about, content } = await this.server.getFramed("filtered", { request: JSON.stringify(request) });
        if (request.id !== this.id) continue;
        if (this.most !== about.most && (request.low !== null || request.high)) this.isStale = true; // f_c has another scale
        this.most = about.most;
        this.map.show(about, content, this.on.highest());
        this.shown = request;
      } catch (error) {
        if (request.id === this.id) this.map.showLack(error.message);
      }
    }
    this.isLoading = false;
  }

  describe({ low, high, zoom, share, beside }) {
    const { sliders } = this, text = (name, words) => {
      sliders[name].words.textContent = `${sliders[name].text}${words}`;
      sliders[name].input.setAttribute("aria-valuetext", words);
    };
    text("low", low === null ? ": off" : ` = ${low} calls`);
    text("high", high ? ` = ${high} calls` : ": off");
    text("zoom", ` × ${number(zoom)}`);
    sliders.share.input.disabled = beside === null;
    text("share", beside === null ? ": pin a second birth" : ` = ${share.toFixed(2)}, birth ${beside}: ${(1 - share).toFixed(2)}`);
  }

  /** Save the visible genome, as kept children are saved; genomes have no zoom. */
  async save() {
    if (!this.shown) return;
    try {
      showKept(this.message, await this.server.postJson("filter-keep", { ...this.shown, picks: this.on.picks().slice(0, 16) }));
    } catch (error) {
      this.message.textContent = error.message;
    }
  }
}
