// A file from wherever it is to prepared levels: read piece by piece, decoded in a worker.
import { beginsAsSeries } from "./frames.js";
import { askPort, borrowPort, returnPort } from "./port.js";
import { Series } from "./series.js";
import { VDIFileError } from "./unpack.js";

const FIRST_BYTES = 1 << 16; // of a series that is read by ranges

/**
 * Load a VDI: first its coarse level, where the file has one, then the whole. Or a series or a set.
 *
 * @param {string|URL|Uint8Array|ArrayBuffer|Blob|ReadableStream|AsyncIterable} source A .vdi, .vdis
 *   or .vdiset file: where it is, its bytes, or its pieces, which may be base64 text as
 *   {@link embedded} gives it.
 * @param {object} options
 * @param {(prepared: object) => void} options.onLevel Called with each level as prepare.js makes
 *   it; its `level` is "coarse" or "full".
 * @param {(vdi: object) => void} [options.onBegin] Called before a coarse level with its camera,
 *   windowSize, bounds and depthOrigin.
 * @param {(series: Series) => void} [options.onSeries] Called with a series when it has a step. Of
 *   an address whose server gives parts of files, steps are read when they are asked for.
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
      const parts = await rangesOf(source, signal);
      const series = parts.read && await Series.ofParts(parts);
      signal?.throwIfAborted();
      if (series) {
        onSeries(series);
        onProgress(1);
        return;
      }
      source = parts.response ?? source;
    }
    pieces = piecesOf(source, onProgress, signal);
    const first = await unlessAborted(pieces.next());
    const rest = following(first, pieces);
    if (Series && onSeries && !first.done && beginsAsSeries(first.value)) {
      await unlessAborted(Series.ofPieces(rest, (series) => {
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
    for (let next; !(next = await unlessAborted(rest.next())).done;) await ask({ piece: next.value });
    await ask({ end: true });
    working = false;
  } finally {
    pieces?.return().catch(() => {});
    began.then((port) => returnPort(port, working));
  }
}

async function* following(first, pieces) {
  if (first.done) return;
  yield first.value;
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
    /\.vdis(et)?$/i.test(new URL(source, document.baseURI).pathname);
}

// A file whose server gives parts of it: its size, its first bytes and what reads others. Otherwise
// the response with all of it, or nothing where the size is not said.
async function rangesOf(url, signal) {
  const ask = (begin, end, by) => fetched(url, by, { Range: `bytes=${begin}-${end - 1}` });
  const response = await ask(0, FIRST_BYTES, signal);
  if (response.status !== 206) return { response };
  const size = Number(/\/(\d+)$/.exec(response.headers.get("Content-Range") ?? "")?.[1] ?? 0);
  const first = new Uint8Array(await response.arrayBuffer());
  if (!size || first.length !== Math.min(size, FIRST_BYTES)) return {};
  const read = async (begin, end) => {
    const part = await ask(begin, end);
    const bytes = part.status === 206 ? new Uint8Array(await part.arrayBuffer()) : [];
    if (bytes.length !== end - begin) {
      throw new VDIFileError(`${url} breaks off, or is another file by now: load it again`);
    }
    return bytes;
  };
  return { read, size, first };
}

async function fetched(url, signal, headers = {}) {
  let response;
  try {
    response = await fetch(url, { signal, headers });
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
