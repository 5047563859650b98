import { made, number } from "./made.js";

/** All that can be done to an axis, without a pointer: what passes, its place, its direction
 * if it `isAxis`.
 * `on`: brush(brush), clear(), move(by), turn(), hide(), close(). Returns what begins with the focus. */
export function axisPanel(parent, column, brush, on) {
  parent.replaceChildren();
  const head = made(parent, "div", "row");
  made(head, "b", "", column.name);
  const range = column.isWords ? `${column.words.length} words` :
    `${number(column.low)} … ${number(column.high)} ${column.unit}`.trimEnd();
  made(head, "span", "faint", [range, column.wanted].filter(Boolean).join("; "));
  const passing = made(parent, "div", "row");
  const first = column.isWords ? words(passing, column, brush, on) : spans(passing, column, brush, on);
  const buttons = made(parent, "div", "row");
  const moves = [
    ["turn over", on.turn], ["move left", () => on.move(-1)], ["move right", () => on.move(1)], ["hide", on.hide],
  ];
  const actions = [["no filter here", on.clear], ...(on.isAxis ? moves : []), ["close", on.close]];
  for (const [text, act] of actions) {
    made(buttons, "button", "", text, { type: "button" }).addEventListener("click", act);
  }
  parent.onkeydown = (event) => {
    if (event.key === "Escape") on.close();
  };
  return first;
}

function words(parent, column, brush, on) {
  const boxes = column.words.map((word) => {
    const label = made(parent, "label");
    const box = made(label, "input", "", "", { type: "checkbox" });
    box.checked = brush.includes(word);
    label.append(word || "none");
    box.addEventListener("change", () => on.brush(column.words.filter((_, k) => boxes[k].checked)));
    return box;
  });
  return boxes[0];
}

/** A pair of numbers for each span, and always one more for another. */
function spans(parent, column, brush, on) {
  const pairs = [];
  const told = () => pairs.flatMap(([from, to]) => {
    if (from.value === "" && to.value === "") return [];
    const low = from.value === "" ? column.low : Number(from.dataset.exact);
    const high = to.value === "" ? column.high : Number(to.dataset.exact);
    return [[Math.min(low, high), Math.max(low, high)]];
  });
  const add = (...ends) => {
    const label = made(parent, "span", "span"), place = pairs.length + 1;
    pairs.push(["from", "to"].map((word, k) => {
      made(label, "span", "faint", word);
      const input = made(label, "input", "", "", {
        type: "number", step: "any", "aria-label": `${column.name} ${word}, span ${place}`,
      });
      input.value = ends.length ? String(Number(ends[k].toPrecision(6))) : "";
      input.dataset.exact = ends.length ? ends[k] : ""; // a rounded end stays exact until it is written anew
      input.addEventListener("input", () => { input.dataset.exact = input.value; });
      input.addEventListener("change", () => {
        on.brush(told());
        if (pairs.at(-1).some((one) => one.value !== "")) add();
      });
      return input;
    }));
  };
  for (const [low, high] of brush) add(low, high);
  add();
  return pairs[0][0];
}
