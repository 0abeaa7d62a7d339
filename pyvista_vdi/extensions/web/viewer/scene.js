// What a plotter shows beside a VDI: meshes, lines, points, texts and other VDIs, as web/scenes/scene.py
// packs them. Layers, meshes and VDIs share one context and its targets: hence more than 500 lines.
import { annotate } from "./annotations.js";
import { cornersOf, layersOf } from "./layers.js";
import { load } from "./loader.js";
import {
  COPY_SHADER, LAYERS_SHADER, MOST_LIGHTS, PICTURE_SHADER, RESOLVED_SHADER, meshFragmentShader,
  meshVertexShader,
} from "./mesh_shader.js";
import { Raycaster, linked, programsOf } from "./raycast.js";
import { cameraAxes, halfExtent, isParallel } from "./rays.js";
import { VERTEX_SHADER } from "./shader.js";
import { VDIFileError } from "./unpack.js";
import { cross, dot, subtract, times } from "./vectors.js";

/** Samples of a pixel where meshes are drawn, as in PyVista's windows. */
const SAMPLES = 4;

/** Slabs in which VDIs that overlap are drawn while a view moves. */
const FEW_SLABS = 12;

/** A scene: `viewer.scene = new Scene(bytes)`. */
export class Scene {
  #gl = null;
  #programs = null;
  #buffers = null;
  #others = []; // what other renderers draw in parts of the window: axes, a picture behind all
  #drawn = null; // the view whose meshes they hold
  #shapes = [];
  #bodies = []; // VDIs; the first is the viewer's own
  #vertices = null;
  #annotated = new WeakMap(); // canvases, and what was drawn there

  /** @param {Uint8Array} bytes What web/scenes/scene.py makes. */
  constructor(bytes) {
    /** The view that the scene begins in, if it says one; null before it is loaded. */
    this.camera = null;
    /** Called when there is more to be seen, and with what is wrong. */
    this.changed = this.failed = () => {};
    /** The viewer that shows it. */
    this.viewer = null;
    /** Whether all of it can be drawn. */
    this.complete = false;
    /** Fulfilled when meshes and texts are there. */
    this.loaded = this.#load(bytes);
    /** Fulfilled when all can be drawn. */
    this.whole = this.loaded.then((others) => Promise.all(others)).then(() => {
      this.complete = true;
      this.changed();
    });
    this.whole.catch((error) => this.failed(error));
  }

