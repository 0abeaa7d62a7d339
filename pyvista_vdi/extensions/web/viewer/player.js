// Which step of a series is shown, and when; steps are decoded ahead, in a worker.
import { OF_SLIDERS, htmlElement, setSlider, slider } from "./html.js";
import { Ahead } from "./series.js";

/** Steps per second of films. */
const RATE = 24;
/** Steps that are decoded before their time comes. */
const STEPS_AHEAD = 3;

/** Shows one step of a series after the other, at a rate, leaving out what is not ready. */
export class Player {
  #series;
  #ahead;
  #changed;
  // Places go on where the series begins anew: place p is step p modulo the steps
  #place = 0;
  #since = null; // seconds, when the place before was due; null before a frame
  #from = 0;
  #playing = false;
  #rate = RATE;
  #frame = 0; // that is asked for

  /**
   * @param {Series} series
   * @param {object} host `show(prepared, step)` has a step drawn with the next frame;
   *   `changed()` is called when it plays or pauses, or another step is wanted; `failed(error)`
   *   when a step that was asked for cannot be shown.
   */
  constructor(series, { show, changed, failed }) {
    [this.#series, this.#changed] = [series, changed];
    this.#ahead = new Ahead(series, {
      show,
      came: (step) => step === this.step && this.#ahead.show(step),
      broken: (step, error) => step === this.step && !this.#playing && failed(error),
    });
    this.resume();
  }

  /** Index of the step that is shown, or will be as soon as it is decoded. */
  get step() {
    return this.#place % this.#series.length;
  }

  set step(step) {
    this.#place = Math.min(Math.max(Math.round(step), 0), this.#series.length - 1);
    [this.#from, this.#since] = [this.#place, null];
    this.resume();
    this.#changed();
  }

  /** Its time. */
  get time() {
    return this.#series.times[this.step];
  }

  /** Whether the step that is asked for is the one that was handed to be drawn. */
  get settled() {
    return this.#ahead.shown === this.step;
  }

  get playing() {
    return this.#playing;
  }

  /** Go on from the step that is shown, behind the last one from the first. */
  play({ rate = RATE } = {}) {
    if (!(rate > 0 && rate < Infinity)) {
      throw new RangeError(`A rate is steps per second, above 0; got ${rate}.`);
    }
    [this.#rate, this.#place, this.#since] = [rate, this.step, null];
    this.#from = this.#place;
    this.#playing = true;
    this.resume(); // what could not be fetched may come now
    this.#nextFrame();
    this.#changed();
  }

  pause() {
    if (!this.#playing) return;
    this.#playing = false;
    this.resume(); // where the step was not ready yet
    this.#changed();
  }

  close() {
    this.#playing = false;
    this.#ahead.stop();
  }

  /** Have the step that is asked for decoded, also what was given up when this was closed; show it. */
  resume() {
    if (this.#ahead.ready.has(this.step)) this.#ahead.show(this.step);
    this.#ahead.want([this.step], true);
  }

  #nextFrame() {
    cancelAnimationFrame(this.#frame);
    this.#frame = requestAnimationFrame(() => this.#tick());
  }

  #tick() {
    if (!this.#playing) return;
    const now = performance.now() / 1000, n = this.#series.length;
    this.#since ??= now;
    // The place whose time has come; the first step follows the last when all have come
    const place = this.#from + Math.floor((now - this.#since) * this.#rate);
    const due = this.#series.complete ? place : Math.min(place, n - 1);
    // Further back than a round the same steps come again
    for (let at = due; at > Math.max(this.#place, due - n); --at) {
      if (!this.#ahead.ready.has(at % n)) continue;
      this.#place = at;
      this.#ahead.show(at % n);
      this.#changed();
      break;
    }
    const first = Math.max(this.#place, due) + 1;
    const next = Array.from({ length: STEPS_AHEAD }, (_, k) => first + k);
    const coming = next.filter((place) => this.#series.complete || place < n).map((place) => place % n);
    this.#ahead.want(this.settled ? coming : [this.step, ...coming]);
    this.#nextFrame();
  }
}

/**
 * A button, a slider and the time of a viewer's series, in a bar; the space bar plays and pauses,
 * comma and period are a step back and forth.
 *
 * @returns {{show: function(), key: function(KeyboardEvent, EventTarget): boolean}} `show` what has
 *   changed; whether a `key` is taken.
 */
export function playerControls(bar, viewer) {
  const toggle = () => viewer.playing ? viewer.pause() : viewer.play();
  const step = () => viewer.series.nearest(viewer.time);
  const seek = (to) => {
    const { times } = viewer.series;
    viewer.time = times[Math.min(Math.max(to, 0), times.length - 1)];
  };
  const button = htmlElement("button", { type: "button" }), output = htmlElement("output");
  const time = slider("Time", { min: 0, step: 1 }, seek);
  button.addEventListener("click", toggle);
  bar.replaceChildren(button, time, output);
  const show = () => {
    bar.hidden = !viewer.series;
    if (bar.hidden) return;
    button.textContent = viewer.playing ? "\u275a\u275a" : "\u25b6\ufe0e";
    button.setAttribute("aria-label", viewer.playing ? "Pause" : "Play");
    time.max = viewer.series.length - 1;
    output.textContent = String(Number(viewer.time.toPrecision(6)));
    setSlider(time, step(), output.textContent);
  };
  const key = (event, target) => {
    if (!viewer.series) return false;
    const steps = { ",": -1, ".": 1 }[event.key];
    if (target === time && OF_SLIDERS.test(event.key)) return true; // it does
    if (target === button && [" ", "Enter"].includes(event.key)) return true; // so does this
    if (steps) seek(step() + steps);
    else if (event.key === " ") toggle();
    else return false;
    event.preventDefault();
    return true;
  };
  return { show, key };
}
