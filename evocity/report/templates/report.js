const numberOf = (input) => (!input || input.value === "" ? null : Number(input.value));
const upwards = (a, b) => (a === null) - (b === null) || a - b;

for (const controls of document.querySelectorAll(".controls")) {
  const gallery = controls.nextElementSibling;
  const cards = [...gallery.children].map((card) => ({
    card, keys: JSON.parse(card.dataset.keys), values: JSON.parse(card.dataset.values),
  }));
  const part = (name) => controls.querySelector(`[name=${name}]`);
  const marked = (name) => part(name) !== null && part(name).checked;
  const choose = () => {
    const low = numberOf(part("low")), high = numberOf(part("high")), measure = numberOf(part("measure"));
    for (const { card, values } of cards) {
      const value = values[measure];
      const within = value === null ? low === null && high === null :
        (low === null || value >= low) && (high === null || value <= high);
      card.hidden = !within || (marked("front") && card.dataset.rank !== "0") ||
        (marked("different") && "alike" in card.dataset) ||
        (marked("sound") && "breaks" in card.dataset);
    }
    const left = cards.filter(({ card }) => !card.hidden).length;
    controls.querySelector("output").textContent = `${left} of ${cards.length} shown`;
  };
  part("order").addEventListener("change", (event) => {
    const key = Number(event.target.value);
    cards.sort((a, b) => upwards(a.keys[key], b.keys[key]) || a.keys[0] - b.keys[0]);
    gallery.append(...cards.map(({ card }) => card));
  });
  controls.addEventListener("input", choose);
  controls.hidden = false;
  choose();
}

for (const heading of document.querySelectorAll(".sortable th")) {
  const column = heading.cellIndex, body = heading.closest("table").tBodies[0];
  const key = (row) => {
    const text = row.cells[column].textContent, number = Number.parseFloat(text);
    return text === "–" ? [2, 0] : Number.isNaN(number) ? [1, text] : [0, number];
  };
  const sort = () => {
    const down = heading.getAttribute("aria-sort") === "ascending";
    for (const other of heading.parentElement.cells) other.removeAttribute("aria-sort");
    heading.setAttribute("aria-sort", down ? "descending" : "ascending");
    const rows = [...body.rows].map((row) => ({ row, key: key(row) }));
    rows.sort(({ key: [kind, a] }, { key: [other, b] }) =>
      kind - other || (kind === 1 ? a.localeCompare(b) : a - b) * (down ? -1 : 1));
    body.append(...rows.map(({ row }) => row));
  };
  heading.tabIndex = 0;
  heading.addEventListener("click", sort);
  heading.addEventListener("keydown", (event) => { if (event.key === "Enter") sort(); });
}

document.addEventListener("click", (event) => {
  if (event.target.matches(".card[id] img")) event.target.closest(".card").classList.toggle("large");
});