  // Returns promises of the VDIs that are in it.
  async #load(bytes) {
    const { head, arrays } = await unpackedScene(bytes);
    const ready = (shape) => ({ ...shape, parts: partsOf(shape, arrays) });
    const shapes = head.shapes.map(ready);
    const others = head.renderers.map((other) => ({ ...other, shapes: other.shapes.map(ready) }));
    for (const { table, texture } of [shapes, ...others.map((other) => other.shapes)].flat()) {
      if (table) table.data = arrays[table.texels];
      if (texture) texture.data = await createImageBitmap(new Blob([arrays[texture.picture]]),
        { premultiplyAlpha: "none", colorSpaceConversion: "none" });
    }
    [this.#shapes, this.#others] = [shapes, others];
    this.head = head;
    this.camera = head.camera;
    this.#bodies = head.vdis.map(({ planes, matrix }) => ({
      planes: planes.map((p) => ({ origin: p.slice(0, 3), normal: p.slice(3) })), matrix,
      prepared: null, raycaster: null,
    }));
    if (this.#gl) this.restore(this.#gl);
    this.changed();
    return head.vdis.map(({ file }, k) => file === null ? null
      : load(arrays[file], { onLevel: (prepared) => this.#take(k, prepared) }));
  }

  #all() {
    return [this.#shapes, ...this.#others.map(({ shapes }) => shapes)].flat();
  }

  #take(k, prepared) {
    const body = this.#bodies[k];
    body.prepared = prepared;
    if (body.raycaster && !this.#gl.isContextLost()) body.raycaster.set(prepared);
    this.changed();
  }

  /** Take the graphics that there is, at first and after it was lost. */
  restore(gl) {
    this.#gl = gl;
    this.#programs = programsOf(gl);
    this.#buffers = this.#drawn = null;
    gl.deleteVertexArray(this.#vertices);
    this.#vertices = gl.createVertexArray();
    if (this.#all().length && !gl.getExtension("EXT_color_buffer_float")) {
      throw new Error("This browser's graphics cannot draw depths as numbers " +
        "(EXT_color_buffer_float), by which meshes hide a volume.");
    }
    for (const body of this.#bodies.slice(1)) {
      body.raycaster = new Raycaster(gl);
      if (body.prepared) body.raycaster.set(body.prepared);
    }
    for (const shape of this.#all()) {
      for (const part of shape.parts) part.drawn = uploaded(gl, part);
      for (const map of [shape.table, shape.texture]) if (map) map.drawn = mapTexture(gl, map);
    }
  }

  /** Free all of the graphics memory that it has taken. */
  dispose() {
    const gl = this.#gl;
    if (!gl) return;
    for (const body of this.#bodies) {
      body.raycaster?.dispose();
      body.raycaster = null;
    }
    for (const shape of this.#all()) {
      for (const { drawn } of shape.parts) {
        gl.deleteVertexArray(drawn?.array ?? null);
        drawn?.buffers.forEach((buffer) => gl.deleteBuffer(buffer));
      }
      for (const map of [shape.table, shape.texture]) gl.deleteTexture(map?.drawn ?? null);
    }
    this.#free();
    gl.deleteVertexArray(this.#vertices);
    this.#gl = this.#vertices = null;
  }

  /**
   * Draw a view, or a band of it, into the bound target, with the scissor set.
   *
   * @param {Raycaster} raycaster The viewer's own VDI.
   * @param {object} target Of a Pacer.
   * @param {object} view camera, width, height, density (pixels of it for one of the page), moving,
   *   look, clippingPlanes; the same object for all bands of a picture.
   */
  paint(raycaster, target, view) {
    const gl = this.#gl, { width, height } = view;
    if (!gl) return; // another scene has taken its place meanwhile
    let depthTexture = null;
    if (this.#all().length) {
      if (this.#drawn !== view) { // in the first band, and where another picture came between
        gl.disable(gl.SCISSOR_TEST);
        this.#drawShapes(target, view);
        gl.enable(gl.SCISSOR_TEST);
        this.#drawn = view;
      }
      const { color, layers, depth } = this.#buffers;
      gl.bindFramebuffer(gl.FRAMEBUFFER, target.framebuffer);
      gl.viewport(0, 0, width, height);
      gl.disable(gl.BLEND);
      this.#resolve(color.texture, view);
      gl.enable(gl.BLEND);
      gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
      if (layers) this.#cover(LAYERS_SHADER, { layers: layers.texture, sums: layers.sums });
      depthTexture = depth.texture;
    }
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE_MINUS_DST_ALPHA, gl.ONE);
    this.#coverOthers(view, true);
    gl.viewport(0, 0, width, height);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    this.#drawVDIs(raycaster, view, depthTexture);
    this.#coverOthers(view, false);
    gl.disable(gl.BLEND);
  }

  // Lay the pictures of other renderers over what is there, or under it.
  #coverOthers(view, behind) {
    const gl = this.#gl;
    const chosen = this.#others.map((other, k) => [other, k]).filter(([other]) =>
      other.behind === behind && other.shapes.length); // others have but letters
    for (const [other, k] of behind ? chosen.reverse() : chosen) {
      const [left, bottom, wide, high] = partOf(other, view);
      gl.viewport(left, bottom, wide, high);
      const picture = this.#buffers.others[k].picture.texture;
      if (isMixed(other)) this.#cover(COPY_SHADER, { picture }, { corner: [left, bottom] });
      else this.#resolve(picture, view, [left, bottom]);
    }
  }

  // Take over a picture whose samples are averaged, as seen before what is behind all.
  #resolve(picture, view, corner = [0, 0]) {
    const k = this.#others.findIndex((other) => other.behind && !other.turns && !isMixed(other));
    const pictured = k >= 0 && this.#buffers.others[k].picture.texture !== picture;
    const behind = pictured ? this.#buffers.others[k].picture.texture : picture;
    const cornerBehind = pictured ? partOf(this.#others[k], view).slice(0, 2) : corner;
    this.#cover(RESOLVED_SHADER, { picture, behind },
      { corner, cornerBehind, pictured, height: view.height });
  }

  #drawVDIs(raycaster, view, depthTexture) {
    const { camera, width, height, moving, few, clippingPlanes, look } = view;
    const bodies = this.#bodies.map((body, k) => k ? body : { ...body, raycaster })
      .filter(({ raycaster: caster }) => caster?.vdi);
    const boxes = bodies.map((body) => cornersOf(body.raycaster.vdi.bounds, matrixOf(body)));
    const [, , forward] = cameraAxes(camera);
    const plane = (depth, sense) => ({
      origin: camera.position.map((x, k) => x + depth * forward[k]),
      normal: forward.map((x) => sense * x),
    });
    for (const { body, near, far } of layersOf(boxes, camera, moving ? FEW_SLABS : undefined)) {
      const { planes, raycaster: caster } = bodies[body];
      const slab = near === -Infinity ? [] : [plane(near, 1), plane(far, -1)];
      caster.draw({
        camera: { ...camera, model_transform: matrixOf(bodies[body]) },
        width, height, depthTexture, few, look, clippingPlanes: [...planes, ...clippingPlanes, ...slab],
      });
    }
  }

  // -- meshes ------------------------------------------------------------------------------------

  #drawShapes(target, view) {
    const gl = this.#gl, { width, height } = view;
    const opaque = this.#shapes.filter(({ translucent }) => !translucent);
    const layers = this.#shapes.filter(({ translucent }) => translucent);
    const buffers = this.#sized(target.width, target.height, layers.length > 0);
    const seen = viewOf(view, this.head);
    gl.viewport(0, 0, width, height);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.depthMask(true);
    gl.disable(gl.BLEND);

    gl.bindFramebuffer(gl.FRAMEBUFFER, buffers.depth.framebuffer);
    gl.clearBufferfv(gl.COLOR, 0, [Infinity, 0, 0, 0]);
    gl.clearBufferfv(gl.DEPTH, 0, [1]);
    for (const shape of opaque) this.#drawShape(shape, seen, ["DEPTH"]);

    gl.bindFramebuffer(gl.FRAMEBUFFER, buffers.samples.framebuffer);
    gl.clearBufferfv(gl.COLOR, 0, [0, 0, 0, 0]);
    gl.clearBufferfv(gl.DEPTH, 0, [1]);
    for (const shape of opaque) this.#drawShape(shape, seen, []);
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, buffers.samples.framebuffer);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, buffers.color.framebuffer);
    gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.NEAREST);

    if (layers.length) {
      gl.bindFramebuffer(gl.FRAMEBUFFER, buffers.layers.framebuffer);
      gl.drawBuffers([gl.COLOR_ATTACHMENT0, gl.COLOR_ATTACHMENT1]);
      gl.clearBufferfv(gl.COLOR, 0, [0, 0, 0, 1]);
      gl.clearBufferfv(gl.COLOR, 1, [0, 0, 0, 1]);
      gl.enable(gl.BLEND);
      gl.depthMask(false);
      gl.blendFuncSeparate(gl.ONE, gl.ONE, gl.ZERO, gl.ONE_MINUS_SRC_ALPHA);
      for (const shape of layers) this.#drawShape(shape, seen, ["LAYERS"]);
    }
    gl.disable(gl.BLEND);
    this.#others.forEach((other, k) => this.#drawOther(other, this.#buffers.others[k], view));
    gl.disable(gl.DEPTH_TEST);
    gl.disable(gl.CULL_FACE);
    gl.bindVertexArray(null);
    gl.activeTexture(gl.TEXTURE0);
  }

  // What another renderer draws, before all else, into a picture of its own.
  #drawOther(other, { samples, picture }, view) {
    const gl = this.#gl;
    const [, , width, height] = partOf(other, view);
    const seen = viewOf({ ...view, width, height, camera: cameraOf(other, view.camera) }, other);
    gl.bindFramebuffer(gl.FRAMEBUFFER, samples.framebuffer);
    gl.enable(gl.DEPTH_TEST);
    gl.depthMask(true);
    gl.clearBufferfv(gl.COLOR, 0, [0, 0, 0, 0]);
    gl.clearBufferfv(gl.DEPTH, 0, [1]);
    gl.viewport(0, 0, width, height);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    for (const layered of [false, true]) {
      if (layered) gl.enable(gl.BLEND);
      for (const shape of other.shapes) {
        const pass = layered ? ["BLENDED"] : isMixed(other) ? ["CODED"] : [];
        if (shape.translucent === layered) this.#drawShape(shape, seen, pass);
      }
    }
    gl.disable(gl.BLEND);
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, samples.framebuffer);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, picture.framebuffer);
    gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.NEAREST);
  }

  #drawShape(shape, seen, pass) {
    const gl = this.#gl, { material, back = material } = shape;
    const near = toView(shape, seen);
    const [front, behind] = shape.culling;
    gl.cullFace(front && behind ? gl.FRONT_AND_BACK : front ? gl.FRONT : gl.BACK);
    for (const part of shape.parts) {
      const { kind } = part, stripes = kind === "lines" || kind === "wires";
      // Lines have no sides, although stripes have
      if ((front || behind) && kind === "faces") gl.enable(gl.CULL_FACE);
      else gl.disable(gl.CULL_FACE);
      const defines = [...pass, shape.planes.length && "CLIPPED", shape.back && "BACK",
        shape.normals !== undefined && "NORMALS", part.lit && seen.lights.length && "LIT",
        seen.headlight && "HEADLIGHT", part.has.color && "COLORS",
        !part.has.color && part.has.coordinate && "COORDINATES",
        kind === "faces" && part.has.place && "PLACES", part.has.edges && "EDGES",
        { faces: 0, lines: "LINES", wires: "WIRES", points: "POINTS" }[kind],
        stripes && material.tubes && "TUBES", shape.nearer && kind === "faces" && "NEARER",
        kind === "points" && material.spheres && "SPHERES"].filter(Boolean);
      const { program, uniforms: u } = this.#program(
        meshVertexShader(defines), meshFragmentShader(defines));
      gl.useProgram(program);
      gl.uniformMatrix3fv(u.linear, true, near.linear.flat());
      gl.uniformMatrix3fv(u.normals, true, near.normals.flat());
      gl.uniform3fv(u.offset, near.offset);
      gl.uniform4fv(u.lens, seen.lens);
      gl.uniform2fv(u.range, seen.range);
      gl.uniform2f(u.size, ...seen.size);
      gl.uniform1i(u.parallel, seen.parallel);
      const width = (kind === "points" ? material.pointSize : material.lineWidth) * seen.density;
      gl.uniform1f(u.width, Math.max(width, 1));
      gl.uniform1f(u.nearer ?? null, shape.nearer ?? 0);
      if (shape.planes.length) gl.uniform4fv(u.planes, near.planes);
      if (!pass.includes("DEPTH")) {
        const sides = [material, back];
        const colors = (name) => sides.flatMap((m) => m[`${name}Color`].map((c) => c * m[name]));
        gl.uniform3fv(u.ambient, colors("ambient"));
        gl.uniform3fv(u.diffuse, colors("diffuse"));
        gl.uniform3fv(u.specular, colors("specular"));
        gl.uniform2fv(u.strength, sides.flatMap((m) => [m.ambient, m.diffuse]));
        gl.uniform2fv(u.shine, sides.flatMap((m) => [m.power, m.opacity]));
        gl.uniform4fv(u.edgeColor, material.edge);
        gl.uniform1f(u.edgeWidth, material.edgeWidth * seen.density);
        seen.setLights(gl, u);
        [["table", shape.table], ["image", shape.texture]].forEach(([name, map], unit) => {
          gl.activeTexture(gl.TEXTURE0 + unit);
          gl.bindTexture(gl.TEXTURE_2D, map?.drawn ?? null);
          gl.uniform1i(u[name], unit);
        });
      }
      const { array, mode, count, indexed } = part.drawn;
      gl.bindVertexArray(array);
      if (indexed) gl.drawElements(gl[mode], count, gl.UNSIGNED_INT, 0);
      else gl.drawArrays(gl[mode], 0, count);
    }
  }

  // -- texts -------------------------------------------------------------------------------------

  /** Draw texts and scalar bars into a canvas, made as large as the picture. */
  annotate(canvas, camera, [width, height]) {
    const { texts, size } = this.head ?? { texts: [], size: [1, 1] };
    const extent = [width, height];
    const key = JSON.stringify([extent, texts.some(({ at }) => at) && camera]);
    if (this.#annotated.get(canvas) === key) return;
    this.#annotated.set(canvas, key);
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = extent;
    annotate(canvas.getContext("2d"), texts, size, ({ at, renderer }) => {
      const other = this.#others[renderer];
      if (!other) return projected(at, camera, extent);
      const [x0, y0, x1, y1] = other.place;
      const [x, y] = projected(at, cameraOf(other, camera), [(x1 - x0) * width, (y1 - y0) * height]);
      return [x0 + x * (x1 - x0), y0 + y * (y1 - y0)];
    });
  }

  /** Lay texts over the bound framebuffer, for a picture. */
  paintTexts(camera, width, height) {
    const gl = this.#gl;
    if (!this.head?.texts.length) return;
    const canvas = new OffscreenCanvas(width, height);
    this.annotate(canvas, camera, [width, height]);
    const picture = gl.createTexture();
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, picture);
    gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, true);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, canvas);
    gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, false);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.viewport(0, 0, width, height);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    this.#cover(PICTURE_SHADER, { picture });
    gl.disable(gl.BLEND);
    gl.deleteTexture(picture);
  }

  #cover(fragment, textures, more = {}) {
    const { corner = [0, 0], cornerBehind = corner, pictured = false, height = 1 } = more;
    const gl = this.#gl;
    const { program, uniforms } = this.#program(VERTEX_SHADER, fragment);
    gl.useProgram(program);
    gl.uniform2i(uniforms.corner, ...corner);
    gl.uniform2i(uniforms.cornerBehind ?? null, ...cornerBehind);
    gl.uniform1i(uniforms.pictured ?? null, pictured);
    gl.uniform1f(uniforms.height ?? null, height);
    gl.uniform3fv(uniforms.ground ?? null, this.head.ground.flat());
    Object.entries(textures).forEach(([name, texture], unit) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.uniform1i(uniforms[name], unit);
    });
    gl.bindVertexArray(this.#vertices);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.bindVertexArray(null);
    gl.activeTexture(gl.TEXTURE0);
  }

  #program(vertex, fragment) {
    const gl = this.#gl, key = vertex + fragment;
    if (!this.#programs.has(key)) {
      const program = linked(gl, vertex, fragment, PLACES), uniforms = {};
      for (let k = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); k-- > 0; ) {
        const { name } = gl.getActiveUniform(program, k);
        uniforms[name.replace("[0]", "")] = gl.getUniformLocation(program, name);
      }
      this.#programs.set(key, { program, uniforms });
    }
    return this.#programs.get(key);
  }

  // Framebuffers as large as the target's: depth, colours by samples, those resolved, layers.
  #sized(width, height, withLayers) {
    const gl = this.#gl, known = this.#buffers;
    if (known?.width === width && known.height === height) return known;
    this.#free();
    const made = { width, height };
    const framebuffer = (...attachments) => {
      const id = gl.createFramebuffer();
      gl.bindFramebuffer(gl.FRAMEBUFFER, id);
      for (const [place, kind, what] of attachments) {
        if (kind === "texture") {
          gl.framebufferTexture2D(gl.FRAMEBUFFER, gl[place], gl.TEXTURE_2D, what, 0);
        } else gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl[place], gl.RENDERBUFFER, what);
      }
      return id;
    };
    const texture = (format, [wide, high] = [width, height]) => {
      const id = gl.createTexture();
      gl.bindTexture(gl.TEXTURE_2D, id);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
      gl.texStorage2D(gl.TEXTURE_2D, 1, gl[format], wide, high);
      return id;
    };
    const renderbuffer = (format, samples, [wide, high] = [width, height]) => {
      const id = gl.createRenderbuffer();
      gl.bindRenderbuffer(gl.RENDERBUFFER, id);
      gl.renderbufferStorageMultisample(gl.RENDERBUFFER, samples, gl[format], wide, high);
      return id;
    };
    gl.activeTexture(gl.TEXTURE0);
    const samples = Math.min(SAMPLES, gl.getParameter(gl.MAX_SAMPLES));
    const depths = renderbuffer("DEPTH_COMPONENT24", 0), far = texture("R32F");
    const many = [renderbuffer("SRGB8_ALPHA8", samples), renderbuffer("DEPTH_COMPONENT24", samples)];
    const color = texture("SRGB8_ALPHA8");
    made.depth = { texture: far, renderbuffers: [depths], framebuffer: framebuffer(
      ["COLOR_ATTACHMENT0", "texture", far], ["DEPTH_ATTACHMENT", "buffer", depths]) };
    made.samples = { renderbuffers: many, framebuffer: framebuffer(
      ["COLOR_ATTACHMENT0", "buffer", many[0]], ["DEPTH_ATTACHMENT", "buffer", many[1]]) };
    made.color = { texture: color, framebuffer: framebuffer(["COLOR_ATTACHMENT0", "texture", color]) };
    // Buffers of their own: ANGLE clears before it resolves what was drawn there earlier
    made.others = this.#others.map((other) => {
      const size = partOf(other, made).slice(2), format = isMixed(other) ? "RGBA8" : "SRGB8_ALPHA8";
      const picture = texture(format, size);
      const own = [format, "DEPTH_COMPONENT24"].map((f) => renderbuffer(f, samples, size));
      return {
        samples: { renderbuffers: own, framebuffer: framebuffer(
          ["COLOR_ATTACHMENT0", "buffer", own[0]], ["DEPTH_ATTACHMENT", "buffer", own[1]]) },
        picture: { texture: picture,
          framebuffer: framebuffer(["COLOR_ATTACHMENT0", "texture", picture]) },
      };
    });
    if (withLayers) {
      const sums = texture("R16F"), layers = texture("RGBA16F");
      made.layers = { texture: layers, sums, framebuffer: framebuffer(
        ["COLOR_ATTACHMENT0", "texture", layers], ["COLOR_ATTACHMENT1", "texture", sums],
        ["DEPTH_ATTACHMENT", "buffer", depths]) };
    }
    this.#buffers = made;
    return made;
  }

  #free() {
    const gl = this.#gl;
    const { others = [], ...rest } = this.#buffers ?? {};
    for (const part of [rest, ...others].flatMap(Object.values)) {
      const { framebuffer, texture, sums, renderbuffers = [] } = part; // a width has none of them
      gl.deleteFramebuffer(framebuffer ?? null);
      gl.deleteTexture(texture ?? null);
      gl.deleteTexture(sums ?? null);
      renderbuffers.forEach((buffer) => gl.deleteRenderbuffer(buffer));
    }
    this.#buffers = this.#drawn = null;
  }
}

