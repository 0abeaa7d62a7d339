// What a viewer shows, and the loop that draws it: with few pixels while it moves, with all at rest.
import { fitted } from "./camera.js";
import { leaveGraphics, showPicture, takeGraphics } from "./graphics.js";
import { AS_MADE } from "./look.js";
import { Pacer } from "./pacer.js";
import { Raycaster } from "./raycast.js";

/** Milliseconds after the last movement from which a view rests, and is drawn with all pixels. */
const REST = 150;
/** Milliseconds after which what is not drawn is drawn with other graphics than those lost. */
const LOST = 250;

/** Draws what a viewer shows; its fields are the state, of which `invalidate` draws what changed. */
export class Renderer {
  /** What is looked at, and how: null before there is a view, a VDI or a scene. */
  camera = null;
  prepared = null;
  scene = null;
  look = AS_MADE;
  clippingPlanes = [];
  /** Width over height of what is to be seen whole; 0 for all that the window shows. */
  aspect = 0;
  /** Width and height of the picture at rest, pixels. */
  size = [1, 1];

  #viewer;
  #canvas;
  #picture; // its context
  #over; // a canvas over it
  #host;
  #gl = null;
  #raycaster = null; // without one there is but the last picture
  #pacer = null;
  #taken = null; // what the raycaster was given
  #moved = -Infinity;
  #drawing = false;
  #asked = false;
  #wake = () => {};

