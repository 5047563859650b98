import { made, number } from "./made.js";

/** Pictures of a birth, by what the server calls them. */
const PICTURES = [["map", "map"], ["stones", "whose stones"]];
/** Maps of how often its own parts are called, by what the server calls them, and in words. */
const COUNTS = [["ranges", "usage", "how many lifs call the domain block that each range block is made of"],
  ["pixels", "µ", "how many lifs call each pixel"]];
/** What the page draws itself, in three dimensions. */
const SPACES = [["columns", "in space"], ["walk", "walk"]];
/** What takes another birth beside it. */
const DIFFERENCE = "difference";

/** Pictures of a birth by the `server` of its run; of two, side by side, on one scale and from one
 * place. */
export class Seen {
  constructor(parent, server) {
    this.server = server;
    this.kind = "map";
    const kinds = made(parent, "div", "row", "", { role: "group", "aria-label": "picture" });
    this.kinds = new Map([...PICTURES, ...COUNTS, ...SPACES, [DIFFERENCE, DIFFERENCE]].map(([kind, text]) => {
      const button = made(kinds, "button", "", text, { type: "button" });
      button.disabled = true; // until a birth is told
      button.addEventListener("click", () => this.picture(kind));
      return [kind, button];
    }));
    this.pair = made(parent, "div", "pair");
    this.figures = [0, 1].map(() => {
      const root = made(this.pair, "figure");
      return { root, caption: made(root, "figcaption"), image: made(root, "img") };
    });
    this.legend = made(parent, "p", "faint");
    this.within = made(parent, "div", "space");
    this.within.hidden = true;
    this.lack = made(parent, "p", "lack");
  }

  /** Those of a birth, `beside` another or none (null); `isPictured`, whether it has any. */
  show(id, beside, isPictured) {
    [this.id, this.beside] = [id, beside];
    if (beside === null && this.kind === DIFFERENCE) this.kind = "map";
    return this.picture(isPictured ? this.kind : null);
  }

  /** No answer that is on its way is meant any more. */
  async picture(kind) {
    const { id, beside } = this, asked = this.asked = {}, isMeant = () => asked === this.asked;
    for (const [one, button] of this.kinds) button.disabled = !kind || (one === DIFFERENCE && beside === null);
    this.legend.textContent = "";
    if (!kind) {
      this.tell("It has no picture.");
      return;
    }
    this.kind = kind;
    for (const [one, button] of this.kinds) button.setAttribute("aria-pressed", String(one === kind));
    try {
      if (SPACES.some(([one]) => one === kind)) await this.draw(kind, isMeant);
      else await this.images(kind, id, kind === DIFFERENCE ? null : beside, isMeant);
    } catch (error) {
      if (isMeant()) this.tell(`It has no picture: ${error.message}`);
    }
  }

  /** Why there is none; nothing where there is one. */
  tell(text) {
    this.lack.textContent = text;
    this.lack.hidden = !text;
    if (text) this.pair.hidden = this.within.hidden = true;
  }

  async images(kind, id, beside, isMeant) {
    const ids = beside === null ? [id] : [id, beside];
    const found = await Promise.all(ids.map((one, place) => this.imageOf(kind, one, ids[1 - place])));
    if (!isMeant()) return;
    this.figures.forEach(({ root, caption, image }, place) => {
      const told = found[place];
      root.hidden = !told;
      if (!told) return;
      caption.textContent = place ? `birth ${beside}, pinned` : `birth ${id}`;
      caption.hidden = beside === null;
      if (image.src) URL.revokeObjectURL(image.src);
      image.src = URL.createObjectURL(told.blob);
      image.alt = told.words;
      image.classList.toggle("evocity-pixels", COUNTS.some(([one]) => one === kind));
    });
    this.legend.textContent = [...new Set(found.map((one) => one.legend || ""))].join(" ");
    this.pair.hidden = this.figures[0].image.hidden = false;
    this.within.hidden = true;
    this.tell("");
  }

  /** One picture, on one scale with that of an `other` birth, if there is one: {blob, words, legend}. */
  async imageOf(kind, id, other) {
    const beside = other === undefined ? {} : { beside: other };
    const count = COUNTS.find(([one]) => one === kind);
    const png = (content) => new Blob([content], { type: "image/png" });
    if (count) {
      const { about, content } = await this.server.framed("calls", { id, count: kind, ...beside });
      const more = about.most > about.end ? `; a few up to ${about.most}` : "";
      const whose = other === undefined ? "" : `, birth ${id}`;
      return { blob: png(content), words: `birth ${id}: ${count[2]}`,
        legend: `${count[2]}${whose}: the bar goes from 0 to ${number(about.end)}${more}.` };
    }
    if (kind === DIFFERENCE) {
      const { about, content } = await this.server.framed("difference", { id, beside: this.beside });
      const share = `${(100 * about.apart).toFixed(about.apart < 0.1 ? 1 : 0)} %`;
      const mean = `${about.more < 0 ? "−" : "+"}${number(Math.abs(about.more))} m`;
      return { blob: png(content), words: `what birth ${id} has more, red, and less, blue, than birth ${this.beside}`,
        legend: `Birth ${id} less birth ${this.beside}: red is higher, blue lower. ${share} of the map differs by over a storey; the mean is ${mean}.` };
    }
    return { blob: await this.server.blobOf("picture", { id, kind, ...beside }),
      words: { map: `map of heights of birth ${id}, north up`, stones: `which city each stone of birth ${id} is from` }[kind] };
  }

  /** In three dimensions; what draws is loaded when it is first asked for. */
  async draw(kind, isMeant) {
    const ids = [this.id, this.beside].filter((one) => one !== null);
    const [{ Space }, ...told] = await Promise.all([import("./space.js"), ...ids.map((id) => this.server.framed("heights", { id }))]);
    if (!isMeant()) return;
    this.drawn ||= new Space(this.within);
    this.pair.hidden = true;
    this.within.hidden = false;
    this.tell("");
    this.drawn.show(told.map(({ about, content }, place) => ({
      city: {
        heights: new Float32Array(content.slice().buffer), rows: about.height, columns: about.width,
        metresPerPixel: about.metres, highest: this.highest,
      },
      called: `birth ${ids[place]}${place ? ", pinned" : ""}`,
    })), kind === "walk");
    if (this.drawn.kind !== "walk") return;
    for (const [place, id] of ids.entries()) { // blocks of pixels until then
      try {
        const bytes = await (await this.server.blobOf("solids", { id })).arrayBuffer();
        if (!isMeant()) return;
        this.drawn.stand(place, bytes);
      } catch (error) {
        if (isMeant()) this.legend.textContent = `The walls of birth ${id} stay those of pixels: ${error.message}`;
      }
    }
  }
}
