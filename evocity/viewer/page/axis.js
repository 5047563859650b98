import { button, element, number, tick } from "./elements.js";

/** The panel of a column, for use without a pointer: its filter, and the `actions` of the view, [text, act] each. `on`:
 * brush(brush), clear(), actions, close(). Returns the element for the focus. */
export function axisPanel(parent, column, brush, on) {
  parent.replaceChildren();
  const head = element(parent, "div", "row");
  element(head, "b", "", column.name);
  const range = column.isWords ? `${column.words.length} words` :
    `${number(column.low)} … ${number(column.high)} ${column.unit}`.trimEnd();
  element(head, "span", "faint", [range, column.wanted].filter(Boolean).join("; "));
  const passing = element(parent, "div", "row");
  const first = column.isWords ? words(passing, column, brush, on) : spans(passing, column, brush, on);
  const buttons = element(parent, "div", "row");
  for (const [text, act] of [["clear this filter", on.clear], ...on.actions, ["close", on.close]]) button(buttons, text, act);
  parent.onkeydown = (event) => {
    if (event.key === "Escape") on.close();
  };
  return first;
}

function words(parent, column, brush, on) {
  const boxes = column.words.map((word) => {
    const box = tick(parent, word || "none", brush.includes(word));
    box.addEventListener("change", () => on.brush(column.words.filter((_, k) => boxes[k].checked)));
    return box;
  });
  return boxes[0];
}

/** A pair of fields for each span, and one empty pair for another span. */
function spans(parent, column, brush, on) {
  const pairs = [];
  const brushOfFields = () => pairs.flatMap(([from, to]) => {
    if (from.value === "" && to.value === "") return [];
    const low = from.value === "" ? column.low : Number(from.dataset.exact);
    const high = to.value === "" ? column.high : Number(to.dataset.exact);
    return [[Math.min(low, high), Math.max(low, high)]];
  });
  const add = (...ends) => {
    const label = element(parent, "span", "span"), place = pairs.length + 1;
    pairs.push(["from", "to"].map((word, k) => {
      element(label, "span", "faint", word);
      const input = element(label, "input", "", "", {
        type: "number", step: "any", "aria-label": `${column.name} ${word}, filter range ${place}`,
      });
      input.value = ends.length ? String(Number(ends[k].toPrecision(6))) : "";
      input.dataset.exact = ends.length ? ends[k] : ""; // a rounded end stays exact until a user types another
      input.addEventListener("input", () => { input.dataset.exact = input.value; });
      input.addEventListener("change", () => {
        on.brush(brushOfFields());
        if (pairs.at(-1).some((one) => one.value !== "")) add();
      });
      return input;
    }));
  };
  for (const [low, high] of brush) add(low, high);
  add();
  return pairs[0][0];
}
