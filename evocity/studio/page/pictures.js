import { showBlob } from "./controls.js";
import { button, element, number } from "./elements.js";
import { FIELDS, FieldSearch } from "./fields.js";
import { Switches } from "./switches.js";

/** Pictures of a birth: the name for the server, the button, and words. */
const PICTURES = [["map", "map", "map of heights, north up"], ["stones", "ancestry", "map coloured by source city"]];
/** Maps of the calls to its own parts. */
const COUNTS = [["ranges", "calls of blocks", "for each range block, how many lifs copy its domain block"],
  ["pixels", "calls of pixels", "how many lifs copy each pixel"]];
/** Views in three dimensions, which the page draws itself. */
const SPACES = [["columns", "3D"], ["walk", "walk"]];
/** The picture that needs a pinned birth. */
const DIFFERENCE = "difference";
const KINDS = [...PICTURES, ...COUNTS, ...FIELDS, ...SPACES, [DIFFERENCE, DIFFERENCE]];
const isOf = (kinds, kind) => kinds.some(([one]) => one === kind);

/** Pictures of a birth from the `server` of its run; of two births side by side, on one scale and from one
 * viewpoint. */
export class Pictures {
  constructor(parent, server) {
    this.server = server;
    this.kind = "map";
    const kinds = element(parent, "div", "row", "", { role: "group", "aria-label": "picture" }), again = () => this.picture(this.kind);
    this.kinds = new Map(KINDS.map(([kind, text, title = ""]) => [kind, button(kinds, text, () => this.picture(kind), { title, disabled: "" })]));
    this.switches = new Switches(parent, again);
    this.fields = new FieldSearch(parent, server, { changed: again, stopped: () => this.begin(this.kind, "You stopped the search.") });
    this.pair = element(parent, "div", "pair");
    this.figures = [0, 1].map(() => {
      const root = element(this.pair, "figure");
      return { root, caption: element(root, "figcaption"), image: element(root, "img") };
    });
    this.legend = element(parent, "p", "faint");
    parent.append(this.fields.curve);
    this.space = element(parent, "div", "space");
    this.lack = element(parent, "p", "lack");
    this.begin(null, "");
    this.space.hidden = true;
  }

  /** Show a birth, `beside` another or none (null); `isPictured`: whether it has pictures; `isFabric`: whether its parts
   * come from cities. */
  show(id, beside, isPictured, isFabric) {
    [this.id, this.beside] = [id, beside];
    const isMissing = (kind) => (kind === DIFFERENCE ? beside === null : !isFabric && isOf([PICTURES[1], ...COUNTS], kind));
    if (isMissing(this.kind)) this.kind = "map";
    for (const [kind, one] of this.kinds) one.disabled = !isPictured || isMissing(kind);
    if (isPictured) return this.picture(this.kind);
    this.begin(null, "This birth has no picture.");
    return null;
  }

  /** Begin a kind of picture, with its controls; returns whether no later one began. */
  begin(kind, lack) {
    const request = this.request = {};
    this.switches.show(isOf(SPACES, kind));
    this.fields.show(isOf(FIELDS, kind));
    this.legend.textContent = "";
    this.showLack(lack);
    return () => request === this.request;
  }

  /** Show a kind of picture; later answers to earlier requests are ignored. */
  async picture(kind) {
    const { id, beside } = this, isCurrent = this.begin(kind, "");
    this.kind = kind;
    for (const [one, pressed] of this.kinds) pressed.setAttribute("aria-pressed", String(one === kind));
    try {
      if (isOf(SPACES, kind)) await this.draw(kind, isCurrent);
      else await this.images(kind, beside === null || kind === DIFFERENCE ? [id] : [id, beside], isCurrent);
    } catch (error) {
      if (isCurrent()) this.begin(kind, `This birth has no picture: ${error.message}`);
    }
  }

  /** Show why there is no picture; an empty text for a picture. */
  showLack(text) {
    this.lack.textContent = text;
    this.lack.hidden = !text;
    if (text) this.pair.hidden = this.space.hidden = true;
  }