  /**
   * What draws into a viewer's canvas, and a scene's texts into the one over it. Of the host
   * `drawn(full, latest)` is called after a frame: whether with all pixels, and of what is to be shown
   * by now; `failed(error)`.
   */
  constructor(viewer, { canvas, over }, host) {
    [this.#viewer, this.#canvas, this.#over, this.#host] = [viewer, canvas, over, host];
    this.#picture = canvas.getContext("2d");
  }

  /** Share of the pixels in the last frame of a movement. */
  get pixels() {
    return this.#pacer?.share ?? 1;
  }

  /** Whether the next frame has another VDI than the one before. */
  get pending() {
    return this.prepared !== this.#taken;
  }

  // -- graphics ----------------------------------------------------------------------------------

  /** Take part in the page's graphics: at first, and after it was lost or given back. */
  begin() {
    if (this.#raycaster && !this.#gl.isContextLost()) return true;
    this.#gl = takeGraphics(this);
    if (!this.#gl) return false;
    this.#raycaster = new Raycaster(this.#gl);
    this.#pacer = new Pacer(this.#gl);
    this.#taken = null;
    this.resize();
    return true;
  }

  /** Give back what is in the graphics' memory; the canvas keeps its picture. */
  release() {
    this.#raycaster?.dispose();
    this.#pacer?.dispose();
    this.scene?.dispose();
    this.#raycaster = this.#pacer = null;
  }

  /** Give it back for good. */
  end() {
    this.release();
    leaveGraphics(this);
  }

  /** What is drawn stays; what is not yet is drawn with other graphics. */
  lost() {
    this.release();
    if (this.#drawing || this.#asked) setTimeout(() => this.invalidate(false), LOST);
  }

  /** Take the size that the viewer has on this screen. */
  resize() {
    const density = window.devicePixelRatio || 1, { clientWidth, clientHeight } = this.#canvas;
    const size = [clientWidth, clientHeight].map((edge) => Math.max(1, Math.round(edge * density)));
    if (this.size.every((edge, k) => edge === size[k])) return;
    this.size = size;
    this.invalidate(); // the first picture of a new size is a quick one
  }

  /** Have the program compiled while the first lists are still being decoded: by an empty VDI. */
  warmUp(begun) {
    if (!this.#raycaster || this.prepared) return;
    this.#raycaster.set(begun);
    this.#gl.bindFramebuffer(this.#gl.FRAMEBUFFER, this.#pacer.screen(...this.size).framebuffer);
    this.#gl.enable(this.#gl.BLEND);
    this.#raycaster.draw({ camera: begun.camera, width: 1, height: 1 });
    this.#gl.disable(this.#gl.BLEND);
  }

  // -- frames ------------------------------------------------------------------------------------

  /** Draw again; after a movement with few pixels first. */
  invalidate(moves = true) {
    if (moves) this.#moved = performance.now();
    this.#asked = true;
    this.#wake();
    const something = this.camera && (this.prepared || this.scene?.head);
    if (this.#drawing || !something || !this.#viewer.isConnected) return;
    if (!this.begin() || this.#drawing) return; // which may have begun to draw with another size
    this.#drawing = true;
    requestAnimationFrame(() => this.#frames());
  }

  /** Have the view drawn with all pixels: its movement has ended. */
  rest() {
    this.#moved = -Infinity;
    this.invalidate(false);
  }

  // Frames until nothing is asked for: while the view moves with the pixels that the rate allows,
  // then all, in bands that a new movement breaks off.
  async #frames() {
    try {
      while (this.#raycaster && this.#viewer.isConnected) {
        const pacer = this.#pacer, [width, height] = this.size;
        this.#give();
        const moving = performance.now() - this.#moved < REST;
        this.#asked = false;
        const { prepared, camera, scene } = this;
        const size = moving ? pacer.sizeFor(width, height) : [width, height];
        const full = size[0] === width && size[1] === height;
        const target = pacer.screen(width, height);
        const paint = this.#painter(size, size[0] / this.#canvas.clientWidth);
        const done = await pacer.inBands(target, ...size, paint, () => !full || !this.#asked || moving);
        if (this.#gl.isContextLost()) return;
        if (pacer !== this.#pacer || !done) continue;
        showPicture(target.framebuffer, size, this.#picture);
        scene?.annotate(this.#over, this.fitted(camera, width, height), [width, height]);
        this.#host.drawn(full, prepared === this.prepared);
        if (this.#asked) continue;
        if (full) return;
        await new Promise((resolve) => { // until the view rests, or moves on
          this.#wake = resolve;
          setTimeout(resolve, Math.max(0, REST - (performance.now() - this.#moved)));
        });
      }
    } catch (error) {
      if (!this.#gl.isContextLost()) this.#host.failed(error);
      this.#asked = false;
    } finally {
      this.#drawing = false;
      if (this.#asked && this.#raycaster) this.invalidate(false);
    }
  }

  // Between two frames: what is being drawn is drawn to its end with one VDI.
  #give() {
    try {
      this.scene?.take(this.#gl);
      if (!this.pending) return;
      this.#taken = this.prepared;
      this.#raycaster.set(this.prepared);
    } catch (error) {
      this.#host.failed(error);
    }
  }

  // What draws the view into the bound target: called for each band, with the scissor set. `density`:
  // pixels of it for one of the page, which points are as wide as.
  #painter([width, height], density = 1) {
    const gl = this.#gl, raycaster = this.#raycaster, { scene, look, clippingPlanes } = this;
    const camera = this.fitted(this.camera, width, height);
    const view = { camera, width, height, density, look, clippingPlanes };
    return (target) => {
      if (scene) {
        scene.paint(raycaster, target, view);
        return;
      }
      gl.enable(gl.BLEND);
      gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
      raycaster.draw(view);
      gl.disable(gl.BLEND);
    };
  }

  /** A camera as it is drawn in a window of some pixels. */
  fitted(camera, width, height) {
    return this.aspect ? fitted(camera, this.aspect, [width, height]) : camera;
  }

  // -- pictures ------------------------------------------------------------------------------

  /** The picture at full quality: premultiplied RGBA, top row first. */
  async screenshot(width, height) {
    const require = (good) => {
      if (!good) throw new Error("A viewer whose graphics are lost, or off the page, has no picture.");
    };
    require(this.#viewer.isConnected && this.begin());
    const gl = this.#gl, pacer = this.#pacer, { scene, camera } = this;
    const largest = gl.getParameter(gl.MAX_RENDERBUFFER_SIZE);
    if (![width, height].every((edge) => Number.isInteger(edge) && edge > 0 && edge <= largest)) {
      throw new RangeError(`A screenshot is 1 to ${largest} pixels wide and high; ` +
        `got ${width} x ${height}.`);
    }
    if (!this.#drawing || !this.#taken) this.#give(); // of other graphics nothing is drawn yet
    const target = pacer.target(width, height);
    try {
      require(await pacer.inBands(target, width, height, this.#painter([width, height])));
      const data = new Uint8ClampedArray(4 * width * height), row = 4 * width;
      const upsideDown = new Uint8Array(data.length);
      gl.bindFramebuffer(gl.FRAMEBUFFER, target.framebuffer);
      gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, upsideDown);
      for (let y = 0; y < height; ++y) {
        data.set(upsideDown.subarray((height - 1 - y) * row, (height - y) * row), y * row);
      }
      scene?.layTexts(data, this.fitted(camera, width, height), [width, height]);
      return { width, height, data };
    } finally {
      pacer.free(target);
    }
  }
}
