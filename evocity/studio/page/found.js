import { counted, made, number } from "./made.js";

/** A count of them in words. */
export const bytes = (count) => (count >= 1e9 ? `${number(count / 1e9)} GB` : count >= 1e6 ? `${number(count / 1e6)} MB` : `${number(count / 1e3)} kB`);

/** What calibrating found: how long the run takes, and what the parents have of each measure. */
export function tellFound(parent, found) {
  const { estimate, values, bounds } = found;
  made(parent, "p", "", `${counted(estimate.births)} births, ${counted(found.generations)} generations: about ${estimate.time} on ${found.workers} cores once it has started, ` +
    `at most ${bytes(estimate.size)} of the disk (${bytes(estimate.free)} free).`);
  if (!estimate.fits) made(parent, "p", "lack", "The disk will not hold this run: free some, or breed fewer generations.");
  if (found.failing) made(parent, "p", "lack", found.failing);
  const notes = made(parent, "ul", "notes");
  for (const text of found.notes) made(notes, "li", "", text);
  const parents = Object.keys(Object.values(values)[0] || {});
  const table = made(made(parent, "div", "wide", "", { tabindex: "0", role: "group", "aria-label": "what the parents have" }), "table", "values");
  made(table, "caption", "", "What the parents have: map, code");
  const head = made(table, "tr");
  for (const text of ["measure", ...parents, "bound"]) made(head, "th", parents.includes(text) ? "number" : "", text, { scope: "col" });
  for (const [name, of] of Object.entries(values)) {
    const row = made(table, "tr");
    made(row, "th", "", name.replaceAll("_", " "), { scope: "row" });
    for (const one of parents) made(row, "td", "number", of[one].map((value) => number(value ?? NaN)).join(", "));
    made(row, "td", "", Object.entries(bounds[name] || {}).map(([side, value]) => `${side === "min" ? "≥" : "≤"} ${number(value)}`).join(" "));
  }
}
