// <vdi-viewer src="brain.vdi">: a VDI that people turn. docs/web.md has its contract.
import { checkedCamera, checkedPlane } from "./camera.js";
import { viewerControls } from "./controls.js";
import { htmlElement } from "./html.js";
import { hearKeys, interact, keyed, scrollsAround } from "./interaction.js";
import { followAddress } from "./link.js";
import { embedded, load } from "./loader.js";
import { AS_MADE, checkedLook } from "./look.js";
import { Player, playerControls } from "./player.js";
import { isParallel } from "./rays.js";
import { Renderer } from "./renderer.js";
import { MOST_CLIPPING_PLANES } from "./shader.js";
import { STYLE_SHEET } from "./style.js";
import { Surround } from "./surround.js";
import { editedFrom, startOf, toldOf } from "./values.js";

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
  static observedAttributes = ["src", "background", "still", "fit", "aria-label"];

  #parts = {};
  #shown; // a Renderer, whose fields are what is shown
  #home = null; // a camera that was given as the first
  #status = { state: "empty", progress: 0 };
  #ready = resolvers();
  #loading = null; // an AbortController
  #source = null; // of what is not yet loaded
  #connected = null; // another AbortController
  #shownBefore = null; // bounds, until another address has given something
  #scene = null; // what is seen beside the VDI, or will be as soon as it can
  #series = null;
  #player = null; // of a series, or what chooses of a set
  #linked = false; // whether the view came from the page's address
  #address = null;
  #bar = null; // controls of turning
  #controls = null; // and of playing
  #hinting = 0; // a timer

  constructor() {
    super();
    const root = this.attachShadow({ mode: "open" });
    root.adoptedStyleSheets = [STYLE_SHEET];
    const make = (name, className, more) => htmlElement(name, { className, hidden: true, ...more });
    const parts = this.#parts = {
      img: make("img", "without", { alt: "" }),
      canvas: make("canvas", "", { hidden: false, tabIndex: 0, role: "img", label: LABEL }),
      over: make("canvas", "over"),
      slot: make("slot"),
      frame: make("div", "frame", { hidden: false }),
      controls: make("div", "controls"),
      progress: make("progress", "", { max: 1 }),
      p: make("p", "", { role: "alert" }),
      hint: make("div", "hint over", { role: "status" }),
    };
    root.append(htmlElement("div", { className: "box" }, ...Object.values(parts)));
    this.#shown = new Renderer(this, parts, {
      drawn: (full, latest) => this.#drawn(full, latest), failed: (error) => this.#fail(error),
    });
    this.#ready.promise.catch(() => {}); // who awaits it is told; nobody need
  }

  // -- what is shown -----------------------------------------------------------------------------

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
    return this.#shown.camera && structuredClone(this.#shown.camera);
  }

  set camera(camera) {
    const checked = checkedCamera(camera);
    // Viewers that follow each other would go round for ever
    if (JSON.stringify(checked) === JSON.stringify(this.#shown.camera)) return;
    this.#shown.camera = checked;
    this.#player?.look?.(checked);
    this.#address?.changed();
    this.dispatchEvent(new CustomEvent("camerachange", { detail: { camera: this.camera } }));
    this.#shown.invalidate();
  }

  /** The first view, which `resetCamera` goes back to; null where none is known. */
  get home() {
    const of = this.#home ?? this.#shown.scene?.camera ?? this.#series?.camera ??
      this.#shown.prepared?.camera;
    return of ? checkedCamera({ ...of, parallel_projection: isParallel(of) }) : null;
  }

  set home(camera) {
    this.#home = camera && checkedCamera(camera);
  }

  /** Go back to the view that the VDI was made for, or in which the scene began. */
  resetCamera() {
    const { home } = this;
    if (home) this.camera = home;
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
    return structuredClone(this.#shown.clippingPlanes);
  }

  set clippingPlanes(planes) {
    const checked = [...planes].map(checkedPlane);
    if (checked.length > MOST_CLIPPING_PLANES) {
      throw new TypeError(`At most ${MOST_CLIPPING_PLANES} planes clip a VDI; got ${checked.length}.`);
    }
    this.#shown.clippingPlanes = checked;
    this.#shown.invalidate();
  }

  /** How it is shown: `{brightness, opacity, clip, transfer}`; what is not set is as it was made. */
  get look() {
    return structuredClone(this.#shown.look);
  }

  set look(look) {
    const checked = checkedLook(look);
    if (JSON.stringify(checked) === JSON.stringify(this.#shown.look)) return;
    this.#shown.look = checked;
    this.#bar?.show();
    this.#address?.changed();
    this.dispatchEvent(new CustomEvent("lookchange", { detail: { look: this.look } }));
    this.#shown.invalidate();
  }

  /** Of values that a VDI keeps the `range`, a `histogram` by length and the `start` of editing. */
  get values() {
    const { prepared, scene } = this.#shown, { values } = prepared ?? {};
    if (!values || scene) return null;
    values.start ??= editedFrom(startOf(prepared));
    return values;
  }

  /** The transfer function of the VDI, as its file has it: `colors`, `scalar_range`, ...; or null. */
  get transferFunction() {
    const { prepared, look } = this.#shown;
    if (prepared?.values) return toldOf(prepared, look.transfer);
    const { transfer_function: told } = prepared?.metadata ?? {};
    return told?.colors?.length && told.scalar_range ? told : null;
  }

  /** The picture at full quality: premultiplied RGBA, 8 bits, top row first, without background. */
  async screenshot({ width = this.#shown.size[0], height = this.#shown.size[1] } = {}) {
    await this.ready;
    return this.#shown.screenshot(width, height);
  }

  /** What is going on: state ("empty", "loading", "coarse", "full", "error"), progress, ... */
  get status() {
    const { n, windowSize } = this.#shown.prepared ?? {};
    return { ...this.#status, supersegments: n, lists: windowSize, pixels: this.#shown.pixels };
  }

  // -- where it comes from -----------------------------------------------------------------------

  /** Show what a URL, bytes, a file or a stream hold: a VDI, a series or a set; wait until it is. */
  async load(source) {
    this.#loading?.abort();
    const { signal } = (this.#loading = new AbortController());
    this.#source = source;
    if (this.#status.state !== "empty") this.#renew();
    const { promise } = this.#ready;
    this.#tell({ state: "loading", progress: 0, message: undefined });
    try {
      await load(source, {
        signal,
        onLevel: (prepared) => {
          if (prepared.level === "begun") this.#shown.warmUp(prepared);
          else this.#take(prepared);
        },
        onSeries: (series) => this.#beginSeries(series),
        onProgress: (progress) => this.#tell({ progress }),
      });
    } catch (error) {
      if (!signal.aborted) this.#fail(error);
    }
    if (!signal.aborted) this.#source = null;
    return promise;
  }

  #take(prepared) {
    const before = this.#shownBefore;
    this.#shownBefore = null;
    this.#endSeries();
    this.#show(prepared);
    // Look at what an address gives, where it lies elsewhere than what it gave before
    if (before && before.some((edge, k) => edge !== prepared.bounds[k])) this.resetCamera();
  }

  // Show what prepare.js has made of a VDI: swapped whole.
  #show(prepared) {
    this.#shown.prepared = prepared;
    if (!this.#shown.camera) this.resetCamera();
    this.#bar?.show();
    const coarse = prepared.level === "coarse";
    this.#tell({ state: coarse ? "coarse" : "full", message: undefined, ...(!coarse && { progress: 1 }) });
    this.#shown.invalidate();
  }

  #loadEmbedded() {
    if (this.#status.state !== "empty" || this.getAttribute("src")) return;
    const within = embedded(this);
    if (within) this.load(within).catch(() => {});
  }

  /** What is seen beside the VDI: a Scene of scene.js, or null. Swapped whole. */
  get scene() {
    return this.#scene;
  }

  set scene(scene) {
    if (scene === this.#scene) return;
    if (scene?.viewer?.isConnected) {
      throw new TypeError("A Scene is shown by one viewer: make another one of the same bytes.");
    }
    if (scene?.viewer) scene.viewer.scene = null;
    const before = this.#scene;
    this.#scene = scene;
    if (before) before.viewer = null;
    if (before?.broken) this.#recover();
    if (!scene || !this.#shown.scene) this.#takeScene(scene);
    if (scene) this.#follow(scene);
  }

  // Show a scene as soon as it can be.
  async #follow(scene) {
    const isWanted = () => scene === this.#scene;
    scene.viewer = this;
    try {
      await scene.loaded;
      if (!isWanted()) return;
      if (scene.camera && !this.#linked) this.camera = scene.camera;
      this.#linked = false; // another scene is looked at as it begins
      this.#bar?.show();
      await scene.whole;
      if (!isWanted()) return;
      if (this.#shown.scene !== scene) this.#takeScene(scene);
      if (this.#status.state === "empty") this.#tell({ state: "full", progress: 1 }); // without a VDI
      this.#shown.invalidate(false);
    } catch (error) {
      scene.broken = true;
      if (isWanted()) this.#fail(error);
    }
  }

  #takeScene(scene) {
    this.#shown.scene?.dispose();
    this.#shown.scene = scene;
    this.#parts.over.hidden = !scene;
    if (scene) scene.changed = () => this.#shown.invalidate(false);
    this.#shown.invalidate(false);
  }

  // Go on with what is there: what was wrong is no more.
  #recover() {
    if (this.#ready.settled) this.#renew();
    if (this.#shown.prepared) this.#show(this.#shown.prepared);
    else this.#tell({ state: "empty", progress: 0, message: undefined });
  }

  // -- series and sets ---------------------------------------------------------------------------

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
    return this.#player?.time ?? null;
  }

  set time(time) {
    if (!Number.isFinite(time)) throw new TypeError(`A time is a number; got ${time}.`);
    this.#player.step = this.#played().nearest(time);
    if (this.#player.settled && this.#status.state === "error") this.#recover();
  }

  /** Whether one step is shown after the other. */
  get playing() {
    return this.#player?.playing ?? false;
  }

  /** Show one step after the other, `{rate}`: so many a second, and from the first again. */
  play(options) {
    this.#played();
    this.#player.play(options);
  }

  /** Stay at the step that is shown. */
  pause() {
    this.#player?.pause?.();
  }

  #played() {
    if (!this.series) throw new TypeError("There is no series that could be played, or not yet.");
    return this.series;
  }

  #beginSeries(series) {
    this.#endSeries();
    this.#series = series;
    const player = this.#player = new (series.views ? Surround : Player)(series, {
      show: (prepared, step) => {
        this.#show(prepared);
        const detail = { step, time: series.times[step] };
        if (!series.views) this.dispatchEvent(new CustomEvent("vditime", { detail }));
      },
      changed: () => {
        if (player !== this.#player) return;
        if (!player.playing) this.#awaitStep();
        this.#controls?.show();
      },
      failed: (error) => player === this.#player && this.#fail(error),
    });
    series.changed = () => {
      this.#controls?.show();
      if (series.views) player.resume();
    };
    [this.#controls, this.#bar].forEach((each) => each?.show());
    if (!series.views) {
      if (this.hasAttribute("autoplay") && !lessMotion().matches) player.play();
    } else if (this.#shown.camera) player.look(this.#shown.camera);
    else this.resetCamera();
  }

  #endSeries() {
    this.#player?.close();
    this.#player = this.#series = null;
    this.#controls?.show();
  }

  // The element is ready again when a step that is asked for, or about to be drawn, is drawn.
  #awaitStep() {
    if ((this.#shown.pending || !this.#player.settled) && this.#ready.settled) this.#renew();
  }

  // -- the page's address ------------------------------------------------------------------------

  // Take what a link says; null: what the page begins with.
  #takeLinked(state) {
    this.look = state?.look ?? AS_MADE;
    if (state) {
      this.#linked = !this.#shown.scene?.head;
      this.camera = state.camera;
    } else this.resetCamera();
  }

  // -- life --------------------------------------------------------------------------------------

  connectedCallback() {
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
      const take = (state) => this.#takeLinked(state);
      this.#address = followAddress(this.getAttribute("hash") || "view", this, take, signal);
    }
    // First: decoding goes on while the browser starts its graphics
    this.#loadEmbedded();
    const draws = this.#shown.begin();
    if (document.readyState === "loading") { // what is in it may come yet
      document.addEventListener("DOMContentLoaded", () => {
        this.#loadEmbedded();
        if (!draws) this.#showWithout();
      }, { signal });
    }
    if (!draws) {
      this.#loading?.abort();
      this.#showWithout();
      this.#fail(new Error("This browser draws no WebGL 2, which turning this picture takes."));
      return;
    }
    if (this.#source && this.#loading.signal.aborted) this.load(this.#source).catch(() => {});
    this.#player?.resume();
    this.#controls = playerControls(this.#parts.controls, this);
    this.#controls.show();
    this.#bar = viewerControls(this.#parts, this, (text) => this.#hint(text), signal);
    this.#listen(signal);
    this.#shown.invalidate(false);
  }

  disconnectedCallback() {
    this.#connected?.abort();
    this.pause();
    queueMicrotask(() => {
      if (this.isConnected) return; // it was but moved
      this.#loading?.abort();
      this.#player?.close();
    });
    this.#shown.end();
  }

  attributeChangedCallback(name, before, value) {
    // What goes wrong is said by the error event, on the page and by ready: nobody awaits this
    if (name === "src" && value) {
      this.#shownBefore = this.#shown.prepared?.bounds;
      this.load(value).catch(() => {});
    }
    if (name === "background") this.style.background = value ?? "";
    if (name === "still" && value) this.#parts.img.src = value;
    if (name === "aria-label") this.#parts.canvas.setAttribute("aria-label", value ?? LABEL);
    if (name === "fit") {
      const [width, height = 1] = (value ?? "").split("/").map(Number);
      this.#shown.aspect = width > 0 && height > 0 ? width / height : 0;
      this.#shown.invalidate();
    }
  }

  // Hear of what people do, and of the canvas' size.
  #listen(signal) {
    const viewer = this, shown = this.#shown, { canvas } = this.#parts;
    interact(canvas, {
      get camera() { return shown.camera; },
      get height() { // pixels that the camera's angle spans
        const { clientWidth, clientHeight } = canvas;
        return shown.aspect ? Math.min(clientHeight, clientWidth / shown.aspect) : clientHeight;
      },
      get shared() { return viewer.#share(); },
      move(camera) { viewer.camera = camera; },
      rest() { shown.rest(); },
      hint(text) { viewer.#hint(text); },
    }, signal);
    hearKeys(this.shadowRoot, (event, target) => this.#key(event, target), signal);
    lessMotion().addEventListener("change", ({ matches }) => matches && this.pause(), { signal });
    const sizes = new ResizeObserver(() => {
      this.#share();
      shown.resize();
    });
    for (const each of [canvas, document.documentElement]) sizes.observe(each);
    // Another screen, or the browser's zoom: not all ways to change it are told
    const density = setInterval(() => shown.resize(), DENSITY);
    signal.addEventListener("abort", () => {
      sizes.disconnect();
      clearInterval(density);
    });
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
    if (event.altKey || event.metaKey || event.ctrlKey) return false;
    if (this.#bar?.key(event, target)) return true;
    if (this.#parts.frame.contains(target)) return false;
    const { camera } = this.#shown;
    if (target !== this.#parts.canvas || !camera) return this.#controls?.key(event, target) ?? false;
    const moved = event.key.toLowerCase() === "r" ? this.home : keyed(camera, event);
    if (!moved) return this.#controls?.key(event, target) ?? false;
    this.camera = moved;
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

  // -- what is told ------------------------------------------------------------------------------

  // What was drawn, and whether it is still what is to be shown: another level may have come since.
  #drawn(full, latest) {
    const { state } = this.#status, whole = this.#shown.scene?.complete ?? true;
    this.dispatchEvent(new CustomEvent("framedrawn", { detail: { full, state } }));
    const settled = this.#player?.settled ?? true;
    if (full && latest && whole && settled && state === "full") this.#ready.resolve(this);
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

const lessMotion = () => matchMedia("(prefers-reduced-motion: reduce)");

function resolvers() {
  const made = { settled: false };
  made.promise = new Promise((resolve, reject) => Object.assign(made, { resolve, reject }));
  const settle = () => (made.settled = true);
  made.promise.then(settle, settle);
  return made;
}

if (!customElements.get("vdi-viewer")) customElements.define("vdi-viewer", VDIViewer);
