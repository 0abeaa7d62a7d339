// Mouse, touch and keyboard: the movements of vtkInteractorStyleTrackballCamera.
import { nearer, panned, rolled, rotated } from "./camera.js";

const MOTION_FACTOR = 10; // VTK's
const ROTATION = 20 * MOTION_FACTOR; // degrees per width, or height, of the window
const KEY_DEGREES = 5;
const KEY_PAN = 0.05; // of the window's height
const MOST_OF_WINDOW = 0.8; // a viewer that is higher could not be scrolled past

const degrees = (y, x) => (Math.atan2(y, x) * 180) / Math.PI;

/**
 * What a drag does: "rotate", "pan", "spin" or "dolly". Points and sizes are pixels from the window's
 * lower left corner; `height`: those that the camera's angle spans.
 */
export function dragged(what, camera, from, to, size, height = size[1]) {
  const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
  const [cx, cy] = [size[0] / 2, size[1] / 2];
  switch (what) {
    case "rotate":
      return rotated(camera, (-ROTATION * dx) / size[0], (-ROTATION * dy) / size[1]);
    case "pan":
      return panned(camera, dx / height, dy / height);
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
 * Hear keys before whatever is around: pages have shortcuts of their own, and those of JupyterLab
 * delete cells. `take(event, target)` does what a key is for, and says whether it is for anything;
 * others go on as if there were no viewer.
 */
export function hearKeys(root, take, signal) {
  const taken = new Set();
  const hear = (event) => {
    const [target, ...around] = event.composedPath();
    if (!around.includes(root)) return;
    if (event.type === "keydown" && take(event, target)) taken.add(event.code);
    else if (event.type === "keydown" || !taken.has(event.code)) return;
    if (event.type === "keyup") taken.delete(event.code);
    event.stopImmediatePropagation();
  };
  for (const type of ["keydown", "keypress", "keyup"]) {
    window.addEventListener(type, hear, { capture: true, signal });
  }
}

/** Whether something around an element can be scrolled up and down, or is in another page. */
export function scrollsAround(element) {
  if (window.self !== window.top) return true;
  const page = document.scrollingElement;
  for (let at = element.parentNode; at; at = at.parentNode ?? at.host) {
    if (!(at instanceof Element) || at.scrollHeight <= at.clientHeight + 1) continue;
    const { overflowY } = getComputedStyle(at);
    if (at === page ? overflowY !== "hidden" : /auto|scroll/.test(overflowY)) return true;
  }
  return false;
}

/**
 * Let people move a view, by pointers over an element. Of the view `camera` is read and `move(camera)`
 * takes the next one; `height`: pixels that its angle spans; `rest()`: a movement has ended; `shared`:
 * whether fingers and the wheel also scroll what is around, and `hint(text)` how it is moved then.
 */
export function interact(target, view, signal) {
  const pointers = new Map(); // identifier -> point
  let drag = null, before = null; // the view in which the pointer went down
  const size = () => [target.clientWidth, target.clientHeight];
  // In the element's own pixels, which a page may have turned or scaled
  const pointOf = ({ offsetX, offsetY }) => [offsetX, target.clientHeight - offsetY];
  const listen = (name, listener, options) =>
    target.addEventListener(name, listener, { signal, ...options });

  listen("pointerdown", (event) => {
    if (pointers.size >= 2) return;
    if (event.pointerType !== "touch") target.focus({ preventScroll: true });
    target.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, pointOf(event));
    drag = dragOf(event.button, event);
    before = view.camera;
  });
  listen("pointermove", (event) => {
    const from = pointers.get(event.pointerId);
    if (!from || !view.camera) return;
    const to = pointOf(event);
    if (pointers.size === 1) {
      view.move(dragged(drag, view.camera, from, to, size(), view.height));
    } else { // two fingers: what is under them stays under them
      const [other] = [...pointers].filter(([id]) => id !== event.pointerId).map(([, p]) => p);
      const apart = (p) => [p[0] - other[0], p[1] - other[1]];
      const [before, after] = [apart(from), apart(to)];
      const pinch = Math.hypot(...after) / Math.hypot(...before);
      const turn = degrees(after[1], after[0]) - degrees(before[1], before[0]);
      const middle = [(to[0] - from[0]) / 2, (to[1] - from[1]) / 2].map((d) => d / view.height);
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
  listen("pointercancel", (event) => { // the page is scrolled after all
    if (pointers.has(event.pointerId) && before) view.move(before);
    released(event);
  });
  listen("contextmenu", (event) => event.preventDefault());
  listen("wheel", (event) => {
    const isLow = target.clientHeight < MOST_OF_WINDOW * window.innerHeight;
    const isWorkedIn = isLow && target.getRootNode().activeElement === target;
    if (view.shared && !event.ctrlKey && !event.metaKey && !isWorkedIn) {
      view.hint("Turn the wheel with Ctrl to come nearer.");
      return;
    }
    event.preventDefault();
    if (!view.camera || event.deltaY === 0) return;
    // A notch of a wheel is VTK's; finer devices send parts of one
    const notch = event.deltaMode ? 3 : 100;
    const notches = Math.min(Math.max(-event.deltaY / notch, -1), 1);
    view.move(nearer(view.camera, 1.1 ** (0.2 * MOTION_FACTOR * notches)));
  }, { passive: false });
}