const matrixOf = ({ matrix }) => matrix;

// -- from bytes to arrays ------------------------------------------------------------------------

// The head and the arrays of a packed scene: deflated, bytes of each array in planes.
async function unpackedScene(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  let buffer, length, head;
  try {
    buffer = await new Response(stream).arrayBuffer();
    length = new DataView(buffer).getUint32(0, true);
    head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  } catch {
    throw new VDIFileError("the scene beside the VDI is damaged: load it again, or export it anew");
  }
  const kinds = { Float32Array, Int16Array, Uint8Array, Uint32Array };
  const arrays = head.arrays.map(([name, at, count]) => {
    const Kind = kinds[name], width = Kind.BYTES_PER_ELEMENT;
    const planes = new Uint8Array(buffer, 4 + length + at, count * width);
    if (width === 1) return planes;
    const joined = new Uint8Array(count * width);
    for (let plane = 0, from = 0; plane < width; ++plane) {
      for (let to = plane; to < joined.length; to += width) joined[to] = planes[from++];
    }
    return new Kind(joined.buffer);
  });
  return { head, arrays };
}

// Attributes: their names in the shader, sizes, and how they are read.
const ATTRIBUTES = {
  position: [3, "FLOAT"], normal: [3, "SHORT"], color: [4, "UNSIGNED_BYTE"],
  coordinate: [2, "FLOAT"], place: [2, "FLOAT"], edges: [1, "UNSIGNED_BYTE"], other: [3, "FLOAT"],
};
const PLACES = Object.keys(ATTRIBUTES);

