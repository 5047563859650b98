import { button, choice, element, field, number, offer, tick } from "./elements.js";
import { framesOf, mirrorPart, moveHandle, namesOf, partsOf, placeOf, removePart } from "./modeller-handles.js";
import { deepest } from "./modeller-picture.js";
import { mapsOf } from "./modeller-shapes.js";

/** Colours of maps, in order; after the last, the first again. */
const PALETTES = {
  "brick and slate": ["#b0403f", "#2f4858", "#d9a441", "#5b8e7d", "#8c5e58", "#3f74a3"],
  "marsh": ["#31493c", "#7a9e7e", "#b3cba0", "#d8c99b", "#a26769", "#582c4d"],
  "night": ["#0b132b", "#3a506b", "#5bc0be", "#f4d35e", "#ee964b", "#f95738"],
};
const MODES = [["ink", "one colour"], ["first", "by first map"], ["mixture", "by all maps, mixed"], ["measure", "by measure µ"]];

const rgbOf = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16) / 255);
const hexOf = (colour) => `#${colour.map((value) => Math.round(255 * value).toString(16).padStart(2, "0")).join("")}`;

/** The first colours of a palette. */
export const coloursOf = (palette, count) => Array.from({ length: count }, (_, k) => rgbOf(PALETTES[palette][k % PALETTES[palette].length]));

/** The fields and buttons of the modeller `of`: shape, figure, colour, metamorphosis. `words`: the line of its state. */
export class Panel {
  constructor(parent, of, words) {
    [this.of, this.words] = [of, words];
    this.buildShape(parent);
    this.buildFigure(parent);
    this.buildColour(parent);
    this.buildMorph(parent);
  }

  field(parent, text, type, act, attributes = {}) {
    const input = field(parent, text, type, attributes.value, attributes);
    input.addEventListener(type === "range" ? "input" : "change", act);
    return input;
  }

  buildShape(parent) {
    element(parent, "h3", "", "Shape");
    const first = element(parent, "div", "row");
    this.starter = choice(first, "start from", [], () => this.of.start(this.of.starts[this.starter.value]));
    offer(this.starter, this.of.starts.map(({ title }, k) => [k, title]));
    this.undoer = button(first, "undo", () => this.of.undo());
    const second = element(parent, "div", "row");
    this.part = choice(second, "map or point", [], () => this.of.select(Number(this.part.value), this.name.value));
    this.name = choice(second, "handle", [], () => this.of.select(this.of.selected.part, this.name.value));
    const third = element(parent, "div", "row");
    const typed = () => { if (this.x.value !== "" && this.y.value !== "") this.of.edit((shape) => moveHandle(shape, this.of.base, this.of.selected.part, this.of.selected.name, [Number(this.x.value), Number(this.y.value)])); };
    [this.x, this.y] = ["x", "y"].map((axis) => this.field(third, axis, "number", typed, { step: "any" }));
    const fourth = element(parent, "div", "row");
    this.adder = button(fourth, "add", () => this.of.add());
    this.remover = button(fourth, "remove", () => this.of.edit((shape) => removePart(shape, this.of.selected.part)));
    this.mirror = button(fourth, "mirror", () => this.of.edit((shape) => mirrorPart(shape, this.of.base, this.of.selected.part)));
    this.framer = button(fourth, "edit as frames", () => this.of.edit(framesOf));
    const fifth = element(parent, "div", "row");
    button(fifth, "fit", () => this.of.fit());
    button(fifth, "closer", () => this.of.stage.zoom(1 / 1.25));
    button(fifth, "farther", () => this.of.stage.zoom(1.25));
    this.hands = tick(fifth, "show frames", true);
    this.hands.addEventListener("change", () => this.of.look());
  }

  buildFigure(parent) {
    element(parent, "h3", "", "Figure");
    const row = element(parent, "div", "row");
    this.figure = choice(row, "initial figure K", [], () => this.of.setFigure());
    offer(this.figure, [["own", "the shape's own"], ["box", "box of the attractor"], ["square", "unit square"], ["segment", "segment"], ["triangle", "triangle"], ["point", "point"]]);
    this.level_ = choice(row, "figure", [], () => this.of.setLevel(this.level_.value === "" ? null : Number(this.level_.value)));
  }

