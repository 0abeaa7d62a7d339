// <vdi-viewer src="brain.vdi">: a VDI that people turn. docs/web.md has its contract, which is that of
// one class: hence more than 500 lines.
import { checkedCamera, checkedPlane, fitted } from "./camera.js";
import { CONTROLS_STYLE, viewerControls } from "./controls.js";
import { leaveGraphics, showPicture, takeGraphics } from "./graphics.js";
import { htmlElement } from "./html.js";
import { hearKeys, interact, keyed, scrollsAround } from "./interaction.js";
import { followAddress } from "./link.js";
import { embedded, load } from "./loader.js";
import { AS_MADE, checkedLook, isAsMade } from "./look.js";
import { Pacer } from "./pacer.js";
import { Player, playerControls } from "./player.js";
import { Raycaster } from "./raycast.js";
import { frameOf, isParallel } from "./rays.js";
import { MOST_CLIPPING_PLANES } from "./shader.js";
import { Surround } from "./surround.js";
import { editedFrom, startOf, toldOf } from "./values.js";
import { dot } from "./vectors.js";

const STYLE = `
:host { display: block; position: relative; width: 100%; aspect-ratio: 16 / 9; overflow: hidden;
  background: black; print-color-adjust: exact; }
:host([hidden]) { display: none; }
canvas, img { position: absolute; width: 100%; height: 100%; inset: 0; }
canvas { touch-action: none; outline-offset: -2px; }
.over { pointer-events: none; }
.without { object-fit: contain; }
p, .hint { position: absolute; inset: auto 0 0 0; margin: 0; padding: 0.5em 1em; font: 14px sans-serif;
  color: white; background: #000a; }
.controls { position: absolute; inset: auto 0 0 0; display: flex; align-items: center; gap: 0.5em;
  padding: 2px 0.5em; font: 14px sans-serif; color: white; background: #0008; }
.controls button { min-width: 36px; min-height: 36px; padding: 0.3em; border: 0; font: inherit; color: inherit;
  background: none; cursor: pointer; }
.controls input { flex: 1; min-width: 3em; height: 36px; margin: 0; accent-color: white; }
.controls output { min-width: 3em; overflow: hidden; text-align: right; font-variant-numeric: tabular-nums; }
.controls:not([hidden]) ~ :is(p, .hint) { bottom: 40px; }
progress { position: absolute; inset: auto 0 0 0; width: 100%; height: 3px; border: 0; }
${CONTROLS_STYLE}
[hidden] { display: none !important; }
@media print { canvas { object-fit: contain; } }`;

/** Milliseconds after the last movement from which a view rests, and is drawn with all pixels. */
const REST = 150;
/** Milliseconds without a frame after which a viewer out of sight keeps its picture alone. */
const IDLE = 1000;
/** Milliseconds after which what is not drawn is drawn with other graphics than those lost. */
const LOST = 250;
/** Milliseconds between two looks at how dense the screen's pixels are. */
const DENSITY = 500;
/** Milliseconds that a hint is read in. */
const HINT = 1500;

/** What a viewer is called without a name of its own. */
const LABEL = "volume, to be turned";

/** Properties that may be set before this module has come. */
const PROPERTIES = ["src", "background", "camera", "clippingPlanes", "home", "look", "scene"];

/** The element. */
export class VDIViewer extends HTMLElement {
  static observedAttributes = ["src", "background", "still", "fit", "controls", "aria-label"];

  #parts = {};
  #holder = { lost: () => this.#lose() }; // of a part of the page's graphics
  #gl = null;
  #raycaster = null; // without one there is but the last picture
  #pacer = null;
  #prepared = null;
  #camera = null;
  #planes = [];
  #look = checkedLook(AS_MADE);
  #home = null; // a camera that was given as the first
  #linked = false; // whether the view came from the page's address
  #wantedTime = null; // of a series, from there
  #status = { state: "empty", progress: 0 };
  #ready = resolvers();
  #loading = null; // an AbortController
  #source = null; // of what is not yet loaded
  #connected = null; // another
  #moved = -Infinity;
  #drawing = false;
  #asked = false;
  #wake = () => {};
  #seen = true;
  #size = [1, 1]; // of the picture at rest, pixels
  #shownBefore = null; // bounds, until another address has given something
  #shots = 0; // pictures that are being made
  #retiring = 0; // a timer, as the next
  #hinting = 0;
  #aspect = 0; // of what is to be seen whole
  #scene = null; // what is drawn
  #coming = null; // what will be, as soon as it can
  #series = null;
  #player = null;
  #step = null; // that is drawn with the next frame
  #controls = null;
  #bar = null; // as those, but beside turning and playing
  #address = null;

