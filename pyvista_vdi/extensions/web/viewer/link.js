// What is seen, in the address of the page: #view={"camera":...}. A link shares it.
import { checkedCamera } from "./camera.js";
import { AS_MADE, checkedLook, isAsMade } from "./look.js";

/** Milliseconds after the last change from which it stands in the address: browsers limit how often. */
const WRITTEN_AFTER = 300;

const keysTaken = new Set(); // by viewers of this page

/** What is seen as text of an address, JSON: what is as it was made is left out. */
export function textOfView({ camera, look = AS_MADE }) {
  return encodeURIComponent(JSON.stringify({ camera, ...(!isAsMade(look) && { look }) }));
}

/** The `camera` and `look` that such a text says; an error names what is wrong. */
export function viewOfText(text) {
  const { camera, look = {} } = JSON.parse(decodeURIComponent(text));
  return { camera: checkedCamera(camera), look: checkedLook(look) };
}

const partsOfHash = (hash) => hash.replace(/^#/, "").split("&").filter(Boolean);

// The text that an address has for a key; undefined without one.
function saidIn(hash, key) {
  return partsOfHash(hash).find((each) => each.startsWith(`${key}=`))?.slice(key.length + 1);
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
    const { camera, home, look } = viewer;
    const begins = isAsMade(look) && JSON.stringify(camera) === JSON.stringify(home);
    const text = !camera || begins ? "" : textOfView({ camera, look });
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
