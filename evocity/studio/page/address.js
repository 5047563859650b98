/** The address of the page: one run or two. For each it has the filter, the order and the axes, the chosen births,
 * the visible birth and the pinned birth. */

/** Chosen births in an address, at most; a larger choice is left out. */
const MOST_CHOSEN = 400;

/** The states of one run or two in the address, {run, …} each; only known runs. */
export function readAddress(isRun) {
  let state = null;
  try {
    state = JSON.parse(decodeURIComponent(location.hash.slice(1)));
  } catch { /* the address is incomplete, or not of studio */ }
  const first = state && typeof state === "object" ? state : {}, second = first.beside;
  if (!isRun(first.run)) first.run = 0;
  return second && isRun(second.run) && second.run !== first.run ? [first, second] : [first];
}

/** The parts of a `state` that fit these births; `usual` for all others. */
export function checkState(state, births, usual) {
  const isName = (name) => typeof name === "string" && births.byName.has(name);
  const listed = (value) => (Array.isArray(value) ? value : []);
  const kept = { ...usual };
  if (state.order && isName(state.order.name)) {
    kept.order = { name: state.order.name, reversed: state.order.reversed === true };
  }
  if (Array.isArray(state.axes)) {
    const axes = state.axes.filter((one) => one && isName(one.name));
    kept.axes = [...new Map(axes.map((one) => [one.name, { name: one.name, turned: one.turned === true }])).values()];
  }
  if (typeof state.view === "string") kept.view = state.view;
  const pair = listed(state.pair).filter(isName);
  if (pair.length === 2) kept.pair = pair;
  kept.chosen = [...new Set(listed(state.chosen))].filter((id) => Number.isInteger(id) && births.row(id) >= 0);
  kept.brushes = {};
  for (const [name, brush] of Object.entries(state.brushes || {})) {
    if (!isName(name)) continue;
    const { words } = births.byName.get(name);
    const parts = listed(brush).filter((part) => (words.length ? words.includes(part) :
      Array.isArray(part) && part.length === 2 && part.every(Number.isFinite) && part[0] <= part[1]));
    if (parts.length) kept.brushes[name] = parts;
  }
  for (const key of ["one", "pinned"]) kept[key] = Number.isInteger(state[key]) && births.row(state[key]) >= 0 ? state[key] : null;
  return kept;
}

/** Write the states of one run or two into the address. */
export function writeAddress(states) {
  const [first, second] = states.map(({ chosen, ...rest }) =>
    (chosen && chosen.length <= MOST_CHOSEN ? { ...rest, chosen } : rest));
  const held = second ? { ...first, beside: second } : first;
  history.replaceState(null, "", `/#${encodeURIComponent(JSON.stringify(held))}`);
}

/** A line of Python that shows the same births in a notebook. */
export function pythonOf(folder, { brushes, order, chosen }) {
  const by = `${order.reversed ? "-" : ""}${order.name}`;
  return [
    "import evocity", `view = evocity.open_run(${JSON.stringify(folder)}).view(order=${JSON.stringify(by)})`,
    `view.brushes, view.selected = ${JSON.stringify(brushes)}, ${JSON.stringify(chosen)}`,
  ].join("; ");
}
