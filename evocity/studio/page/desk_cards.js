import { byteText } from "./calibration.js";
import { USES, WindowMap } from "./desk_map.js";
import { button, choice, countText, element, field, number, offer } from "./elements.js";
import { Fault, faultText, uploadFile } from "./server.js";

/** Metres, and letters of an attribution. */
const LENGTH = { min: 0.000001, max: 1000000 }, LONGEST = 1000;
/** The sources of the heights of buildings, by rule; height of those without one, m. */
const RULES = { height: "in the file", levels: "from storeys" }, DEFAULT_HEIGHT = 6;
/** Options of reading: key, text, limits of a number; without limits it is a text. `takes`: only readers that take it. */
const OPTIONS = [
  ["default_height", "default height, m", LENGTH, false], ["layer", "layer that contains the buildings"], ["height_column", "column of heights, m"],
  ["levels_column", "column of storeys"], ["height_scale", "height in metres of one grey level in a picture, or of one unit in a raster", LENGTH],
  ["nodata", "value of missing pixels", {}], ["terrain", "elevation of the ground, m", { min: -1000, max: 10000 }],
];

export const numberIn = ({ value }) => (value.trim() === "" ? null : Number(value));

/** A text in one line. */
const lineIn = ({ value }) => value.trim().replace(/\s+/g, " ");

/** The cards of all maps, with the maps to move windows on, and uploads. `on`: window(); resize(about), to the window of a
 * kept child; changed(use), which sends all choices; look(); drop(map); longest(). */
export class Cards {
  constructor(parent, on) {
    [this.on, this.cards, this.chosen, this.placed, this.areas, this.queue] = [on, new Map(), [], new Map(), {}, []];
    const row = element(parent, "div", "row");
    const file = this.file = element(element(row, "label", "file", "your own files "), "input", "", "", { type: "file", multiple: "" });
    file.addEventListener("change", (event) => { event.stopPropagation(); this.upload([...file.files]); });
    element(row, "span", "faint", "To add files, drop them here: GeoJSON, GeoPackage, GeoParquet, FlatGeobuf, OSM, KML, CityJSON, GML, DXF, GeoTIFF, ASCII grid, PNG, NPY. If your map is a Shapefile or a File GDB, pack its files into a zip.");
    this.status = element(parent, "p", "", "", { role: "status" });
    this.list = element(parent, "ul", "cards", "", { "aria-label": "cities" });
  }

  /** Take the choices of the server. */
  load(draft) {
    this.placed = new Map(draft.maps.map((one) => [one.map, one]));
    this.chosen = draft.maps.filter((one) => one.chosen).map((one) => one.map);
    this.areas = { lock: draft.lock, within: draft.within };
  }

  show({ maps, scale, areas }) {
    [this.scale, this.names] = [scale, areas];
    for (const [one, card] of this.cards) {
      if (maps.some(({ map }) => map === one)) continue;
      card.item.remove();
      this.cards.delete(one);
    }
    for (const one of maps) {
      if (!this.cards.has(one.map)) this.cards.set(one.map, this.card(one));
      const card = this.cards.get(one.map), place = this.chosen.indexOf(one.map);
      card.box.checked = place >= 0;
      card.place.textContent = place < 0 ? "" : place ? `parent ${place + 1}` : "first parent";
      card.item.classList.toggle("evocity-on", place >= 0);
      if (one.about && card.turn !== `${one.turn} ${scale}`) {
        card.turn = `${one.turn} ${scale}`;
        card.image.src = `/api/desk-picture?${new URLSearchParams({ map: one.map, turn: one.turn, scale })}`;
      }
      card.image.hidden = !one.about;
      card.about = one.about;
      const fault = one.fault && faultText(one.fault);
      card.text.textContent = one.reading ? "reading …" : fault || aboutOf(one.about, (card.default_height && numberIn(card.default_height)) || DEFAULT_HEIGHT);
      card.text.classList.toggle("evocity-lack", Boolean(one.fault) && !one.reading);
      if (card.attribution) card.attribution.placeholder = (one.about && one.about.attribution) || "the file states no attribution";
      else card.credit.textContent = one.about ? one.about.attribution : "";
      if (fault && fault !== card.fault && card.more && !(card.map && card.map.set)) card.more.open = true;
      card.fault = fault;
      if (card.terrain_map) this.showRasters(one.map, card, maps);
      if (one.over && (one.own || place >= 0)) this.showMap(one, card);
      if (card.map) card.wide.hidden = !(one.own || place >= 0);
      card.item.classList.toggle("evocity-placed", Boolean(card.map) && !card.wide.hidden);
    }
  }

  // -- the map of a file and its areas -------------------------------------------------------

