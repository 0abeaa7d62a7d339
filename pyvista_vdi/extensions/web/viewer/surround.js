// Which VDI of a set is shown: the one nearest to the view. Its neighbours come ahead.
import { isParallel } from "./rays.js";
import { Ahead } from "./series.js";
import { cross, dot, subtract, times } from "./vectors.js";

/** VDIs that are decoded: the nearest, and its neighbours. */
const NEAREST_VIEWS = 5;
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

/** Shows of a set what was made nearest to the view: a player whose step the view chooses. */
export class Surround {
  #set;
  #ahead;
  #changed;
  #centre;
  #places; // of the views
  #here = null;

  /** Index of the VDI that is nearest to the view. */
  step = -1;

  /**
   * @param {Series} set Its `views` are the V_Os' cameras, its `bounds` those of the data.
   * @param {object} host `show(prepared, index)` has a VDI drawn with the next frame;
   *   `changed()` is called when another one is wanted; `failed(error)` when it cannot be shown.
   */
  constructor(set, { show, changed, failed }) {
    [this.#set, this.#changed] = [set, changed];
    this.#ahead = new Ahead(set, {
      show,
      // Of what is there the nearest, until the very nearest is
      came: () => this.#ahead.show(this.#order().find((i) => this.#ahead.ready.has(i))),
      broken: (i, error) => i === this.step && failed(error),
    });
    const middle = [0, 2, 4].map((k) => (set.bounds[k] + set.bounds[k + 1]) / 2);
    const model = set.views[0].model_transform;
    this.#centre = model.slice(0, 3).map((row) => dot(row, middle) + row[3]);
    this.#places = set.views.map((view) => placeOf(view, this.#centre));
  }

  /** Whether the nearest is the one that was handed to be drawn. */
  get settled() {
    return this.#ahead.shown === this.step && this.step >= 0;
  }

  close() {
    this.#ahead.stop();
  }

  /** Look from a view: show the nearest VDI as soon as it is there. */
  look(camera) {
    this.#here = placeOf(camera, this.#centre);
    this.resume();
  }

  /** Choose among the VDIs that there are by now, also when what was closed goes on. */
  resume() {
    if (!this.#here) return;
    const order = this.#order(), [nearest] = order, isOther = nearest !== this.step;
    this.step = nearest;
    if (this.#ahead.ready.has(nearest)) this.#ahead.show(nearest);
    this.#changed();
    this.#ahead.want(order.slice(0, NEAREST_VIEWS), isOther);
  }

  // The set's VDIs, the nearest to the view first.
  #order() {
    const far = this.#places.slice(0, this.#set.length).map((place) => apart(this.#here, place));
    return [...far.keys()].sort((i, k) => far[i] - far[k]);
  }
}
