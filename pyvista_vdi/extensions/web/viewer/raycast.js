// A VDI in WebGL 2: textures of its lists, and a fragment shader that casts a ray for each pixel.
import { filledTexture, programOf } from "./graphics.js";
import { AS_MADE } from "./look.js";
import { TEXTURE_WIDTH } from "./prepare.js";
import { frameForms, frameOf, isParallel, pixelRays, pixelsOfBoxes } from "./rays.js";
import { VERTEX_SHADER, fragmentShader } from "./shader.js";
import { MEAN_STEPS, SPREADS, fillTable } from "./values.js";

/** A ray ends where less transmittance than this is left. */
const TRANSMITTANCE_CUTOFF = 1e-6;
/** Rows of pixels that are drawn at once. */
const STRIP = 16;

/** Draws prepared VDIs from any view into the bound framebuffer. */
export class Raycaster {
  /** @param {WebGL2RenderingContext} gl */
  constructor(gl) {
    this.gl = gl;
    this.vdi = null;
    this.vertices = gl.createVertexArray();
  }

  /** Take what prepare.js made of a VDI; the one before is freed when its textures are there. */
  set(prepared) {
    const { gl } = this, { n, windowSize, packed, stacks } = prepared;
    const largest = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    const most = Math.max(Math.ceil(n / TEXTURE_WIDTH), ...windowSize);
    if (Math.max(most, TEXTURE_WIDTH) > largest) {
      throw new Error(`The VDI has ${n} supersegments in ${windowSize.join(" x ")} lists, ` +
        `which take textures of up to ${most} texels along an edge; this browser's ` +
        `MAX_TEXTURE_SIZE is ${largest}: make it with fewer lists.`);
    }
    const [ofLists, ofFaces] = packed ? ["RGBA32UI", "RG32UI"] : ["RG32UI", "RG32F"];
    const textures = {
      lists: filledTexture(gl, ofLists, windowSize[0], prepared.lists),
      masks: filledTexture(gl, "RG32UI", stacks[0], prepared.masks),
      faces: filledTexture(gl, ofFaces, TEXTURE_WIDTH, prepared.faces),
    };
    if (!packed) textures.media = filledTexture(gl, "RGBA32F", TEXTURE_WIDTH, prepared.media);
    const table = prepared.values ? new Float32Array(4 * (MEAN_STEPS + 1) * SPREADS) : null;
    if (table) textures.table = filledTexture(gl, "RGBA32F", MEAN_STEPS + 1, table);
    if (gl.getError() === gl.OUT_OF_MEMORY) {
      Object.values(textures).forEach((texture) => gl.deleteTexture(texture));
      throw new Error(`The graphics memory cannot hold ${n} supersegments.`);
    }
    this.free();
    this.vdi = { ...prepared, textures, table, lists: null, masks: null, faces: null, media: null };
    this.transfer = undefined; // what the table is of
  }

  // Have the table that of a transfer function, null: of the one that the file starts with.
  classify(transfer) {
    if (transfer === this.transfer) return;
    const { gl, vdi } = this;
    fillTable(vdi, transfer, vdi.table);
    gl.bindTexture(gl.TEXTURE_2D, vdi.textures.table);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, MEAN_STEPS + 1, SPREADS, gl.RGBA, gl.FLOAT, vdi.table);
    this.transfer = transfer;
  }

  /**
   * Draw premultiplied RGBA into the bound framebuffer, by its blending; bottom row first. A
   * scissor that is set holds.
   *
   * Of the view the `camera` is VTK's, in world units, with a `model_transform` where the model lies
   * elsewhere than it did for the VDI; the viewport is set to `width` and `height`, pixels.
   * `clippingPlanes`, world, keep the side of their normals; rays end at a `depthTexture`, R32F, view
   * depths of what is opaque in world units.
   */
  draw({ camera, width, height, clippingPlanes = [], depthTexture = null, look = AS_MADE }) {
    const { gl, vdi } = this;
    if (!vdi) return;
    if (vdi.values) this.classify(look.transfer ?? null);
    const { bounds, space, windowSize } = vdi;
    const frame = camera.model_transform ? frameOf({ bounds, camera }) : vdi.frame;
    const rays = pixelRays(frame, camera, [width, height]);
    const { coordinates, planes } = frameForms(frame, space, windowSize, rays, isParallel(camera),
      clippingPlanes, look.clip);
    const defines = [vdi.packed && "PACKED", depthTexture && "OPAQUE", vdi.values && "VALUES"];
    const shader = fragmentShader(defines.filter(Boolean), planes.length);
    const { program, uniforms: u } = programOf(gl, VERTEX_SHADER, shader);
    gl.useProgram(program);
    gl.viewport(0, 0, width, height);
    const halves = (forms) => [0, 3].map((k) => forms.flatMap((form) => form.slice(k, k + 3)));
    const [formValue, formSlope] = halves(coordinates), [planeValue, planeSlope] = halves(planes);
    const vectors = { formValue, formSlope, planeValue, planeSlope };
    for (const [name, value] of Object.entries(vectors)) gl.uniform3fv(u[name], value);
    const scalars = {
      firstDepth: vdi.firstDepth, slabsPerDepth: vdi.slabsPerDepth, cutoff: TRANSMITTANCE_CUTOFF,
      brightness: look.brightness, thickness: look.opacity, codeStep: vdi.step,
      nearest: space.nearest, worldScale: frame.scale, reference: rays.reference,
    };
    for (const [name, value] of Object.entries(scalars)) gl.uniform1f(u[name], value);
    gl.uniform4fv(u.depths, space.depths);
    gl.uniform2fv(u.reciprocals, space.reciprocals);
    gl.uniform2f(u.middle, width / 2, height / 2);
    gl.uniformMatrix3fv(u.direction, false, rays.direction.flat());
    gl.uniform2i(u.window, ...windowSize);
    const bound = depthTexture ? { ...vdi.textures, opaque: depthTexture } : vdi.textures;
    Object.entries(bound).forEach(([name, texture], unit) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.uniform1i(u[name], unit);
    });
    gl.bindVertexArray(this.vertices);
    this.drawStrips(pixelsOfBoxes(frame, camera, [width, height], vdi.boxes), height);
    gl.bindVertexArray(null);
    gl.activeTexture(gl.TEXTURE0);
  }

  // Draw only where something may be seen: strip by strip, from the first to the last such pixel,
  // within the scissor that is set.
  drawStrips(boxes, height) {
    const { gl } = this;
    const set = gl.isEnabled(gl.SCISSOR_TEST) ? gl.getParameter(gl.SCISSOR_BOX) : null;
    const [firstX, firstY, wide, high] = set ?? [0, 0, Infinity, height];
    gl.enable(gl.SCISSOR_TEST);
    for (let row = 0; row < height; row += STRIP) {
      const here = boxes.filter(([, [y0, y1]]) => y0 < row + STRIP && y1 > row).map(([x]) => x);
      const x0 = Math.max(Math.min(...here.map(([x]) => x)), firstX);
      const x1 = Math.min(Math.max(...here.map(([, x]) => x)), firstX + wide);
      const y0 = Math.max(row, firstY), y1 = Math.min(row + STRIP, height, firstY + high);
      if (!here.length || x0 >= x1 || y0 >= y1) continue;
      gl.scissor(x0, y0, x1 - x0, y1 - y0);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
    }
    if (set) gl.scissor(...set);
    else gl.disable(gl.SCISSOR_TEST);
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
