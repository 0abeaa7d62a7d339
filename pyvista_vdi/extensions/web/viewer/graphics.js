// The WebGL 2 context that all viewers of a page draw with. Browsers keep some sixteen, and take the
// oldest from who still shows it; so each viewer shows a copy of its picture, in a canvas of its own.

let canvas = null;
let gl = null;
const viewers = new Set();

/**
 * Take part in the page's graphics.
 *
 * @param {{lost: function()}} viewer `lost` is called when all that it has made there is gone.
 * @returns {WebGL2RenderingContext|null} null where this browser has no WebGL 2.
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
 * Bring a picture to a viewer's canvas, which becomes as large as it is: a moving view has few pixels,
 * and the page makes a canvas as large as its element.
 *
 * @param {WebGLFramebuffer} framebuffer Its lower left part is the picture.
 * @param {number[]} size Width and height of that part, pixels.
 * @param {CanvasRenderingContext2D} to Of the viewer's canvas.
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
