/** Cameras that a user moves: around a city, or on a walk through it. Several canvases may share a camera, so that
 * births side by side have the same viewpoint. */

import { placement, sinCos } from "./axonometry.js";
import { BUILT_ABOVE } from "./ramp.js";

const WHOLE = { azimuth: 25, tilt: 40, zoom: 1, centre: [0, 0] };
const TILTS = [8, 90], ZOOMS = [0.5, 40], GLIDE = 180; // ms
const EYE = 1.7, AROUND = 0.4, WALK = 4, RUN = 16; // metres, and metres a second
const clamp = (value, [low, high]) => Math.min(high, Math.max(low, value));
const within = (degrees) => ((degrees % 360) + 360) % 360;

/** Listen to a canvas: `on.drag(dx, dy, event)` in CSS px; `on.pinch(ratio, [x, y], dx, dy)` for two fingers about
 * their middle; `on.wheel(steps, [x, y])`; `on.keys(event)`, true for a known key, and `on.release(event)`, without
 * an event when the canvas loses focus. Returns a function that removes all listeners. */
function listenTo(canvas, on) {
  const held = new Map(), end = new AbortController();
  const hear = (name, act, how = {}) => canvas.addEventListener(name, act, { signal: end.signal, ...how });
  const middle = () => {
    const [a, b] = [...held.values()];
    return { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, apart: Math.hypot(a.x - b.x, a.y - b.y) || 1 };
  };
  const place = (x, y) => {
    const box = canvas.getBoundingClientRect();
    return [x - box.left, y - box.top];
  };
  canvas.tabIndex = 0;
  canvas.style.touchAction = "none";
  hear("pointerdown", (event) => {
    if (held.size < 2) held.set(event.pointerId, { x: event.clientX, y: event.clientY });
    canvas.setPointerCapture(event.pointerId);
    canvas.focus({ preventScroll: true });
  });
  hear("pointermove", (event) => {
    const was = held.get(event.pointerId);
    if (!was) return;
    const now = { x: event.clientX, y: event.clientY };
    if (held.size === 1) {
      held.set(event.pointerId, now);
      on.drag(now.x - was.x, now.y - was.y, event);
    } else {
      const before = middle();
      held.set(event.pointerId, now);
      const after = middle();
      on.pinch(after.apart / before.apart, place(after.x, after.y), after.x - before.x, after.y - before.y);
    }
  });
  for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) {
    hear(name, (event) => held.delete(event.pointerId));
  }
  hear("wheel", (event) => {
    event.preventDefault(); // the page does not scroll
    const px = event.deltaY * [1, 33, 400][event.deltaMode];
    on.wheel(clamp(-px / 100, [-3, 3]), place(event.clientX, event.clientY));
  }, { passive: false });
  hear("contextmenu", (event) => event.preventDefault()); // the other button moves the city
  hear("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || !on.keys(event)) return;
    event.preventDefault();
    event.stopPropagation();
  });
  hear("keyup", (event) => on.release(event));
  hear("blur", () => on.release());
  return () => end.abort();
}

/** A function that calls `act` at most once a frame. */
function oncePerFrame(act) {
  let waiting = 0;
  return () => {
    waiting ||= requestAnimationFrame(() => {
      waiting = 0;
      act();
    });
  };
}

const isStill = () => matchMedia("(prefers-reduced-motion: reduce)").matches;

/** A camera around a city, for `Axonometry` and `Walk`. Drag turns and tilts it; Shift, another button, or two fingers
 * move it; wheel and pinch zoom; arrows turn and tilt, with Shift they move; + and - zoom; 0 or Home shows the whole
 * city. */
export class Orbit {
  /** `draw(camera)` is called after each change of the camera, at most once a frame. */
  constructor(city, draw, camera = {}) {
    this.city = city;
    this.camera = { ...WHOLE, ...camera };
    this.drawSoon = oncePerFrame(() => draw(this.camera));
    this.gliding = 0;
  }

  /** Let the user move the camera on a canvas; returns a function that ends it. */
  attach(canvas) {
    const two = (dx, dy) => this.set(this.moved(canvas, this.camera, dx, dy));
    return listenTo(canvas, {
      drag: (dx, dy, event) => {
        if (event.shiftKey || (event.buttons & 6)) two(dx, dy);
        else this.set({ azimuth: this.camera.azimuth + dx / 2, tilt: this.camera.tilt + dy / 3 });
      },
      pinch: (ratio, at, dx, dy) => {
        two(dx, dy);
        this.set(this.zoomed(canvas, ratio, at));
      },
      wheel: (steps, at) => this.set(this.zoomed(canvas, 1.15 ** steps, at)),
      keys: (event) => this.press(canvas, event),
      release: () => {},
    });
  }

  /** Change parts of the camera at once. */
  set(change) {
    cancelAnimationFrame(this.gliding);
    this.put(change);
  }

