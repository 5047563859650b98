import { element, tick } from "./elements.js";

/** Switches of a 3D view, by their names for the server. */
const SWITCHES = [["streets", "streets"], ["classes", "colours by class"], ["library", "objects of the library"]];

/** The switches of a 3D view, and the colours of its classes and ground. */
export class Switches {
  constructor(parent, changed) {
    this.root = element(parent, "div", "row", "", { role: "group", "aria-label": "3D view" });
    this.key = element(parent, "p", "row");
    this.boxes = new Map(SWITCHES.map(([name, text]) => [name, tick(this.root, text)]));
    for (const box of this.boxes.values()) box.addEventListener("change", changed);
    this.offerLibrary(false);
  }

  /** Show the switches, or hide them; without colours. */
  show(isShown) {
    this.root.hidden = !isShown;
    this.key.replaceChildren();
  }

  offerLibrary(isOffered) { this.boxes.get("library").parentElement.hidden = !isOffered; }

  /** The switches that are on, as the server expects them. */
  get query() { return Object.fromEntries([...this.boxes].filter(([, box]) => box.checked).map(([name]) => [name, 1])); }

  /** Show the colours of groups of a scene, [name, colour, count] each. */
  showKey(groups) {
    this.key.replaceChildren();
    for (const [name, colour, count] of groups) {
      const entry = element(this.key, "span");
      element(entry, "span", "swatch").style.background = `rgb(${colour})`;
      entry.append(`${name.replaceAll("_", " ")}: ${count}`);
    }
  }
}
