const gallery = document.getElementById("gallery");
if (gallery) {
  const cards = [...gallery.children];
  const keys = new Map(cards.map((card) => [card, JSON.parse(card.dataset.keys)]));
  document.getElementById("order").addEventListener("change", (event) => {
    const key = Number(event.target.value);
    cards.sort((a, b) => keys.get(a)[key] - keys.get(b)[key] || keys.get(a)[0] - keys.get(b)[0]);
    gallery.append(...cards);
  });
  document.getElementById("front-only").addEventListener("change", (event) => {
    for (const card of cards) card.hidden = event.target.checked && card.dataset.rank !== "0";
  });
}
document.addEventListener("click", (event) => {
  if (event.target.matches(".card[id] img")) event.target.closest(".card").classList.toggle("large");
});