// Pick rows of an array.
function rows(array, size, order) {
  const picked = new array.constructor(order.length * size);
  for (let k = 0, to = 0; k < order.length; ++k) {
    for (let c = 0, from = order[k] * size; c < size; ++c) picked[to++] = array[from++];
  }
  return picked;
}

// The vertices of each part of a shape. What belongs to cells takes vertices of the cell's own.
function partsOf(shape, arrays) {
  const ofPoints = { position: shape.points, normal: shape.normals, color: shape.colors,
    coordinate: shape.coordinates, place: shape.places };
  return shape.parts.map(({ kind, points, colors, edges, lit }) => {
    const indices = arrays[points];
    const pick = (order) => Object.fromEntries(Object.entries(ofPoints)
      .filter(([, number]) => number !== undefined)
      .map(([name, number]) => [name, rows(arrays[number], ATTRIBUTES[name][0], order)]));
    const spread = (array, size, each) =>
      rows(array, size, Uint32Array.from({ length: each * (array.length / size) },
        (_, k) => Math.floor(k / each)));
    let attributes, elements = null;
    if (kind === "lines" || kind === "wires") {
      const count = indices.length / 2; // segments; each is a stripe of four vertices
      const corner = (end) => Uint32Array.from({ length: 4 * count },
        (_, k) => indices[2 * (k >> 2) + ((k >> 1 & 1) ^ end)]);
      attributes = pick(corner(0));
      attributes.other = rows(arrays[shape.points], 3, corner(1));
      elements = Uint32Array.from({ length: 6 * count },
        (_, k) => 4 * Math.floor(k / 6) + [0, 1, 2, 2, 1, 3][k % 6]);
      if (colors !== undefined) attributes.color = spread(arrays[colors], 4, 4);
    } else if (kind === "points" || colors !== undefined || edges !== undefined) {
      attributes = pick(indices);
      const each = kind === "points" ? 1 : 3;
      if (colors !== undefined) attributes.color = spread(arrays[colors], 4, each);
      if (edges !== undefined) attributes.edges = spread(arrays[edges], 1, each);
    } else {
      attributes = Object.fromEntries(Object.entries(ofPoints)
        .filter(([, number]) => number !== undefined).map(([name, number]) => [name, arrays[number]]));
      elements = indices;
    }
    return { kind, lit, attributes, elements, has: attributes };
  });
}

