import { COLOURS, FONT, countText, element, number, shortenText, fitCanvas } from "./elements.js";

const AROUND = 8, CAPTION = 18;
/** Sides of pictures, px. */
const SMALL = 96, LARGE = 192;
let galleries = 0;

/** The gallery: pictures of births, drawn when they come into view, and a list for keyboard and screen readers. `on`:
 * choose(ids), activate(row). */
export class Gallery {
  constructor(parent, tiles, on) {
    [this.tiles, this.on] = [tiles, on];
    this.name = `evocity-gallery-${++galleries}`;
    this.root = element(parent, "div", "tiles", "", {
      role: "listbox", tabindex: "0", "aria-multiselectable": "true", "aria-label": "births",
    });
    this.spacer = element(this.root, "div", "spacer", "", { role: "presentation" });
    this.canvas = element(this.spacer, "canvas", "", "", { "aria-hidden": "true" });
    this.options = element(this.spacer, "div", "options", "", { role: "presentation" });
    this.rows = new Uint32Array(0);
    this.chosen = new Set();
    this.marked = new Set(); // births with a star
    this.size = 96;
    this.active = -1; // the place, not the row
    this.root.addEventListener("scroll", () => this.drawSoon());
    this.root.addEventListener("keydown", (event) => this.press(event));
    this.options.addEventListener("click", (event) => this.click(event));
  }

  /** Show rows in their order; `by`: the column below each picture. */
  show(births, rows, by) {
    const was = this.active >= 0 ? births.row(this.births.ids[this.rows[this.active]]) : -1;
    [this.births, this.rows, this.by] = [births, rows, by];
    this.status = births.byName.get("status");
    this.feasible = births.byName.get("feasible");
    this.active = was < 0 ? -1 : this.rows.indexOf(was);
    this.resize();
  }

  resize() {
    const { ratio } = this.births.about;
    this.wide = ratio >= 1 ? this.size : Math.max(24, this.size * ratio);
    this.tall = this.wide / ratio;
    this.width = this.root.clientWidth;
    this.height = this.root.clientHeight;
    this.across = Math.max(1, Math.floor((this.width - AROUND) / (this.wide + AROUND)));
    this.cellWide = (this.width - AROUND) / this.across;
    this.cellTall = this.tall + CAPTION + AROUND;
    this.spacer.style.height = `${Math.ceil(this.rows.length / this.across) * this.cellTall + AROUND}px`;
    this.draw();
  }

  drawSoon() {
    if (this.isWaiting) return;
    this.isWaiting = true;
    requestAnimationFrame(() => {
      this.isWaiting = false;
      this.draw();
    });
  }

  // -- drawing -------------------------------------------------------------------------------

  draw() {
    if (!this.births) return;
    const top = this.root.scrollTop;
    const context = fitCanvas(this.canvas, this.width, this.height);
    const first = Math.max(0, Math.floor((top - AROUND) / this.cellTall)) * this.across;
    const end = Math.min(this.rows.length, (Math.floor((top + this.height) / this.cellTall) + 1) * this.across);
    const side = Math.max(this.wide, this.tall) * (window.devicePixelRatio || 1) > 120 ? LARGE : SMALL;
    const ids = [];
    for (let place = first; place < end; place++) {
      const row = this.rows[place];
      ids.push(this.births.ids[row]);
      this.drawBirth(context, row, ...this.corner(place, top), side);
    }
    this.list(first, end);
    // small pictures from the log arrive at once; they stand in for the large ones
    const bare = side === LARGE && this.births.about.thumbnails ? ids.filter((id) => !this.tile(id, side) && !this.tiles.reason(id)) : [];
    if (bare.length) this.tiles.request(bare, SMALL);
    else this.tiles.request(ids, side);
  }

  /** A picture of a birth, with this side if it is loaded, or with the other. */
  tile(id, side) { return this.tiles.get(id, side) || this.tiles.get(id, side === SMALL ? LARGE : SMALL); }

