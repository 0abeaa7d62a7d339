// Mouse, touch and keyboard: the movements of vtkInteractorStyleTrackballCamera.
import { nearer, panned, rolled, rotated } from "./camera.js";

const MOTION_FACTOR = 10; // VTK's
const ROTATION = 20 * MOTION_FACTOR; // degrees per width, or height, of the window
const KEY_DEGREES = 5;
const KEY_PAN = 0.05; // of the window's height

const degrees = (y, x) => (Math.atan2(y, x) * 180) / Math.PI;

/**
 * What a drag does: the view after the pointer went from one point to another.
 *
 * @param {"rotate"|"pan"|"spin"|"dolly"} what
 * @param {object} camera Before.
 * @param {number[]} from Pixels from the window's lower left corner, as `to`.
 * @param {number[]} to
 * @param {number[]} size Of the window.
 */
export function dragged(what, camera, from, to, size) {
  const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
  const [cx, cy] = [size[0] / 2, size[1] / 2];
  switch (what) {
    case "rotate":
      return rotated(camera, (-ROTATION * dx) / size[0], (-ROTATION * dy) / size[1]);
    case "pan":
      return panned(camera, dx / size[1], dy / size[1]);
    case "spin":
      return rolled(camera, degrees(to[1] - cy, to[0] - cx) - degrees(from[1] - cy, from[0] - cx));
    default:
      return nearer(camera, 1.1 ** ((MOTION_FACTOR * dy) / cy));
  }
}

/** What a button of the mouse does, with the keys that are held. */
export function dragOf(button, { shiftKey, ctrlKey }) {
  if (button === 1) return "pan";
  if (button === 2) return "dolly";
  if (shiftKey) return ctrlKey ? "dolly" : "pan";
  return ctrlKey ? "spin" : "rotate";
}

/** What a key does to a view; undefined for other keys. */
export function keyed(camera, { key, shiftKey }) {
  const arrow = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowDown: [0, -1], ArrowUp: [0, 1] }[key];
  if (arrow && shiftKey) return panned(camera, KEY_PAN * arrow[0], KEY_PAN * arrow[1]);
  if (arrow) return rotated(camera, -KEY_DEGREES * arrow[0], -KEY_DEGREES * arrow[1]);
  if (key === "+" || key === "=") return nearer(camera, 1.1);
  if (key === "-") return nearer(camera, 1 / 1.1);
  return undefined;
}

/**
 * Let people move a view.
 *
 * @param {HTMLElement} target What the pointer is over.
 * @param {{camera: object, move: function(object), rest: function(), reset: function()}} view
 *   `camera` is read and `move` takes the next one; `rest` is called when a movement ends.
 * @param {AbortSignal} signal Ends it.
 */
export function interact(target, view, signal) {
  const pointers = new Map(); // identifier -> point
  let drag = null;
  const size = () => [target.clientWidth, target.clientHeight];
  const pointOf = (event) => {
    const box = target.getBoundingClientRect();
    return [event.clientX - box.left, box.bottom - event.clientY];
  };
  const listen = (name, listener, options) =>
    target.addEventListener(name, listener, { signal, ...options });

  listen("pointerdown", (event) => {
    if (pointers.size >= 2) return;
    target.focus({ preventScroll: true });
    target.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, pointOf(event));
    drag = dragOf(event.button, event);
  });
  listen("pointermove", (event) => {
    const from = pointers.get(event.pointerId);
    if (!from || !view.camera) return;
    const to = pointOf(event);
    if (pointers.size === 1) {
      view.move(dragged(drag, view.camera, from, to, size()));
    } else { // two fingers: what is under them stays under them
      const [other] = [...pointers].filter(([id]) => id !== event.pointerId).map(([, p]) => p);
      const apart = (p) => [p[0] - other[0], p[1] - other[1]];
      const [before, after] = [apart(from), apart(to)];
      const pinch = Math.hypot(...after) / Math.hypot(...before);
      const turn = degrees(after[1], after[0]) - degrees(before[1], before[0]);
      const middle = [(to[0] - from[0]) / 2, (to[1] - from[1]) / 2].map((d) => d / size()[1]);
      let camera = panned(view.camera, ...middle);
      if (Number.isFinite(pinch) && pinch > 0) camera = nearer(rolled(camera, turn), pinch);
      view.move(camera);
    }
    pointers.set(event.pointerId, to);
  });
  const released = (event) => {
    if (pointers.delete(event.pointerId) && pointers.size === 0) view.rest();
    drag = "rotate"; // of the finger that is left
  };
  listen("pointerup", released);
  listen("pointercancel", released);
  listen("contextmenu", (event) => event.preventDefault());
  listen("wheel", (event) => {
    event.preventDefault();
    if (!view.camera || event.deltaY === 0) return;
    // A notch of a wheel is VTK's; finer devices send parts of one
    const notch = event.deltaMode ? 3 : 100;
    const notches = Math.min(Math.max(-event.deltaY / notch, -1), 1);
    view.move(nearer(view.camera, 1.1 ** (0.2 * MOTION_FACTOR * notches)));
  }, { passive: false });
  listen("keydown", (event) => {
    if (event.altKey || event.metaKey || event.ctrlKey || !view.camera) return;
    if (event.key === "r" || event.key === "R") return view.reset();
    const camera = keyed(view.camera, event);
    if (!camera) return;
    event.preventDefault();
    view.move(camera);
  });
}