  put(change) {
    const next = { ...this.camera, ...change }, { city } = this;
    const [wide, deep] = [city.columns, city.rows].map((count) => (count * city.metresPerPixel) / 2);
    this.camera = {
      azimuth: within(next.azimuth), tilt: clamp(next.tilt, TILTS), zoom: clamp(next.zoom, ZOOMS),
      centre: [clamp(next.centre[0], [-wide, wide]), clamp(next.centre[1], [-deep, deep])],
    };
    this.drawSoon();
  }

  /** Change parts of the camera within a moment; at once for users who prefer reduced motion. */
  glide(change) {
    cancelAnimationFrame(this.gliding);
    if (isStill()) {
      this.put(change);
      return;
    }
    const from = this.camera, to = { ...from, ...change }, began = performance.now();
    const turn = within(to.azimuth - from.azimuth + 180) - 180; // the shorter way
    const step = (now) => {
      const share = clamp((now - began) / GLIDE, [0, 1]), eased = 1 - (1 - share) ** 3;
      const mixed = (a, b) => a + eased * (b - a);
      this.put(share === 1 ? to : {
        azimuth: from.azimuth + eased * turn, tilt: mixed(from.tilt, to.tilt), zoom: mixed(from.zoom, to.zoom),
        centre: from.centre.map((one, k) => mixed(one, to.centre[k])),
      });
      if (share < 1) this.gliding = requestAnimationFrame(step);
    };
    this.gliding = requestAnimationFrame(step);
  }

  press(canvas, { key, shiftKey }) {
    const { camera } = this, step = Math.min(canvas.clientWidth, canvas.clientHeight) / 8;
    const moves = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const acts = {
      ArrowLeft: () => ({ azimuth: camera.azimuth - 15 }), ArrowRight: () => ({ azimuth: camera.azimuth + 15 }),
      ArrowUp: () => ({ tilt: camera.tilt + 8 }), ArrowDown: () => ({ tilt: camera.tilt - 8 }),
      "+": () => ({ zoom: camera.zoom * 1.3 }), "=": () => ({ zoom: camera.zoom * 1.3 }),
      "-": () => ({ zoom: camera.zoom / 1.3 }), 0: () => WHOLE, Home: () => WHOLE,
    };
    if (shiftKey && key in moves) this.glide(this.moved(canvas, camera, ...moves[key].map((one) => one * step)));
    else if (Object.hasOwn(acts, key)) this.glide(acts[key]());
    else return false;
    return true;
  }

  /** The centre after the ground moves by `dx`, `dy` px. */
  moved(canvas, camera, dx, dy) {
    const { sin, cos, steep, scale } = placement(this.city, camera, canvas.clientWidth, canvas.clientHeight);
    const right = -dx / scale, ahead = dy / (scale * steep), [east, north] = camera.centre;
    return { centre: [east + right * cos + ahead * sin, north - right * sin + ahead * cos] };
  }

  /** Zoom and centre, so that the ground at a point of the canvas stays there. */
  zoomed(canvas, ratio, [x, y]) {
    const { left, low } = placement(this.city, this.camera, canvas.clientWidth, canvas.clientHeight);
    const zoom = clamp(this.camera.zoom * ratio, ZOOMS), share = zoom / this.camera.zoom - 1;
    return { zoom, ...this.moved(canvas, { ...this.camera, zoom }, (left - x) * share, (low - y) * share) };
  }
}

/** The height at a place, [east, north] from the middle of a city, metres; 0 outside. */
export function heightAt(city, east, north) {
  const column = Math.floor(city.columns / 2 + east / city.metresPerPixel);
  const row = Math.floor(city.rows / 2 - north / city.metresPerPixel);
  if (column < 0 || row < 0 || column >= city.columns || row >= city.rows) return 0;
  return city.heights[row * city.columns + column] || 0;
}

/** The start of a walk: on open ground around the middle, with the longest free view; the middle itself without open
 * ground. */
export function start(city) {
  const { rows, columns, metresPerPixel: side } = city, reach = (Math.max(rows, columns) * side) / 2;
  const isOpen = (east, north) => heightAt(city, east, north) <= BUILT_ABOVE;
  const step = Math.max(1, Math.round(Math.min(rows, columns) / 48));
  let best = { position: [0, 0, EYE], azimuth: 0, tilt: 0 }, longest = -1;
  for (let row = Math.floor(rows / 3); row <= (2 * rows) / 3; row += step) {
    for (let column = Math.floor(columns / 3); column <= (2 * columns) / 3; column += step) {
      const east = (column + 0.5 - columns / 2) * side, north = (rows / 2 - row - 0.5) * side;
      if (!isOpen(east, north)) continue;
      for (let azimuth = 0; azimuth < 360; azimuth += 15) {
        const [sin, cos] = sinCos(azimuth);
        let far = 0;
        while (far < reach && isOpen(east + far * sin, north + far * cos)) far += side;
        if (far > longest) [best, longest] = [{ position: [east, north, EYE], azimuth, tilt: 0 }, far];
      }
    }
  }
  return best;
}

