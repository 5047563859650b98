const gallery = document.getElementById("gallery");
if (gallery) {
  const cards = [...gallery.children];
  const keys = new Map(cards.map((card) => [card, JSON.parse(card.dataset.keys)]));
  document.getElementById("order").addEventListener("change", (event) => {
    const key = Number(event.target.value);
    cards.sort((a, b) => keys.get(a)[key] - keys.get(b)[key] || keys.get(a)[0] - keys.get(b)[0]);
    gallery.append(...cards);
  });
  const front = document.getElementById("front-only");
  const different = document.getElementById("different-only");
  const choose = () => {
    for (const card of cards) {
      card.hidden = (front.checked && card.dataset.rank !== "0") ||
        (different.checked && "alike" in card.dataset);
    }
  };
  front.addEventListener("change", choose);
  different.addEventListener("change", choose);
}
document.addEventListener("click", (event) => {
  if (event.target.matches(".card[id] img")) event.target.closest(".card").classList.toggle("large");
});
