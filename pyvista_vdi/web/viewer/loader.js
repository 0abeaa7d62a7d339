// A file from wherever it is to prepared levels: read piece by piece, decoded in a worker.
import { VDIFileError } from "./unpack.js";
import { serve } from "./worker.js";
import { spawnWorker } from "./spawn.js";

const idle = []; // workers that have nothing to do

/**
 * Load a VDI: first its coarse level, where the file has one, then the whole.
 *
 * @param {string|URL|Uint8Array|ArrayBuffer|ReadableStream|AsyncIterable} source A .vdi file: where
 *   it is, its bytes, or its pieces, which may be base64 text as {@link embedded} gives it.
 * @param {object} options
 * @param {(prepared: object) => void} options.onLevel Called with each level as prepare.js makes
 *   it; its `level` is "coarse" or "full".
 * @param {(vdi: object) => void} [options.onBegin] Called before a coarse level with its camera,
 *   windowSize, bounds and depthOrigin.
 * @param {(fraction: number) => void} [options.onProgress] Called with the share that was read,
 *   0 to 1, where the length is known.
 * @param {AbortSignal} [options.signal] Ends it; the promise is then rejected by its reason.
 * @returns {Promise<void>} Resolves when the full level has been given.
 * @throws {VDIFileError} A sentence that says what is wrong.
 */
export async function load(
  source, { onLevel, onBegin = () => {}, onProgress = () => {}, signal }
) {
  signal?.throwIfAborted();
  const aborted = new Promise((_, reject) => {
    signal?.addEventListener("abort", () => reject(signal.reason), { once: true });
  });
  aborted.catch(() => {});
  const port = await decodingPort();
  const ask = (message) => Promise.race([aborted, new Promise((resolve, reject) => {
    port.onmessage = ({ data }) => {
      if (data.error) reject(new VDIFileError(data.error));
      else if (data.done) resolve();
      else if (!signal?.aborted) data.begun ? onBegin(data.begun) : onLevel(data.prepared);
    };
    port.onerror = (event) => reject(new VDIFileError(`the VDI is not decoded: ${event.message}`));
    port.postMessage(message);
  })]);
  try {
    for await (const piece of piecesOf(source, onProgress, signal)) await ask({ piece });
    await ask({ end: true });
  } catch (error) {
    port.terminate();
    throw error;
  }
  port.onmessage = port.onerror = null;
  if (port instanceof Worker) idle.push(port);
}

const EMBEDDED = 'script[type="application/vdi+base64"]';

/**
 * The base64 text in an element's `<script type="application/vdi+base64">`, one or several, as the
 * page is read.
 *
 * @param {Element} element
 * @returns {AsyncGenerator<string>|null} For {@link load}; null where there is no such script yet.
 */
export function embedded(element) {
  return element.querySelector(EMBEDDED) && embeddedTexts(element);
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
  if (source instanceof Uint8Array) {
    yield source;
    onProgress(1);
    return;
  }
  let total = 0;
  if (typeof source === "string" || source instanceof URL) {
    const response = await fetched(source, signal);
    total = Number(response.headers.get("Content-Length"));
    source = response.body;
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

// A worker that listens, or what stands for one on this thread where none may be started.
async function decodingPort() {
  if (idle.length) return idle.pop();
  try {
    const worker = spawnWorker();
    await new Promise((resolve, reject) => {
      worker.onmessage = resolve;
      worker.onerror = reject;
    });
    return worker;
  } catch {
    const port = { onmessage: null, terminate() {} };
    const scope = { postMessage: (data) => port.onmessage?.({ data }) };
    port.postMessage = (data) => scope.onmessage({ data });
    serve(scope);
    return port;
  }
}