function uploaded(gl, { kind, attributes, elements }) {
  const array = gl.createVertexArray(), buffers = [];
  gl.bindVertexArray(array);
  const upload = (kindOf, data) => {
    buffers.push(gl.createBuffer());
    gl.bindBuffer(kindOf, buffers.at(-1));
    gl.bufferData(kindOf, data, gl.STATIC_DRAW);
  };
  for (const [name, data] of Object.entries(attributes)) {
    const place = PLACES.indexOf(name), [size, type] = ATTRIBUTES[name];
    upload(gl.ARRAY_BUFFER, data);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, size, gl[type], name === "color" || name === "normal", 0, 0);
  }
  if (elements) upload(gl.ELEMENT_ARRAY_BUFFER, elements);
  gl.bindVertexArray(null);
  return { array, buffers, mode: kind === "points" ? "POINTS" : "TRIANGLES",
    indexed: Boolean(elements), count: elements?.length ?? attributes.position.length / 3 };
}

function mapTexture(gl, { size, data, repeat = false, smooth = false }) {
  const texture = gl.createTexture();
  gl.activeTexture(gl.TEXTURE0);
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, ...size, 0, gl.RGBA, gl.UNSIGNED_BYTE, data);
  for (const [name, value] of [["MIN_FILTER", smooth ? "LINEAR" : "NEAREST"],
    ["MAG_FILTER", smooth ? "LINEAR" : "NEAREST"], ["WRAP_S", repeat ? "REPEAT" : "CLAMP_TO_EDGE"],
    ["WRAP_T", repeat ? "REPEAT" : "CLAMP_TO_EDGE"]]) {
    gl.texParameteri(gl.TEXTURE_2D, gl[`TEXTURE_${name}`], gl[value]);
  }
  return texture;
}