  corner(place, top = 0) {
    const x = AROUND + (place % this.across) * this.cellWide + (this.cellWide - AROUND - this.wide) / 2;
    return [x, AROUND + Math.floor(place / this.across) * this.cellTall - top];
  }

  isFailed(row) { return this.status !== undefined && this.status.words[this.status.values[row]] !== "ok"; }

  breaksBound(row) { return this.feasible !== undefined && !this.isFailed(row) && this.feasible.values[row] === 0; }

  drawBirth(context, row, x, y, side) {
    const id = this.births.ids[row], { wide, tall } = this;
    const tile = this.tile(id, side);
    if (tile) {
      context.imageSmoothingEnabled = tile.width > wide;
      context.drawImage(tile.image, tile.x, tile.y, tile.width, tile.height, x, y, wide, tall);
    } else this.drawPlaceholder(context, row, x, y);
    context.font = `11px ${FONT}`;
    if (this.breaksBound(row)) {
      const text = wide < 70 ? "✕" : "✕ bounds";
      context.fillStyle = "rgb(250 248 244 / 88%)";
      context.fillRect(x, y, context.measureText(text).width + 8, 16);
      context.fillStyle = COLOURS.ink;
      context.textAlign = "left";
      context.fillText(text, x + 4, y + 12);
    }
    const isChosen = this.chosen.has(id);
    context.strokeStyle = isChosen ? COLOURS.chosen : COLOURS.line;
    context.lineWidth = isChosen ? 4 : 1;
    context.strokeRect(x, y, wide, tall);
    if (isChosen) {
      context.fillStyle = COLOURS.chosen;
      context.fillRect(x + wide - 16, y, 16, 16);
      context.fillStyle = "#fff";
      context.textAlign = "center";
      context.fillText("✓", x + wide - 8, y + 12);
    }
    context.fillStyle = COLOURS.ink;
    context.textAlign = "left";
    context.font = `600 11px ${FONT}`;
    const own = this.marked.has(id) ? `★ ${id}` : String(id), used = context.measureText(own).width + 6;
    context.fillText(own, x, y + tall + 14);
    context.font = `11px ${FONT}`;
    context.fillStyle = COLOURS.faint;
    context.textAlign = "right";
    const value = this.valueText(row);
    if (wide - used > 20) context.fillText(shortenText(context, value, wide - used), x + wide, y + tall + 14);
  }

  drawPlaceholder(context, row, x, y) {
    const { wide, tall } = this, failed = this.isFailed(row);
    const text = failed ? this.status.words[this.status.values[row]] :
      this.tiles.reason(this.births.ids[row]) ? "no picture" : "";
    context.save();
    context.beginPath();
    context.rect(x, y, wide, tall);
    context.clip();
    context.fillStyle = "#efeae0";
    context.fillRect(x, y, wide, tall);
    if (failed) {
      context.strokeStyle = "#d8cfbf";
      context.lineWidth = 2;
      context.beginPath();
      for (let k = -tall; k < wide; k += 10) {
        context.moveTo(x + k, y + tall);
        context.lineTo(x + k + tall, y);
      }
      context.stroke();
    }
    context.fillStyle = COLOURS.ink;
    context.textAlign = "center";
    context.font = `11px ${FONT}`;
    const lines = failed && text !== "failed" ? ["failed:", text] : [text];
    lines.forEach((line, k) => context.fillText(
      shortenText(context, line, wide - 6), x + wide / 2, y + tall / 2 + 4 + (k - (lines.length - 1) / 2) * 14));
    context.restore();
  }

  /** The value of a birth in the column of the order. */
  valueText(row) {
    if (!this.by || this.by.name === "id") return "";
    const value = this.by.values[row];
    return this.by.isWords ? this.by.words[value].replaceAll("_", " ") : number(value);
  }

  // -- the list --------------------------------------------------------------------------------

