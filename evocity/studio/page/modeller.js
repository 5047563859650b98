import { element } from "./elements.js";
import { addPart, moveHandle, namesOf, partsOf, removePart } from "./modeller-handles.js";
import { ModellerFiles } from "./modeller-files.js";
import { coloursOf, Panel } from "./modeller-panel.js";
import { drawPieces, Picture } from "./modeller-picture.js";
import { boxOf, contractionOf, faultOf, mapsBetween, mapsOf } from "./modeller-shapes.js";
import { SIDE, Stage } from "./modeller-stage.js";
import { getJson, postJson } from "./server.js";

/** Small figures: their number, side in px, and pieces at most; milliseconds between two drawings. */
const SMALL = 4, SMALL_SIDE = 140, SMALL_PIECES = 2000, BETWEEN = 120;
const MOST_MAPS = 64, MOST_UNDO = 100, REST = 150;

/** The modeller. `on`: trouble(error, of), show(run). The slider of the metamorphosis says which shape is edited:
 * the first at its left end, the last at its right end. */
export class Modeller {
  constructor(root, on) {
    [this.root, this.on] = [root, on];
    this.isShown = false;
    this.undone = [];
    this.level = null;
    this.t = 0;
  }

  async show(isShown) {
    this.isShown = isShown;
    this.root.hidden = !isShown;
    if (!isShown || this.isBuilt) return;
    this.isBuilt = true;
    try {
      const { starts, cities, home, started } = await getJson("modeller");
      this.starts = starts;
      this.build(cities, home);
      this.files.runs(started);
      this.start(starts[0]);
    } catch (error) {
      this.isBuilt = false;
      this.on.trouble(error, "modeller");
    }
  }

  // -- the page --------------------------------------------------------------------------------

  build(cities, home) {
    element(this.root, "h2", "", "Modeller");
    element(this.root, "p", "faint", "Each map takes the dashed figure to one frame. All products of the maps make the shape. Drag the frames, or the points of a wire form.");
    const columns = element(this.root, "div", "modeller"), left = element(columns, "div"), right = element(columns, "div", "modeller-panel");
    this.stage = new Stage(left, {
      shape: () => this.current, base: () => this.base, selected: () => this.selected,
      move: (part, name, place) => this.move(part, name, place), select: (part, name) => this.select(part, name),
      remove: () => this.edit((shape) => removePart(shape, this.selected.part)), drag: (isDragging) => this.drag(isDragging), look: () => this.look(),
    });
    this.picture = new Picture(this.stage.context, SIDE);
    this.words = element(left, "p", "modeller-words", "", { role: "status" });
    const row = element(left, "div", "modeller-small", "", { role: "group", "aria-label": "first figures" });
    this.small = Array.from({ length: SMALL }, (_, level) => this.smallFigure(row, level));
    this.panel = new Panel(right, this, this.words);
    this.files = new ModellerFiles(right, cities, home, {
      shape: () => this.current, both: () => this.shapes, last: () => this.last, view: () => this.stage.view, level: () => this.level,
      mode: () => this.panel.mode.value, trouble: (error) => this.on.trouble(error, "modeller"), show: (run) => this.on.show(run),
      open: (shape) => this.start({ shape, title: "opened" }), openLast: (shape) => this.choose(shape),
    });
  }

  smallFigure(parent, level) {
    const root = element(parent, "button", "", "", { type: "button", title: `show figure ${level}` });
    const canvas = element(root, "canvas", "", "", { width: SMALL_SIDE, height: SMALL_SIDE });
    element(root, "span", "", level ? `𝒯${["", "", "²", "³"][level]}K` : "K");
    root.addEventListener("click", () => this.setLevel(level));
    return canvas.getContext("2d");
  }

  // -- the shapes ------------------------------------------------------------------------------

  /** Which of the two shapes is edited; −1 between them. */
  get edited() { return this.t === 0 ? 0 : this.t === 1 ? 1 : -1; }
  get shape() { return this.shapes[Math.max(0, this.edited)]; }
  get base() { return this.bases[Math.max(0, this.edited)]; }
  get last() { return this.shapes[1]; }
  /** The map to which a colour belongs: a frame, or the arc that begins at a point. */
  get mapNumber() { return this.shape.kind === "wire" ? Math.max(0, this.shape.arcs.findIndex(([start]) => start === this.selected.part)) : this.selected.part; }

