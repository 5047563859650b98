import { button, choice, element, field } from "./elements.js";
import { downloadFile, Fault, getJson, postJson } from "./server.js";
import { Starts } from "./starts.js";

/** Bytes of a file that can be opened; milliseconds between two looks at runs that begin. */
const MOST_FILE = 500_000, SOON = 1000;
const ROLES = [["parent", "parent of a run of shapes"], ["course", "course through a city"], ["motif", "motif of buildings, crossed with a city"]];

/** Files and runs of the modeller. `of`: shape(), both(), last(), view(), level(), mode(), trouble(error), show(run),
 * open(shape), openLast(shape). */
export class ModellerFiles {
  constructor(parent, cities, home, of) {
    this.of = of;
    element(parent, "h3", "", "Files");
    this.opener(parent, "open a shape", (shape) => of.open(shape));
    this.opener(parent, "open the second shape", (shape) => of.openLast(shape));
    const row = element(parent, "div", "row");
    this.savers = [["save the shape", () => this.save("modeller-json", this.fieldsOf(of.shape()), "shape.json")],
      ["save a picture", () => this.savePicture("png", "shape.png")]].map(([text, act]) => button(row, text, act));
    const film = element(parent, "div", "row");
    this.frames = this.number(film, "frames", 2, 240, 48);
    this.milliseconds = this.number(film, "milliseconds per frame", 10, 10000, 40);
    this.films = [["save as WebP", () => this.savePicture("webp", "metamorphosis.webp")],
      ["save as PNG frames", () => this.savePicture("zip", "metamorphosis.zip")]].map(([text, act]) => button(film, text, act));
    this.state = element(parent, "p", "faint", "", { role: "status" });

    element(parent, "h3", "", "Use in a run");
    const use = element(parent, "div", "row");
    const turn = () => {
      this.city.parentElement.hidden = this.role.value === "parent";
      this.width.parentElement.hidden = this.role.value !== "course";
    };
    this.role = choice(use, "as", ROLES, turn);
    this.city = choice(use, "city", cities.map((name, k) => [k, name]));
    this.width = this.number(use, "width of the course in metres", 2, 60, 14);
    turn();
    const sizes = element(parent, "div", "row");
    this.population = this.number(sizes, "individuals alive", 2, 10000, 30);
    this.generations = this.number(sizes, "generations", 1, 100000, 20);
    const go = element(parent, "div", "row");
    this.users = [button(go, "write the recipe", () => this.use(false)), button(go, "begin the run", () => this.use(true))];
    this.began = element(go, "span", "faint", "", { role: "status" });
    element(parent, "p", "faint", `Studio writes the recipe, the shape and the run into the folder ${home}.`);
    this.result = element(parent, "div");
    this.list = new Starts(element(parent, "div"), { show: (run) => of.show(run), stop: (place) => this.send("modeller-end", { map: place }) });
  }

  number(parent, text, min, max, value) { return field(parent, text, "number", value, { min, max, step: 1 }); }

  /** A shape as the server takes it. */
  fieldsOf({ kind, maps = [], points = [], arcs = [], flipped = [], matrices = [], primitive = null, colours = null, mix = 0.5 }) {
    return { kind, maps, points, arcs, flipped, matrices, primitive, colours: kind === "curve" ? null : colours, mix };
  }

  opener(parent, text, act) {
    const input = field(element(parent, "div", "row"), text, "file", "", { accept: ".json,application/json" });
    input.addEventListener("change", async () => {
      const [file] = input.files;
      input.value = "";
      if (!file) return;
      try {
        if (file.size > MOST_FILE) throw new Fault({ found: `the file has ${file.size} bytes`, expected: `at most ${MOST_FILE} bytes`, remedy: "choose a file of write_shape" });
        const { shape } = await postJson("modeller-open", { text: await file.text() });
        this.of.trouble(null);
        act(shape);
      } catch (error) {
        this.of.trouble(error);
      }
    });
  }

  inform(fault, hasLast) {
    for (const one of [...this.savers, ...this.users]) one.disabled = Boolean(fault);
    for (const one of this.films) one.disabled = Boolean(fault) || !hasLast;
  }

  async save(name, body, file) {
    this.state.textContent = `making ${file} …`;
    try {
      await downloadFile(name, body, file);
      this.of.trouble(null);
      this.state.textContent = `${file} is ready`;
    } catch (error) {
      this.of.trouble(error);
      this.state.textContent = "";
    }
  }

  savePicture(kind, file) {
    const { left, low, wide } = this.of.view(), isFilm = kind !== "png";
    const film = isFilm ? { frames: Number(this.frames.value), milliseconds: Number(this.milliseconds.value) } : {};
    const shapes = isFilm ? this.of.both() : [this.of.shape()];
    return this.save("modeller-picture", {
      ...film, kind, shape: this.fieldsOf(shapes[0]), last: shapes[1] ? this.fieldsOf(shapes[1]) : null,
      left, low, wide, level: this.of.level(), paint: this.of.mode(),
    }, file);
  }

  async use(begin) {
    const role = this.role.value, last = this.of.last();
    const answer = await this.send("modeller-use", {
      role, begin, shape: this.fieldsOf(this.of.shape()), last: role === "parent" && last ? this.fieldsOf(last) : null, city: Number(this.city.value),
      width: Number(this.width.value), level: this.of.level(), population: Number(this.population.value), generations: Number(this.generations.value),
    });
    if (!answer) return;
    this.result.replaceChildren();
    element(this.result, "p", "", begin ? "The run begins by this command:" : "The recipe is written. This command begins the run:");
    element(this.result, "code", "command", answer.command);
    element(this.result, "pre", "toml", answer.recipe, { tabindex: "0", role: "group", "aria-label": "full text of the recipe" });
    if (begin) this.list.follow(answer.started.at(-1), this.began);
  }

  async send(name, body) {
    try {
      const answer = await postJson(name, body);
      this.of.trouble(null);
      this.runs(answer.started);
      return answer;
    } catch (error) {
      this.of.trouble(error);
      return null;
    }
  }

  /** Show the runs that began here, and look again while one starts. */
  runs(started) {
    this.list.show(started);
    clearTimeout(this.timer);
    if (started.some((one) => one.at)) this.timer = setTimeout(() => this.watch(), SOON);
  }

  async watch() {
    try {
      this.runs((await getJson("modeller-runs")).started);
    } catch { /* the page shows this at the next request */ }
  }
}