  /** Elements stay when pictures arrive, so that a press ends where it began. */
  list(first, end) {
    const options = this.options.children;
    while (options.length > end - first) this.options.lastChild.remove();
    for (let place = first; place < end; place++) {
      const row = this.rows[place], id = this.births.ids[row], [x, y] = this.corner(place);
      const parts = [String(id), this.valueText(row) && `${this.by.name} ${this.valueText(row)}`,
        this.isFailed(row) && `failed: ${this.status.words[this.status.values[row]]}`,
        this.breaksBound(row) && "breaks a bound", this.marked.has(id) && "picked"];
      const option = options[place - first] || element(this.options, "div", "", "", { role: "option" });
      option.className = place === this.active ? "evocity-option evocity-active" : "evocity-option";
      const attributes = {
        id: `${this.name}-${place}`, "aria-selected": String(this.chosen.has(id)),
        "aria-setsize": String(this.rows.length), "aria-posinset": String(place + 1),
        "aria-label": parts.filter(Boolean).join(", "),
      };
      for (const [key, value] of Object.entries(attributes)) option.setAttribute(key, value);
      option.dataset.place = place;
      Object.assign(option.style, {
        left: `${x}px`, top: `${y}px`, width: `${this.wide}px`, height: `${this.tall + CAPTION}px`,
      });
    }
    if (this.active >= first && this.active < end) {
      this.root.setAttribute("aria-activedescendant", `${this.name}-${this.active}`);
    } else this.root.removeAttribute("aria-activedescendant");
    this.root.setAttribute("aria-label", `${countText(this.rows.length)} births`);
  }

  click(event) {
    const option = event.target.closest("[role=option]");
    if (!option) return;
    const place = Number(option.dataset.place);
    this.root.focus({ preventScroll: true }); // a notebook would focus its cell
    const touched = event.pointerType === "touch";
    this.take(place, event.shiftKey, event.ctrlKey || event.metaKey || touched);
  }

  /** Choose the birth at a place: only this one, all from the last one (`isRange`), or with the others (`isAdded`). */
  take(place, isRange, isAdded) {
    const id = this.births.ids[this.rows[place]];
    if (isRange && this.anchor >= 0) {
      const [low, high] = [Math.min(this.anchor, place), Math.max(this.anchor, place)];
      const ids = Array.from(this.rows.slice(low, high + 1), (row) => this.births.ids[row]);
      this.on.choose([...new Set([...(isAdded ? this.chosen : []), ...ids])]);
    } else {
      this.anchor = place;
      const others = isAdded ? [...this.chosen].filter((one) => one !== id) : [];
      this.on.choose(isAdded && this.chosen.has(id) ? others : [...others, id]);
    }
    this.activate(place);
  }

  /** Make the birth at a place the active one, and bring it into view. */
  activate(place) {
    this.active = place;
    const [, y] = this.corner(place);
    if (y - AROUND < this.root.scrollTop) this.root.scrollTop = y - AROUND;
    else if (y + this.cellTall > this.root.scrollTop + this.height) this.root.scrollTop = y + this.cellTall - this.height;
    this.draw();
    this.on.activate(this.rows[place]);
  }

  press(event) {
    const { key } = event, isCommand = event.ctrlKey || event.metaKey, last = this.rows.length - 1;
    const page = this.across * Math.max(1, Math.floor(this.height / this.cellTall));
    const steps = {
      ArrowRight: 1, ArrowLeft: -1, ArrowDown: this.across, ArrowUp: -this.across,
      PageDown: page, PageUp: -page, Home: -Infinity, End: Infinity,
    };
    if (key in steps && last >= 0) {
      const place = Math.min(last, Math.max(0, this.active < 0 ? 0 : this.active + steps[key]));
      if (event.shiftKey) {
        if (!(this.anchor >= 0)) this.anchor = Math.max(0, this.active);
        this.take(place, true, false);
      } else this.activate(place);
    } else if ((key === " " || key === "Enter") && this.active >= 0) this.take(this.active, event.shiftKey, true);
    else if (key === "a" && isCommand) this.on.choose(Array.from(this.rows, (row) => this.births.ids[row]));
    else if (key === "Escape") this.on.choose([]);
    else return;
    event.preventDefault();
    event.stopPropagation(); // the notebook uses these keys too
  }
}
