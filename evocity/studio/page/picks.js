import { counted, made, sized } from "./made.js";

const SIZE = 56;

/** Who is picked, with notes; births as files. `on`: wake(id), chosen(), choose(ids), picked(ids),
 * python(), trouble(error). */
export class Picks {
  constructor(parent, server, small, on) {
    [this.server, this.small, this.on] = [server, small, on];
    this.ids = [];
    this.isGoing = false;
    const first = made(parent, "div", "row");
    this.pickChosen = this.button(first, "", () => this.change({ change: "pick", ids: on.chosen() }));
    this.undo = this.button(first, "undo", () => this.change({ change: "undo" }));
    this.chooseThese = this.button(first, "choose the picks", () => on.choose(this.ids));
    this.list = made(parent, "ul", "picks");
    this.nobody = made(parent, "p", "faint", "Nobody is picked. Click births to choose them, with Ctrl for one more, and pick them; each may have a note.");
    this.steer = made(parent, "div", "row");
    this.button(this.steer, "have the run breed from these too", () => this.command("pick"));
    this.button(this.steer, "no longer", () => this.command("drop"));
    this.said = made(parent, "p", "faint", "", { role: "status" });
    made(parent, "h2", "part", "as files");
    const files = made(parent, "div", "row");
    this.whose = made(made(files, "label", "", "of "), "select");
    for (const text of ["the picks", "the chosen"]) made(this.whose, "option", "", text, { value: text });
    this.whose.addEventListener("change", () => this.inform());
    this.files = [["zip", "zip"], ["contact sheet", "png"], ["CSV", "csv"]].map(([text, kind]) =>
      this.button(files, text, () => this.save(kind)));
    made(parent, "p", "faint", "A zip has of each birth its map as GeoTIFF, footprints, a picture, its genome and a " +
      "scene for three-dimensional programs, and the scores of all.");
    made(parent, "h2", "part", "the same births in a notebook");
    this.python = made(parent, "textarea", "code", "", { readonly: "", rows: "4", "aria-label": "a line of Python" });
    this.button(made(parent, "div", "row"), "copy", () => this.copy());
    this.place = made(parent, "p", "faint");
    this.tell({ picks: [], undo: 0, place: "" });
  }

  button(parent, text, act) {
    const found = made(parent, "button", "", text, { type: "button" });
    found.addEventListener("click", act);
    return found;
  }

  async load() { this.tell(await this.server.asked("picks")); }

  async change(change) {
    try {
      this.tell(await this.server.told("pick", change));
      this.on.trouble(null);
    } catch (error) {
      this.on.trouble(error);
    }
  }

  /** Whether the run goes on, and takes commands. */
  set going(isGoing) {
    this.isGoing = isGoing;
    this.steer.hidden = !isGoing || !this.ids.length;
  }

  tell({ picks, undo, place }) {
    const focused = document.activeElement.closest(".evocity-picks li");
    const kept = focused && [Number(focused.dataset.id), document.activeElement.tagName];
    this.ids = picks.map((one) => one.id);
    this.undo.disabled = !undo;
    this.nobody.hidden = picks.length > 0;
    this.chooseThese.disabled = !picks.length;
    this.list.replaceChildren(...picks.map((one) => this.item(one)));
    if (kept) {
      const item = [...this.list.children].find((one) => Number(one.dataset.id) === kept[0]);
      (item ? item.querySelector(kept[1].toLowerCase()) : this.undo).focus();
    }
    this.place.textContent = place ? `Picks are kept in ${place}.` : "";
    this.going = this.isGoing;
    this.small.want(this.ids, 96);
    this.draw();
    this.inform();
    this.on.picked(this.ids);
  }

  item({ id, note }) {
    const item = made(null, "li");
    item.dataset.id = id;
    const seen = made(item, "button", "node", "", { type: "button", "aria-label": `show birth ${id}` });
    made(seen, "canvas", "", "", { "aria-hidden": "true" });
    made(seen, "span", "", String(id));
    seen.addEventListener("click", () => this.on.wake(id));
    const text = made(item, "textarea", "", "", { rows: "2", maxlength: "2000", placeholder: "note", "aria-label": `note of birth ${id}` });
    text.value = note;
    text.addEventListener("change", () => this.change({ change: "note", ids: [id], note: text.value }));
    this.button(item, "drop", () => this.change({ change: "drop", ids: [id] })).setAttribute("aria-label", `drop birth ${id}`);
    return item;
  }

  arrived() {
    this.small.want(this.ids, 96);
    this.draw();
  }

  draw() {
    for (const item of this.list.children) {
      const tile = this.small.get(Number(item.dataset.id), 96);
      const context = sized(item.querySelector("canvas"), SIZE, SIZE);
      context.fillStyle = "#efeae0";
      context.fillRect(0, 0, SIZE, SIZE);
      if (tile) context.drawImage(tile.image, tile.x, tile.y, tile.width, tile.height, 0, 0, SIZE, SIZE);
    }
  }

  /** What depends on who is chosen. */
  inform() {
    const chosen = this.on.chosen();
    this.pickChosen.textContent = `pick the ${counted(chosen.length)} chosen`;
    this.pickChosen.disabled = !chosen.length;
    for (const button of this.files) button.disabled = !this.meant.length;
    this.python.value = this.on.python();
  }

  get meant() { return this.whose.value === "the picks" ? this.ids : this.on.chosen(); }

  async save(kind) {
    this.said.textContent = "writing the files …";
    try {
      await this.server.saved(kind, { ids: this.meant }, `births.${kind}`);
      this.said.textContent = `births.${kind} is with your downloads.`;
      this.on.trouble(null);
    } catch (error) {
      this.said.textContent = "";
      this.on.trouble(error);
    }
  }

  async command(steer) {
    try {
      const { words, going } = await this.server.told("steer", { steer, ids: this.ids });
      this.said.textContent = `${words}; ${going ? "from the next generation on" : "once the run goes on"}`;
      this.on.trouble(null);
    } catch (error) {
      this.on.trouble(error);
    }
  }

  async copy() {
    try {
      await navigator.clipboard.writeText(this.python.value);
      this.said.textContent = "copied";
    } catch {
      this.python.select();
      this.said.textContent = "The line is selected: copy it with Ctrl and C.";
    }
  }
}