  constructor() {
    super();
    const root = this.attachShadow({ mode: "open" });
    root.adoptedStyleSheets = [styleSheet()];
    const make = (name, className, more) => htmlElement(name, { className, hidden: true, ...more });
    const parts = this.#parts = {
      img: make("img", "without", { alt: "" }),
      canvas: make("canvas", "", { hidden: false, tabIndex: 0, role: "img" }),
      over: make("canvas", "over"),
      slot: make("slot"),
      marks: make("canvas", "over"),
      frame: make("div", "frame", { hidden: false }),
      controls: make("div", "controls"),
      progress: make("progress", "", { max: 1 }),
      p: make("p", "", { role: "alert" }),
      hint: make("div", "hint over", { role: "status" }),
    };
    root.append(...Object.values(parts));
    parts.picture = parts.canvas.getContext("2d");
    parts.marked = parts.marks.getContext("2d");
    parts.canvas.setAttribute("aria-label", LABEL);
    this.#ready.promise.catch(() => {}); // who awaits it is told; nobody need
  }

  // -- the contract ------------------------------------------------------------------------------

  /** Fulfilled with the element when all of the VDI is drawn; rejected if it cannot be. */
  get ready() {
    return this.#ready.promise;
  }

  /** Where the VDI, the series or the set comes from; another one is loaded when it is set. */
  get src() {
    return this.getAttribute("src") ?? "";
  }

  set src(src) {
    this.setAttribute("src", src);
  }

  /** The view: position, focal_point, view_up and view_angle or parallel_scale; null before one. */
  get camera() {
    return this.#camera && structuredClone(this.#camera);
  }

  set camera(camera) {
    const checked = checkedCamera(camera);
    // Viewers that follow each other would go round for ever
    if (JSON.stringify(checked) === JSON.stringify(this.#camera)) return;
    this.#camera = checked;
    this.#announceCamera();
    this.invalidate();
  }

  /** What is behind the VDI: a CSS colour, or three numbers from 0 to 1. */
  get background() {
    return this.getAttribute("background") ?? "black";
  }

  set background(color) {
    const css = typeof color === "string" ? color
      : `rgb(${[...color].map((c) => `${100 * c}%`).join(" ")})`;
    if (!CSS.supports("background", css)) {
      throw new TypeError(`A background is a CSS colour or three numbers; got ${color}.`);
    }
    this.setAttribute("background", css);
  }

  /** Planes that clip the VDI: [{origin, normal}], world; the side of the normal is kept. */
  get clippingPlanes() {
    return structuredClone(this.#planes);
  }

  set clippingPlanes(planes) {
    const checked = [...planes].map(checkedPlane);
    if (checked.length > MOST_CLIPPING_PLANES) {
      throw new TypeError(`At most ${MOST_CLIPPING_PLANES} planes clip a VDI; got ${checked.length}.`);
    }
    this.#planes = checked;
    this.invalidate();
  }

  /** How it is shown: `{brightness, opacity, clip, transfer}`; what is not set is as the VDI was made. */
  get look() {
    return structuredClone(this.#look);
  }

  set look(look) {
    const checked = checkedLook(look);
    if (JSON.stringify(checked) === JSON.stringify(this.#look)) return;
    this.#look = checked;
    this.#bar?.show();
    this.#address?.changed();
    this.dispatchEvent(new CustomEvent("lookchange", { detail: { look: this.look } }));
    this.invalidate();
  }

  /** The first view, which `resetCamera` goes back to; null where none is known. */
  get home() {
    const of = this.#home ?? this.#scene?.camera ?? this.#series?.camera ?? this.#prepared?.camera;
    return of ? checkedCamera({ ...of, parallel_projection: isParallel(of) }) : null;
  }

  set home(camera) {
    this.#home = camera && checkedCamera(camera);
  }

  /** A box of the world that the VDI is in: low and high of x, y and z; null without a VDI. */
  get bounds() {
    if (!this.#prepared) return null;
    const { linear, offset, half, scale } = frameOf(this.#prepared);
    return linear.flatMap((row, k) => {
      const reach = dot(row.map(Math.abs), half);
      return [offset[k] - reach, offset[k] + reach].map((x) => x / scale);
    });
  }

  /** Of a VDI that keeps values: their `range`, a `histogram` by length and the `start` of editing; or null. */
  get values() {
    const { values } = this.#prepared ?? {};
    if (!values || this.#scene) return null;
    values.start ??= editedFrom(startOf(this.#prepared));
    return values;
  }

  /** The transfer function of the VDI, as its file has it: `colors`, `scalar_range` and others; or null. */
  get transferFunction() {
    if (this.#prepared?.values) return toldOf(this.#prepared, this.#look.transfer);
    const { transfer_function: told } = this.#prepared?.metadata ?? {};
    return told?.colors?.length && told.scalar_range ? told : null;
  }

  /**
   * A point of the world under a place of the picture: where half of what hides the ray lies.
   *
   * @param {number} x CSS pixels from the left, and from the top `y`.
   * @returns {number[]|null} null where hardly anything is seen, and in scenes.
   */
  pointAt(x, y) {
    const [width, height] = this.#size, { clientWidth, clientHeight } = this;
    if (!this.#raycaster || this.#scene || !this.#camera) return null;
    const view = { camera: this.#fitted(this.#camera, width, height), width, height,
      clippingPlanes: this.#planes, look: this.#look };
    const [column, row] = [x * width / clientWidth, y * height / clientHeight].map(Math.floor);
    const pixel = [column, height - 1 - row];
    const target = this.#pacer.target(1, 1); // of its own: a frame may be half drawn
    try {
      return this.#raycaster.pointAt(target, view, pixel);
    } finally {
      this.#pacer.free(target);
    }
  }

  /** What is going on: state ("empty", "loading", "coarse", "full", "error"), progress, ... */
  get status() {
    const { n, windowSize, level, precision } = this.#prepared ?? {};
    const pixels = this.#pacer?.share ?? 1;
    return { ...this.#status, supersegments: n, lists: windowSize, level, precision, pixels };
  }

  /** The series that is shown: `times`, `length`, `nearest(time)`; null where it is none. */
  get series() {
    return this.#series?.views ? null : this.#series;
  }

  /** Of a set: how many VDIs are there, and which is nearest to the view; null where it is none. */
  get set() {
    return this.#series?.views ? { length: this.#series.length, nearest: this.#player.step } : null;
  }

  /** The time of the step that is shown, or will be when it is decoded; null without a series. */
  get time() {
    return this.#player && this.#player.time;
  }

  set time(time) {
    if (!Number.isFinite(time)) throw new TypeError(`A time is a number; got ${time}.`);
    this.#seek(this.#played().#series.nearest(time));
  }

  /** Whether one step is shown after the other. */
  get playing() {
    return this.#player !== null && this.#player.playing;
  }

  /**
   * Show one step after the other, from the one that is shown, or from the first where the last
   * one is and nothing follows it. Steps that are not decoded in time are left out.
   *
   * @param {{rate: number, loop: boolean}} [options] Steps per second, 24 by default; whether the
   *   first step follows the last one, as it does by default.
   */
  play(options) {
    this.#played().#player.play(options);
  }

  /** Stay at the step that is shown. */
  pause() {
    this.#player?.pause();
  }

  /**
   * The picture at full quality: premultiplied RGBA, 8 bits, top row first, without background; a
   * scene's texts are in it.
   *
   * @param {{width: number, height: number}} size Pixels.
   * @returns {Promise<{width: number, height: number, data: Uint8ClampedArray}>}
   */
  async screenshot({ width = this.#size[0], height = this.#size[1] } = {}) {
    await this.ready;
    if (this.isConnected) this.#begin();
    const gl = this.#gl, pacer = this.#pacer, scene = this.#scene, camera = this.#camera;
    const require = (good) => {
      if (!good) throw new Error("A viewer whose graphics are lost, or off the page, has no picture.");
    };
    require(pacer);
    const largest = gl.getParameter(gl.MAX_RENDERBUFFER_SIZE);
    if (![width, height].every((edge) => Number.isInteger(edge) && edge > 0 && edge <= largest)) {
      throw new RangeError(`A screenshot is 1 to ${largest} pixels wide and high; ` +
        `got ${width} x ${height}.`);
    }
    const target = pacer.target(width, height);
    ++this.#shots;
    try {
      require(await pacer.inBands(target, width, height, this.#painter(camera, width, height)));
      const data = new Uint8ClampedArray(4 * width * height), row = 4 * width;
      const upsideDown = new Uint8Array(data.length);
      gl.bindFramebuffer(gl.FRAMEBUFFER, target.framebuffer);
      scene?.paintTexts(this.#fitted(camera, width, height), width, height);
      gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, upsideDown);
      for (let y = 0; y < height; ++y) {
        data.set(upsideDown.subarray((height - 1 - y) * row, (height - y) * row), y * row);
      }
      return { width, height, data };
    } finally {
      pacer.free(target);
      --this.#shots;
      this.#retire();
    }
  }

  /**
   * Show what a URL, bytes, a file or a stream hold: a .vdi file, a series, .vdis, or a set, .vdiset.
   *
   * @param {string|URL|Uint8Array|Blob|ReadableStream} source A File is a Blob.
   * @returns {Promise<VDIViewer>} When all of it is drawn.
   */
  async load(source) {
    this.#loading?.abort();
    const loading = (this.#loading = new AbortController());
    this.#source = source;
    if (this.#status.state !== "empty") this.#renew();
    const { promise } = this.#ready;
    this.#tell({ state: "loading", progress: 0, message: undefined });
    try {
      await load(source, {
        signal: loading.signal,
        onBegin: (vdi) => !loading.signal.aborted && this.#warmUp(vdi),
        onLevel: (prepared) => {
          if (loading.signal.aborted) return;
          this.#endSeries();
          this.setPrepared(prepared);
          this.#comeTo(prepared.bounds);
        },
        onSeries: (series) => this.#beginSeries(series),
        onProgress: (progress) => !loading.signal.aborted && this.#tell({ progress }),
      });
    } catch (error) {
      if (!loading.signal.aborted) this.#fail(error);
    }
    if (!loading.signal.aborted) this.#source = null;
    return promise;
  }

  // Look at what an address gives, where it lies elsewhere than what it gave before.
  #comeTo(bounds) {
    const before = this.#shownBefore;
    this.#shownBefore = null;
    if (before && before.some((edge, k) => edge !== bounds[k])) this.resetCamera();
  }

  /** Show the bytes of a .vdi file; what is there stays until they are decoded. */
  showBytes(bytes) {
    return this.load(bytes);
  }

  /** Show what prepare.js has made of a VDI: swapped whole. */
  setPrepared(prepared) {
    try {
      if (this.#raycaster) this.#raycaster.set(prepared);
      this.#prepared = prepared;
    } catch (error) {
      this.#fail(error);
      return;
    }
    if (!this.#camera) this.resetCamera();
    this.#bar?.show();
    this.#tell({ state: prepared.level === "coarse" ? "coarse" : "full", message: undefined,
      ...(prepared.level === "coarse" ? {} : { progress: 1 }) });
    this.invalidate();
  }

  /** Go back to the view that the VDI was made for, or in which the scene began. */
  resetCamera() {
    const { home } = this;
    if (home) this.camera = home;
  }

  /** What is seen beside the VDI: a Scene of scene.js, or null. Swapped whole. */
  get scene() {
    return this.#coming;
  }

  set scene(scene) {
    if (scene === this.#coming) return;
    const { viewer } = scene ?? {};
    if (viewer && !viewer.isConnected) viewer.scene = null;
    else if (viewer) {
      throw new TypeError("A Scene is shown by one viewer: make another one of the same bytes.");
    }
    if (scene) scene.viewer = this;
    if (this.#coming) this.#coming.viewer = null;
    if (this.#coming?.broken) this.#recover();
    this.#coming = scene;
    const isWanted = () => scene === this.#coming;
    if (scene) {
      scene.failed = (error) => {
        scene.broken = true;
        if (isWanted()) this.#fail(error);
      };
    }
    if (!scene || !this.#scene) this.#takeScene(scene);
    else scene.whole.then(() => isWanted() && this.#takeScene(scene), () => {});
    scene?.loaded.then(() => {
      if (!isWanted()) return;
      if (scene.camera && !this.#linked) this.camera = scene.camera;
      this.#linked = false; // another scene is looked at as it begins
      this.#bar?.show();
    }, () => {});
    scene?.whole.then(() => {
      if (!isWanted() || this.#status.state !== "empty") return;
      this.#tell({ state: "full", progress: 1 }); // there is no VDI of its own
      this.invalidate(false);
    }, () => {});
  }

  // Go on with what is there: what was wrong is no more.
  #recover() {
    if (this.#ready.settled) this.#renew();
    if (this.#prepared) this.setPrepared(this.#prepared);
    else this.#tell({ state: "empty", progress: 0, message: undefined });
  }

  #takeScene(scene) {
    this.#scene?.dispose();
    this.#scene = scene;
    this.#parts.over.hidden = !scene;
    if (scene) scene.changed = () => this.invalidate(false);
    if (scene && this.#raycaster) this.#give(scene);
    this.invalidate(false);
  }

  // -- series ------------------------------------------------------------------------------------

  #beginSeries(series) {
    this.#endSeries();
    this.#series = series;
    if (series.views) {
      this.#beginSet(series);
      return;
    }
    const player = this.#player = new Player(series, {
      show: (prepared, time, step) => this.#showStep({ prepared, time, step }),
      changed: () => {
        if (!player.playing) this.#awaitStep();
        this.#controls?.show();
        this.#address?.changed();
      },
      failed: (error) => player === this.#player && this.#fail(error),
    });
    const comeToTime = () => {
      if (this.#wantedTime === null) return;
      this.#seek(series.nearest(this.#wantedTime)); // until the step itself has come
      if (series.complete || player.time === this.#wantedTime) this.#wantedTime = null;
    };
    series.changed = () => {
      this.#controls?.show();
      comeToTime();
    };
    [this.#controls, this.#bar].forEach((each) => each?.show());
    const still = matchMedia("(prefers-reduced-motion: reduce)").matches || this.#wantedTime !== null;
    comeToTime();
    if (this.hasAttribute("autoplay") && !still) player.play();
  }

  // The nearest VDI of a set is a step that the view chooses.
  #beginSet(set) {
    const surround = this.#player = new Surround(set, {
      show: (prepared, step) => this.#showStep({ prepared, time: null, step }),
      changed: () => surround === this.#player && this.#awaitStep(),
      failed: (error) => surround === this.#player && this.#fail(error),
    });
    set.changed = () => surround.grown();
    if (this.#camera) surround.look(this.#camera);
    else this.resetCamera();
  }

  #endSeries() {
    this.#player?.close();
    this.#player = this.#series = this.#step = null;
    this.#controls?.show();
  }

  #played() {
    if (!this.series) throw new TypeError("There is no series that could be played, or not yet.");
    return this;
  }

  #seek(step) {
    const player = this.#player;
    player.step = step;
    if (!player.settled || this.#status.state !== "error" || !this.#raycaster) return;
    if (this.#ready.settled) this.#renew();
    this.setPrepared(this.#prepared); // of the step, whatever has failed since
  }

  // The element is ready again when a step that is asked for, or about to be drawn, is drawn.
  #awaitStep() {
    if ((this.#step || !this.#player?.settled) && this.#ready.settled) this.#renew();
  }

  // Between two frames: what is being drawn is drawn to its end with one step.
  #showStep(shown) {
    this.#step = shown;
    if (this.#drawing) this.invalidate();
    else this.#takeStep();
  }

  #takeStep() {
    if (!this.#step) return;
    const { prepared, time, step } = this.#step;
    this.#step = null;
    this.setPrepared(prepared);
    if (this.series) this.dispatchEvent(new CustomEvent("vditime", { detail: { time, step } }));
  }

  // -- the page's address ------------------------------------------------------------------------

  // What is seen, for a link; null where it is what the page begins with.
  #linkable() {
    const { camera, home, look } = this;
    if (!camera) return null;
    const time = this.series && !this.playing && this.#player.step > 0 ? this.time : null;
    const begins = time === null && isAsMade(look) && JSON.stringify(camera) === JSON.stringify(home);
    return begins ? null : { camera, look, time };
  }

  #takeLinked(state) {
    this.look = state?.look ?? AS_MADE;
    if (!state) {
      this.resetCamera();
      if (this.series) this.#seek(0);
      return;
    }
    this.#linked = !this.#scene?.head;
    this.camera = state.camera;
    this.#wantedTime = this.series ? null : state.time;
    if (!this.series) return;
    this.pause();
    this.#seek(state.time === null ? 0 : this.#series.nearest(state.time));
  }

  // -- life --------------------------------------------------------------------------------------

  connectedCallback() {
    const { canvas, controls } = this.#parts;
    const { signal } = (this.#connected = new AbortController());
    try {
      for (const name of PROPERTIES.filter((each) => Object.hasOwn(this, each))) {
        const value = this[name];
        delete this[name]; // it hides the accessor
        this[name] = value;
      }
    } catch (error) {
      this.#fail(error);
    }
    if (this.hasAttribute("hash")) {
      this.#address = followAddress(this.getAttribute("hash") || "view", {
        state: () => this.#linkable(), take: (state) => this.#takeLinked(state),
      }, signal);
    }
    // First: decoding goes on while the browser starts its graphics
    this.#loadEmbedded();
    if (document.readyState === "loading") { // what is in it may come yet
      document.addEventListener("DOMContentLoaded", () => {
        this.#loadEmbedded();
        if (!this.#gl) this.#showWithout();
      }, { signal });
    }
    this.#begin();
    if (!this.#gl) {
      this.#loading?.abort();
      this.#showWithout();
      this.#fail(new Error("This browser draws no WebGL 2, which turning this picture takes."));
      return;
    }
    if (this.#source && this.#loading.signal.aborted) this.load(this.#source).catch(() => {});
    this.#player?.resume();
    this.#controls = playerControls?.(controls, () => this.series && this.#player,
      () => this.#series.times, {
        toggle: () => this.playing ? this.pause() : this.play(),
        seek: (step) => this.#seek(step),
      }, signal);
    this.#controls?.show();
    const { frame, marked } = this.#parts;
    this.#bar = viewerControls(frame, canvas, marked, this, {
      background: () => {
        const { backgroundColor: color, backgroundImage: image } = getComputedStyle(this);
        return { color, image };
      },
      camera: (width, height) => this.#fitted(this.#camera, width, height),
      hasLink: () => this.#address !== null,
      link: () => {
        this.#address.now();
        return location.href;
      },
      say: (text) => this.#hint(text),
    }, signal);
    this.#listen(signal);
    this.invalidate(false);
  }

  // Hear of what people do, of the canvas' size and of whether it is in sight.
  #listen(signal) {
    const viewer = this, { canvas } = this.#parts;
    interact(canvas, {
      get camera() { return viewer.#camera; },
      get height() { // pixels that the camera's angle spans
        const { clientWidth, clientHeight } = canvas;
        return viewer.#aspect ? Math.min(clientHeight, clientWidth / viewer.#aspect) : clientHeight;
      },
      get shared() { return viewer.#share(); },
      move(camera) { viewer.camera = camera; },
      rest() { viewer.#moved = -Infinity; viewer.invalidate(); },
      hint(text) { viewer.#hint(text); },
    }, signal);
    hearKeys(this.shadowRoot, (event, target) => this.#key(event, target), signal);
    const sizes = new ResizeObserver(() => this.#resize());
    for (const each of [this, document.documentElement]) sizes.observe(each);
    const sight = new IntersectionObserver((entries) => {
      this.#seen = entries.at(-1).isIntersecting;
      this.#share();
      if (this.#seen && !this.#raycaster) this.invalidate(false);
      this.#retire();
    }, { rootMargin: "50%" });
    sight.observe(this);
    signal.addEventListener("abort", () => [sizes, sight].forEach((each) => each.disconnect()));
    canvas.addEventListener("contextrestored", () => this.invalidate(false), { signal });
    // Another screen, or the browser's zoom: not all ways to change it are told
    const density = setInterval(() => this.#seen && this.#resize(), DENSITY);
    signal.addEventListener("abort", () => clearInterval(density));
  }

  // Whether fingers and the wheel move the page, too: then a viewer does not take all of them.
  #share() {
    const wanted = this.getAttribute("gestures");
    const shared = wanted ? wanted === "shared" : scrollsAround(this);
    this.#parts.canvas.style.touchAction = shared ? "pan-y" : "";
    return shared;
  }

  // Whether a key that is pressed in here is taken.
  #key(event, target) {
    if (event.altKey || event.metaKey || event.ctrlKey) return this.#bar?.undo(event, target) ?? false;
    if (this.#bar?.key(event, target)) return true;
    if (this.#parts.frame.contains(target)) return false;
    if (target !== this.#parts.canvas || !this.#camera) {
      return this.#controls?.key(event, target) ?? false;
    }
    const camera = keyed(this.#camera, event);
    if (camera) this.camera = camera;
    else if (event.key === "r" || event.key === "R") this.resetCamera();
    else return this.#controls?.key(event, target) ?? false;
    event.preventDefault();
    return true;
  }

  #hint(text) {
    const { hint } = this.#parts;
    hint.textContent = text;
    hint.hidden = false;
    clearTimeout(this.#hinting);
    this.#hinting = setTimeout(() => (hint.hidden = true), HINT);
  }

  // The still picture, in place of one that can be turned.
  #showWithout() {
    const { img, canvas } = this.#parts;
    canvas.hidden = true;
    if (!img.getAttribute("src")) img.src = this.querySelector("img")?.src ?? "";
    img.hidden = !img.getAttribute("src");
  }

  #loadEmbedded() {
    if (this.#status.state !== "empty" || this.getAttribute("src")) return;
    const within = embedded(this);
    if (within) this.load(within).catch(() => {});
  }

  disconnectedCallback() {
    this.#connected?.abort();
    this.pause();
    queueMicrotask(() => {
      if (this.isConnected) return; // it was but moved
      this.#loading?.abort();
      this.#series?.close(); // its worker; another one starts when it is needed again
    });
    this.#release();
    leaveGraphics(this.#holder);
  }

  attributeChangedCallback(name, before, value) {
    // What goes wrong is said by the error event, on the page and by ready: nobody awaits this
    if (name === "src" && value) {
      this.#shownBefore = this.#prepared?.bounds;
      this.load(value).catch(() => {});
    }
    if (name === "controls") this.#bar?.show();
    if (name === "background") this.style.background = value ?? "";
    if (name === "still" && value) this.#parts.img.src = value;
    if (name === "aria-label") this.#parts.canvas.setAttribute("aria-label", value ?? LABEL);
    if (name === "fit") {
      const [width, height = 1] = (value ?? "").split("/").map(Number);
      this.#aspect = width > 0 && height > 0 ? width / height : 0;
      this.invalidate();
    }
  }

  // Take part in the page's graphics: at first, and after it was lost or given back.
  #begin() {
    if (this.#raycaster && !this.#gl.isContextLost()) return;
    const gl = (this.#gl = takeGraphics(this.#holder));
    if (!gl) return;
    this.#raycaster = new Raycaster(gl);
    this.#pacer = new Pacer(gl);
    if (this.#scene) this.#give(this.#scene);
    try {
      if (this.#prepared) this.#raycaster.set(this.#prepared);
    } catch (error) {
      this.#fail(error);
    }
    this.#resize();
  }

  // Give back what is in the graphics' memory; the canvas keeps its picture.
  #release() {
    clearTimeout(this.#retiring);
    this.#raycaster?.dispose();
    this.#pacer?.dispose();
    this.#scene?.dispose();
    this.#raycaster = this.#pacer = null;
  }

  #retire() {
    clearTimeout(this.#retiring);
    if (this.#seen) return;
    const busy = () => this.#drawing || this.#shots || this.playing;
    this.#retiring = setTimeout(() => busy() || this.#release(), IDLE);
  }

  // What is drawn stays; what is not yet is drawn with other graphics.
  #lose() {
    this.#release();
    if (this.#drawing || this.#asked) setTimeout(() => this.invalidate(false), LOST);
  }

  #give(scene) {
    try {
      scene.restore(this.#gl);
    } catch (error) {
      this.#fail(error);
    }
  }

  #resize() {
    const density = window.devicePixelRatio || 1;
    const size = [this.clientWidth, this.clientHeight].map((edge) => Math.max(1, Math.round(edge * density)));
    if (this.#size.every((edge, k) => edge === size[k])) return;
    this.#size = size;
    this.#moved = performance.now(); // the first picture of a new size is a quick one
    this.invalidate(false);
  }

  // -- frames ------------------------------------------------------------------------------------

  /** Draw again; after a movement with few pixels first. */
  invalidate(moves = true) {
    if (moves) this.#moved = performance.now();
    this.#asked = true;
    this.#wake();
    const something = this.#prepared || this.#scene?.head;
    if (this.#drawing || !something || !this.#camera || !this.isConnected) return;
    this.#begin(); // which may come here itself
    if (this.#raycaster && !this.#drawing) {
      this.#drawing = true;
      requestAnimationFrame(() => this.#frames());
    }
  }

  // Frames until nothing is asked for: while the view moves with the pixels that the rate allows,
  // then all, in bands that a new movement breaks off.
  async #frames() {
    try {
      while (this.#raycaster && this.isConnected) {
        const pacer = this.#pacer, [width, height] = this.#size;
        this.#takeStep();
        const moving = performance.now() - this.#moved < REST;
        this.#asked = false;
        const shown = this.#prepared;
        const camera = this.#camera;
        const few = pacer.few(moving && this.#raycaster.thinning(camera).some(Boolean), width, height);
        const size = moving ? pacer.sizeFor(width, height) : [width, height];
        const full = size[0] === width && size[1] === height && !few;
        const target = pacer.screen(width, height);
        const density = size[0] / this.clientWidth;
        const painter = this.#painter(camera, ...size, { density, moving, few });
        const done = await pacer.inBands(target, ...size, painter,
          () => !full || !this.#asked || moving);
        if (this.#gl.isContextLost()) return;
        if (pacer !== this.#pacer || !done) continue;
        showPicture(target.framebuffer, size, this.#parts.picture);
        this.#scene?.annotate(this.#parts.over, this.#fitted(camera, width, height), [width, height]);
        this.#bar?.drawn();
        this.#drawn(full, shown === this.#prepared);
        if (this.#asked) continue;
        if (full) return;
        await new Promise((resolve) => { // until the view rests, or moves on
          this.#wake = resolve;
          setTimeout(resolve, Math.max(0, REST - (performance.now() - this.#moved)));
        });
      }
    } catch (error) {
      if (!this.#gl.isContextLost()) this.#fail(error);
    } finally {
      this.#drawing = false;
      if (this.#asked && this.#raycaster && this.#status.state !== "error") this.invalidate(false);
      this.#retire();
    }
  }

  // Have the program compiled while the first lists are still being decoded.
  #warmUp(vdi) {
    const [width, height] = this.#size;
    if (!this.#raycaster || this.#prepared) return;
    this.#gl.bindFramebuffer(this.#gl.FRAMEBUFFER, this.#pacer.screen(width, height).framebuffer);
    this.#gl.enable(this.#gl.BLEND);
    this.#raycaster.warmUp(vdi);
    this.#gl.disable(this.#gl.BLEND);
  }

  // What draws a view into the bound target: called for each band, with the scissor set. `density`:
  // pixels of it for one of the page, which lines and points are as wide as; `few`: of few lists.
  #painter(camera, width, height, { density = 1, moving = false, few = false } = {}) {
    const gl = this.#gl, raycaster = this.#raycaster, scene = this.#scene, planes = this.#planes;
    const look = this.#look;
    camera = this.#fitted(camera, width, height);
    const view = { camera, width, height, density, moving, few, look, clippingPlanes: planes };
    return (target) => {
      if (scene) {
        scene.paint(raycaster, target, view);
        return;
      }
      gl.enable(gl.BLEND);
      gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
      raycaster.draw({ camera, width, height, clippingPlanes: planes, few, look });
      gl.disable(gl.BLEND);
    };
  }

  #fitted(camera, width, height) {
    return this.#aspect ? fitted(camera, this.#aspect, [width, height]) : camera;
  }

  // What was drawn, and whether it is still what is to be shown: another level may have come since.
  #drawn(full, latest) {
    const { state } = this.#status, whole = this.#scene?.complete ?? true;
    this.dispatchEvent(new CustomEvent("framedrawn", { detail: { full, state } }));
    const settled = !this.#step && (this.#player?.settled ?? true);
    if (full && latest && whole && settled && state === "full") this.#ready.resolve(this);
  }

  #announceCamera() {
    this.#player?.look?.(this.#camera);
    this.#address?.changed();
    this.dispatchEvent(new CustomEvent("camerachange", { detail: { camera: this.camera } }));
  }

  #tell(changes) {
    Object.assign(this.#status, changes);
    const { state, progress, message } = this.#status, { progress: bar, p } = this.#parts;
    bar.hidden = !(state === "loading" || state === "coarse");
    bar.value = progress;
    p.hidden = state !== "error";
    p.textContent = message ?? "";
  }

  #fail(error) {
    const message = error.message ?? String(error);
    this.#tell({ state: "error", message });
    this.#ready.reject(error);
    this.dispatchEvent(new CustomEvent("error", { detail: { message } }));
  }

  // Who still waits for what is shown no more waits for what is.
  #renew() {
    const { resolve, reject } = this.#ready;
    this.#ready = resolvers();
    this.#ready.promise.then(resolve, reject);
  }
}

// One for all viewers of a page. No markup in text: pages may forbid what is not in a file of theirs
let sheet = null;
function styleSheet() {
  if (!sheet) {
    sheet = new CSSStyleSheet();
    sheet.replaceSync(STYLE);
  }
  return sheet;
}

function resolvers() {
  const made = { settled: false };
  made.promise = new Promise((resolve, reject) => Object.assign(made, { resolve, reject }));
  const settle = () => (made.settled = true);
  made.promise.then(settle, settle);
  return made;
}

if (!customElements.get("vdi-viewer")) customElements.define("vdi-viewer", VDIViewer);