  async images(kind, ids, isCurrent) {
    if (isOf(FIELDS, kind)) {
      this.pair.hidden = this.space.hidden = true;
      await this.fields.find(ids, isCurrent);
      if (!isCurrent()) return;
    }
    const images = await Promise.all(ids.map((one, place) => this.imageOf(kind, one, ids[1 - place])));
    if (!isCurrent()) return;
    this.figures.forEach(({ root, caption, image }, place) => {
      const picture = images[place];
      root.hidden = !picture;
      if (!picture) return;
      caption.textContent = place ? `birth ${ids[1]}, pinned` : `birth ${ids[0]}`;
      caption.hidden = ids.length < 2;
      showBlob(image, new Blob([picture.content], { type: "image/png" }));
      image.alt = picture.words;
      image.classList.toggle("evocity-pixels", isOf([...COUNTS, ...FIELDS], kind));
    });
    this.legend.textContent = [...new Set(images.map((one) => one.legend || ""))].join(" ");
    if (isOf(FIELDS, kind)) this.fields.showCurves(images.map((one) => one.curve));
    this.pair.hidden = false;
    this.space.hidden = true;
  }

  /** One picture, on one scale with an `other` birth, if there is one: {content, words, legend}. */
  async imageOf(kind, id, other) {
    const isOne = other === undefined, query = isOne ? { id } : { id, beside: other };
    const [, , title] = KINDS.find(([one]) => one === kind), words = `birth ${id}: ${title}`;
    if (isOf(FIELDS, kind)) return { words, ...await this.fields.mapOf(kind, id) };
    if (isOf(PICTURES, kind)) return { words, content: await this.server.getBlob("picture", { kind, ...query }) };
    if (isOf(COUNTS, kind)) {
      const { about, content } = await this.server.getFramed("calls", { count: kind, ...query });
      const more = about.most > about.end ? `; a few values reach ${about.most}` : "";
      return { content, words, legend: `${title}${isOne ? "" : `, birth ${id}`}: the colour scale covers values from 0 to ${number(about.end)}${more}.` };
    }
    const { beside } = this, { about, content } = await this.server.getFramed("difference", { id, beside });
    const share = `${(100 * about.apart).toFixed(about.apart < 0.1 ? 1 : 0)} %`;
    const mean = `${about.more < 0 ? "−" : "+"}${number(Math.abs(about.more))} m`;
    return { content, words: `difference of heights: red where birth ${id} is higher, blue where birth ${beside} is higher`,
      legend: `Birth ${id} minus birth ${beside}: red is higher, blue is lower. ${share} of the map differs by more than a storey; the mean difference is ${mean}.` };
  }

  /** Draw in three dimensions; the modules for this load at first use. */
  async draw(kind, isCurrent) {
    const ids = [this.id, this.beside].filter((one) => one !== null), { query } = this.switches;
    const [{ Space }, { library }, ...maps] = await Promise.all([import("./space.js"), this.server.getJson("scene-options"),
      ...ids.map((id) => this.server.getFramed("heights", { id }))]);
    if (!isCurrent()) return;
    this.switches.offerLibrary(library);
    this.spaceView ||= new Space(this.space);
    this.pair.hidden = true;
    this.space.hidden = false;
    this.spaceView.show(maps.map(({ about, content }, place) => ({
      city: cityOf(about, content, this.highest), title: `birth ${ids[place]}${place ? ", pinned" : ""}`,
    })), kind === "columns" && Object.keys(query).length ? "solids" : kind);
    if (this.spaceView.kind === "columns") return;
    for (const [place, id] of ids.entries()) { // blocks of pixels until these arrive
      try {
        const { about, content } = await this.server.getFramed("solids", { id, ...query });
        if (!isCurrent()) return;
        this.spaceView.setSolids(place, content.slice().buffer);
        if (!place) this.switches.showKey(about.groups);
        if (query.library) this.legend.textContent = about.attribution;
      } catch (error) {
        if (isCurrent()) this.legend.textContent = `Birth ${id} has no building outlines, so the walls follow the pixels: ${error.message}`;
      }
    }
  }
}

/** A city for `Space` from an answer of the server. */
export const cityOf = (about, content, highest) => ({
  heights: new Float32Array(content.slice().buffer), rows: about.height, columns: about.width, metresPerPixel: about.metres,
  highest, latitude: about.latitude,
});