// -- a view, in float64 --------------------------------------------------------------------------

// What all shapes need of a view: axes, lens, the depths that are told apart, lights.
function viewOf({ camera, width, height, density }, { bounds, lights }) {
  const axes = cameraAxes(camera), parallel = isParallel(camera);
  axes[2] = axes[2].map((x) => -x); // VTK's z is to the viewer
  const [near, far] = clippingRange(camera, bounds, axes[2]);
  const slope = (far + near) / (far - near);
  const shed = lights.slice(0, MOST_LIGHTS).map((light) => lightIn(light, camera, axes));
  const { kind, positional } = lights[0] ?? {};
  return {
    axes, parallel, eye: camera.position, density, size: [width, height],
    lens: [...halfExtent(camera, [width, height]), ...(camera.window_center ?? [0, 0])],
    range: parallel ? [2 / (far - near), -slope] : [slope, -2 * far * near / (far - near)],
    lights: shed,
    headlight: lights.length === 1 && kind === "head" && !positional,
    setLights(gl, u) {
      if (!shed.length) return;
      const padded = (name) => Array.from({ length: MOST_LIGHTS },
        (_, k) => (shed[k] ?? shed[0])[name]).flat();
      gl.uniform1i(u.lights ?? null, shed.length);
      gl.uniform3fv(u.lightColor ?? null, padded("color"));
      gl.uniform3fv(u.lightDirection ?? null, padded("direction"));
      gl.uniform3fv(u.lightPosition ?? null, padded("position"));
      gl.uniform4fv(u.lightShape ?? null, padded("shape"));
      gl.uniform3fv(u.lightFading ?? null, padded("fading"));
    },
  };
}

