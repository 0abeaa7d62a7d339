// What a plotter shows beside a VDI: plain meshes, other VDIs, and a picture that VTK has drawn of
// texts, scalar bars and axes, as web/scene.py packs them.
import { bytesOfBase64, VDIFileError } from "./bytes.js";
import { emptyTexture, programOf } from "./graphics.js";
import { load } from "./loader.js";
import { Raycaster } from "./raycast.js";
import { cameraAxes, halfExtent, isParallel } from "./rays.js";
import { dot, subtract } from "./vectors.js";

/** Samples of a pixel where meshes are drawn, as in PyVista's windows. */
const SAMPLES = 4;

const PLACES = ["position", "color", "normal"];

// View coordinates are VTK's: x to the right, y up, z to the viewer.
const MESH_VERTEX_SHADER = `#version 300 es
in vec3 position, color, normal;
uniform mat3 axes;     // from the world to view coordinates
uniform vec3 offset;   // of the mesh's origin, view coordinates
uniform vec4 lens;     // half the width and height, and the window's centre
uniform vec2 range;    // clip z: range.x * depth + range.y
uniform bool parallel;
uniform float size;    // of points, pixels
out vec3 seenFrom, seenNormal, tint;
void main() {
  seenFrom = axes * position + offset;
  seenNormal = axes * normal;
  tint = color;
  float depth = -seenFrom.z, w = parallel ? 1.0 : depth;
  gl_Position = vec4(seenFrom.xy / lens.xy - lens.zw * w, range.x * depth + range.y, w);
  gl_PointSize = size;
}`;

const MESH_FRAGMENT_SHADER = `#version 300 es
precision highp float;
in vec3 seenFrom, seenNormal, tint;
uniform bool depths;   // view depths are written, in place of colours
uniform bool lit, smoothed;
out vec4 seen;
void main() {
  vec3 normal = smoothed ? seenNormal : cross(dFdx(seenFrom), dFdy(seenFrom));
  float headlight = lit ? abs(normalize(normal).z) : 1.0;
  seen = depths ? vec4(-seenFrom.z) : vec4(headlight * tint, 1.0);
}`;

/** A scene: `viewer.scene = new Scene(bytes)`. */
export class Scene {
  #gl = null;
  #buffers = null;
  #drawn = null; // the view whose meshes they hold
  #meshes = [];
  #bodies = []; // VDIs; the first is the viewer's own
  #pictures = []; // of all views, and of the view that the scene was made in
  #annotated = new WeakMap(); // canvases, and as how large it was drawn there

  /** The view that the scene begins in, if it says one; null before it is loaded. */
  camera = null;
  /** Called when there is more to be seen. */
  changed = () => {};
  /** The viewer that shows it. */
  viewer = null;
  /** Whether all of it can be drawn. */
  complete = false;

  /** @param {Uint8Array} bytes What web/scene.py makes. */
  constructor(bytes) {
    /** Fulfilled when meshes and the picture are there. */
    this.loaded = this.#load(bytes);
    /** Fulfilled when all can be drawn. */
    this.whole = this.loaded.then((others) => Promise.all(others)).then(() => {
      this.complete = true;
      this.changed();
    });
    this.whole.catch(() => {}); // who shows it is told
  }

