import { element } from "./elements.js";

/** Panes, one of them visible, with tabs; the arrow keys go from tab to tab. `names`: a name for each pane, or its name
 * and title; `of`: a word that makes ids unique; `onShow(name)`: a listener, if it is set. */
export class Tabs {
  constructor(list, parent, names, of) {
    this.panes = {};
    this.tabs = new Map(names.map((one) => {
      const [name, title] = Array.isArray(one) ? one : [one, one];
      const tab = element(list, "button", "", title, {
        type: "button", role: "tab", id: `tab-${of}-${name}`, "aria-controls": `pane-${of}-${name}`,
      });
      this.panes[name] = element(parent, "div", "", "", {
        role: "tabpanel", id: `pane-${of}-${name}`, "aria-labelledby": `tab-${of}-${name}`,
      });
      tab.addEventListener("click", () => this.show(name));
      return [name, tab];
    }));
    list.addEventListener("keydown", ({ key }) => {
      const by = { ArrowRight: 1, ArrowLeft: -1 }[key];
      if (!by) return;
      const offered = [...this.tabs.keys()].filter((name) => !this.tabs.get(name).hidden);
      const name = offered[(offered.indexOf(this.shown) + by + offered.length) % offered.length];
      this.show(name);
      this.tabs.get(name).focus();
    });
    this.mark([...this.tabs.keys()][0]);
  }

  /** Offer only these tabs, and mark the shown one. */
  offer(names, shown) {
    for (const [name, tab] of this.tabs) tab.hidden = !names.includes(name);
    this.mark(shown);
  }

  show(name) {
    this.mark(name);
    if (this.onShow) this.onShow(name);
  }

  mark(name) {
    this.shown = name;
    for (const [one, tab] of this.tabs) {
      tab.setAttribute("aria-selected", String(one === name));
      tab.tabIndex = one === name ? 0 : -1;
      this.panes[one].hidden = one !== name;
    }
  }
}