  buildColour(parent) {
    element(parent, "h3", "", "Colour");
    const row = element(parent, "div", "row");
    this.mode = choice(row, "colour", [], () => this.of.look());
    offer(this.mode, MODES);
    this.palette = choice(row, "palette", [], () => this.of.setColours(coloursOf(this.palette.value, this.of.shape.colours.length)));
    offer(this.palette, Object.keys(PALETTES));
    const second = element(parent, "div", "row");
    this.colour = this.field(second, "colour of the map", "color", () => {
      this.of.setColours(this.of.shape.colours.map((one, k) => (k === this.of.mapNumber ? rgbOf(this.colour.value) : one)));
    });
    this.mix = this.field(second, "weight of further maps", "range", () => {
      this.of.shapes[this.of.edited] = { ...this.of.shape, mix: Number(this.mix.value) };
      this.of.look();
    }, { min: 0.05, max: 0.95, step: 0.05, value: 0.5 });
  }

  buildMorph(parent) {
    element(parent, "h3", "", "Metamorphosis");
    const row = element(parent, "div", "row");
    this.second = choice(row, "to", [], () => this.of.choose(this.second.value === "" ? null : this.of.starts[this.second.value].shape));
    offer(this.second, [["", "none"], ...this.of.starts.map(({ title }, k) => [k, title])]);
    this.slider = this.field(row, "t", "range", () => this.of.setTime(Number(this.slider.value)), { min: 0, max: 1, step: 0.01, value: 0 });
    this.pairs = element(parent, "p", "faint", "");
    this.keep = button(element(parent, "div", "row"), "go on with this shape", () => {
      const shape = this.of.current;
      this.second.value = "";
      this.of.start({ shape, title: "between" });
    });
  }

  /** Show the state of a shape, which has a fault or not, and is edited or lies between two. */
  inform(shape, fault, isEdited) {
    const { kind } = shape, count = mapsOf(shape).length, most = deepest(kind === "curve" ? shape.matrices.length : count);
    const what = kind === "frames" ? `${count} maps` : kind === "wire" ? `${count} arcs` : `${shape.points.length} control points`;
    const text = fault ? `${fault} The picture shows the last shape whose maps contract. Make the frame or the arc smaller, or press undo.` :
      isEdited ? `${what}` : `${what} at t = ${number(this.of.t)}. Move t to an end to edit a shape.`;
    if (this.words.textContent !== text) this.words.textContent = text;
    this.words.classList.toggle("evocity-lack", Boolean(fault));
    const levels = JSON.stringify(most);
    if (levels !== this.levels) {
      this.levels = levels;
      offer(this.level_, [["", "attractor"], ...Array.from({ length: most + 1 }, (_, n) => [n, n ? `figure ${n}` : "K"])]);
      if (this.of.level > most) this.of.level = most;
    }
    this.level_.value = this.of.level ?? "";
    if (this.of.edited >= 0) this.informParts();
    for (const one of [this.part, this.name, this.x, this.y, this.figure]) one.disabled = !isEdited;
    this.adder.disabled = this.remover.disabled = this.mirror.disabled = !isEdited || kind === "curve";
    this.framer.disabled = !isEdited || kind !== "wire";
    this.undoer.disabled = !this.of.undone.length;
    this.slider.disabled = !this.of.last;
    this.keep.hidden = isEdited;
    this.colour.disabled = this.palette.disabled = !isEdited || kind === "curve";
    this.mode.disabled = kind === "curve";
    const pairs = this.of.last && this.of.morph && !this.of.stale && !this.of.morph.curve ? this.of.morph.numbers[0].map((k, n) => `${k}→${this.of.morph.numbers[1][n]}`).join(", ") : "";
    this.pairs.textContent = pairs ? `paired maps: ${pairs}` : "";
  }

  informParts() {
    const { part, name } = this.of.selected, key = JSON.stringify([this.of.shape.kind, partsOf(this.of.shape)]);
    if (key !== this.partsKey) {
      this.partsKey = key;
      const word = this.of.shape.kind === "frames" ? "map" : "point";
      offer(this.part, Array.from({ length: partsOf(this.of.shape) }, (_, k) => [k, `${word} ${k}`]));
      offer(this.name, namesOf(this.of.shape));
    }
    [this.part.value, this.name.value] = [part, name];
    const place = placeOf(this.of.shape, this.of.base, part, name);
    [this.x, this.y].forEach((field, axis) => { if (document.activeElement !== field) field.value = Number(place[axis].toPrecision(8)); });
    this.colour.value = hexOf(this.of.shape.colours[Math.min(this.of.mapNumber, this.of.shape.colours.length - 1)]);
    this.mix.value = this.of.shape.mix;
  }
}
