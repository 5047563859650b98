import { countText, element, number } from "./elements.js";

/** A count of bytes in words. */
export const byteText = (count) => (count >= 1e9 ? `${number(count / 1e9)} GB` : count >= 1e6 ? `${number(count / 1e6)} MB` : `${number(count / 1e3)} kB`);

/** Show the result of a calibration: the time and disk space of the run, and the measures of the parents. */
export function showCalibration(parent, result) {
  const { estimate, values, bounds } = result;
  element(parent, "p", "", `${countText(estimate.births)} births in ${countText(result.generations)} generations will take about ${estimate.time} on ${result.workers} cores. ` +
    `The run takes at most ${byteText(estimate.size)} of disk space; ${byteText(estimate.free)} are free.`);
  if (!estimate.fits) element(parent, "p", "lack", "The run needs more disk space than is free. Delete some files, or choose fewer generations.");
  if (result.failing) element(parent, "p", "lack", result.failing);
  const notes = element(parent, "ul", "notes");
  for (const text of result.notes) element(notes, "li", "", text);
  const parents = Object.keys(Object.values(values)[0] || {});
  const table = element(element(parent, "div", "wide", "", { tabindex: "0", role: "group", "aria-label": "measures of the parents" }), "table", "values");
  element(table, "caption", "", "Measures of the parents: map, code");
  const head = element(table, "tr");
  for (const text of ["measure", ...parents, "bound"]) element(head, "th", parents.includes(text) ? "number" : "", text, { scope: "col" });
  for (const [name, of] of Object.entries(values)) {
    const row = element(table, "tr");
    element(row, "th", "", name.replaceAll("_", " "), { scope: "row" });
    for (const title of parents) element(row, "td", "number", of[title].map((value) => number(value ?? NaN)).join(", "));
    element(row, "td", "", Object.entries(bounds[name] || {}).map(([side, value]) => `${side === "min" ? "≥" : "≤"} ${number(value)}`).join(" "));
  }
}
