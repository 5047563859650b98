/** Small pictures, asked for as they come into view, a sheet at a time. */

/** So many pictures a request, a window full: births of one generation are read together. So many are kept. */
const AT_ONCE = 72, KEPT = 2000;

export class Tiles {
  /** `ask(ids, side)`: a promise of {tiles, image, across, width, height, lacking}; `arrived` is
   * called when there are more. */
  constructor(ask, arrived) {
    [this.ask, this.arrived] = [ask, arrived];
    this.found = new Map();
    this.lacks = new Map();
    this.wanted = [];
    this.asking = false;
  }

  /** {image, x, y, width, height} of a birth, of any side until that one is there; or null. */
  get(id, side) {
    const tile = this.found.get(`${side}:${id}`);
    if (tile) { // the last that are seen are kept
      this.found.delete(`${side}:${id}`);
      this.found.set(`${side}:${id}`, tile);
    }
    return tile || null;
  }

  /** Why a birth has no picture; nothing while it may have one. */
  reason(id) { return this.lacks.get(id); }

  /** These ids are in view, and no others. */
  want(ids, side) {
    this.wanted = ids.filter((id) => !this.found.has(`${side}:${id}`) && !this.lacks.has(id));
    this.side = side;
    this.next();
  }

  forget() {
    this.found.clear();
    this.lacks.clear();
    this.wanted = [];
  }

  async next() {
    if (this.asking || !this.wanted.length) return;
    const ids = this.wanted.splice(0, AT_ONCE), side = this.side;
    this.asking = true;
    try {
      const sheet = await this.ask(ids, side);
      const image = sheet.tiles.length ? await createImageBitmap(sheet.image) : null;
      sheet.tiles.forEach((id, place) => this.found.set(`${side}:${id}`, {
        image, width: sheet.width, height: sheet.height,
        x: (place % sheet.across) * sheet.width, y: Math.floor(place / sheet.across) * sheet.height,
      }));
      for (const [id, why] of sheet.lacking) this.lacks.set(id, why);
      while (this.found.size > KEPT) this.found.delete(this.found.keys().next().value);
    } catch (error) {
      for (const id of ids) this.lacks.set(id, `no picture: ${error.message}`);
    }
    this.asking = false;
    this.wanted = this.wanted.filter((id) => !this.found.has(`${this.side}:${id}`) && !this.lacks.has(id));
    this.arrived();
    this.next();
  }
}
