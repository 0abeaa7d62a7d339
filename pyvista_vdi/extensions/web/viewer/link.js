// What is seen, in the address of the page: #view=position:80,40,90/... A link shares it.
import { checkedCamera } from "./camera.js";
import { AS_MADE, checkedLook, isAsMade } from "./look.js";

/** Milliseconds after the last change from which it stands in the address: browsers limit how often. */
const WRITTEN_AFTER = 300;

/** Numbers of an entry, or null for text or any number of them. */
const ENTRIES = {
  position: 3, focal_point: 3, view_up: 3, window_center: 2, view_angle: 1, parallel_scale: 1,
  brightness: 1, opacity: 1, clip: 6, time: 1, cmap: null, clim: null, points: null,
};

const keysTaken = new Set(); // by viewers of this page

/** What is seen as text, `position:80,40,90/focal_point:...`; what is as it was made is left out. */
export function textOfView({ camera, look: { transfer, ...look } = AS_MADE, time = null }) {
  const isOther = ([name, value]) => JSON.stringify(value) !== JSON.stringify(AS_MADE[name]);
  const said = { ...camera, ...Object.fromEntries(Object.entries(look).filter(isOther)), time, ...transfer };
  return Object.entries(said)
    .filter(([name, value]) => name in ENTRIES && value !== null)
    .map(([name, value]) => `${name}:${value}`).join("/");
}

/** The `camera`, `look` and `time` that such a text says; a TypeError names what is wrong. */
export function viewOfText(text) {
  const said = {};
  for (const entry of text.split("/")) {
    const [name, value = ""] = entry.split(":");
    if (!Object.hasOwn(ENTRIES, name)) throw new TypeError(`A view in an address has no "${name}".`);
    const numbers = value.split(",").map((part) => (part.trim() ? Number(part) : NaN));
    const count = ENTRIES[name];
    if (count && (numbers.length !== count || !numbers.every(Number.isFinite))) {
      throw new TypeError(`The ${name} of a view in an address is ${count} numbers with commas; ` +
        `got "${value}".`);
    }
    said[name] = name === "cmap" ? value : count === 1 ? numbers[0] : numbers;
  }
  const { brightness = 1, opacity = 1, clip = AS_MADE.clip, time = null,
    cmap, clim, points, ...camera } = said;
  const transfer = cmap || clim || points ? { cmap, clim, points } : undefined;
  const look = { brightness, opacity, clip, transfer };
  return { camera: checkedCamera(camera), look: checkedLook(look), time };
}

const partsOfHash = (hash) => hash.replace(/^#/, "").split("&").filter(Boolean);

// The text that an address has for a key; undefined without one.
function saidIn(hash, key) {
  const part = partsOfHash(hash).find((each) => each.startsWith(`${key}=`))?.slice(key.length + 1);
  try {
    return part && decodeURIComponent(part);
  } catch {
    return part; // it says no view, and that is told of
  }
}

// What a viewer shows, as text; empty where it is what the page begins with.
function textOfViewer({ camera, home, look, series, playing, time }) {
  const paused = series && !playing && time !== series.times[0] ? time : null;
  const begins = paused === null && isAsMade(look) && JSON.stringify(camera) === JSON.stringify(home);
  return !camera || begins ? "" : textOfView({ camera, look, time: paused });
}

/**
 * Keep what a viewer shows in the page's address, behind a key, and follow the address: `take(state)`
 * shows something else, of null what the page begins with. Of viewers with the same key the first one
 * is followed; for others null is returned, else what is to be told of changes: `changed()`.
 */
export function followAddress(key, viewer, take, signal) {
  if (keysTaken.has(key)) return null;
  keysTaken.add(key);
  let timer = 0;
  signal.addEventListener("abort", () => {
    keysTaken.delete(key);
    clearTimeout(timer);
  });
  const read = () => {
    const text = saidIn(location.hash, key);
    try {
      if (text !== undefined) take(viewOfText(text));
      else if (!partsOfHash(location.hash).length) take(null);
    } catch (error) {
      console.info(`The view in this page's address is not followed: ${error.message}`);
    }
  };
  const write = () => {
    const text = textOfViewer(viewer);
    if (text === (saidIn(location.hash, key) ?? "")) return;
    const others = partsOfHash(location.hash).filter((part) => !part.startsWith(`${key}=`));
    const hash = [...others, ...(text ? [`${key}=${text}`] : [])].join("&");
    try {
      history.replaceState(history.state, "", `#${hash}`);
    } catch (error) { // some pages have no address of their own
      console.info(`What is seen is not kept in this page's address: ${error.message}`);
    }
  };
  window.addEventListener("hashchange", read, { signal });
  if (saidIn(location.hash, key) !== undefined) read();
  return {
    changed() {
      clearTimeout(timer);
      timer = setTimeout(write, WRITTEN_AFTER);
    },
  };
}
