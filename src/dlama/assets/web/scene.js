// A GLB of ours (a mesh of textured parts with _ORIGIN and _CONFIDENCE, soft ones last) in; its picture on a canvas, turned by the pointer, out.
const VERTEX = `#version 300 es
in vec3 position; in vec2 uv; in float origin; in float confidence;
uniform mat4 clip; out vec2 at; flat out int code; out float sure;
void main() { gl_Position = clip * vec4(position, 1.0); at = uv; code = int(origin + 0.5); sure = confidence; gl_PointSize = 2.0; }`;
const FRAGMENT = `#version 300 es
precision highp float;
in vec2 at; flat in int code; in float sure; out vec4 color;
uniform sampler2D picture; uniform int mode; uniform vec3 palette[8];
void main() {
  vec4 texel = texture(picture, at);
  vec3 seen = texel.rgb;
  float light = 0.35 + 0.65 * dot(seen, vec3(0.299, 0.587, 0.114));
  if (mode == 1) seen = palette[clamp(code, 0, 7)] * light;
  if (mode == 2) seen = mix(vec3(0.83, 0.22, 0.10), mix(vec3(0.98, 0.85, 0.35), vec3(0.16, 0.55, 0.80), clamp(2.0 * sure - 1.0, 0.0, 1.0)), clamp(2.0 * sure, 0.0, 1.0)) * light;
  color = vec4(seen, texel.a);
}`;

export async function readGlb(blob) {
  const data = await blob.arrayBuffer(), head = new DataView(data);
  if (head.getUint32(0, true) !== 0x46546c67) throw new Error("no GLB");
  const length = head.getUint32(12, true);
  const json = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 20, length)));
  const start = 20 + length + 8, primitives = json.meshes?.[0]?.primitives;
  if (!primitives) return null;
  const taken = (number) => {
    const accessor = json.accessors[number], view = json.bufferViews[accessor.bufferView];
    return { accessor, offset: start + (view.byteOffset ?? 0) + (accessor.byteOffset ?? 0), length: view.byteLength, stride: view.byteStride ?? 0 };
  };
  const textures = await Promise.all((json.textures ?? []).map(({ source }) => {
    const image = json.images[source], view = json.bufferViews[image.bufferView];
    return createImageBitmap(new Blob([new Uint8Array(data, start + (view.byteOffset ?? 0), view.byteLength)], { type: image.mimeType }), { premultiplyAlpha: "none" });
  }));
  const parts = primitives.map((primitive) => {
    const material = json.materials?.[primitive.material], texture = textures[material?.pbrMetallicRoughness.baseColorTexture?.index];
    const attributes = {};
    for (const [name, key] of [["POSITION", "position"], ["TEXCOORD_0", "uv"], ["_ORIGIN", "origin"], ["_CONFIDENCE", "confidence"]]) {
      if (primitive.attributes[name] !== undefined) attributes[key] = taken(primitive.attributes[name]);
    }
    const indices = primitive.indices === undefined ? null : taken(primitive.indices);
    return { attributes, indices, texture, soft: material?.alphaMode === "BLEND", count: (indices ?? attributes.position).accessor.count };
  });
  return { data, parts, middle: json.nodes[0].translation ?? [0, 0, 0] };
}

const SIZES = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4 };
export const sub = (a, b) => a.map((v, i) => v - b[i]);
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const unit = (a) => { const n = Math.hypot(...a) || 1; return a.map((v) => v / n); };
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const along = (a, b, s) => a.map((v, i) => v + s * b[i]);

// The vector v turned about a unit axis.
export function spin(v, axis, angle) {
  const c = Math.cos(angle), s = Math.sin(angle), k = cross(axis, v), d = dot(axis, v) * (1 - c);
  return v.map((_, i) => v[i] * c + k[i] * s + axis[i] * d);
}

function times(a, b) {
  const out = new Float32Array(16);
  for (let c = 0; c < 4; c++) for (let r = 0; r < 4; r++) for (let k = 0; k < 4; k++) out[4 * c + r] += a[4 * k + r] * b[4 * c + k];
  return out;
}

