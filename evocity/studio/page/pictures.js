import { element, number } from "./elements.js";

/** Pictures of a birth, by their names for the server. */
const PICTURES = [["map", "map"], ["stones", "ancestry"]];
/** Maps of the calls to its own parts, by their names for the server, and in words. */
const COUNTS = [["ranges", "usage", "how many lifs copy from each domain block"],
  ["pixels", "µ", "how many lifs copy from each pixel"]];
/** Views in three dimensions, which the page draws itself. */
const SPACES = [["columns", "3D"], ["walk", "walk"]];
/** The picture that needs a pinned birth. */
const DIFFERENCE = "difference";

/** Pictures of a birth from the `server` of its run; of two births side by side, on one scale and from one
 * viewpoint. */
export class Pictures {
  constructor(parent, server) {
    this.server = server;
    this.kind = "map";
    const kinds = element(parent, "div", "row", "", { role: "group", "aria-label": "picture" });
    this.kinds = new Map([...PICTURES, ...COUNTS, ...SPACES, [DIFFERENCE, DIFFERENCE]].map(([kind, text]) => {
      const button = element(kinds, "button", "", text, { type: "button" });
      button.disabled = true; // until a birth is shown
      button.addEventListener("click", () => this.picture(kind));
      return [kind, button];
    }));
    this.pair = element(parent, "div", "pair");
    this.figures = [0, 1].map(() => {
      const root = element(this.pair, "figure");
      return { root, caption: element(root, "figcaption"), image: element(root, "img") };
    });
    this.legend = element(parent, "p", "faint");
    this.space = element(parent, "div", "space");
    this.space.hidden = true;
    this.lack = element(parent, "p", "lack");
  }

  /** Show a birth, `beside` another or none (null); `isPictured`: whether it has pictures. */
  show(id, beside, isPictured) {
    [this.id, this.beside] = [id, beside];
    if (beside === null && this.kind === DIFFERENCE) this.kind = "map";
    return this.picture(isPictured ? this.kind : null);
  }

  /** Show a kind of picture; later answers to earlier requests are ignored. */
  async picture(kind) {
    const { id, beside } = this, request = this.request = {}, isCurrent = () => request === this.request;
    for (const [one, button] of this.kinds) button.disabled = !kind || (one === DIFFERENCE && beside === null);
    this.legend.textContent = "";
    if (!kind) {
      this.showLack("This birth has no picture.");
      return;
    }
    this.kind = kind;
    for (const [one, button] of this.kinds) button.setAttribute("aria-pressed", String(one === kind));
    try {
      if (SPACES.some(([one]) => one === kind)) await this.draw(kind, isCurrent);
      else await this.images(kind, id, kind === DIFFERENCE ? null : beside, isCurrent);
    } catch (error) {
      if (isCurrent()) this.showLack(`This birth has no picture: ${error.message}`);
    }
  }

  /** Show why there is no picture; an empty text for a picture. */
  showLack(text) {
    this.lack.textContent = text;
    this.lack.hidden = !text;
    if (text) this.pair.hidden = this.space.hidden = true;
  }

  async images(kind, id, beside, isCurrent) {
    const ids = beside === null ? [id] : [id, beside];
    const images = await Promise.all(ids.map((one, place) => this.imageOf(kind, one, ids[1 - place])));
    if (!isCurrent()) return;
    this.figures.forEach(({ root, caption, image }, place) => {
      const picture = images[place];
      root.hidden = !picture;
      if (!picture) return;
      caption.textContent = place ? `birth ${beside}, pinned` : `birth ${id}`;
      caption.hidden = beside === null;
      if (image.src) URL.revokeObjectURL(image.src);
      image.src = URL.createObjectURL(picture.blob);
      image.alt = picture.words;
      image.classList.toggle("evocity-pixels", COUNTS.some(([one]) => one === kind));
    });
    this.legend.textContent = [...new Set(images.map((one) => one.legend || ""))].join(" ");
    this.pair.hidden = this.figures[0].image.hidden = false;
    this.space.hidden = true;
    this.showLack("");
  }

  /** One picture, on one scale with an `other` birth, if there is one: {blob, words, legend}. */
  async imageOf(kind, id, other) {
    const beside = other === undefined ? {} : { beside: other };
    const count = COUNTS.find(([one]) => one === kind);
    const png = (content) => new Blob([content], { type: "image/png" });
    if (count) {
      const { about, content } = await this.server.getFramed("calls", { id, count: kind, ...beside });
      const more = about.most > about.end ? `; a few values reach ${about.most}` : "";
      const whose = other === undefined ? "" : `, birth ${id}`;
      return { blob: png(content), words: `birth ${id}: ${count[2]}`,
        legend: `${count[2]}${whose}: the colour scale covers values from 0 to ${number(about.end)}${more}.` };
    }
    if (kind === DIFFERENCE) {
      const { about, content } = await this.server.getFramed("difference", { id, beside: this.beside });
      const share = `${(100 * about.apart).toFixed(about.apart < 0.1 ? 1 : 0)} %`;
      const mean = `${about.more < 0 ? "−" : "+"}${number(Math.abs(about.more))} m`;
      return { blob: png(content), words: `difference of heights: red where birth ${id} is higher, blue where birth ${this.beside} is higher`,
        legend: `Birth ${id} minus birth ${this.beside}: red is higher, blue is lower. ${share} of the map differs by more than a storey; the mean difference is ${mean}.` };
    }
    return { blob: await this.server.getBlob("picture", { id, kind, ...beside }),
      words: { map: `map of heights of birth ${id}, north up`, stones: `map of birth ${id}, coloured by source city` }[kind] };
  }

  /** Draw in three dimensions; the modules for this load at first use. */
  async draw(kind, isCurrent) {
    const ids = [this.id, this.beside].filter((one) => one !== null);
    const [{ Space }, ...maps] = await Promise.all([import("./space.js"), ...ids.map((id) => this.server.getFramed("heights", { id }))]);
    if (!isCurrent()) return;
    this.spaceView ||= new Space(this.space);
    this.pair.hidden = true;
    this.space.hidden = false;
    this.showLack("");
    this.spaceView.show(maps.map(({ about, content }, place) => ({
      city: {
        heights: new Float32Array(content.slice().buffer), rows: about.height, columns: about.width,
        metresPerPixel: about.metres, highest: this.highest,
      },
      title: `birth ${ids[place]}${place ? ", pinned" : ""}`,
    })), kind === "walk");
    if (this.spaceView.kind !== "walk") return;
    for (const [place, id] of ids.entries()) { // blocks of pixels until these arrive
      try {
        const bytes = await (await this.server.getBlob("solids", { id })).arrayBuffer();
        if (!isCurrent()) return;
        this.spaceView.setSolids(place, bytes);
      } catch (error) {
        if (isCurrent()) this.legend.textContent = `Birth ${id} has no building outlines, so the walls follow the pixels: ${error.message}`;
      }
    }
  }
}