  /** The visible shape: one of the two, or one between them. */
  get current() {
    if (this.edited >= 0 || !this.morph) return this.shape;
    const [first, last] = this.shapes, t = this.t, nearer = t < 0.5 ? first : last;
    const mean = (one, other) => one.map((value, k) => (1 - t) * value + t * other[k]);
    if (this.morph.curve) {
      return { ...first, points: first.points.map((point, k) => mean(point, last.points[k])), ends: first.ends.map((end, k) => mean(end, last.ends[k])),
        matrices: first.matrices.map((matrix, k) => matrix.map((line, n) => mean(line, last.matrices[k][n]))) };
    }
    const [before, after] = this.morph.numbers, colour = (shape, k) => shape.colours[Math.min(k, shape.colours.length - 1)];
    return { kind: "frames", maps: mapsBetween(this.morph, t), points: [], arcs: [], flipped: [], primitive: nearer.primitive, mix: nearer.mix,
      colours: before.map((k, n) => mean(colour(first, k), colour(last, after[n]))) };
  }

  start({ shape }) {
    this.keepUndo();
    this.shapes = [this.coloured(shape), null];
    this.bases = [this.baseOf(this.shapes[0]), null];
    this.own = [shape.primitive ?? null, null];
    this.panel.second.value = "";
    this.setTime(0);
    this.panel.figure.value = "own";
    this.selected = { part: 0, name: namesOf(shape)[0] };
    this.fit();
  }

  coloured(shape) {
    const count = shape.kind === "curve" ? shape.matrices.length : mapsOf(shape).length;
    return { mix: 0.5, ...shape, colours: shape.colours || coloursOf(this.panel.palette.value, count) };
  }

  /** The rectangle whose images are the frames: the unit square, or the box of a shape that is much larger. */
  baseOf(shape) {
    if (shape.kind !== "frames" || faultOf(shape)) return { low: [0, 0], high: [1, 1] };
    const [left, low, right, high] = boxOf(shape.maps), isUnit = left > -0.6 && low > -0.6 && right < 1.6 && high < 1.6;
    return isUnit ? { low: [0, 0], high: [1, 1] } : { low: [left, low], high: [right, high] };
  }

