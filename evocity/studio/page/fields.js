import { choice, element, field, number } from "./elements.js";
import { pollJob, ProgressRow } from "./progress.js";

/** Maps of autosimilarity: the name for the server, the button, and words. */
export const FIELDS = [["mean", "error µ̃", "mean error µ̃ of the range blocks that contain each pixel"],
  ["least", "error µ_min", "least error µ_min of the range blocks that contain each pixel"],
  ["domain", "best D", "side D of the domain block with the least error, px"]];

/** The search for maps of autosimilarity, with its settings and progress. `on`: changed(), stopped(). */
export class FieldSearch {
  constructor(parent, server, on) {
    [this.server, this.on] = [server, on];
    this.root = element(parent, "div", "row", "", { role: "group", "aria-label": "search for µ" });
    this.block = field(this.root, "side B of range blocks, px", "number", "8", { min: "2", max: "16" });
    this.domains = field(this.root, "sides D of domain blocks, px", "text", "16", { size: "10" });
    this.divisor = choice(this.root, "µ divided by", [["heights", "squared range of heights"], ["variance", "variance of the block"]]);
    for (const one of [this.block, this.domains, this.divisor]) one.addEventListener("change", on.changed);
    this.progress = new ProgressRow(parent, "searching for µ", () => {
      on.stopped();
      server.postJson("fields-stop", {}).catch(() => {});
    });
    this.curve = element(null, "div");
  }

  /** Show the settings, or hide them; without progress and curve. */
  show(isShown) {
    this.root.hidden = !isShown;
    this.progress.hide();
    this.curve.replaceChildren();
  }

  /** Search until the maps of births are ready. */
  async find(ids, isCurrent) {
    const domains = this.domains.value.split(/[\s,;]+/).filter(Boolean).map(Number);
    this.request = { ids, block: Number(this.block.value), domains, normalise: this.divisor.value };
    await pollJob(() => this.server.postJson("fields", this.request), this.progress, isCurrent);
  }

  /** The map of a birth that was searched: {content, legend, curve}. */
  async mapOf(kind, id) {
    const { ids, normalise } = this.request, request = JSON.stringify({ ...this.request, place: ids.indexOf(id), measure: kind });
    const { about, content } = await this.server.getFramed("field", { request });
    const value = (one) => `${number(one ?? NaN)} ${about.unit}`.trimEnd();
    const whose = ids.length > 1 ? `, birth ${id}` : "", words = [...this.divisor.options].find((one) => one.value === normalise).text;
    return { content, curve: about.curve, legend: `${about.title}${whose}${kind === "domain" ? "" : `, a share of the ${words}`}: pale is 0, dark is ${value(about.end)} ` +
      `and above; mean ${value(about.mean)}, largest ${value(about.most)}.${about.known < 1 ? " Grey pixels have no value." : ""}` };
  }

  /** Show the mean µ of each side D, with bars, for each birth of the search. */
  showCurves(curves) {
    const { ids } = this.request, most = Math.max(...curves.flat().map(([, mean]) => mean ?? 0)) || 1;
    const table = element(this.curve, "table", "values");
    element(table, "caption", "", "D → mean error µ of all range blocks");
    curves.forEach((curve, place) => curve.forEach(([side, mean]) => {
      const row = element(table, "tr");
      element(row, "th", "", `D = ${side} px${ids.length > 1 ? `, birth ${ids[place]}` : ""}`, { scope: "row" });
      element(row, "td", "number", number(mean ?? NaN));
      element(element(row, "td", "share"), "div", "bar").style.width = `${(100 * (mean ?? 0)) / most}%`;
    }));
  }
}
