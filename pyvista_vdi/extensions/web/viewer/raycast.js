// A VDI in WebGL 2: textures of its lists, and a fragment shader that casts a ray for each pixel.
import { AS_MADE } from "./look.js";
import { TEXTURE_WIDTH } from "./prepare.js";
import {
  frameForms, frameOf, isParallel, listSpace, listsCrossed, pixelRays, pixelsOfBoxes, pointAlong,
  thinnedSpace,
} from "./rays.js";
import { MOST_PLANES, VERTEX_SHADER, fragmentShader } from "./shader.js";
import { MEAN_STEPS, SPREADS, fillTable } from "./values.js";

/** A ray ends where less transmittance than this is left. */
const TRANSMITTANCE_CUTOFF = 1e-6;

/** Lists that rays must cross along an edge for every second one to be worth it. */
const OBLIQUE = 16;

/** Opacity, of 255, below which a ray sees too little for its place to be asked for. */
const LEAST_SEEN = 4;

/** Rows of pixels that are drawn at once. */
const STRIP = 16;

/** Draws prepared VDIs from any view into the bound framebuffer. */
export class Raycaster {
  /** @param {WebGL2RenderingContext} gl */
  constructor(gl) {
    this.gl = gl;
    this.programs = programsOf(gl);
    this.vdi = null;
    this.vertices = gl.createVertexArray();
  }

  /**
   * Take a VDI; the one before is drawn until its textures are there, and is freed then.
   *
   * @param {object} prepared What prepare.js makes.
   * @throws {Error} If this machine's textures cannot hold it.
   */
  set(prepared) {
    const { gl } = this;
    const largest = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    const rows = Math.ceil(prepared.n / TEXTURE_WIDTH);
    if (Math.max(rows, TEXTURE_WIDTH, ...prepared.windowSize) > largest) {
      throw new Error(
        `The VDI has ${prepared.n} supersegments in ${prepared.windowSize.join(" x ")} lists, ` +
        `which take textures of up to ${Math.max(rows, ...prepared.windowSize)} texels along an ` +
        `edge; this browser's MAX_TEXTURE_SIZE is ${largest}: make it with fewer lists.`);
    }
    const textures = {
      lists: prepared.packed
        ? this.texture(prepared.lists, "RGBA32UI", prepared.windowSize[0])
        : this.texture(prepared.lists, "RG32UI", prepared.windowSize[0]),
      masks: this.texture(prepared.masks, "RG32UI", prepared.stacks[0]),
      faces: this.texture(prepared.faces, prepared.packed ? "RG32UI" : "RG32F", TEXTURE_WIDTH),
    };
    if (!prepared.packed) textures.media = this.texture(prepared.media, "RGBA32F", TEXTURE_WIDTH);
    if (prepared.values) {
      textures.table = this.texture(new Float32Array(4 * (MEAN_STEPS + 1) * SPREADS), "RGBA32F", MEAN_STEPS + 1);
    }
    if (gl.getError() === gl.OUT_OF_MEMORY) {
      Object.values(textures).forEach((texture) => gl.deleteTexture(texture));
      throw new Error(`The graphics memory cannot hold ${prepared.n} supersegments.`);
    }
    this.free();
    this.vdi = { ...prepared, textures, lists: null, masks: null, faces: null, media: null };
    this.transfer = undefined; // what the table is of
  }

