import { element } from "./elements.js";

/** Panes, one of them visible, with tabs; the arrow keys go from tab to tab. `of`: a word that makes ids unique;
 * `onShow(name)`: a listener, if it is set. */
export class Tabs {
  constructor(list, parent, names, of) {
    this.panes = {};
    this.tabs = names.map((name) => {
      const tab = element(list, "button", "", name, {
        type: "button", role: "tab", id: `tab-${of}-${name}`, "aria-controls": `pane-${of}-${name}`,
      });
      this.panes[name] = element(parent, "div", "", "", {
        role: "tabpanel", id: `pane-${of}-${name}`, "aria-labelledby": `tab-${of}-${name}`,
      });
      tab.addEventListener("click", () => this.show(name));
      return tab;
    });
    list.addEventListener("keydown", ({ key }) => {
      const by = { ArrowRight: 1, ArrowLeft: -1 }[key];
      if (!by) return;
      const place = (names.indexOf(this.shown) + by + names.length) % names.length;
      this.show(names[place]);
      this.tabs[place].focus();
    });
    this.show(names[0]);
  }

  show(name) {
    this.shown = name;
    if (this.onShow) this.onShow(name);
    for (const tab of this.tabs) {
      const isShown = tab.textContent === name;
      tab.setAttribute("aria-selected", String(isShown));
      tab.tabIndex = isShown ? 0 : -1;
      this.panes[tab.textContent].hidden = !isShown;
    }
  }
}
