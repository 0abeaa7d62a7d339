// A file from wherever it is to prepared levels: read piece by piece, decoded in a worker.
import { GrowingBytes, VDIFileError } from "./bytes.js";
import { withWorker } from "./port.js";
import { BEGIN, Series, beginsAsSeries } from "./series.js";

/**
 * Load a VDI: first its coarse level, where the file has one, then the whole. Or a series or a set.
 *
 * @param {string|URL|Uint8Array|ArrayBuffer|Blob|ReadableStream|AsyncIterable} source A .vdi, .vdis
 *   or .vdiset file: where it is, its bytes, or its pieces, which may be base64 text as
 *   {@link embedded} gives it.
 * @param {object} options `onLevel(prepared)` is called with each level as prepare.js makes it,
 *   `onSeries(series)` in its place, as soon as it has a VDI; `onProgress(share)` with what is read
 *   of 1. `signal` ends it: nothing is called any more.
 * @throws {VDIFileError} A sentence that says what is wrong.
 */
export async function load(source, { onLevel, onSeries, onProgress = () => {},
  signal = new AbortController().signal }) {
  const unlessAborted = (call) => (given) => signal.aborted || call(given);
  const [level, series, progress] = [onLevel, onSeries, onProgress].map(unlessAborted);
  let pieces = null;
  try {
    const { reading } = await withWorker(signal, async (ask) => {
      pieces = piecesOf(source, progress, signal);
      const head = new GrowingBytes(); // which tells what it is
      for (let next; head.whole.length < BEGIN || head.broken; head.push(next.value)) {
        if ((next = await pieces.next()).done) break;
      }
      if (onSeries && beginsAsSeries(head.whole)) {
        return { reading: Series.ofPieces(head.whole, pieces, series) }; // without this worker
      }
      const hear = ({ prepared }) => level(prepared);
      await ask({ piece: head.whole }, hear);
      for await (const piece of pieces) await ask({ piece }, hear);
      await ask({ end: true }, hear);
      return {};
    });
    await reading;
  } finally {
    pieces?.return().catch(() => {});
  }
}

const EMBEDDED = 'script[type="application/vdi+base64"]';

/**
 * The base64 text in an element's scripts, as the page is read: for {@link load}, also once more; null
 * where there is no such script yet.
 */
export function embedded(element) {
  return element.querySelector(EMBEDDED) && { [Symbol.asyncIterator]: () => textsIn(element) };
}

async function* textsIn(element) {
  for (let taken = 0; ;) {
    const parsed = document.readyState !== "loading";
    const scripts = element.querySelectorAll(EMBEDDED);
    // The last one may still be growing
    while (taken < scripts.length - (parsed ? 0 : 1)) yield scripts[taken++].textContent;
    if (parsed) return;
    if (document.readyState !== "loading") continue; // it was read while the text was taken
    await new Promise((resolve) => {
      new MutationObserver((_, observer) => {
        observer.disconnect();
        resolve();
      }).observe(element, { childList: true });
      document.addEventListener("readystatechange", resolve, { once: true });
    });
  }
}

async function* piecesOf(source, onProgress, signal) {
  let total = 0;
  if (typeof source === "string" || source instanceof URL) {
    const response = await fetched(source, signal);
    total = Number(response.headers.get("Content-Length"));
    source = response.body;
  }
  if (source instanceof ArrayBuffer) source = new Uint8Array(source);
  if (source instanceof Blob) source = source.stream();
  if (!(source instanceof ReadableStream)) {
    yield* source instanceof Uint8Array ? [source] : source;
    return;
  }
  const reader = source.getReader();
  try {
    for (let read = 0, next; !(next = await reader.read()).done;) {
      read += next.value.length;
      yield next.value;
      if (total) onProgress(Math.min(1, read / total));
    }
  } catch (error) {
    if (signal.aborted) throw error;
    throw new VDIFileError(`the VDI file breaks off while it is read (${error.message})`);
  } finally {
    reader.cancel().catch(() => {});
  }
}

async function fetched(url, signal) {
  let response;
  try {
    response = await fetch(url, { signal });
  } catch (error) {
    if (signal?.aborted) throw error;
    throw new VDIFileError(
      location.protocol === "file:"
        ? `${url} cannot be read: a page that is opened from disk may load no other files. Write ` +
          "one page with the VDI in it by pyvista-vdi convert x.vdi -o x.html, or serve the folder"
        : `${url} cannot be read (${error.message}): is it there, and may this page load it?`
    );
  }
  if (!response.ok) {
    throw new VDIFileError(`${url} cannot be read: ${response.status} ${response.statusText}`);
  }
  return response;
}
