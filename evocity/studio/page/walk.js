import { AMBIENT, placement, MOST, SUN, sinCos } from "./axonometry.js";
import { prismsOf, STRIDE, trianglesOf } from "./prisms.js";
import { PAPER } from "./ramp.js";

/** The walk: a city in perspective, in WebGL2, with shadows of the sun; from outside, with the camera of `Axonometry`,
 * or from inside, with the camera of `Stroll`, {position, azimuth, tilt}. */

const SHADOW = 2048; // px along a side of the shadow map
const FIELD = 28, WITHIN = 62; // vertical degrees, outside and inside a city
const SMALLER = 0.85; // than in parallel projection, because near buildings are larger
const STOREY = 3; // metres
const OVER = 1 / 4; // px by which surfaces overlap; some machines place corners to a sixteenth
const SKY = [214, 226, 236], AROUND = [226, 221, 211];

const PLACED = `#version 300 es
in vec3 place; in vec3 normal; in vec3 colour; in vec3 beyond;
uniform mat4 onto; uniform mat4 sunwards; uniform float texel; uniform float over;
out vec3 at; out vec3 facing; out vec3 paint; out vec4 shade;
void main() {
  at = place + beyond * over * dot(vec4(onto[0].w, onto[1].w, onto[2].w, onto[3].w), vec4(place, 1.0));
  facing = normal; paint = colour;
  // a little before the surface, so that it casts no shadow on itself
  shade = sunwards * vec4(at + normal * texel * 1.5, 1.0);
  gl_Position = onto * vec4(at, 1.0);
}`;
const PAINTED = `#version 300 es
precision highp float; precision highp sampler2DShadow;
in vec3 at; in vec3 facing; in vec3 paint; in vec4 shade;
uniform sampler2DShadow seen; uniform vec3 eye; uniform vec3 sun; uniform float day; uniform float direct;
uniform float steep; uniform float step;
out vec4 found;
float lit() {
  vec3 where = shade.xyz * 0.5 + 0.5;
  if (any(lessThan(where, vec3(0.0))) || any(greaterThan(where, vec3(1.0)))) return 1.0;
  float sum = 0.0;
  for (int x = 0; x <= 1; x++) for (int y = 0; y <= 1; y++)
    sum += texture(seen, vec3(where.xy + (vec2(x, y) - 0.5) * step, where.z));
  return sum / 4.0;
}
void main() {
  vec3 normal = normalize(facing);
  float shaded = ${AMBIENT.toFixed(2)} * (0.88 + 0.12 * max(0.0, dot(normal, normalize(eye - at))));
  float roof = ${AMBIENT.toFixed(2)} * (0.88 + 0.12 * steep);
  float slant = max(0.0, dot(normal, sun)) / max(sun.z, 0.05);
  float light = shaded * day;
  if (direct > 0.0 && slant > 0.0) light += (1.0 - roof) * slant * direct * lit();
  light = min(light, ${MOST.toFixed(2)});
  if (abs(normal.z) < 0.5) { // storeys, up to a distance at which they are distinct
    float storey = at.z / ${STOREY.toFixed(1)}, wide = fwidth(storey);
    float line = 1.0 - smoothstep(0.5, 1.5, abs(fract(storey + 0.5) - 0.5) / max(wide, 0.02));
    light *= 1.0 - 0.10 * line * (1.0 - smoothstep(0.1, 0.35, wide));
  }
  found = vec4(paint * light, 1.0);
}`;
const CAST = `#version 300 es
in vec3 place; in vec3 beyond; uniform mat4 onto; uniform float over;
void main() { gl_Position = onto * vec4(place + beyond * over, 1.0); }`;
const NOTHING = `#version 300 es
precision mediump float;
void main() {}`;

let known = null;