  showMap(one, card) {
    const { map, title } = one;
    if (!card.map) {
      card.wide = element(card.item, "div", "wide-map");
      card.map = new WindowMap(card.wide, title, {
        window: () => this.on.window(), scale: () => this.scale, moved: () => this.on.changed(),
        areas: () => Object.fromEntries(Object.entries(this.areas).filter(([, area]) => area && area.map === map)),
        drew: (use, shape) => this.draw(map, use, shape),
      });
      const choice = this.placed.get(map) || {};
      card.map.set = choice.at || null;
      const row = element(card.wide, "div", "row");
      card.areas = new Map(USES.map(([use, name]) => [use, this.area(row, card, map, use, name, title)]));
    }
    card.map.show(one, card.map.set);
    for (const [use, line] of card.areas) {
      const area = this.areas[use], here = area && area.map === map, read = one.about && one.about.areas && one.about.areas[use];
      const draw = card.map.buttons.get(use);
      draw.disabled = Boolean(area && (!here || area.file !== null));
      draw.title = !draw.disabled ? "" : here ? `The ${line.name} comes from a file. Remove it to draw one.` : `The ${line.name} lies on another map. Remove it there to draw one here.`;
      line.remove.hidden = line.undo.hidden = !here;
      line.undo.hidden ||= area.shapes.length < 2;
      line.label.hidden = Boolean(area);
      const what = here ? (area.file === null ? `${area.shapes.length} drawn` : this.names[area.file]) : "";
      const share = read && !read.fault ? `, ${+(100 * read.share).toFixed(1)} % of the window${read.note ? `; ${read.note}` : ""}` : "";
      line.text.textContent = !here ? line.fault || "" : read && read.fault ? faultText(read.fault) : one.reading ? `${line.name}: reading …` : `${line.name}: ${what}${share}.`;
      line.text.classList.toggle("evocity-lack", Boolean(here ? read && read.fault : line.fault));
    }
  }

  /** The line of an area: its text, its file, and buttons. */
  area(row, card, map, use, name, title) {
    const line = { name };
    line.text = element(row, "span", "", "", { role: "status" });
    const acting = (text, act) => button(row, text, () => { act(); this.on.changed(); card.map.redraw(); card.map.canvas.focus(); }, { "aria-label": `${text} on ${title}` });
    line.undo = acting(`remove the last shape of the ${name}`, () => { this.areas[use] = { ...this.areas[use], shapes: this.areas[use].shapes.slice(0, -1) }; });
    line.remove = acting(`remove the ${name}`, () => { this.areas[use] = null; });
    const file = field(row, `${name} from a file`, "file");
    line.label = file.parentElement;
    file.addEventListener("change", async (event) => {
      event.stopPropagation();
      line.fault = "";
      try {
        this.areas[use] = { map, shapes: [], file: await this.send(file.files[0], { area: 1 }) };
        this.on.changed(use);
      } catch (error) {
        line.text.textContent = line.fault = error.message;
      }
      file.value = "";
    });
    return line;
  }

  draw(map, use, shape) {
    const area = this.areas[use] || { map, shapes: [], file: null };
    this.areas[use] = { ...area, shapes: [...area.shapes, shape] };
    this.on.changed(use);
  }

  // -- cards ---------------------------------------------------------------------------------

  /** Offer the user's other rasters as ground of a map. */
  showRasters(map, card, maps) {
    const ofFootprints = (one) => one.about && Object.keys(one.about.rules).length > 0; // in a zip
    const isRaster = (one) => one.own && one.takes.includes("terrain") && !ofFootprints(one);
    const rasters = maps.filter((one) => one.map !== map && isRaster(one));
    const key = JSON.stringify(rasters.map((one) => one.map)), select = card.terrain_map;
    if (key === card.rasters) return;
    const value = card.rasters ? select.value : String((this.placed.get(map) || {}).terrain_map ?? "");
    card.rasters = key;
    offer(select, [["", "none"], ...rasters.map((one) => [one.map, one.title])]);
    select.value = value;
    if (select.selectedIndex < 0) select.value = "";
  }

