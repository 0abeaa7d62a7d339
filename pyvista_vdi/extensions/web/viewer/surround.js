// Which VDI of a set is shown: the one nearest to the view. Those that it heads for come ahead.
import { isParallel } from "./rays.js";
import { add, cross, dot, subtract, times } from "./vectors.js";

/** VDIs that are decoded, or being decoded, beside the one that is shown. */
const AHEAD_OF_VIEW = 4;
/** Decoded VDIs that are kept. */
const KEPT_VIEWS = 10;
/** How far ahead of its last movement a view is expected, in such movements. */
const HEADING = 4;
/** Tangent of half the angle of VTK's lens: it says how far away a parallel view would be. */
const LENS = Math.tan(Math.PI / 12);

// Direction of an eye from a centre, and the logarithm of its distance.
function placeOf(camera, centre) {
  const arm = subtract(camera.position, centre);
  const length = Math.hypot(...arm) || 1;
  const away = isParallel(camera) ? camera.parallel_scale / LENS : length;
  return { towards: times(arm, 1 / length), away: Math.log(away) };
}

// As VDISet.distances: the angle between two eyes and the logarithm of the ratio of distances.
function apart(a, b) {
  const sine = Math.hypot(...cross(a.towards, b.towards));
  return Math.hypot(Math.atan2(sine, dot(a.towards, b.towards)), a.away - b.away);
}

/** Shows of a set what was made nearest to the view. */
export class Surround {
  #set;
  #host;
  #centre;
  #places; // of the views
  #here = null;
  #before = null;
  #nearest = -1; // index
  #shown = -1;
  #ready = new Map(); // index -> what prepare.js made; what was used last is last
  #broken = new Set();
  #working = false;
  #closed = false;

  /** There is no time in a set. */
  time = null;
  playing = false;

  /**
   * @param {Series} set Its `views` are the V_Os' cameras, its `bounds` those of the data.
   * @param {object} host `show(prepared, index)` has a VDI drawn with the next frame;
   *   `changed()` is called when another one is wanted; `failed(error)` when it cannot be shown.
   */
  constructor(set, host) {
    [this.#set, this.#host] = [set, host];
    const middle = [0, 2, 4].map((k) => (set.bounds[k] + set.bounds[k + 1]) / 2);
    const model = set.views[0].model_transform ??
      [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]];
    this.#centre = [0, 1, 2].map((row) =>
      model[row][3] + middle.reduce((sum, x, k) => sum + model[row][k] * x, 0));
    this.#places = set.views.map((view) => placeOf(view, this.#centre));
  }

  /** Index of the VDI that is nearest to the view. */
  get step() {
    return this.#nearest;
  }

  /** Whether the nearest is the one that was handed to be drawn. */
  get settled() {
    return this.#shown === this.#nearest && this.#shown >= 0;
  }

  pause() {}

  /** Go on with what was given up when the set was closed. */
  resume() {
    if (this.#here) this.#work();
  }

  close() {
    this.#closed = true;
    this.#ready.clear();
    this.#set.close();
  }

  /** Look from a view: show the nearest VDI as soon as it is there. */
  look(camera) {
    const here = placeOf(camera, this.#centre);
    if (this.#here && apart(here, this.#here) > 0) this.#before = this.#here;
    this.#here = here;
    this.#choose();
  }

  /** There are more VDIs than before. */
  grown() {
    if (this.#here) this.#choose();
  }

  #choose() {
    const nearest = this.#order(this.#here)[0];
    if (nearest !== this.#nearest) {
      this.#nearest = nearest;
      this.#broken.delete(nearest); // one that could not be fetched may come now
    }
    if (this.#ready.has(nearest)) this.#give(nearest);
    this.#host.changed();
    this.#work();
  }

  // The set's VDIs, the nearest to a place first.
  #order(place) {
    const far = Array.from({ length: this.#set.length }, (_, i) =>
      apart(place, this.#places[i]));
    return [...far.keys()].sort((i, k) => far[i] - far[k]);
  }

  #give(i) {
    const prepared = this.#ready.get(i);
    this.#ready.delete(i);
    this.#ready.set(i, prepared);
    if (this.#shown === i) return;
    this.#shown = i;
    this.#host.show(prepared, i);
  }

  // Where the view will be if it goes on as it did last.
  #ahead() {
    if (!this.#before) return this.#here;
    const { towards, away } = this.#here;
    const on = add(towards, subtract(towards, this.#before.towards), HEADING);
    const length = Math.hypot(...on) || 1;
    return { towards: times(on, 1 / length),
      away: away + HEADING * (away - this.#before.away) };
  }

  // The next VDI to be decoded: the nearest, then those that the view heads for; -1: enough are.
  #wanted() {
    const wanted = new Set([this.#nearest, ...this.#order(this.#ahead()).slice(0, AHEAD_OF_VIEW)]);
    for (const i of wanted) if (!this.#ready.has(i) && !this.#broken.has(i)) return i;
    return -1;
  }

  // Decode what is wanted, one after the other, whatever is wanted meanwhile.
  async #work() {
    if (this.#working) return;
    this.#working = true;
    for (let i; !this.#closed && (i = this.#wanted()) >= 0;) {
      try {
        this.#ready.set(i, await this.#set.prepared(i));
      } catch (error) {
        if (error.name === "AbortError") break;
        this.#broken.add(i);
        if (i === this.#nearest) this.#host.failed(error);
        continue;
      }
      for (const old of this.#ready.keys()) {
        if (this.#ready.size <= KEPT_VIEWS) break;
        if (old !== this.#nearest && old !== this.#shown) this.#ready.delete(old);
      }
      // Of what is there the nearest, until the very nearest is
      const [best] = this.#order(this.#here).filter((k) => this.#ready.has(k));
      if (best !== undefined && !this.#closed) this.#give(best);
    }
    this.#working = false;
  }
}
