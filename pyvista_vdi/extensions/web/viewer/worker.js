// What runs in the worker: bytes come, prepared levels go. A page that may start none runs it, too.
import { LevelDecoder, decodeVDI } from "./decode.js";
import { prepare, transferables } from "./prepare.js";

/**
 * Decode files whose pieces come as messages, one file after the other.
 *
 * Messages to it are `{ piece }` (Uint8Array, or base64 text) and `{ end: true }`; or `{ file }`, for a
 * whole .vdi file, as of a step. It sends `{ ready: true }` when it listens, `{ prepared }` for each
 * level, and answers a message by `{ done: true }`, or by `{ error }`, a sentence. After an error it
 * takes no more pieces. `scope`: the worker's, or what stands for it.
 */
export function serve(scope) {
  const give = (vdi) => {
    const prepared = prepare(vdi);
    scope.postMessage({ prepared }, transferables(prepared));
  };
  let decoder = new LevelDecoder(give);
  scope.onmessage = async ({ data: { piece, end, file } }) => {
    try {
      if (file) give(await decodeVDI(file));
      else await (end ? decoder.end() : decoder.push(piece));
      if (end) decoder = new LevelDecoder(give);
      scope.postMessage({ done: true });
    } catch (error) {
      scope.postMessage({ error: String(error?.message ?? error) });
    }
  };
  scope.postMessage({ ready: true });
}

if ("WorkerGlobalScope" in globalThis) serve(self);
