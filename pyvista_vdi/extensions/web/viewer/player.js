// Which step of a series is shown, and when; steps are decoded ahead, in a worker.
import { htmlElement } from "./html.js";

/** Steps per second of films. */
const RATE = 24;
/** Steps that are decoded before their time comes. */
const AHEAD = 3;
/** Share of the last step's decoding in what the next one is expected to take. */
const LAST = 0.3;

/** Keys that a slider takes by itself. */
const OF_SLIDERS = /^(Arrow|Page|Home|End)/;

/**
 * Shows one step of a series after the other, at a rate, leaving out what is not ready: where
 * decoding takes longer than steps last, it takes those that will be due when they are ready.
 */
export class Player {
  #series;
  #show;
  #changed;
  #failed;
  // Places go on where the series begins anew: place p is step p modulo the steps
  #place = 0;
  #since = null; // seconds, when the place before was due; null before a frame
  #from = 0;
  #playing = false;
  #rate = RATE;
  #loop = true;
  #ready = new Map(); // step -> what prepare.js made of it
  #broken = new Set();
  #shown = -1; // the step
  #seeking = false;
  #working = false;
  #seconds = 0; // that a step takes to be ready
  #frame = 0; // that is asked for

  /**
   * @param {Series} series
   * @param {object} host `show(prepared, time, step)` has a step drawn with the next frame;
   *   `changed()` is called when it plays or pauses, or another step is wanted; `failed(error)`
   *   when a step that was asked for cannot be shown.
   */
  constructor(series, { show, changed, failed }) {
    this.#series = series;
    [this.#show, this.#changed, this.#failed] = [show, changed, failed];
    this.#seek();
  }

  /** Index of the step that is shown, or will be as soon as it is decoded. */
  get step() {
    return this.#place % this.#series.length;
  }

  set step(step) {
    this.#moveTo(Math.min(Math.max(Math.round(step), 0), this.#series.length - 1));
    [this.#from, this.#since] = [this.#place, null];
    this.#broken.clear(); // one that could not be fetched may come now
    this.#seek();
    this.#changed();
  }

  /** Its time. */
  get time() {
    return this.#series.times[this.step];
  }

  set time(time) {
    this.step = this.#series.nearest(time);
  }

  /** Whether the step that is asked for is the one that was handed to be drawn. */
  get settled() {
    return this.#shown === this.step;
  }

  get playing() {
    return this.#playing;
  }

  /** Go on from the step that is shown, or from the first where the last one is. */
  play({ rate = RATE, loop = true } = {}) {
    if (!(rate > 0 && rate < Infinity)) {
      throw new RangeError(`A rate is steps per second, above 0; got ${rate}.`);
    }
    const n = this.#series.length;
    this.#place %= n;
    [this.#rate, this.#loop] = [rate, loop];
    if (!loop && this.#place === n - 1) this.#moveTo(0);
    [this.#from, this.#since] = [this.#place, null];
    this.#broken.clear();
    this.#playing = true;
    this.#nextFrame();
    this.#changed();
  }

  pause() {
    if (!this.#playing) return;
    this.#playing = false;
    this.#seek(); // where the step was not ready yet
    this.#changed();
  }

  /** Go on with what was given up when the series was closed. */
  resume() {
    this.#seek();
  }

  close() {
    this.#playing = false;
    this.#ready.clear();
    this.#series.close();
  }

  // -- frames ------------------------------------------------------------------------------------

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
      if (this.#ready.has(place % n)) {
        this.#moveTo(place);
        this.#give(place % n);
        this.#changed();
        break;
      }
    }
    if (this.#ended()) {
      this.pause();
      return;
    }
    this.#work();
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
    while (last > this.#place && this.#broken.has(last)) --last;
    return this.#place >= last;
  }

  #give(step) {
    if (this.#shown === step) return;
    this.#shown = step;
    this.#show(this.#ready.get(step), this.#series.times[step], step);
  }

  // Show a place, and forget the steps that are neither that nor soon to come.
  #moveTo(place) {
    this.#place = place;
    const n = this.#series.length, keep = new Set();
    for (let k = 0; k < AHEAD + 2; ++k) keep.add((place + k) % n);
    for (const step of [...this.#ready.keys()]) if (!keep.has(step)) this.#ready.delete(step);
  }

  // -- decoding ----------------------------------------------------------------------------------

  // Decode the step that is asked for, whatever is asked for meanwhile.
  async #seek() {
    if (this.#seeking) return;
    this.#seeking = true;
    while (!this.settled) {
      const { step } = this;
      try {
        if (!this.#ready.has(step)) this.#ready.set(step, await this.#series.prepared(step));
        if (this.#ready.has(step) && (step === this.step || !this.#playing)) this.#give(step);
      } catch (error) {
        if (error.name === "AbortError") break;
        if (step !== this.step) continue;
        this.#broken.add(step);
        if (!this.#playing) this.#failed(error);
        break;
      }
    }
    this.#seeking = false;
  }

  // Decode what is wanted, step after step, until enough are ready.
  async #work() {
    if (this.#working) return;
    this.#working = true;
    for (let step; this.#playing && (step = this.#wanted()) >= 0;) {
      const began = performance.now();
      try {
        this.#ready.set(step, await this.#series.prepared(step));
      } catch (error) {
        if (error.name === "AbortError") break;
        this.#broken.add(step); // the next ones may be whole
        continue;
      }
      const took = (performance.now() - began) / 1000;
      this.#seconds += (took - this.#seconds) * (this.#seconds ? LAST : 1);
      for (const late of [...this.#ready.keys()].slice(0, -AHEAD - 1)) this.#ready.delete(late);
    }
    this.#working = false;
  }

  // The next step to be decoded; -1 where enough are.
  #wanted() {
    const n = this.#series.length, now = performance.now() / 1000;
    const first = Math.max(this.#place + 1, this.#dueAt(now + this.#seconds));
    const end = this.#loops ? first + AHEAD : Math.min(first + AHEAD, n);
    for (let place = first; place < end; ++place) {
      const step = place % n;
      if (!this.#ready.has(step) && !this.#broken.has(step)) return step;
    }
    return -1;
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
