// The WebGL 2 context that all viewers of a page draw with, and what is made in it. Browsers keep some
// sixteen contexts, and take the oldest from who still shows it; so each viewer shows a copy of its
// picture, in a canvas of its own.

let canvas = null;
let gl = null;
const viewers = new Set();

/**
 * Take part in the page's graphics: the context, or null where this browser has no WebGL 2. The
 * viewer's `lost` is called when all that it has made there is gone.
 */
export function takeGraphics(viewer) {
  if (!gl || gl.isContextLost()) {
    canvas = document.createElement("canvas");
    gl = canvas.getContext("webgl2", { antialias: false, depth: false });
    const mine = gl;
    canvas.addEventListener("webglcontextlost", () => {
      if (mine === gl) viewers.forEach((each) => each.lost());
    });
  }
  if (gl) viewers.add(viewer);
  return gl;
}

/** Take part no more; without viewers there is no context. */
export function leaveGraphics(viewer) {
  viewers.delete(viewer);
  queueMicrotask(() => { // one that was but moved is back by now
    if (viewers.size || !gl) return;
    gl.getExtension("WEBGL_lose_context")?.loseContext();
    canvas = gl = null;
  });
}

/**
 * Bring a picture, the lower left part of a framebuffer, to a viewer's canvas, which becomes as large
 * as it is: a moving view has few pixels, and the page makes a canvas as large as its element.
 */
export function showPicture(framebuffer, [width, height], to) {
  for (const each of [canvas, to.canvas]) {
    if (each.width !== width) each.width = width;
    if (each.height !== height) each.height = height;
  }
  gl.bindFramebuffer(gl.READ_FRAMEBUFFER, framebuffer);
  gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, null);
  gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.NEAREST);
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  to.globalCompositeOperation = "copy";
  to.drawImage(canvas, 0, 0);
}

/** Make an empty texture, of which texels are read as they are. */
export function emptyTexture(gl, format, width, height) {
  const texture = gl.createTexture();
  gl.activeTexture(gl.TEXTURE0);
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
  gl.texStorage2D(gl.TEXTURE_2D, 1, gl[format], width, height);
  return texture;
}

/** Make a texture of an array: floats or whole numbers of 32 bits, two or four channels. */
export function filledTexture(gl, format, width, array) {
  const channels = format.startsWith("RGBA") ? 4 : 2, height = array.length / channels / width;
  const [suffix, type] = format.endsWith("F") ? ["", gl.FLOAT] : ["_INTEGER", gl.UNSIGNED_INT];
  const texture = emptyTexture(gl, format, width, height);
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 4);
  gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, height,
    gl[(channels === 4 ? "RGBA" : "RG") + suffix], type, array);
  return texture;
}

const compiled = new WeakMap(); // context -> text of both shaders -> program

/**
 * Return a program, compiled and linked when it is first asked for: all viewers of a page share it.
 * `attributes`: the vertex shader's inputs, in the order of their places. With it come the places of
 * its uniforms by their names.
 */
export function programOf(gl, vertex, fragment, attributes = []) {
  if (!compiled.has(gl)) compiled.set(gl, new Map());
  const programs = compiled.get(gl), known = programs.get(vertex + fragment);
  if (known) return known;
  const program = gl.createProgram(), uniforms = {};
  const require = (good, words) => {
    if (!good && !gl.isContextLost()) {
      throw new Error(`This browser's graphics driver refuses a shader: ${words}`);
    }
  };
  attributes.forEach((name, place) => gl.bindAttribLocation(program, place, name));
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
    gl.deleteShader(shader);
    require(gl.getShaderParameter(shader, gl.COMPILE_STATUS), gl.getShaderInfoLog(shader));
  }
  gl.linkProgram(program);
  require(gl.getProgramParameter(program, gl.LINK_STATUS), gl.getProgramInfoLog(program));
  for (let k = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); k-- > 0; ) {
    const { name } = gl.getActiveUniform(program, k);
    uniforms[name.replace("[0]", "")] = gl.getUniformLocation(program, name);
  }
  programs.set(vertex + fragment, { program, uniforms });
  return { program, uniforms };
}
