// The worker that decodes, or what stands for one on the page's own thread.
import { waysToSpawn } from "./spawn.js";
import { VDIFileError } from "./unpack.js";
import { serve } from "./worker.js";

/** Files that are decoded at a time, as many as browsers fetch at a time. */
const MOST_FILES = 6;

/** Milliseconds in which a worker says that it listens, if it is ours. */
const PATIENCE = 20000;

const idle = []; // workers that have nothing to do
const waiting = []; // what goes on when another file is done
let lent = 0;
let warned = false;

/** A worker that listens, or what stands for one on this thread where none may be started. */
export async function decodingPort() {
  if (idle.length) return idle.pop();
  const causes = new Set();
  for (const spawn of waysToSpawn) {
    let worker = null;
    try {
      worker = spawn();
      await new Promise((resolve, reject) => {
        worker.onmessage = resolve;
        worker.onerror = reject;
        setTimeout(reject, PATIENCE, new Error(`it says nothing for ${PATIENCE / 1000} s`));
      });
      return worker;
    } catch (error) {
      worker?.terminate();
      causes.add(error.message || "its script cannot be loaded");
    }
  }
  if (!warned) {
    console.warn("<vdi-viewer> decodes on the page's own thread, as no worker starts: " +
      `${[...causes].join("; ")}. Does the page's policy allow it (worker-src), and is worker.js ` +
      "beside the script (to some bundlers it is to be named as another entry)?");
    warned = true;
  }
  const port = { onmessage: null, terminate() {} };
  const scope = { postMessage: (data) => port.onmessage?.({ data }) };
  port.postMessage = (data) => scope.onmessage({ data });
  serve(scope);
  return port;
}

/** Give back a port that has nothing to do. */
export function releasePort(port) {
  port.onmessage = port.onerror = null;
  if (port instanceof Worker) idle.push(port);
}

/** A port for one file, as soon as no more than MOST_FILES have one. */
export async function borrowPort() {
  if (lent >= MOST_FILES) await new Promise((resolve) => waiting.push(resolve));
  else ++lent;
  return decodingPort();
}

/** Give it back, or end it where it still works. */
export function returnPort(port, works) {
  works ? port.terminate() : releasePort(port);
  const next = waiting.shift();
  next ? next() : --lent;
}

/**
 * Say something to a port, and wait until it is done.
 *
 * @param {object} port Of {@link decodingPort}.
 * @param {object} message See worker.js.
 * @param {(data: object) => void} hear Called with what it says meanwhile.
 * @param {ArrayBuffer[]} [handed] What is handed over.
 * @returns {Promise<void>}
 * @throws {VDIFileError} A sentence that says what is wrong.
 */
export function askPort(port, message, hear, handed = []) {
  return new Promise((resolve, reject) => {
    port.onmessage = ({ data }) => {
      if (data.error) reject(new VDIFileError(data.error));
      else if (data.done) resolve();
      else {
        try {
          hear(data);
        } catch (error) { // what is wrong with what was decoded, not with the port
          reject(error);
        }
      }
    };
    port.onerror = (event) => reject(new VDIFileError(`the VDI is not decoded: ${event.message}`));
    port.postMessage(message, handed);
  });
}
