// A file from wherever it is to prepared levels: read piece by piece, decoded in a worker.
import { askPort, borrowPort, returnPort } from "./port.js";
import { BEGIN, Series, beginsAsSeries } from "./series.js";
import { GrowingBytes, VDIFileError } from "./unpack.js";

/**
 * Load a VDI: first its coarse level, where the file has one, then the whole. Or a series or a set.
 *
 * @param {string|URL|Uint8Array|ArrayBuffer|Blob|ReadableStream|AsyncIterable} source A .vdi, .vdis
 *   or .vdiset file: where it is, its bytes, or its pieces, which may be base64 text as
 *   {@link embedded} gives it. Or where the folder of a series is.
 * @param {object} options
 * @param {(prepared: object) => void} options.onLevel Called with each level as prepare.js makes
 *   it; its `level` is "coarse" or "full".
 * @param {(vdi: object) => void} [options.onBegin] Called before a coarse level with its camera,
 *   windowSize, bounds and depthOrigin.
 * @param {(series: Series) => void} [options.onSeries] Called with a series when it has a step. Of
 *   a folder, steps are read when they are asked for.
 * @param {(fraction: number) => void} [options.onProgress] Called with the share that was read,
 *   0 to 1, where the length is known.
 * @param {AbortSignal} [options.signal] Ends it; the promise is then rejected by its reason.
 * @returns {Promise<void>} Resolves when the full level has been given, or the series.
 * @throws {VDIFileError} A sentence that says what is wrong.
 */
export async function load(
  source, { onLevel, onBegin = () => {}, onSeries, onProgress = () => {}, signal }
) {
  signal?.throwIfAborted();
  const aborted = new Promise((_, reject) => {
    signal?.addEventListener("abort", () => reject(signal.reason), { once: true });
  });
  aborted.catch(() => {});
  const unlessAborted = (promise) => Promise.race([aborted, promise]);
  const began = borrowPort(); // it starts while the first bytes come
  let working = false; // whether it has been told what it has not finished
  let pieces = null;
  try {
    if (isSeriesAddress(source) && Series && onSeries) {
      const { folder, response } = await folderAt(source, signal);
      if (folder) {
        const name = /\.vdis\/$/i.test(folder.pathname) ? "series.json" : "set.json";
        const series = await Series.ofFolder(name, async (file) =>
          new Uint8Array(await (await fetched(new URL(file, folder))).arrayBuffer()));
        signal?.throwIfAborted();
        onSeries(series);
        onProgress(1);
        return;
      }
      source = response;
    }
    pieces = piecesOf(source, onProgress, signal);
    const rest = await unlessAborted(begun(pieces));
    if (Series && onSeries && rest.first && beginsAsSeries(rest.first)) {
      await unlessAborted(Series.ofPieces(rest.pieces, (series) => {
        if (!signal?.aborted) onSeries(series);
      }));
      return;
    }
    const port = await began;
    working = true;
    const hear = ({ begun, prepared }) => {
      if (!signal?.aborted) begun ? onBegin(begun) : onLevel(prepared);
    };
    const ask = (message) => unlessAborted(askPort(port, message, hear));
    for (let next; !(next = await unlessAborted(rest.pieces.next())).done;) await ask({ piece: next.value });
    await ask({ end: true });
    working = false;
  } finally {
    pieces?.return().catch(() => {});
    began.then((port) => returnPort(port, working));
  }
}

// The first bytes, or the first text, of pieces, and all of them.
async function begun(pieces) {
  let { value: first, done } = await pieces.next();
  while (!done && typeof first !== "string" && first.length < BEGIN) {
    const next = await pieces.next();
    if ((done = next.done)) break;
    const [before, piece] = [new GrowingBytes(), next.value];
    [first, piece].forEach((each) => before.push(each));
    first = before.whole;
  }
  return { first, pieces: following(first, pieces) };
}

async function* following(first, pieces) {
  if (first === undefined) return;
  yield first;
  yield* pieces;
}

const EMBEDDED = 'script[type="application/vdi+base64"]';

/**
 * The base64 text in an element's `<script type="application/vdi+base64">`, one or several, as the
 * page is read.
 *
 * @param {Element} element
 * @returns {AsyncIterable<string>|null} For {@link load}, also once more; null where there is no
 *   such script yet.
 */
export function embedded(element) {
  return element.querySelector(EMBEDDED) &&
    { [Symbol.asyncIterator]: () => embeddedTexts(element) };
}

async function* embeddedTexts(element) {
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
  if (source instanceof ArrayBuffer) source = new Uint8Array(source);
  if (source instanceof Blob) source = source.stream();
  if (source instanceof Uint8Array) {
    yield source;
    onProgress(1);
    return;
  }
  let total = 0;
  if (typeof source === "string" || source instanceof URL) source = await fetched(source, signal);
  if (source instanceof Response) {
    total = Number(source.headers.get("Content-Length"));
    source = source.body;
  }
  if (!(source instanceof ReadableStream)) {
    yield* source;
    return;
  }
  const reader = source.getReader();
  try {
    for (let read = 0; ;) {
      const { done, value } = await reader.read();
      if (done) break;
      read += value.length;
      yield value;
      if (total) onProgress(Math.min(1, read / total));
    }
  } catch (error) {
    if (signal?.aborted || error instanceof VDIFileError) throw error;
    throw new VDIFileError(`the VDI file breaks off while it is read (${error.message})`);
  } finally {
    reader.cancel().catch(() => {});
  }
}

// Whether an address is one of a series, or a set: by its name.
function isSeriesAddress(source) {
  if (typeof source !== "string" && !(source instanceof URL)) return false;
  return URL.canParse(source, document.baseURI) &&
    /\.vdis(et)?\/?$/i.test(new URL(source, document.baseURI).pathname);
}

// Whether an address is that of a folder: it ends in a slash, by itself or as servers say. Otherwise
// the response with the file.
async function folderAt(source, signal) {
  const url = new URL(source, document.baseURI);
  if (url.pathname.endsWith("/")) return { folder: url };
  const response = await fetched(url, signal);
  const found = response.url ? new URL(response.url) : url;
  if (!found.pathname.endsWith("/")) return { response };
  response.body?.cancel();
  return { folder: found };
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