// Draws a scene as seen from `eye`, looking at `target`; who extends it says where these are: home, turn, zoom and pan.
export class SceneView {
  constructor(canvas) {
    this.canvas = canvas;
    this.mode = 0;
    this.gl = null;
    this.pointers = new Map();
    canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); this.pointers.set(event.pointerId, [event.clientX, event.clientY]); });
    canvas.addEventListener("pointermove", (event) => this.drag(event));
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => this.pointers.delete(event.pointerId));
    canvas.addEventListener("wheel", (event) => { event.preventDefault(); this.zoom(Math.exp(Math.max(-1, Math.min(1, event.deltaY / 400)))); }, { passive: false });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("keydown", (event) => this.key(event));
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  get ready() { return Boolean(this.gl && this.parts?.length); }

  // start: { world_from_cam (4 x 4, rows), pivot (m), fovy (degrees) } in OpenCV axes; palette: rows of RGB 0..255.
  show(glb, start, palette) {
    this.start = start;
    this.parts = [];
    if (!glb) return;
    const gl = this.gl ??= this.begin();
    if (!gl) throw new Error("this browser shows no 3-D (WebGL 2 is off); scene.glb in the zip opens in other viewers");
    if (palette.length) gl.uniform3fv(gl.getUniformLocation(this.program, "palette"), palette.flat().map((v) => v / 255));
    this.parts = glb.parts.map((part) => this.load(glb.data, part));
    this.middle = glb.middle;
    this.home();
  }

  load(data, { attributes, indices, texture, soft, count }) {
    const gl = this.gl, vertices = gl.createVertexArray(), picture = gl.createTexture();
    gl.bindVertexArray(vertices);
    for (const [name, { accessor, offset, length, stride }] of Object.entries(attributes)) {
      const place = gl.getAttribLocation(this.program, name);
      if (place < 0) continue;
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, new Uint8Array(data, offset, length), gl.STATIC_DRAW);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, SIZES[accessor.type], accessor.componentType, Boolean(accessor.normalized), stride, 0);
    }
    if (indices) {
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint8Array(data, indices.offset, indices.length), gl.STATIC_DRAW);
    }
    gl.bindTexture(gl.TEXTURE_2D, picture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, texture);
    for (const [name, value] of [[gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE]]) gl.texParameteri(gl.TEXTURE_2D, name, value);
    return { vertices, picture, numbers: indices?.accessor.componentType, soft, count };
  }

  begin() {
    const gl = this.canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
    if (!gl) return null;
    const program = this.program = gl.createProgram();
    for (const [kind, code] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, code);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    gl.useProgram(program);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE);
    return gl;
  }

  drag(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before || !this.ready) return;
    const [dx, dy] = [(event.clientX - before[0]) / this.canvas.clientHeight, (event.clientY - before[1]) / this.canvas.clientHeight];
    if (this.pointers.size === 2) {
      const other = [...this.pointers].find(([id]) => id !== event.pointerId)[1];
      const far = (at) => Math.hypot(at[0] - other[0], at[1] - other[1]) || 1;
      this.zoom(far(before) / far([event.clientX, event.clientY]));
    } else if (event.shiftKey || event.buttons === 2 || event.buttons === 4) this.pan(dx, dy);
    else this.turn(dx * 2, dy * 2);
    this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
  }

  key(event) {
    const turned = { ArrowLeft: [0.08, 0], ArrowRight: [-0.08, 0], ArrowUp: [0, 0.08], ArrowDown: [0, -0.08] }[event.key];
    if (!this.ready) return;
    if (turned) this.turn(...turned);
    else if (event.key === "+" || event.key === "=") this.zoom(0.9);
    else if (event.key === "-") this.zoom(1.1);
    else if (event.key === "0" || event.key === "Home") this.home();
    else return;
    event.preventDefault();
  }

  draw() {
    if (!this.ready || !this.canvas.clientWidth) return;
    const gl = this.gl, ratio = Math.min(window.devicePixelRatio || 1, 2);
    const [width, height] = [Math.round(this.canvas.clientWidth * ratio), Math.round(this.canvas.clientHeight * ratio)];
    if (this.canvas.width !== width || this.canvas.height !== height) [this.canvas.width, this.canvas.height] = [width, height];
    const color = getComputedStyle(this.canvas).backgroundColor.match(/[\d.]+/g).map(Number);
    gl.viewport(0, 0, width, height);
    gl.clearColor(color[0] / 255, color[1] / 255, color[2] / 255, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const z = unit(sub(this.eye, this.target)), x = unit(cross(this.up, z)), y = cross(z, x);
    const eye = sub(this.eye, this.middle);
    const look = new Float32Array([x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0, -dot(x, eye), -dot(y, eye), -dot(z, eye), 1]);
    const size = Math.hypot(...sub(this.eye, this.target)), near = size / 200, far = size * 400;
    const focal = 1 / Math.tan(this.start.fovy * Math.PI / 360), aspect = width / height, wide = this.start.aspect > aspect ? aspect / this.start.aspect : 1;
    const lens = new Float32Array([focal * wide / aspect, 0, 0, 0, 0, focal * wide, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, 2 * far * near / (near - far), 0]);
    gl.uniformMatrix4fv(gl.getUniformLocation(this.program, "clip"), false, times(lens, look));
    gl.uniform1i(gl.getUniformLocation(this.program, "mode"), this.mode);
    for (const { vertices, picture, numbers, soft, count } of this.parts) {
      gl.bindVertexArray(vertices);
      gl.bindTexture(gl.TEXTURE_2D, picture);
      soft ? gl.enable(gl.BLEND) : gl.disable(gl.BLEND);
      gl.depthMask(!soft);
      numbers ? gl.drawElements(gl.TRIANGLES, count, numbers, 0) : gl.drawArrays(gl.POINTS, 0, count);
    }
    gl.depthMask(true);
  }
}