/** {works, isSlow}: whether this browser draws in WebGL2, and whether without a graphics card. */
function probe() {
  if (known) return known;
  const gl = document.createElement("canvas").getContext("webgl2");
  if (!gl) return (known = { works: false, isSlow: false });
  let name = gl.getParameter(gl.RENDERER);
  if (name === "WebKit WebGL") { // only this browser hides the name
    const info = gl.getExtension("WEBGL_debug_renderer_info");
    if (info) name = gl.getParameter(info.UNMASKED_RENDERER_WEBGL);
  }
  gl.getExtension("WEBGL_lose_context")?.loseContext(); // a browser has few contexts
  return (known = { works: true, isSlow: /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name) });
}

/** Whether this browser draws in WebGL2; otherwise use an `Axonometry`. */
export const supported = () => probe().works;

export class Walk {
  /** `solids` replace the height map, if given: the bytes of a scene's triangles (`evocity.scene.Scene.triangles`),
   * with straight walls. */
  constructor(canvas, city, solids = null) {
    this.canvas = canvas;
    // smooth edges take most of the time without a graphics card
    this.gl = canvas.getContext("webgl2", { alpha: false, antialias: !probe().isSlow });
    if (!this.gl) throw new Error("This browser has no WebGL2. Call supported() before you make a Walk; if supported() returns false, draw an Axonometry.");
    this.end = new AbortController();
    const { signal } = this.end;
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault(), { signal });
    canvas.addEventListener("webglcontextrestored", () => {
      this.prepare();
      this.show(this.city, this.solids);
      if (this.last) this.draw(...this.last);
    }, { signal });
    this.prepare();
    this.show(city, solids);
  }

  /** Prepare the parts that all cities share. */
  prepare() {
    const { gl } = this;
    this.painted = program(gl, PLACED, PAINTED);
    this.cast = program(gl, CAST, NOTHING);
    this.shadowMap = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.shadowMap);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.DEPTH_COMPONENT24, SHADOW, SHADOW);
    for (const [name, value] of [
      [gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_MAG_FILTER, gl.LINEAR],
      [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE],
      [gl.TEXTURE_COMPARE_MODE, gl.COMPARE_REF_TO_TEXTURE], [gl.TEXTURE_COMPARE_FUNC, gl.LEQUAL],
    ]) gl.texParameteri(gl.TEXTURE_2D, name, value);
    this.frame = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, this.shadowMap, 0);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    this.meshes = [];
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.CULL_FACE);
  }

  /** Show another city from the next `draw` on. */
  show(city, solids = null) {
    for (const mesh of this.meshes) mesh.forget();
    [this.city, this.solids, this.sunKey] = [city, solids, null];
    const made = solids ? trianglesOf(city, solids) : prismsOf(city);
    const wide = (city.columns * city.metresPerPixel) / 2, deep = (city.rows * city.metresPerPixel) / 2;
    const { places, count } = made.surfaces;
    this.highest = 1;
    for (let k = 0; k < count; k++) this.highest = Math.max(this.highest, places[(k * STRIDE) / 4 + 2]);
    this.box = [wide, deep, this.highest];
    this.reach = Math.hypot(wide, deep, this.highest);
    const far = 6 * this.reach, around = prismsOf({
      heights: new Float32Array(1), rows: 1, columns: 1, metresPerPixel: 2 * far, colours: Uint8Array.from(AROUND),
    });
    this.meshes = [made, around].map((one) => meshOf(this.gl, one));
    this.triangles = made.indices.length / 3;
  }

  /** Draw the city for a camera, in the light of the sun at {azimuth, height}, see `sunAt`. */
  draw(camera, sun = SUN) {
    const { canvas, gl, painted } = this, ratio = window.devicePixelRatio || 1;
    this.last = [camera, sun];
    if (gl.isContextLost() || !canvas.clientWidth || !canvas.clientHeight) return; // or the canvas is hidden
    const wide = Math.max(1, Math.round(canvas.clientWidth * ratio));
    const tall = Math.max(1, Math.round(canvas.clientHeight * ratio));
    if (canvas.width !== wide || canvas.height !== tall) [canvas.width, canvas.height] = [wide, tall];
    this.castBy(sun);
    const isWithin = camera.position !== undefined;
    const view = isWithin ? this.viewWithin(camera, wide, tall) : this.viewAbout(camera, wide, tall);
    const day = 0.4 + 0.6 * smooth(-8, 6, sun.height);
    gl.viewport(0, 0, wide, tall);
    gl.clearColor(...(isWithin ? SKY.map((one) => (one / 255) * (1.6 * day - 0.6)) : PAPER.map((one) => one / 255)), 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.useProgram(painted.program);
    gl.uniformMatrix4fv(painted.at("onto"), false, view.onto);
    gl.uniformMatrix4fv(painted.at("sunwards"), false, this.sunwards);
    gl.uniform1f(painted.at("texel"), this.texel);
    gl.uniform1f(painted.at("over"), (OVER * 2 * view.half) / tall);
    gl.uniform1f(painted.at("step"), 1 / SHADOW);
    gl.uniform3fv(painted.at("eye"), view.eye);
    gl.uniform3fv(painted.at("sun"), this.towardsSun);
    gl.uniform1f(painted.at("day"), day);
    gl.uniform1f(painted.at("direct"), smooth(0, 3, sun.height));
    gl.uniform1f(painted.at("steep"), view.steep);
    gl.bindTexture(gl.TEXTURE_2D, this.shadowMap);
    if (isWithin) { // the surroundings are behind everything
      gl.depthMask(false);
      this.meshes[1].draw(0);
      gl.depthMask(true);
    }
    this.meshes[0].draw(0);
  }

  /** Draw the shadow map, once for each position of the sun. */
  castBy(sun) {
    const key = `${sun.azimuth} ${sun.height}`;
    if (this.sunKey === key) return;
    this.sunKey = key;
    const { gl, cast, box: [wide, deep, high] } = this;
    const [right, up, towards] = directions(sun.azimuth + 180, Math.min(90, Math.max(0.5, sun.height)));
    this.towardsSun = towards;
    const corners = [-wide, wide].flatMap((x) => [-deep, deep].flatMap((y) => [0, high].map((z) => [x, y, z])));
    const ends = [right, up, towards].map((way) => corners.map((one) => dot(one, way)));
    const spans = ends.map((all) => [Math.min(...all) - 1, Math.max(...all) + 1]);
    // as matrix: each row takes its span to -1…1, nearer ones lower
    const rows = [right, up, towards].map((way, k) => {
      const [low, top] = spans[k], scale = (k === 2 ? -2 : 2) / (top - low);
      return [...way.map((one) => one * scale), -scale * ((low + top) / 2)];
    });
    this.sunwards = columnsOf([...rows, [0, 0, 0, 1]]);
    this.texel = Math.max(spans[0][1] - spans[0][0], spans[1][1] - spans[1][0]) / SHADOW;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.viewport(0, 0, SHADOW, SHADOW);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    if (sun.height > 0) {
      gl.useProgram(cast.program);
      gl.uniformMatrix4fv(cast.at("onto"), false, this.sunwards);
      gl.uniform1f(cast.at("over"), OVER * this.texel);
      gl.enable(gl.POLYGON_OFFSET_FILL);
      gl.polygonOffset(2, 4);
      this.meshes[0].draw(1);
      gl.disable(gl.POLYGON_OFFSET_FILL);
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  viewAbout(camera, wide, tall) {
    const { scale, low } = placement(this.city, camera, wide, tall), ways = directions(camera.azimuth, camera.tilt);
    const half = Math.tan((FIELD * Math.PI) / 360), far = tall / (2 * scale * SMALLER * half);
    const eye = [...camera.centre, 0].map((one, k) => one + far * ways[2][k]);
    const near = Math.max(far / 50, far - this.reach - Math.hypot(...camera.centre));
    return projection(eye, ways, half, wide / tall, [near, far + 2 * this.reach], 1 - (2 * low) / tall);
  }

  viewWithin(camera, wide, tall) {
    const half = Math.tan((WITHIN * Math.PI) / 360), ways = directions(camera.azimuth, camera.tilt);
    return projection(camera.position, ways, half, wide / tall, [0.15, 14 * this.reach], 0);
  }

  /** Free all memory. The canvas draws nothing in WebGL afterwards. */
  dispose() {
    this.end.abort();
    for (const mesh of this.meshes) mesh.forget();
    this.meshes = [];
    this.gl.getExtension("WEBGL_lose_context")?.loseContext();
  }
}

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const columnsOf = (rows) => new Float32Array(rows[0].flatMap((_, k) => rows.map((row) => row[k])));

function smooth(low, high, value) {
  const share = Math.min(1, Math.max(0, (value - low) / (high - low)));
  return share * share * (3 - 2 * share);
}

/** The directions to the right, up, and towards a viewer who looks along an azimuth and down by a tilt. */
function directions(azimuth, tilt) {
  const [sin, cos] = sinCos(azimuth), [steep, flat] = sinCos(tilt);
  return [[cos, -sin, 0], [steep * sin, steep * cos, flat], [-flat * sin, -flat * cos, steep]];
}

/** The projection from metres to the picture; `half`: the tangent of half the field of view; `shift` moves the picture
 * up, in halves of its height. */
function projection(eye, [right, up, towards], half, ratio, [near, far], shift) {
  const row = (way) => [...way, -dot(way, eye)];
  const [x, y, z] = [row(right), row(up), row(towards)]; // z is below 0 ahead
  const scaled = (one, by) => one.map((value) => value * by);
  const high = scaled(y, 1 / half).map((value, k) => value - shift * z[k]);
  const deep = scaled(z, -(far + near) / (far - near));
  deep[3] -= (2 * far * near) / (far - near);
  return { onto: columnsOf([scaled(x, 1 / (half * ratio)), high, deep, scaled(z, -1)]), eye, half, steep: Math.max(0, towards[2]) };
}

function program(gl, vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
  }
  ["place", "normal", "colour", "beyond"].forEach((name, k) => gl.bindAttribLocation(made, k, name));
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS) && !gl.isContextLost()) {
    const logs = gl.getAttachedShaders(made).map((one) => gl.getShaderInfoLog(one));
    throw new Error(`This browser cannot draw the walk through the city: ${[...logs, gl.getProgramInfoLog(made)].join(" ")}`);
  }
  const places = {};
  return { program: made, at: (name) => (places[name] ??= gl.getUniformLocation(made, name)) };
}

