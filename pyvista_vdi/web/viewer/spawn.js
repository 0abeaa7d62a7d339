// Starts the worker that decodes. In a page of one file another text takes this module's place:
// see bundle.py.

/**
 * Start the worker. A worker's own file must be of the page's origin, what it imports need not.
 * @returns {Worker} it sends `{ ready: true }` once it listens
 */
export function spawnWorker() {
  const place = new URL("./worker.js", import.meta.url).href;
  const text = `import { serve } from ${JSON.stringify(place)}; serve(self);`;
  const url = URL.createObjectURL(new Blob([text], { type: "text/javascript" }));
  return new Worker(url, { type: "module" });
}