/** The camera of a walk through a city, for `Walk`: {position, azimuth, tilt}, position = [east, north, up] from the
 * middle of the city, metres; tilt in degrees downwards. W A S D or arrows walk, with Shift faster; left and right
 * arrows, Q and E turn; Page Up and Page Down rise and sink; drag looks around, two fingers walk. Walls stop it. */
export class Stroll {
  /** `draw(camera)` is called after each change of the camera, at most once a frame. */
  constructor(city, draw, camera = {}) {
    this.city = city;
    this.camera = { ...start(city), ...camera };
    this.drawSoon = oncePerFrame(() => draw(this.camera));
    this.keys = new Set();
    this.fast = false;
  }

  attach(canvas) {
    const detach = listenTo(canvas, {
      drag: (dx, dy) => this.look(-dx / 4, -dy / 4),
      pinch: (ratio, at, dx, dy) => {
        this.go(dy / 20, -dx / 20, 0);
        this.drawSoon();
      },
      wheel: (steps) => {
        this.go(2 * steps, 0, 0);
        this.drawSoon();
      },
      keys: (event) => {
        this.fast = event.shiftKey;
        const key = WAYS[event.code] ? event.code : null;
        if (!key) return false;
        this.keys.add(key);
        this.stride();
        return true;
      },
      release: (event) => {
        this.fast = Boolean(event?.shiftKey);
        if (event) this.keys.delete(event.code);
        else this.keys.clear();
      },
    });
    return () => {
      this.keys.clear();
      detach();
    };
  }

  /** Change parts of the camera at once. */
  set(change) {
    Object.assign(this.camera, change);
    this.look(0, 0);
  }

  look(aside, down) {
    this.camera.azimuth = within(this.camera.azimuth + aside);
    this.camera.tilt = clamp(this.camera.tilt + down, [-80, 80]);
    this.drawSoon();
  }

  /** Walk as long as keys are down. */
  stride() {
    if (this.walking) return;
    let last = performance.now();
    const step = (now) => {
      const spent = clamp((now - last) / 1e3, [0, 0.05]);
      last = now;
      const sum = [0, 0, 0, 0];
      for (const key of this.keys) WAYS[key].forEach((one, k) => { sum[k] += one; });
      const far = spent * (this.fast ? RUN : WALK);
      this.go(sum[0] * far, sum[1] * far, sum[2] * far);
      this.look(sum[3] * spent * 75, 0);
      this.walking = this.keys.size ? requestAnimationFrame(step) : 0;
    };
    this.walking = requestAnimationFrame(step);
  }

  /** Walk metres ahead, to the right and up, until a wall, and then along it. */
  go(ahead, right, up) {
    const { camera } = this, [sin, cos] = sinCos(camera.azimuth);
    const count = Math.max(1, Math.ceil(Math.hypot(ahead, right) / AROUND)); // so that no step crosses a wall
    for (let k = 0; k < count; k++) {
      const [east, north, eye] = camera.position;
      const [dx, dy] = [(ahead * sin + right * cos) / count, (ahead * cos - right * sin) / count];
      const way = [[dx, dy], [dx, 0], [0, dy]].find(([a, b]) => this.isFree(east + a, north + b, eye));
      if (way) camera.position = [east + way[0], north + way[1], eye];
    }
    const [east, north, eye] = camera.position;
    const floor = Math.max(...this.around(east, north)), most = 400;
    if (up) camera.position = [east, north, clamp(eye + up, [floor + EYE, Math.max(most, floor + EYE)])];
  }

  around(east, north) {
    return [-AROUND, AROUND].flatMap((a) => [-AROUND, AROUND].map((b) => heightAt(this.city, east + a, north + b)));
  }

  isFree(east, north, eye) {
    const { city } = this, side = city.metresPerPixel / 2;
    if (Math.abs(east) > city.columns * side || Math.abs(north) > city.rows * side) return false;
    return Math.max(...this.around(east, north)) + 0.2 < eye;
  }
}

/** The motion of each key: ahead, to the right, up, a turn to the right. */
const WAYS = {
  KeyW: [1, 0, 0, 0], KeyS: [-1, 0, 0, 0], KeyA: [0, -1, 0, 0], KeyD: [0, 1, 0, 0],
  ArrowUp: [1, 0, 0, 0], ArrowDown: [-1, 0, 0, 0], ArrowLeft: [0, 0, 0, -1], ArrowRight: [0, 0, 0, 1],
  KeyQ: [0, 0, 0, -1], KeyE: [0, 0, 0, 1], PageUp: [0, 0, 1, 0], PageDown: [0, 0, -1, 0],
};
