/** Small pictures, loaded when they come into view, a sheet at a time. */

import { fitCanvas } from "./elements.js";

/** Pictures in a request: about a window, so that births of one generation are read together. Pictures kept. */
const AT_ONCE = 72, KEPT = 2000;

/** Paint a picture on a canvas of `wide` × `tall` px, and return its context. A missing picture becomes plain ground. */
export function paintTile(canvas, tile, wide, tall = wide) {
  const context = fitCanvas(canvas, wide, tall);
  context.fillStyle = "#efeae0";
  context.fillRect(0, 0, wide, tall);
  if (tile) context.drawImage(tile.image, tile.x, tile.y, tile.width, tile.height, 0, 0, wide, tall);
  return context;
}

export class Tiles {
  /** `load(ids, side)`: a promise of {tiles, image, across, width, height, lacking}; `onLoad()` is called after
   * each sheet. */
  constructor(load, onLoad) {
    [this.load, this.onLoad] = [load, onLoad];
    this.tiles = new Map();
    this.reasons = new Map();
    this.queue = [];
    this.isLoading = false;
  }

  /** {image, x, y, width, height} of a birth with a side, or null. */
  get(id, side) {
    const tile = this.tiles.get(`${side}:${id}`);
    if (tile) { // the latest used ones stay
      this.tiles.delete(`${side}:${id}`);
      this.tiles.set(`${side}:${id}`, tile);
    }
    return tile || null;
  }

  /** Why a birth has no picture, if it has none. */
  reason(id) { return this.reasons.get(id); }

  /** Load the pictures of these ids, which are in view. */
  request(ids, side) {
    this.queue = ids.filter((id) => !this.tiles.has(`${side}:${id}`) && !this.reasons.has(id));
    this.side = side;
    this.next();
  }

  forget() {
    this.tiles.clear();
    this.reasons.clear();
    this.queue = [];
  }

  async next() {
    if (this.isLoading || !this.queue.length) return;
    const ids = this.queue.splice(0, AT_ONCE), side = this.side;
    this.isLoading = true;
    try {
      const sheet = await this.load(ids, side);
      const image = !sheet.tiles.length || sheet.image instanceof ImageBitmap ? sheet.image : await createImageBitmap(sheet.image);
      sheet.tiles.forEach((id, place) => this.tiles.set(`${side}:${id}`, {
        image, width: sheet.width, height: sheet.height,
        x: (place % sheet.across) * sheet.width, y: Math.floor(place / sheet.across) * sheet.height,
      }));
      for (const [id, why] of sheet.lacking) this.reasons.set(id, why);
      while (this.tiles.size > KEPT) this.tiles.delete(this.tiles.keys().next().value);
    } catch (error) {
      for (const id of ids) this.reasons.set(id, `no picture: ${error.message}`);
    }
    this.isLoading = false;
    this.queue = this.queue.filter((id) => !this.tiles.has(`${this.side}:${id}`) && !this.reasons.has(id));
    this.onLoad();
    this.next();
  }
}
