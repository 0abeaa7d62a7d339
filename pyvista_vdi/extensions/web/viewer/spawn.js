// Starts the worker that decodes. In a page of one file another text takes this module's place:
// see bundle.py.

/** Start the worker, in the form that bundlers know, to the letter. */
export const spawn = () => new Worker(new URL("./worker.js", import.meta.url), { type: "module" });