/** The buffers of surfaces: `draw(0)` draws them with normals and colours, `draw(1)` only their places. */
function meshOf(gl, { surfaces, indices }) {
  const [bytes, order] = [gl.createBuffer(), gl.createBuffer()];
  const arrays = [0, 1].map((bare) => {
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, bytes);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, STRIDE, 0);
    gl.enableVertexAttribArray(3);
    gl.vertexAttribPointer(3, 3, gl.BYTE, true, STRIDE, 20);
    if (!bare) {
      gl.enableVertexAttribArray(1);
      gl.vertexAttribPointer(1, 3, gl.BYTE, true, STRIDE, 12);
      gl.enableVertexAttribArray(2);
      gl.vertexAttribPointer(2, 3, gl.UNSIGNED_BYTE, true, STRIDE, 16);
    }
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, order);
    return array;
  });
  gl.bufferData(gl.ARRAY_BUFFER, surfaces.used, gl.STATIC_DRAW);
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, indices, gl.STATIC_DRAW);
  gl.bindVertexArray(null);
  return {
    draw(which) {
      gl.bindVertexArray(arrays[which]);
      gl.drawElements(gl.TRIANGLES, indices.length, gl.UNSIGNED_INT, 0);
      gl.bindVertexArray(null);
    },
    forget() {
      for (const array of arrays) gl.deleteVertexArray(array);
      for (const buffer of [bytes, order]) gl.deleteBuffer(buffer);
    },
  };
}
