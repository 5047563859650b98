import { announce } from "./controls.js";
import { button, choice, element, field, offer, tick } from "./elements.js";

const LEVELS = {
  "2.2": "2.2, with roofs", "1.3": "1.3, each building", "1.2": "1.2, parts of buildings", "1.0": "1.0, blocks",
  afar: "afar, from a distance", 0: "0, footprints",
};
/** The level that a format has unless the user chooses another. */
const USUAL = "1.3";

/** The export of births or children as files of other programs. `on`: what(), the births or children for the server,
 * null for none; words(), these in words. */
export class Export {
  constructor(parent, server, on) {
    [this.server, this.on] = [server, on];
    this.root = element(parent, "details");
    element(this.root, "summary", "", "export to other programs");
    const form = element(this.root, "form"), row = element(form, "div", "row");
    form.hidden = true;
    this.root.addEventListener("toggle", () => {
      form.hidden = !this.root.open;
      if (this.root.open) this.load();
    });
    this.format = choice(row, "format", []);
    this.format.addEventListener("change", () => this.inform());
    this.level = choice(row, "level of detail", []);
    this.streets = tick(row, "streets and squares");
    this.placed = element(form, "div", "row");
    this.place = choice(this.placed, "place on Earth of", []);
    this.crs = field(this.placed, "reference system", "text", "", { maxlength: "200", placeholder: "of the place", spellcheck: "false" });
    const last = element(form, "div", "row");
    this.go = element(last, "button", "", "export", { type: "submit" });
    this.state = element(last, "span", "", "", { role: "status" });
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.write();
    });
    this.inform();
  }

  async load() {
    if (this.formats) return;
    try {
      const { formats, places, placed } = await this.server.getJson("formats");
      this.formats = new Map(formats.map((one) => [one.name, one]));
      offer(this.format, formats.map(({ name, title }) => [name, title]));
      offer(this.place, [...places, ""].map((name) => [name, name || "no city"]));
      this.place.value = places[0] ?? "";
      this.isPlaced = placed;
      this.place.parentElement.hidden = !places.length;
      this.inform();
    } catch (error) {
      this.show(error.message, true);
    }
  }

  /** Show the parts that depend on the format, and on what is chosen. */
  inform() {
    const kind = this.formats?.get(this.format.value);
    this.go.disabled = this.isBusy || !kind || !this.on.what();
    this.go.textContent = `export ${this.on.words()}`;
    if (!kind) return;
    const had = this.level.value;
    offer(this.level, kind.levels.map((one) => [one, LEVELS[one]]));
    if (!had && kind.levels.includes(USUAL)) this.level.value = USUAL;
    this.level.parentElement.hidden = !kind.levels.length;
    this.streets.parentElement.hidden = !kind.streets;
    this.placed.hidden = !(kind.placed && this.isPlaced);
  }

  show(text, isLack = false) {
    announce(this.state, text);
    this.state.classList.toggle("evocity-lack", isLack);
  }

  async write() {
    const kind = this.formats.get(this.format.value), began = performance.now();
    this.isBusy = true;
    this.inform();
    const tell = () => this.show(`writing … ${Math.round((performance.now() - began) / 1000)} s`);
    const timer = setInterval(tell, 1000);
    tell();
    try {
      const name = await this.server.downloadFile("export", {
        ...this.on.what(), format: kind.name, at: (kind.placed && this.place.value) || null,
        crs: (kind.placed && this.crs.value.trim()) || null, streets: kind.streets && this.streets.checked,
        level: kind.levels.length ? this.level.value : null,
      });
      this.show(`The file ${name} is in your downloads folder.`);
    } catch (error) {
      this.show(error.message, true);
    }
    clearInterval(timer);
    this.isBusy = false;
    this.inform();
  }
}
