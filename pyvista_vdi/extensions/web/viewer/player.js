// Which step of a series is shown, and when; steps are decoded ahead, in a worker.
import { htmlElement } from "./html.js";
import { Ahead } from "./series.js";

/** Steps per second of films. */
const RATE = 24;
/** Steps that are decoded before their time comes. */
const STEPS_AHEAD = 3;

/** Keys that a slider takes by itself. */
const OF_SLIDERS = /^(Arrow|Page|Home|End)/;

/**
 * Shows one step of a series after the other, at a rate, leaving out what is not ready: where
 * decoding takes longer than steps last, it takes those that will be due when they are ready.
 */
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
  #loop = true;
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
    this.#seek();
  }

  /** Index of the step that is shown, or will be as soon as it is decoded. */
  get step() {
    return this.#place % this.#series.length;
  }

  set step(step) {
    this.#place = Math.min(Math.max(Math.round(step), 0), this.#series.length - 1);
    [this.#from, this.#since] = [this.#place, null];
    this.#seek();
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

  /** Go on from the step that is shown, or from the first where the last one is. */
  play({ rate = RATE, loop = true } = {}) {
    if (!(rate > 0 && rate < Infinity)) {
      throw new RangeError(`A rate is steps per second, above 0; got ${rate}.`);
    }
    const { step } = this;
    [this.#rate, this.#loop] = [rate, loop];
    this.#place = !loop && step === this.#series.length - 1 ? 0 : step;
    [this.#from, this.#since] = [this.#place, null];
    this.#playing = true;
    this.#seek(); // what could not be fetched may come now
    this.#nextFrame();
    this.#changed();
  }

  pause() {
    if (!this.#playing) return;
    this.#playing = false;
    this.#seek(); // where the step was not ready yet
    this.#changed();
  }

  /** Go on with what was given up when it was closed. */
  resume() {
    this.#seek();
  }

  close() {
    this.#playing = false;
    this.#ahead.stop();
  }

  // Have the step that is asked for decoded, unless it is, and shown.
  #seek() {
    if (this.#ahead.isReady(this.step)) this.#ahead.show(this.step);
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
    const due = this.#dueAt(now);
    // Further back than a round the same steps come again
    for (let place = due; place > Math.max(this.#place, due - n); --place) {
      if (this.#ahead.isReady(place % n)) {
        this.#place = place;
        this.#ahead.show(place % n);
        this.#changed();
        break;
      }
    }
    if (this.#ended()) {
      this.pause();
      return;
    }
    const first = Math.max(this.#place + 1, this.#dueAt(now + this.#ahead.seconds));
    const next = Array.from({ length: STEPS_AHEAD }, (_, k) => first + k);
    const coming = next.filter((place) => this.#loops || place < n).map((place) => place % n);
    this.#ahead.want(this.settled ? coming : [this.step, ...coming]);
    this.#nextFrame();
  }

  // The place whose time has come.
  #dueAt(now) {
    const place = this.#from + Math.floor((now - (this.#since ?? now)) * this.#rate);
    return this.#loops ? place : Math.min(place, this.#series.length - 1);
  }

  // Whether the first step follows the last: not while there are steps to come.
  get #loops() {
    return this.#loop && this.#series.complete;
  }

  #ended() {
    if (this.#loop || !this.#series.complete) return false;
    let last = this.#series.length - 1;
    while (last > this.#place && this.#ahead.isBroken(last)) --last;
    return this.#place >= last;
  }
}

/**
 * A button, a slider and the time; the space bar plays and pauses, comma and period are a step
 * back and forth.
 *
 * @param {HTMLElement} bar What they are put in.
 * @param {() => (Player|null)} playerOf
 * @param {() => number[]} timesOf
 * @param {{toggle: function(), seek: function(number)}} does
 * @param {AbortSignal} signal Ends it.
 * @returns {{show: function(), key: function(KeyboardEvent, EventTarget): boolean}} `show` what has
 *   changed; whether a `key` is taken.
 */
export function playerControls(bar, playerOf, timesOf, does, signal) {
  const button = htmlElement("button", { type: "button" }), output = htmlElement("output");
  const slider = htmlElement("input", { type: "range", min: 0, step: 1, label: "Time" });
  bar.replaceChildren(button, slider, output);
  button.addEventListener("click", does.toggle, { signal });
  slider.addEventListener("input", () => does.seek(Number(slider.value)), { signal });
  const show = () => {
    const player = playerOf();
    bar.hidden = !player;
    if (!player) return;
    const times = timesOf(), { step, playing } = player;
    button.textContent = playing ? "\u275a\u275a" : "\u25b6\ufe0e";
    button.setAttribute("aria-label", playing ? "Pause" : "Play");
    slider.max = times.length - 1;
    slider.value = step;
    const time = String(Number(times[step].toPrecision(6)));
    slider.setAttribute("aria-valuetext", time);
    output.textContent = time;
  };
  const key = (event, target) => {
    const player = playerOf();
    if (!player) return false;
    const steps = { ",": -1, ".": 1 }[event.key];
    if (target === slider && OF_SLIDERS.test(event.key)) return true; // it does
    if (target === button && [" ", "Enter"].includes(event.key)) return true; // so does this
    if (steps) does.seek(player.step + steps);
    else if (event.key === " ") does.toggle();
    else return false;
    event.preventDefault();
    return true;
  };
  return { show, key };
}