// vtkRenderer::ResetCameraClippingRange
function clippingRange(camera, bounds, back) {
  const box = bounds ?? [-1, 1, -1, 1, -1, 1];
  const depths = Array.from({ length: 8 }, (_, k) => -dot(back,
    subtract([box[k & 1], box[2 + (k >> 1 & 1)], box[4 + (k >> 2)]], camera.position)));
  let near = Math.min(...depths), far = Math.max(...depths, 1e-18);
  const parallel = isParallel(camera);
  const least = parallel ? 0.1 * camera.parallel_scale
    : 0.2 * Math.tan((camera.view_angle * Math.PI) / 360) * far;
  const missing = Math.max(0, least - (far - near));
  near -= missing / 2;
  far += missing / 2;
  if (!parallel) near = Math.max(near, 0);
  const room = 0.5 * (far - near);
  [near, far] = [0.99 * near - room, 1.01 * far + room];
  if (near >= far) near = 0.01 * far;
  return [parallel ? near : Math.max(near, 0.001 * far), far];
}

// A light in view coordinates. Those of the camera are told where it is at (0, 0, 1).
function lightIn(light, camera, axes) {
  const { kind, positional, cone, exponent, color, attenuation } = light;
  let ends = [light.position, light.focalPoint];
  if (kind === "scene") {
    ends = ends.map((p) => axes.map((axis) => dot(axis, subtract(p, camera.position))));
  } else {
    const distance = Math.hypot(...subtract(camera.focal_point, camera.position));
    ends = ends.map(([x, y, z]) => [x * distance, y * distance, (z - 1) * distance]);
  }
  const towards = subtract(ends[1], ends[0]), length = Math.hypot(...towards) || 1;
  return { color, position: ends[0], direction: times(towards, 1 / length),
    shape: [Number(positional), cone, exponent, 0], fading: attenuation };
}

