/** What the address holds: which run, or two beside each other; of each filter, order, axes, who is
 * chosen, which birth is shown, and which is pinned. */

/** So many chosen ones stand in an address; it holds none of more. */
const MOST_CHOSEN = 400;

/** What the address tells of runs: {run, …} each, one or two, of runs that there are. */
export function readAddress(isRun) {
  let told = null;
  try {
    told = JSON.parse(decodeURIComponent(location.hash.slice(1)));
  } catch { /* it was cut off, or is another's */ }
  const first = told && typeof told === "object" ? told : {}, second = first.beside;
  if (!isRun(first.run)) first.run = 0;
  return second && isRun(second.run) && second.run !== first.run ? [first, second] : [first];
}

/** What was `told` of a state, as far as it is one of these births; what is else in it does not count. */
export function checked(told, births, usual) {
  const isName = (name) => typeof name === "string" && births.byName.has(name);
  const listed = (value) => (Array.isArray(value) ? value : []);
  const found = { ...usual };
  if (told.order && isName(told.order.name)) {
    found.order = { name: told.order.name, reversed: told.order.reversed === true };
  }
  if (Array.isArray(told.axes)) {
    const axes = told.axes.filter((one) => one && isName(one.name));
    found.axes = [...new Map(axes.map((one) => [one.name, { name: one.name, turned: one.turned === true }])).values()];
  }
  if (["axes", "scatter", "grid"].includes(told.view)) found.view = told.view;
  const pair = listed(told.pair).filter(isName);
  if (pair.length === 2) found.pair = pair;
  found.chosen = [...new Set(listed(told.chosen))].filter((id) => Number.isInteger(id) && births.row(id) >= 0);
  found.brushes = {};
  for (const [name, brush] of Object.entries(told.brushes || {})) {
    if (!isName(name)) continue;
    const { words } = births.byName.get(name);
    const kept = listed(brush).filter((one) => (words.length ? words.includes(one) :
      Array.isArray(one) && one.length === 2 && one.every(Number.isFinite) && one[0] <= one[1]));
    if (kept.length) found.brushes[name] = kept;
  }
  for (const key of ["one", "pinned"]) found[key] = Number.isInteger(told[key]) && births.row(told[key]) >= 0 ? told[key] : null;
  return found;
}

/** Put the states of one run or two into the address, in place of the token that was in it. */
export function writeAddress(states) {
  const [first, second] = states.map(({ chosen, ...rest }) =>
    (chosen && chosen.length <= MOST_CHOSEN ? { ...rest, chosen } : rest));
  const held = second ? { ...first, beside: second } : first;
  history.replaceState(null, "", `/#${encodeURIComponent(JSON.stringify(held))}`);
}

/** A line of Python that has the same births in a notebook. */
export function pythonOf(folder, { brushes, order, chosen }) {
  const by = `${order.reversed ? "-" : ""}${order.name}`;
  return [
    "import evocity", `view = evocity.open_run(${JSON.stringify(folder)}).view(order=${JSON.stringify(by)})`,
    `view.brushes, view.selected = ${JSON.stringify(brushes)}, ${JSON.stringify(chosen)}`,
  ].join("; ");
}