  card({ map, title, own, child, takes }) {
    const item = element(this.list, "li"), card = { item, child };
    if (own || child) this.list.insertBefore(item, this.first); // a user's maps before bundled districts
    else this.first ||= item;
    const label = element(item, "label");
    card.box = element(label, "input", "", "", { type: "checkbox" });
    element(label, "b", "", title);
    card.box.addEventListener("change", () => {
      this.chosen = this.chosen.filter((one) => one !== map);
      if (card.box.checked && child && !this.chosen.length) this.on.resize(card.about);
      if (card.box.checked) this.chosen.push(map);
    });
    card.place = element(item, "span", "place");
    card.image = element(item, "img", "", "", { alt: `map of heights of ${title}, north up`, width: 160, height: 160 });
    card.text = element(item, "p");
    card.credit = element(item, "p", "faint");
    if (child) return card;
    const options = this.placed.get(map) || {};
    const credit = own && element(item, "div", "credit");
    card.more = element(item, "details");
    element(card.more, "summary", "", "options for reading");
    const option = (name, text, limits) => (card[name] = field(card.more, text, limits ? "number" : "text", options[name] ?? "", limits && { step: "any", ...limits }));
    if (own) {
      const input = card.attribution = element(element(credit, "label", "", "attribution that the licence asks for"), "textarea", "", options.attribution ?? "", { rows: 3 });
      input.addEventListener("input", () => input.setCustomValidity(lineIn(input).length > LONGEST ? `The attribution has ${countText(lineIn(input).length)} letters. Shorten it to ${countText(LONGEST)}.` : ""));
    }
    for (const [name, text, limits, isSpecial = true] of OPTIONS) {
      if (isSpecial && !takes.includes(name)) continue;
      const input = option(name, text, limits);
      if (name === "default_height") input.placeholder = DEFAULT_HEIGHT;
      if (!limits) input.maxLength = 100;
    }
    if (takes.includes("terrain")) card.terrain_map = choice(card.more, "raster of the ground", []);
    if (own) {
      button(item, `remove ${title}`, async () => {
        this.chosen = this.chosen.filter((one) => one !== map);
        for (const [use] of USES) if (this.areas[use] && this.areas[use].map === map) this.areas[use] = null;
        await this.on.changed();
        this.on.drop(map);
        this.file.focus();
      });
    }
    return card;
  }

  /** Read all fields of maps and areas. */
  get choices() {
    const maps = [...this.chosen, ...[...this.cards.keys()].filter((map) => !this.chosen.includes(map))].map((map) => {
      const card = this.cards.get(map), choice = { map, chosen: this.chosen.includes(map) };
      if (!card || card.child) return choice;
      if (card.map ? card.map.set : (this.placed.get(map) || {}).at) choice.at = card.map ? card.map.set : this.placed.get(map).at;
      for (const [name, , limits] of [...OPTIONS, ["attribution"]]) {
        const value = card[name] && (limits ? numberIn(card[name]) : name === "attribution" ? lineIn(card[name]) : card[name].value.trim());
        if (value || value === 0) choice[name] = value;
      }
      if (card.terrain_map && card.terrain_map.value) choice.terrain_map = Number(card.terrain_map.value);
      return choice;
    });
    return { maps, lock: this.areas.lock || null, within: this.areas.within || null };
  }

  // -- files ---------------------------------------------------------------------------------

  async send(file, more = {}) {
    if (file.size > this.on.longest()) throw new Fault({ found: `${file.name} has ${byteText(file.size)}`, expected: `${byteText(this.on.longest())} at most`, remedy: "upload a smaller part of the file, or convert the file to a GeoPackage" });
    return (await uploadFile("desk-file", file, more)).map;
  }

  async upload(files) {
    this.queue.push(...files);
    if (this.isUploading) return; // the loop below takes these too
    this.isUploading = true;
    const faults = [];
    let count = 0;
    while (this.queue.length) {
      const file = this.queue.shift();
      count += 1;
      this.status.textContent = `uploading ${file.name}, ${count} of ${count + this.queue.length} …`;
      try {
        this.chosen.push(await this.send(file));
        if (!(await this.on.changed())) await this.on.look(); // a new map is chosen
      } catch (error) {
        faults.push(error.message);
      }
    }
    this.isUploading = false;
    this.file.value = "";
    this.status.textContent = faults.join(" ") || `${count === 1 ? "one new file is" : `${count} new files are`} on the desk`;
    this.status.classList.toggle("evocity-lack", faults.length > 0);
  }
}

/** The facts of a map in a line; `missing`: the height of buildings without one, m. */
function aboutOf(about, missing) {
  if (!about) return "";
  const [wide, tall] = about.metres, rules = Object.entries(about.rules);
  const count = rules.reduce((sum, [, of]) => sum + of, 0);
  const heights = rules.map(([rule, of]) => `${countText(of)} ${rule === "default" ? `missing, taken as ${number(missing)} m` : RULES[rule] || `from ${rule}`}`).join(", ");
  const source = about.pixels ? `; a kept child of ${about.pixels} px${about.locked ? `, which locks ${+(100 * about.locked).toFixed(1)} % of the window` : ""}.`
    : count ? `; ${countText(count)} buildings, heights: ${heights}.` : "; a raster of heights.";
  return `${number(wide)} × ${number(tall)} m, ${Math.round(100 * about.built)} % built, buildings up to ${number(about.highest)} m high${source}`;
}
