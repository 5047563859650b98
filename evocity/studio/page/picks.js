import { attempt } from "./controls.js";
import { button, choice, countText, element } from "./elements.js";
import { Export } from "./export.js";
import { paintTile } from "./tiles.js";

const SIZE = 56, MOST_EXPORTED = 20;

/** The pane of picks with notes, and of births as files. `on`: showBirth(id), chosen(), choose(ids), picked(ids),
 * python(), trouble(error). */
export class Picks {
  constructor(parent, server, small, on) {
    [this.server, this.small, this.on] = [server, small, on];
    this.ids = [];
    this.isGoing = false;
    const first = element(parent, "div", "row");
    this.pickChosen = button(first, "", () => this.change({ change: "pick", ids: on.chosen() }));
    this.undo = button(first, "undo", () => this.change({ change: "undo" }));
    this.chooseThese = button(first, "choose the picks", () => on.choose(this.ids));
    this.list = element(parent, "ul", "picks");
    this.emptyText = element(parent, "p", "faint", "No picks yet. Click a birth to choose it; hold Ctrl and click to choose more births. Then pick the chosen births. You can add a note to each pick.");
    this.steer = element(parent, "div", "row");
    button(this.steer, "use the picked births as parents in the run", () => this.command("pick"));
    button(this.steer, "stop using the picked births as parents in the run", () => this.command("drop"));
    this.message = element(parent, "p", "faint", "", { role: "status" });
    element(parent, "h2", "part", "save as files");
    const files = element(parent, "div", "row");
    this.source = choice(files, "of", ["the picks", "the chosen births"].map((text) => [text, text]));
    this.source.addEventListener("change", () => this.inform());
    this.files = [["zip", "zip"], ["contact sheet", "png"], ["CSV", "csv"]].map(([text, kind]) =>
      button(files, text, () => this.save(kind)));
    element(parent, "p", "faint", "The zip file contains each birth's GeoTIFF map, building footprints, picture and genome. " +
      "The zip file includes a 3D scene of each birth and a table of scores.");
    this.export = new Export(parent, server, {
      what: () => (this.exportIds.length ? { ids: this.exportIds.slice(0, MOST_EXPORTED) } : null),
      words: () => {
        const ids = this.exportIds, more = ids.length > MOST_EXPORTED ? `the first ${MOST_EXPORTED} of ` : "";
        return ids.length === 1 ? `birth ${ids[0]}` : `${more}${countText(ids.length)} births`;
      },
    });
    element(parent, "h2", "part", "open in a notebook");
    this.python = element(parent, "textarea", "code", "", { readonly: "", rows: "4", "aria-label": "a line of Python" });
    button(element(parent, "div", "row"), "copy", () => this.copy());
    this.place = element(parent, "p", "faint");
    this.showState({ picks: [], undo: 0, place: "" });
  }

  async load() { this.showState(await this.server.getJson("picks")); }

  async change(change) {
    await attempt(this.on.trouble, async () => this.showState(await this.server.postJson("pick", change)));
  }

  /** Whether the run is running and takes commands. */
  set going(isGoing) {
    this.isGoing = isGoing;
    this.steer.hidden = !isGoing || !this.ids.length;
  }

  showState({ picks, undo, place }) {
    const focused = document.activeElement.closest(".evocity-picks li");
    const kept = focused && [Number(focused.dataset.id), document.activeElement.tagName];
    this.ids = picks.map((one) => one.id);
    this.undo.disabled = !undo;
    this.emptyText.hidden = picks.length > 0;
    this.chooseThese.disabled = !picks.length;
    this.list.replaceChildren(...picks.map((one) => this.item(one)));
    if (kept) {
      const item = [...this.list.children].find((one) => Number(one.dataset.id) === kept[0]);
      (item ? item.querySelector(kept[1].toLowerCase()) : this.undo).focus();
    }
    this.place.textContent = place ? `Studio saves your picks in the file ${place}` : "";
    this.going = this.isGoing;
    this.small.request(this.ids, 96);
    this.draw();
    this.inform();
    this.on.picked(this.ids);
  }

  item({ id, note }) {
    const item = element(null, "li");
    item.dataset.id = id;
    const picture = element(item, "button", "node", "", { type: "button", "aria-label": `show birth ${id}` });
    element(picture, "canvas", "", "", { "aria-hidden": "true" });
    element(picture, "span", "", String(id));
    picture.addEventListener("click", () => this.on.showBirth(id));
    const text = element(item, "textarea", "", "", { rows: "2", maxlength: "2000", placeholder: "note", "aria-label": `note of birth ${id}` });
    text.value = note;
    text.addEventListener("change", () => this.change({ change: "note", ids: [id], note: text.value }));
    button(item, "drop", () => this.change({ change: "drop", ids: [id] })).setAttribute("aria-label", `drop birth ${id}`);
    return item;
  }

  drawTiles() {
    this.small.request(this.ids, 96);
    this.draw();
  }

  draw() {
    for (const item of this.list.children) {
      paintTile(item.querySelector("canvas"), this.small.get(Number(item.dataset.id), 96), SIZE);
    }
  }

  /** Show the parts that depend on the choice. */
  inform() {
    const chosen = this.on.chosen();
    this.pickChosen.textContent = `pick ${countText(chosen.length)} chosen`;
    this.pickChosen.disabled = !chosen.length;
    for (const one of this.files) one.disabled = !this.exportIds.length;
    this.export.inform();
    this.python.value = this.on.python();
  }

  /** The picks or the chosen births; the chosen births if there are no picks. */
  get exportIds() { return this.source.value === "the picks" && this.ids.length ? this.ids : this.on.chosen(); }

  async save(kind) {
    this.message.textContent = "writing files …";
    const isSaved = await attempt(this.on.trouble, () => this.server.downloadFile(kind, { ids: this.exportIds }, `births.${kind}`));
    this.message.textContent = isSaved ? `The file births.${kind} is in your downloads folder.` : "";
  }

  command(steer) {
    return attempt(this.on.trouble, async () => {
      const { words, going } = await this.server.postJson("steer", { steer, ids: this.ids });
      this.message.textContent = `${words}; ${going ? "from the next generation on" : "when the run resumes"}`;
    });
  }

  async copy() {
    try {
      await navigator.clipboard.writeText(this.python.value);
      this.message.textContent = "copied";
    } catch {
      this.python.select();
      this.message.textContent = "The line of Python code is selected. Press Ctrl+C to copy the line.";
    }
  }
}