  fit() {
    const shape = this.current, points = shape.kind === "frames" ? [this.base.low, this.base.high] : shape.points;
    const xs = points.map(([x]) => x), ys = points.map(([, y]) => y);
    const boxes = [[Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)]];
    if (shape.kind !== "curve" && !faultOf(shape)) boxes.push(boxOf(mapsOf(shape)));
    this.stage.fit([0, 1, 2, 3].map((k) => Math[k < 2 ? "min" : "max"](...boxes.map((box) => box[k]))));
  }

  keepUndo() {
    if (!this.shapes) return;
    this.undone.push(JSON.stringify([this.shapes, this.bases, this.own]));
    if (this.undone.length > MOST_UNDO) this.undone.shift();
  }

  undo() {
    if (!this.undone.length) return;
    [this.shapes, this.bases, this.own] = JSON.parse(this.undone.pop());
    if (!this.last) this.setTime(0);
    this.stale = true;
    this.select(Math.min(this.selected.part, partsOf(this.shape) - 1), this.selected.name);
  }

  /** Replace the edited shape by `change(shape)`, which is null for no change. */
  edit(change) {
    if (this.edited < 0) return;
    const shape = change(this.shape);
    if (!shape || shape === this.shape) return;
    if (!this.isDragging) this.keepUndo();
    const count = mapsOf(shape).length, { colours } = shape;
    if (shape.kind !== "curve" && colours.length !== count) {
      const removed = count < colours.length ? colours.filter((_, k) => k !== this.mapNumber) : [...colours, ...coloursOf(this.panel.palette.value, count).slice(colours.length)];
      shape.colours = removed.slice(0, count);
    }
    this.shapes[this.edited] = shape;
    this.stale = true;
    if (this.selected.part >= partsOf(shape) || !namesOf(shape).includes(this.selected.name)) this.select(Math.min(this.selected.part, partsOf(shape) - 1), this.selected.name);
    else this.look();
  }

  add() {
    if (this.edited < 0) return;
    if (mapsOf(this.shape).length >= MOST_MAPS) {
      this.on.trouble(new Error(`The shape already has ${MOST_MAPS} maps. A shape on this page has at most ${MOST_MAPS} maps. Remove a map, then add another.`), "modeller");
      return;
    }
    this.edit((shape) => addPart(shape, this.base, this.selected.part));
    this.select(partsOf(this.shape) - 1, namesOf(this.shape)[0]);
  }

  move(part, name, place) { this.edit((shape) => moveHandle(shape, this.base, part, name, place)); }

  drag(isDragging) {
    if (isDragging && !this.isDragging) this.keepUndo();
    this.isDragging = isDragging;
    this.look();
  }

  select(part, name) {
    this.selected = { part, name: namesOf(this.shape).includes(name) ? name : namesOf(this.shape)[0] };
    this.look();
  }

  setColours(colours) {
    if (this.edited < 0) return;
    this.shapes[this.edited] = { ...this.shape, colours };
    if (this.panel.mode.value === "ink") this.panel.mode.value = "first";
    this.look();
  }

  setFigure() {
    if (this.edited < 0) return;
    const figures = {
      own: this.own[this.edited], box: null, square: { points: [[0, 0], [1, 0], [1, 1], [0, 1]], lines: [], faces: [[0, 1, 2], [0, 2, 3]] },
      segment: { points: [[0, 0], [1, 0]], lines: [[0, 1]], faces: [] }, point: { points: [[0, 0]], lines: [], faces: [] },
      triangle: { points: [[0, 0], [1, 0], [0.5, Math.sqrt(3) / 2]], lines: [], faces: [[0, 1, 2]] },
    };
    this.edit((shape) => ({ ...shape, primitive: figures[this.panel.figure.value] }));
  }

  setLevel(level) {
    this.level = level;
    this.look();
  }

  // -- metamorphosis ---------------------------------------------------------------------------

  choose(shape) {
    this.keepUndo();
    this.shapes[1] = shape && this.coloured(shape);
    this.bases[1] = shape && this.baseOf(this.last);
    this.own[1] = shape && (shape.primitive ?? null);
    this.stale = true;
    this.setTime(0);
  }

  async setTime(t) {
    this.t = this.last ? t : 0;
    this.panel.slider.value = this.t;
    if (this.last && this.stale && this.edited < 0) {
      try {
        const [first, last] = this.shapes.map((shape) => this.files.fieldsOf(shape));
        this.morph = await postJson("modeller-morph", { first, last });
        this.stale = false;
        this.on.trouble(null, "modeller");
      } catch (error) {
        this.t = this.panel.slider.value = 0;
        this.on.trouble(error, "modeller");
      }
    }
    if (this.selected) this.select(Math.min(this.selected.part, partsOf(this.shape) - 1), this.selected.name);
  }

  // -- drawing ---------------------------------------------------------------------------------

  look() {
    this.isDirty = true;
    this.moved = performance.now();
    if (this.shapes && this.stage) this.wait();
  }

  paint() {
    this.isWaiting = false;
    if (!this.isShown) return;
    if (this.isDirty) {
      this.isDirty = false;
      const shape = this.current, fault = faultOf(shape), isEdited = this.edited >= 0;
      Object.assign(this.stage, { isShown: this.panel.hands.checked && isEdited, faulty: fault && shape.kind !== "curve" ? contractionOf(mapsOf(shape)).word[0] : null });
      const key = JSON.stringify([shape, this.stage.view, this.level, this.panel.mode.value, this.isDragging]);
      if (!fault && key !== this.drawn) {
        this.drawn = key;
        this.picture.draw(shape, this.stage.map, this.level, this.paintOf(shape), this.isDragging);
        this.frames = (this.frames || 0) + 1;
      }
      this.stage.drawHands();
      this.panel.inform(shape, fault, isEdited);
      this.files.inform(fault, Boolean(this.last));
      if (!fault) this.drawSmall(shape);
    } else this.picture.go();
    if (this.isDirty || this.picture.isDone) return;
    clearTimeout(this.rest); // a hand that rests sees the whole attractor
    this.rest = setTimeout(() => this.wait(), this.isDragging && performance.now() - this.moved < REST ? REST : 0);
  }

  /** Paint in the next picture of the screen. */
  wait() {
    if (this.isWaiting) return;
    this.isWaiting = true;
    requestAnimationFrame(() => this.paint());
  }

  paintOf(shape) { return { mode: this.panel.mode.value, colours: shape.colours, mix: shape.mix }; }

  /** Draw the first figures; in a drag only from time to time. */
  drawSmall(shape) {
    clearTimeout(this.timer);
    if (this.isDragging && performance.now() - (this.smallSince || 0) < BETWEEN) {
      this.timer = setTimeout(() => this.drawSmall(shape), BETWEEN);
      return;
    }
    this.smallSince = performance.now();
    const view = this.stage.map.map((value) => value * SMALL_SIDE / SIDE), maps = mapsOf(shape);
    this.small.forEach((context, level) => {
      context.canvas.parentElement.hidden = shape.kind === "curve" || maps.length ** level > SMALL_PIECES;
      if (!context.canvas.parentElement.hidden) drawPieces(context, SMALL_SIDE, view, shape, maps, level, this.paintOf(shape));
      context.canvas.parentElement.setAttribute("aria-pressed", String(this.level === level));
    });
  }
}