// Where a point of the world is seen: parts of the window, and depth; null if behind the eye.
function projected(point, camera, extent) {
  const from = subtract(point, camera.position), half = halfExtent(camera, extent);
  const [cx, cy] = camera.window_center ?? [0, 0];
  const [x, y, z] = cameraAxes(camera).map((axis) => dot(axis, from));
  const w = isParallel(camera) ? 1 : z;
  return w > 0 ? [(x / half[0] / w - cx + 1) / 2, (y / half[1] / w - cy + 1) / 2, z] : null;
}

// Whether colours are mixed in what another renderer draws, which they are as they are coded.
const isMixed = ({ shapes }) => shapes.some(({ translucent }) => translucent);

// The view of another renderer: turned as the scene's is, or as it was.
function cameraOf({ turns, camera: { distance, ...own } }, camera) {
  if (!turns) return own;
  const [, up, forward] = cameraAxes(camera);
  const position = own.focal_point.map((x, k) => x - distance * forward[k]);
  return { ...own, position, view_up: up };
}

// Where another renderer draws in a picture: left, bottom, width, height. What is of so many pixels
// of its window grows with the picture, about its middle.
function partOf({ place: [x0, y0, x1, y1], window: of }, { width, height }) {
  if (of) {
    const scale = Math.min(width / of[0], height / of[1]);
    const end = (low, high, n, from, side) =>
      (low + high) / 2 + (side * (high - low) * from * scale) / 2 / n;
    [x0, x1] = [-1, 1].map((side) => end(x0, x1, width, of[0], side));
    [y0, y1] = [-1, 1].map((side) => end(y0, y1, height, of[1], side));
  }
  const [left, bottom] = [Math.round(x0 * width), Math.round(y0 * height)];
  return [left, bottom, Math.max(1, Math.round(x1 * width) - left),
    Math.max(1, Math.round(y1 * height) - bottom)];
}

// From a shape's points, which are about its origin, to view coordinates.
function toView({ matrix, origin, planes, facing = false }, { axes, eye }) {
  const rotation = matrix.slice(0, 3).map((row) => row.slice(0, 3));
  const columns = [0, 1, 2].map((k) => rotation.map((row) => row[k]));
  const place = matrix.slice(0, 3).map((row) => row[3]);
  const placed = facing ? place : place.map((x, k) => x + dot(rotation[k], origin));
  // What faces the viewer is not turned about its place
  const linear = facing ? columns
    : axes.map((axis) => columns.map((column) => dot(axis, column)));
  const [a, b, c] = linear;
  const cofactors = [cross(b, c), cross(c, a), cross(a, b)];
  const sense = Math.sign(dot(a, cofactors[0])) || 1;
  return {
    linear, offset: axes.map((axis, k) => dot(axis, subtract(placed, eye)) + facing * origin[k]),
    normals: cofactors.map((row) => row.map((x) => sense * x)),
    planes: Array.from({ length: 6 }, (_, k) => {
      if (!planes[k]) return [0, 0, 0, 1];
      const from = planes[k].slice(0, 3), normal = planes[k].slice(3);
      return [...columns.map((column) => dot(normal, column)),
        dot(normal, subtract(placed, from))];
    }).flat(),
  };
}

// -- in a page -----------------------------------------------------------------------------------

/** The scene that a page holds for a viewer; null if there is none. */
export function embeddedScene(viewer) {
  const script = viewer.querySelector(':scope > script[type="application/vdi-scene+base64"]');
  if (!script) return null;
  return new Scene(Uint8Array.from(atob(script.textContent), (c) => c.charCodeAt(0)));
}

/** Have the views with the same `data-link` turn with one, as those of a plotter do. */
export function turnTogether(viewer) {
  viewer.addEventListener("camerachange", ({ detail }) => {
    const text = JSON.stringify(detail.camera);
    for (const other of document.querySelectorAll(`[data-link="${viewer.dataset.link}"]`)) {
      if (JSON.stringify(other.camera) !== text) other.camera = detail.camera;
    }
  });
}

function takeEmbedded() {
  for (const viewer of document.querySelectorAll("vdi-viewer")) {
    const scene = viewer.scene ? null : embeddedScene(viewer);
    if (!scene) continue;
    viewer.scene = scene;
    if (viewer.dataset.link) turnTogether(viewer);
  }
}

takeEmbedded();
document.addEventListener("DOMContentLoaded", takeEmbedded);