  // Returns promises of the VDIs that are in it.
  async #load(bytes) {
    const head = await unpackedScene(bytes);
    const floats = (text) => new Float32Array(bytesOfBase64(text).buffer);
    this.#pictures = await Promise.all(head.pictures.map((text) =>
      text && createImageBitmap(new Blob([bytesOfBase64(text)]))));
    this.#meshes = head.meshes.map(({ points, colors, normals, ...mesh }) => ({
      ...mesh, attributes: [floats(points), bytesOfBase64(colors), normals && floats(normals)],
    }));
    this.#bodies = head.vdis.map(({ planes, matrix, opacity }) => ({
      planes: planes.map((p) => ({ origin: p.slice(0, 3), normal: p.slice(3) })), matrix, opacity,
      prepared: null, raycaster: null,
    }));
    this.head = head;
    this.camera = head.camera;
    this.changed();
    return head.vdis.map(({ file }, k) => file === null ? null
      : load(bytesOfBase64(file), { onLevel: (prepared) => this.#take(k, prepared) }));
  }

  #take(k, prepared) {
    const body = this.#bodies[k];
    body.prepared = prepared;
    if (body.raycaster && !this.#gl.isContextLost()) body.raycaster.set(prepared);
    this.changed();
  }

  /** Take the graphics that there is, at first and after it was lost. */
  take(gl) {
    if (gl === this.#gl || !this.head) return;
    this.#gl = gl;
    this.#buffers = this.#drawn = null;
    if (this.#meshes.length && !gl.getExtension("EXT_color_buffer_float")) {
      throw new Error("This browser's graphics cannot draw depths as numbers " +
        "(EXT_color_buffer_float), by which meshes hide a volume.");
    }
    for (const body of this.#bodies.slice(1)) {
      body.raycaster = new Raycaster(gl);
      if (body.prepared) body.raycaster.set(body.prepared);
    }
    for (const mesh of this.#meshes) mesh.drawn = uploaded(gl, mesh.attributes);
  }

  /** Free all of the graphics memory that it has taken. */
  dispose() {
    const gl = this.#gl;
    if (!gl) return;
    for (const body of this.#bodies) {
      body.raycaster?.dispose();
      body.raycaster = null;
    }
    for (const { drawn } of this.#meshes) {
      gl.deleteVertexArray(drawn?.array ?? null);
      drawn?.buffers.forEach((buffer) => gl.deleteBuffer(buffer));
    }
    this.#free();
    this.#gl = null;
  }

  /**
   * Draw a view, or a band of it, into the bound target, with the scissor set.
   *
   * @param {Raycaster} raycaster The viewer's own VDI.
   * @param {object} target Of a Pacer.
   * @param {object} view camera, width, height, density (pixels of it for one of the page), look,
   *   clippingPlanes; the same object for all bands of a picture.
   */
  paint(raycaster, target, view) {
    const gl = this.#gl, { width, height } = view;
    if (!gl) return; // another scene has taken its place meanwhile
    gl.disable(gl.BLEND);
    if (this.#meshes.length) {
      if (this.#drawn !== view) { // in the first band, and where another picture came between
        gl.disable(gl.SCISSOR_TEST);
        this.#drawMeshes(target, view);
        gl.enable(gl.SCISSOR_TEST);
        this.#drawn = view;
      }
      // Behind the VDIs, within the scissor
      gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.#buffers.resolved);
      gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, target.framebuffer);
      gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.NEAREST);
      gl.bindFramebuffer(gl.FRAMEBUFFER, target.framebuffer);
    }
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    this.#drawVDIs(raycaster, view);
    gl.disable(gl.BLEND);
  }

  // The farthest first: by the middles of their boxes.
  #drawVDIs(raycaster, view) {
    const { camera, look, clippingPlanes } = view;
    const [, , forward] = cameraAxes(camera);
    const placed = this.#bodies.map((body, k) => ({ ...body, caster: k ? body.raycaster : raycaster }))
      .filter(({ caster }) => caster?.vdi).map((body) => {
        const { bounds: b } = body.caster.vdi;
        const middle = [0, 2, 4].map((k) => (b[k] + b[k + 1]) / 2);
        const world = body.matrix.slice(0, 3).map((row) => dot(row, middle) + row[3]);
        return { ...body, depth: dot(forward, subtract(world, camera.position)) };
      });
    for (const { caster, matrix, opacity, planes } of placed.sort((a, b) => b.depth - a.depth)) {
      caster.draw({
        ...view, camera: { ...camera, model_transform: matrix },
        look: { ...look, opacity: look.opacity * opacity },
        depthTexture: this.#meshes.length ? this.#buffers.depth : null,
        clippingPlanes: [...planes, ...clippingPlanes],
      });
    }
  }

  // View depths of one sample by which rays end, and colours by several samples.
  #drawMeshes(target, view) {
    const gl = this.#gl, { camera, width, height, density } = view;
    const buffers = this.#sized(target.width, target.height);
    const axes = cameraAxes(camera), parallel = isParallel(camera);
    axes[2] = axes[2].map((x) => -x);
    const from = (point) => axes.map((axis) => dot(axis, subtract(point, camera.position)));
    const ends = this.#meshes.map(({ origin, radius }) => {
      const depth = -from(origin)[2];
      return [depth - radius, depth + radius];
    });
    const [least, most] = [Math.min(...ends.map(([a]) => a)), Math.max(...ends.map(([, b]) => b))];
    const room = 0.01 * (most - least) + 1e-6 * Math.abs(most) + 1e-18, far = most + room;
    const near = parallel ? least - room : Math.max(least - room, 0.001 * far);
    const slope = (far + near) / (far - near);
    const { program, uniforms: u } = programOf(gl, MESH_VERTEX_SHADER, MESH_FRAGMENT_SHADER, PLACES);
    gl.useProgram(program);
    gl.uniformMatrix3fv(u.axes, true, axes.flat());
    gl.uniform4f(u.lens, ...halfExtent(camera, [width, height]), ...(camera.window_center ?? [0, 0]));
    gl.uniform2f(u.range, ...(parallel ? [2 / (far - near), -slope] : [slope, -2 * far * near / (far - near)]));
    gl.uniform1i(u.parallel, parallel);
    gl.viewport(0, 0, width, height);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.depthMask(true);
    for (const [pass, framebuffer] of buffers.passes.entries()) {
      gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
      gl.clearBufferfv(gl.COLOR, 0, pass ? [0, 0, 0, 0] : [Infinity, 0, 0, 0]);
      gl.clearBufferfv(gl.DEPTH, 0, [1]);
      gl.uniform1i(u.depths, !pass);
      for (const { kind, origin, lit, size, attributes, drawn } of this.#meshes) {
        gl.uniform3f(u.offset, ...from(origin));
        gl.uniform1i(u.lit, lit && kind === "triangles");
        gl.uniform1i(u.smoothed, Boolean(attributes[2]));
        gl.uniform1f(u.size, Math.max(1, size * density));
        gl.bindVertexArray(drawn.array);
        gl.drawArrays(gl[kind.toUpperCase()], 0, attributes[0].length / 3);
      }
    }
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, buffers.passes[1]);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, buffers.resolved);
    gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.NEAREST);
    gl.disable(gl.DEPTH_TEST);
    gl.bindVertexArray(null);
  }

  // -- the picture that VTK has drawn ------------------------------------------------------------

  /** Draw texts, scalar bars and axes into a canvas, made as large as the viewer's picture. */
  annotate(canvas, camera, [width, height]) {
    const view = this.head?.view;
    const begun = view && ["position", "focal_point", "view_up"].every((name) =>
      Math.hypot(...subtract(view[name], camera[name])) <= 1e-6 * Math.hypot(...view[name]));
    const shown = this.#pictures.filter((picture, k) => picture && (k === 0 || begun));
    const key = `${width} ${height} ${shown.length} ${begun}`;
    if (this.#annotated.get(canvas) === key) return;
    this.#annotated.set(canvas, key);
    [canvas.width, canvas.height] = [width, height]; // which clears it
    for (const picture of shown) {
      const scale = Math.min(width / picture.width, height / picture.height);
      const [wide, high] = [picture.width * scale, picture.height * scale];
      canvas.getContext("2d").drawImage(picture, (width - wide) / 2, (height - high) / 2, wide, high);
    }
  }

  /** Lay them over a picture: premultiplied RGBA, top row first. */
  layTexts(data, camera, size) {
    if (!this.#pictures.some(Boolean)) return;
    const canvas = new OffscreenCanvas(...size);
    this.annotate(canvas, camera, size);
    const { data: over } = canvas.getContext("2d").getImageData(0, 0, ...size);
    for (let k = 0; k < data.length; ++k) {
      const opacity = over[k | 3] / 255, straight = (k & 3) === 3 ? 255 : over[k];
      data[k] = opacity * straight + (1 - opacity) * data[k];
    }
  }

  // Framebuffers as large as the target's: of depths, of colours by samples, and of those resolved.
  #sized(width, height) {
    const gl = this.#gl;
    if (this.#buffers?.width === width && this.#buffers.height === height) return this.#buffers;
    this.#free();
    const samples = Math.min(SAMPLES, gl.getParameter(gl.MAX_SAMPLES));
    const renderbuffer = (format, count) => {
      const id = gl.createRenderbuffer();
      gl.bindRenderbuffer(gl.RENDERBUFFER, id);
      gl.renderbufferStorageMultisample(gl.RENDERBUFFER, count, gl[format], width, height);
      return id;
    };
    const framebuffer = (color, depth) => {
      const id = gl.createFramebuffer();
      gl.bindFramebuffer(gl.FRAMEBUFFER, id);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.RENDERBUFFER, color);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, depth);
      return id;
    };
    const depth = emptyTexture(gl, "R32F", width, height);
    const renderbuffers = [renderbuffer("DEPTH_COMPONENT24", 0), renderbuffer("RGBA8", samples),
      renderbuffer("DEPTH_COMPONENT24", samples), renderbuffer("RGBA8", 0)];
    const passes = [framebuffer(null, renderbuffers[0]), framebuffer(renderbuffers[1], renderbuffers[2])];
    const resolved = framebuffer(renderbuffers[3], null);
    gl.bindFramebuffer(gl.FRAMEBUFFER, passes[0]);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, depth, 0);
    this.#buffers = { width, height, depth, renderbuffers, passes, resolved };
    return this.#buffers;
  }

  #free() {
    const gl = this.#gl, { depth, renderbuffers, passes, resolved } = this.#buffers ?? {};
    if (this.#buffers) {
      gl.deleteTexture(depth);
      for (const buffer of renderbuffers) gl.deleteRenderbuffer(buffer);
      for (const framebuffer of [...passes, resolved]) gl.deleteFramebuffer(framebuffer);
    }
    this.#buffers = this.#drawn = null;
  }
}

// What web/scene.py has packed; arrays are base64 texts.
async function unpackedScene(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  try {
    return await new Response(stream).json();
  } catch {
    throw new VDIFileError("the scene beside the VDI is damaged: load it again, or export it anew");
  }
}

// Positions, colours and normals, if there are some, as buffers.
function uploaded(gl, attributes) {
  const array = gl.createVertexArray(), buffers = [];
  gl.bindVertexArray(array);
  for (const [place, data] of attributes.entries()) {
    if (!data) continue;
    const bytes = data instanceof Uint8Array;
    buffers.push(gl.createBuffer());
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers.at(-1));
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, 3, bytes ? gl.UNSIGNED_BYTE : gl.FLOAT, bytes, 0, 0);
  }
  gl.bindVertexArray(null);
  return { array, buffers };
}

// -- in a page -----------------------------------------------------------------------------------

function takeEmbedded() {
  for (const viewer of document.querySelectorAll("vdi-viewer")) {
    const script = viewer.querySelector(':scope > script[type="application/vdi-scene+base64"]');
    if (script && !viewer.scene) viewer.scene = new Scene(bytesOfBase64(script.textContent));
  }
}

takeEmbedded();
document.addEventListener("DOMContentLoaded", takeEmbedded);
