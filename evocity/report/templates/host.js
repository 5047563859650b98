
/** The host of the report: the document, the births and their pictures are in the page. */
{
  const { document: whole, births, pictures } = JSON.parse(document.getElementById("page").textContent);
  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const sheet = (async () => {
    const image = pictures.tiles.length ? await createImageBitmap(new Blob([bytes(pictures.image)], { type: pictures.kind })) : null;
    return { ...pictures, image };
  })();
  const has = new Set(pictures.tiles), root = document.getElementById("viewer"), { about } = whole;
  const lack = (id) => [id, `This page has no picture of birth ${id}. The command evocity show RUN --id ${id} -o ${id}.png draws one.`];
  const reasons = new Map(pictures.lacking);
  root.closest("section").hidden = false;
  document.body.className = "scripted"; // the viewer has the tables of births, too
  window.report = new Viewer(root, {
    about, buffer: bytes(births), state: { order: about.order, axes: about.axes },
    save() {},
    part: (name) => Promise.resolve(whole[name]),
    async tiles(ids) {
      return { ...await sheet, lacking: ids.filter((id) => !has.has(id)).map((id) => (reasons.has(id) ? [id, reasons.get(id)] : lack(id))) };
    },
  });
}
