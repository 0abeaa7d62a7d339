// The workers that decode, or what stands for one on the page's own thread.
import { VDIFileError } from "./bytes.js";
import { spawn } from "./spawn.js";
import { serve } from "./worker.js";

/** Files that are decoded at a time, as many as browsers fetch at a time. */
const MOST_FILES = 6;
/** Milliseconds in which a worker says that it listens, if it is ours. */
const PATIENCE = 20000;

const idle = []; // workers that have nothing to do
const waiting = []; // what goes on when another file is done
let lent = 0;
let warned = false;

/**
 * Decode a file, in a worker that starts meanwhile, as soon as no more than MOST_FILES are decoded:
 * `work(ask)` has `ask(message, hear, handed)` say messages of worker.js to it, hear its answers, and
 * wait until it is done. The signal ends it, and the worker that is at it.
 */
export async function withWorker(signal, work) {
  signal.throwIfAborted();
  const lending = borrowed();
  let works = false; // whether it has been told what it has not finished
  let abort;
  const aborted = new Promise((_, reject) => (abort = () => reject(signal.reason)));
  aborted.catch(() => {});
  signal.addEventListener("abort", abort);
  const ask = async (message, hear, handed) => {
    const port = await Promise.race([aborted, lending]);
    works = true;
    await Promise.race([aborted, answered(port, message, hear, handed)]);
    works = !(message.end || message.file); // it has a part of a file
  };
  try {
    return await Promise.race([aborted, work(ask)]);
  } finally {
    signal.removeEventListener("abort", abort);
    lending.then((port) => giveBack(port, works));
  }
}

async function borrowed() {
  if (lent >= MOST_FILES) await new Promise((resolve) => waiting.push(resolve));
  else ++lent;
  return idle.pop() ?? started();
}

function giveBack(port, works) {
  port.onmessage = port.onerror = null;
  if (works) port.terminate();
  else if (port instanceof Worker) idle.push(port);
  const next = waiting.shift();
  if (next) next();
  else --lent;
}

// A worker that listens, or what stands for one on this thread where none may be started.
async function started() {
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
    if (!warned) {
      console.warn("<vdi-viewer> decodes on the page's own thread, as no worker starts: " +
        `${error.message || "its script cannot be loaded"}. Does the page's policy allow it ` +
        "(worker-src), and is worker.js beside the script (to some bundlers it is to be named as " +
        "another entry)?");
    }
    warned = true;
  }
  const port = { onmessage: null, terminate() {} };
  const scope = { postMessage: (data) => port.onmessage?.({ data }) };
  port.postMessage = (data) => scope.onmessage({ data });
  serve(scope);
  return port;
}

// Say something to a port, and wait until it is done.
function answered(port, message, hear, handed = []) {
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
