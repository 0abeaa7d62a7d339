// Keeps a frame rate: frames with fewer pixels while a view moves, full ones in bands.

/** Seconds that a frame of a movement may take. */
const FRAME_SECONDS = 1 / 30;
/** Seconds of a band of a full frame: what a new movement waits for, at most. */
const BAND_SECONDS = 1 / 20;
/** Least share of the pixels: a quarter along each edge. */
const LEAST_SHARE = 1 / 16;
/** Shares of the pixels below which frames take every second list, and above which all again. */
const FEW_BELOW = 0.25, FEW_ABOVE = 0.45;
/** Time of a frame of every second list over one of all (docs/decisions/any_view.md). */
const FEW_COST = 0.8;
/** Share of a frame by which its size may miss the goal before it is changed. */
const DEAD_BAND = 0.25;
/** How many times as high as the band before a band may be. */
const MOST_GROWTH = 4;
/** A pixel's time above so many times that of the frame before held something else: compiling. */
const STALE = 2;

/** Targets to draw into, and how many pixels they can have. */
export class Pacer {
  #perPixel = null; // seconds, by the frames before
  #few = false; // whether those had every second list
  #screen = null;

  /** @param {WebGL2RenderingContext} gl */
  constructor(gl) {
    this.gl = gl;
    this.share = 1; // of the pixels, in the frame before
  }

  /**
   * Whether the next frame is to have every second list.
   *
   * @param {boolean} worth Whether they would cost less: in a movement, in a view from the side.
   */
  few(worth, width, height) {
    const share = FRAME_SECONDS / (this.#perPixel * width * height);
    const few = worth && this.#perPixel !== null && share < (this.#few ? FEW_ABOVE : FEW_BELOW);
    if (few !== this.#few) this.#perPixel *= few ? FEW_COST : 1 / FEW_COST;
    return (this.#few = few);
  }

  /** Pixels of the next frame of a movement in a window of width x height. */
  sizeFor(width, height) {
    const pixels = width * height;
    if (this.#perPixel === null) { // unknown yet: whatever the machine, soon
      this.share = LEAST_SHARE;
    } else {
      const share = Math.min(Math.max(FRAME_SECONDS / (this.#perPixel * pixels), LEAST_SHARE), 1);
      if (share === 1 || Math.abs(share / this.share - 1) > DEAD_BAND) this.share = share;
    }
    const edge = Math.sqrt(this.share);
    return [Math.max(1, Math.round(width * edge)), Math.max(1, Math.round(height * edge))];
  }

  /**
   * Draw a picture band by band, and wait for each.
   *
   * @param {object} target Of {@link target}.
   * @param {function(object, boolean)} paint Draws into the target; true: for the first band.
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
      paint(target, row === 0);
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
    const { gl } = this;
    const texture = gl.createTexture(), framebuffer = gl.createFramebuffer();
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA8, width, height);
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
