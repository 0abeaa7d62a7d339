// Keeps a frame rate: frames with fewer pixels while a view moves, full ones in bands.
import { emptyTexture } from "./graphics.js";

/** Seconds that a frame of a movement may take. */
const FRAME_SECONDS = 1 / 30;
/** Seconds of a band of a full frame: what a new movement waits for, at most. */
const BAND_SECONDS = 1 / 20;
/** Least share of the pixels: a quarter along each edge. */
const LEAST_SHARE = 1 / 16;
/** Share of a frame by which its size may miss the goal before it is changed. */
const DEAD_BAND = 0.25;
/** How many times as high as the band before a band may be. */
const MOST_GROWTH = 4;
/** A pixel's time above so many times that of the frame before held something else: compiling. */
const STALE = 2;

/** Targets to draw into, and how many pixels they can have. */
export class Pacer {
  #perPixel = null; // seconds, by the frames before
  #screen = null;

  /** @param {WebGL2RenderingContext} gl */
  constructor(gl) {
    this.gl = gl;
    this.share = 1; // of the pixels, in the frame before
  }

  /** Pixels of the next frame of a movement in a window of width x height. */
  sizeFor(width, height) {
    if (this.#perPixel === null) { // unknown yet: whatever the machine, soon
      this.share = LEAST_SHARE;
    } else {
      const wanted = FRAME_SECONDS / (this.#perPixel * width * height);
      const share = Math.min(Math.max(wanted, LEAST_SHARE), 1);
      if (share === 1 || Math.abs(share / this.share - 1) > DEAD_BAND) this.share = share;
    }
    const edge = Math.sqrt(this.share);
    return [Math.max(1, Math.round(width * edge)), Math.max(1, Math.round(height * edge))];
  }

  /**
   * Draw a picture band by band, and wait for each.
   *
   * @param {object} target Of {@link target}.
   * @param {function(object)} paint Draws into the target.
   * @param {function(): boolean} [goesOn] Asked between bands.
   * @returns {Promise<boolean>} Whether it was finished.
   */
  async inBands(target, width, height, paint, goesOn = () => true) {
    const { gl } = this;
    let rows = this.#perPixel === null ? height : BAND_SECONDS / (this.#perPixel * width);
    let seconds = 0;
    for (let row = 0, high; row < height; row += high) {
      if (gl.isContextLost() || (row > 0 && !goesOn())) return false;
      high = Math.min(Math.max(1, Math.floor(rows)), height - row);
      const began = performance.now();
      gl.bindFramebuffer(gl.FRAMEBUFFER, target.framebuffer);
      gl.enable(gl.SCISSOR_TEST);
      gl.scissor(0, row, width, high);
      gl.clearColor(0, 0, 0, 0);
      gl.clear(gl.COLOR_BUFFER_BIT);
      paint(target);
      gl.disable(gl.SCISSOR_TEST);
      await finished(gl);
      const took = (performance.now() - began) / 1000;
      seconds += took;
      // By this band's time: the frame before may have waited for a compiler
      rows = high * Math.min(BAND_SECONDS / took, MOST_GROWTH);
    }
    const perPixel = seconds / (width * height), before = this.#perPixel ?? Infinity;
    this.#perPixel = before > STALE * perPixel ? perPixel : 0.5 * (before + perPixel);
    return true;
  }

  /** A target of some pixels: RGBA, 8 bits. */
  target(width, height) {
    const { gl } = this, texture = emptyTexture(gl, "RGBA8", width, height);
    const framebuffer = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
    return { texture, framebuffer, width, height };
  }

  /** The target of the frames of a window, made anew when its size changes. */
  screen(width, height) {
    if (this.#screen?.width !== width || this.#screen.height !== height) {
      this.free(this.#screen);
      this.#screen = this.target(width, height);
    }
    return this.#screen;
  }

  free(target) {
    if (!target) return;
    this.gl.deleteFramebuffer(target.framebuffer);
    this.gl.deleteTexture(target.texture);
  }

  dispose() {
    this.free(this.#screen);
    this.#screen = null;
  }
}

// Wait until the device has done what it was told, without holding up the page.
async function finished(gl) {
  const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
  gl.flush();
  for (;;) {
    await new Promise((resolve) => setTimeout(resolve, 1));
    const state = gl.isContextLost() ? gl.WAIT_FAILED : gl.clientWaitSync(fence, 0, 0);
    if (state !== gl.TIMEOUT_EXPIRED) break;
  }
  gl.deleteSync(fence);
}
