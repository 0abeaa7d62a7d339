// What is seen, in the address of the page: #view=position:80,40,90/... A link shares it.
import { checkedCamera } from "./camera.js";
import { AS_MADE, checkedLook } from "./look.js";

/** Milliseconds after the last change from which it stands in the address: browsers limit how often. */
const WRITTEN_AFTER = 300;

const LISTS = { position: 3, focal_point: 3, view_up: 3, window_center: 2, clip: 6 };
const OF_TRANSFER = { cmap: (x) => x, clim: numbersIn, points: numbersIn };
const NUMBERS = ["view_angle", "parallel_scale", "brightness", "opacity", "time"];

const keysTaken = new Set(); // by viewers of this page

/**
 * What is seen as text: entries of the camera, the look and the time.
 *
 * @param {{camera: object, look: object, time: number|null}} state
 * @returns {string} `position:80,40,90/focal_point:...`; what is as it was made is left out.
 */
export function textOfView({ camera, look = AS_MADE, time = null }) {
  const { transfer, ...rest } = look, said = { ...camera };
  for (const [name, value] of Object.entries(rest)) {
    if (JSON.stringify(value) !== JSON.stringify(AS_MADE[name])) said[name] = value;
  }
  if (time !== null) said.time = time;
  for (const name of Object.keys(OF_TRANSFER)) if (transfer?.[name]) said[name] = transfer[name];
  return Object.entries(said)
    .filter(([name]) => name in LISTS || name in OF_TRANSFER || NUMBERS.includes(name))
    .map(([name, value]) => `${name}:${value}`).join("/");
}

/**
 * The state that such a text says.
 *
 * @throws {TypeError} That names what is wrong.
 */
export function viewOfText(text) {
  const said = {}, transfer = {};
  for (const entry of text.split("/")) {
    const [name, value = ""] = entry.split(":");
    if (Object.hasOwn(OF_TRANSFER, name)) {
      transfer[name] = OF_TRANSFER[name](value);
      continue;
    }
    if (!Object.hasOwn(LISTS, name) && !NUMBERS.includes(name)) {
      throw new TypeError(`A view in an address has no "${name}".`);
    }
    const numbers = numbersIn(value);
    if (numbers.length !== (LISTS[name] ?? 1) || !numbers.every(Number.isFinite)) {
      throw new TypeError(`The ${name} of a view in an address is ${LISTS[name] ?? 1} numbers ` +
        `with commas; got "${value}".`);
    }
    said[name] = name in LISTS ? numbers : numbers[0];
  }
  const { brightness = 1, opacity = 1, clip = AS_MADE.clip, time = null, ...camera } = said;
  const look = { brightness, opacity, clip, ...(Object.keys(transfer).length && { transfer }) };
  return { camera: checkedCamera(camera), look: checkedLook(look), time };
}

function numbersIn(text) {
  return text.split(",").map((part) => (part.trim() ? Number(part) : NaN));
}

const partsOfHash = (hash) => hash.replace(/^#/, "").split("&").filter(Boolean);

// The text that an address has for a key; undefined without one.
function saidIn(hash, key) {
  const part = partsOfHash(hash).find((each) => each.startsWith(`${key}=`));
  if (part === undefined) return undefined;
  try {
    return decodeURIComponent(part.slice(key.length + 1));
  } catch {
    return part.slice(key.length + 1); // it says no view, and that is told of
  }
}

/**
 * Keep what a viewer shows in the page's address, and follow the address.
 *
 * @param {string} key Before the `=`: of viewers with the same the first one is followed.
 * @param {object} host `state()` says what is shown, `null` where it is what the page begins with;
 *   `take(state)` shows something else, of null what the page begins with.
 * @param {AbortSignal} signal Ends it.
 * @returns {{changed: function()}|null} To be told that something else is shown; null where another
 *   viewer has the key.
 */
export function followAddress(key, host, signal) {
  if (keysTaken.has(key)) return null;
  keysTaken.add(key);
  let timer = 0;
  signal.addEventListener("abort", () => {
    keysTaken.delete(key);
    clearTimeout(timer);
  });
  const read = (hash) => {
    const text = saidIn(hash, key);
    if (text === undefined) {
      if (!partsOfHash(hash).length) host.take(null);
      return;
    }
    try {
      host.take(viewOfText(text));
    } catch (error) {
      console.info(`The view in this page's address is not followed: ${error.message}`);
    }
  };
  const written = () => {
    timer = 0;
    const state = host.state();
    const text = state ? textOfView(state) : "";
    if (text === (saidIn(location.hash, key) ?? "")) return;
    const others = partsOfHash(location.hash).filter((part) => !part.startsWith(`${key}=`));
    const hash = [...others, ...(text ? [`${key}=${text}`] : [])].join("&");
    try {
      history.replaceState(history.state, "", `#${hash}`);
    } catch (error) { // some pages have no address of their own
      console.info(`What is seen is not kept in this page's address: ${error.message}`);
    }
  };
  window.addEventListener("hashchange", () => read(location.hash), { signal });
  if (saidIn(location.hash, key) !== undefined) read(location.hash);
  return {
    changed() {
      clearTimeout(timer);
      timer = setTimeout(written, WRITTEN_AFTER);
    },
    now() { // who takes the address elsewhere wants what is seen now
      if (timer) clearTimeout(timer), written();
    },
  };
}