  // Have the table that of a transfer function, null: of the one that the file starts with.
  classify(transfer) {
    if (transfer === this.transfer) return;
    const { gl, vdi } = this;
    vdi.table ??= new Float32Array(4 * (MEAN_STEPS + 1) * SPREADS);
    fillTable(vdi, transfer, vdi.table);
    gl.bindTexture(gl.TEXTURE_2D, vdi.textures.table);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, MEAN_STEPS + 1, SPREADS, gl.RGBA, gl.FLOAT, vdi.table);
    this.transfer = transfer;
  }

  texture(array, format, width) {
    const { gl } = this;
    const isFloat = format.endsWith("F"), channels = format.startsWith("RGBA") ? 4 : 2;
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl[format], width, array.length / channels / width);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 4);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, array.length / channels / width,
      gl[(channels === 4 ? "RGBA" : "RG") + (isFloat ? "" : "_INTEGER")],
      isFloat ? gl.FLOAT : gl.UNSIGNED_INT, array);
    return texture;
  }

  /**
   * Draw premultiplied RGBA into the bound framebuffer, by its blending; bottom row first. A
   * scissor that is set holds.
   *
   * @param {object} view
   * @param {object} view.camera position, focal_point, view_up and view_angle (degrees) or
   *   parallel_scale: VTK's meanings, world units; model_transform, if the model lies elsewhere in
   *   the world than it did for the VDI.
   * @param {number} view.width Pixels, as height; the viewport is set to them.
   * @param {number[]} [view.corner] Of the viewport.
   * @param {{origin: number[], normal: number[]}[]} [view.clippingPlanes] World; the side that the
   *   normal points to is kept.
   * @param {WebGLTexture} [view.depthTexture] R32F: view depth of what is opaque, world units, at
   *   each texel of the framebuffer; rays end there.
   * @param {boolean} [view.few] Whether every second list does: see {@link thinning}.
   * @param {object} [view.look] Of look.js.
   * @param {number} [view.cutoff] A ray ends where less transmittance is left.
   * @param {boolean} [view.finds] Whether t of a ray's end is written, as four bytes of a float32.
   */
  draw({ camera, width, height, corner = [0, 0], clippingPlanes = [], depthTexture = null,
    few = false, look = AS_MADE, cutoff = TRANSMITTANCE_CUTOFF, finds = false }) {
    const { gl, vdi } = this;
    if (!vdi) return;
    if (vdi.values) this.classify(look.transfer ?? null);
    const { bounds } = vdi;
    const thinned = few ? this.thinning(camera) : [0, 0];
    const { space, windowSize } = thinned.some(Boolean)
      ? thinnedSpace(vdi.space, vdi.windowSize, thinned) : vdi;
    const frame = camera.model_transform ? frameOf({ bounds, camera }) : vdi.frame;
    const rays = pixelRays(frame, camera, [width, height]);
    const { coordinates, planes } = frameForms(frame, space, windowSize, rays, isParallel(camera),
      clippingPlanes, look.clip);
    if (planes.length > MOST_PLANES) {
      throw new Error(`A VDI is clipped to at most ${clippingPlanes.length - planes.length +
        MOST_PLANES} planes, not to ${clippingPlanes.length}.`);
    }
    const { program, uniforms: u } = this.program(space, vdi, depthTexture, planes);
    gl.useProgram(program);
    gl.viewport(...corner, width, height);
    const halves = (forms) => [0, 3].map((k) => forms.flatMap((form) => form.slice(k, k + 3)));
    const [formValue, formSlope] = halves(coordinates);
    const [planeValue, planeSlope] = halves(planes);
    gl.uniform2f(u.corner, ...corner);
    gl.uniform2f(u.middle, width / 2, height / 2);
    gl.uniform3fv(u.formValue, formValue);
    gl.uniform3fv(u.formSlope, formSlope);
    gl.uniform3fv(u.planeValue, planeValue);
    gl.uniform3fv(u.planeSlope, planeSlope);
    gl.uniformMatrix3fv(u.direction, false, rays.direction.flat());
    gl.uniform2i(u.window, ...windowSize);
    gl.uniform2i(u.thinned, ...thinned);
    gl.uniform1f(u.depthOrigin, space.origin);
    gl.uniform1f(u.firstDepth, vdi.firstDepth);
    gl.uniform1f(u.slabsPerDepth, vdi.slabsPerDepth);
    gl.uniform1f(u.cutoff, cutoff);
    gl.uniform1f(u.brightness, look.brightness);
    gl.uniform1f(u.thickness, look.opacity);
    gl.uniform1i(u.finds, Number(finds));
    gl.uniform1f(u.codeStep, vdi.step);
    gl.uniform1f(u.nearest, space.parallel ? -1e30 : space.nearest - space.origin);
    gl.uniform1f(u.worldScale, frame.scale);
    gl.uniform1f(u.reference, rays.reference);
    const bound = depthTexture ? { ...vdi.textures, opaque: depthTexture } : vdi.textures;
    Object.entries(bound).forEach(([name, texture], unit) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.uniform1i(u[name], unit);
    });
    gl.bindVertexArray(this.vertices);
    this.drawStrips(pixelsOfBoxes(frame, camera, [width, height], vdi.corners), corner, height);
    gl.bindVertexArray(null);
    gl.activeTexture(gl.TEXTURE0);
  }

  /**
   * Where the ray of a pixel has lost half of the light that it loses: a point of the world, or null
   * where hardly anything is seen. Waits for the device.
   *
   * @param {object} target Of a Pacer, of a pixel.
   * @param {object} view As of {@link draw}.
   * @param {number[]} pixel From the lower left corner.
   */
  pointAt(target, view, [x, y]) {
    const { gl, vdi } = this, { camera, width, height } = view;
    if (!vdi) return null;
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.framebuffer);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(0, 0, 1, 1);
    gl.clearColor(0, 0, 0, 0);
    const bytes = new Uint8Array(4);
    const drawn = (more) => {
      gl.clear(gl.COLOR_BUFFER_BIT);
      this.draw({ ...view, corner: [-x, -y], ...more });
      gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    };
    drawn({});
    const opacity = bytes[3] / 255, isSeen = bytes[3] > LEAST_SEEN;
    if (isSeen) drawn({ cutoff: 1 - opacity / 2, finds: true });
    gl.disable(gl.SCISSOR_TEST);
    const t = new DataView(bytes.buffer).getFloat32(0, true);
    if (!isSeen || !Number.isFinite(t)) return null;
    const rays = pixelRays(vdi.frame, camera, [width, height]);
    return pointAlong(vdi.frame, rays, [x + 0.5 - width / 2, y + 0.5 - height / 2], t);
  }

  /**
   * Along which edges every second list does for a view with few pixels: those that most lists are
   * crossed along; none near V_O, where a ray's cost is not that of the lists.
   *
   * @returns {number[]} 1 or 0 for the window's width and height.
   */
  thinning(camera) {
    const { vdi } = this;
    if (!vdi) return [0, 0];
    const frame = camera.model_transform ? frameOf({ bounds: vdi.bounds, camera }) : vdi.frame;
    const crossed = listsCrossed(frame, vdi.space, camera), most = Math.max(...crossed);
    return crossed.map((many) => Number(most >= OBLIQUE && many >= most / 2));
  }

  // Draw only where something may be seen: strip by strip, from the first to the last such pixel,
  // within the scissor that is set.
  drawStrips(boxes, [left, bottom], height) {
    const { gl } = this;
    const set = gl.isEnabled(gl.SCISSOR_TEST) ? gl.getParameter(gl.SCISSOR_BOX) : null;
    const [firstX, firstY, wide, high] = set ?? [left, bottom, Infinity, height];
    gl.enable(gl.SCISSOR_TEST);
    for (let row = 0; row < height; row += STRIP) {
      const here = boxes.filter(([, , y0, y1]) => y0 < row + STRIP && y1 > row);
      const x0 = Math.max(left + Math.min(...here.map(([x]) => x)), firstX);
      const x1 = Math.min(left + Math.max(...here.map(([, x]) => x)), firstX + wide);
      const y0 = Math.max(bottom + row, firstY);
      const y1 = Math.min(bottom + Math.min(row + STRIP, height), firstY + high);
      if (!here.length || x0 >= x1 || y0 >= y1) continue;
      gl.scissor(x0, y0, x1 - x0, y1 - y0);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
    }
    if (set) gl.scissor(...set);
    else gl.disable(gl.SCISSOR_TEST);
  }

  /**
   * Have the program for V_O of a VDI in 8 bytes compiled, which takes longer than a frame: by a
   * pixel of the bound framebuffer, in which no ray is left.
   *
   * @param {object} vdi camera, windowSize, bounds and depthOrigin of what will be set.
   */
  warmUp(vdi) {
    const { gl } = this, { camera, windowSize } = vdi;
    const frame = frameOf(vdi), space = listSpace(frame, vdi);
    const rays = pixelRays(frame, camera, windowSize);
    const { planes } = frameForms(frame, space, windowSize, rays, space.parallel, []);
    const known = this.programs.size;
    const { program, uniforms } = this.program(space, { packed: true, values: vdi.values }, null, planes);
    if (this.programs.size === known) return;
    gl.useProgram(program);
    gl.uniform3fv(uniforms.planeValue, new Float32Array(3 * planes.length).fill(-1));
    if (uniforms.table) gl.uniform1i(uniforms.table, 1); // floats, and all others are whole numbers
    const everything = this.texture(new Uint32Array(4), "RGBA32UI", 1);
    gl.viewport(0, 0, 1, 1);
    gl.bindVertexArray(this.vertices);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.bindVertexArray(null);
    gl.deleteTexture(everything);
  }

  program({ parallel, shifted }, { packed, values }, opaque, { length }) {
    const { gl } = this;
    const defines = [parallel && "PARALLEL", shifted && "SHIFTED", packed && "PACKED",
      opaque && "OPAQUE", values && "VALUES"].filter(Boolean);
    const key = [...defines, length].join();
    if (!this.programs.has(key)) {
      const program = linked(gl, VERTEX_SHADER, fragmentShader(defines, length));
      const uniforms = {};
      for (let k = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); k-- > 0; ) {
        const { name } = gl.getActiveUniform(program, k);
        uniforms[name.replace("[0]", "")] = gl.getUniformLocation(program, name);
      }
      this.programs.set(key, { program, uniforms });
    }
    return this.programs.get(key);
  }

  free() {
    const textures = Object.values(this.vdi?.textures ?? {});
    textures.forEach((texture) => this.gl.deleteTexture(texture));
    this.vdi = null;
  }

  /** Free all of the graphics memory that it has taken. */
  dispose() {
    this.free();
    this.gl.deleteVertexArray(this.vertices);
  }
}

const compiled = new WeakMap();

/** The programs that were compiled, by names of their own: all viewers of a page share them. */
export function programsOf(gl) {
  if (!compiled.has(gl)) compiled.set(gl, new Map());
  return compiled.get(gl);
}

/**
 * Compile and link a program.
 *
 * @param {string[]} [attributes] Names of the vertex shader's inputs, in the order of their places.
 * @throws {Error} With the compiler's words, if it refuses.
 */
export function linked(gl, vertex, fragment, attributes = []) {
  const program = gl.createProgram();
  attributes.forEach((name, place) => gl.bindAttribLocation(program, place, name));
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
    gl.deleteShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) {
      const words = gl.getShaderInfoLog(shader);
      throw new Error(`This browser's graphics driver refuses a shader: ${words}`);
    }
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
    const words = gl.getProgramInfoLog(program);
    throw new Error(`This browser's graphics driver refuses a program: ${words}`);
  }
  return program;
}
