// Starts the worker that decodes. In a page of one file another text takes this module's place:
// see bundle.py.

/** Ways to start the worker, each for where the one before does not start it. */
export const waysToSpawn = [
  // The form that bundlers know, to the letter
  () => new Worker(new URL("./worker.js", import.meta.url), { type: "module" }),
  // A worker's own file must be of the page's origin, what it imports need not
  () => {
    const here = import.meta.url; // apart: bundlers would take the file into the page once more
    const text = `import ${JSON.stringify(new URL("./worker.js", here).href)};`;
    const url = URL.createObjectURL(new Blob([text], { type: "text/javascript" }));
    return new Worker(url, { type: "module" });
  },
];
