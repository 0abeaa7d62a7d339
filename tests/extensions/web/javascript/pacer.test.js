// What keeps a page's frame rate, with a device and a clock of its own: nothing here takes time.
import assert from "node:assert/strict";
import { test } from "node:test";
import { viewerModule } from "./viewer.js";

const { Pacer } = await viewerModule("pacer.js");

// Draw frames of [width, height, seconds before the first row, seconds of a row]: bands, what is next.
async function drawn(...frames) {
  let rows = 0, now = 0, cost;
  const bands = [];
  const gl = {
    SIGNALED: 1, scissor(x, y, w, high) { rows = x ? NaN : high; }, isContextLost: () => false,
    clientWaitSync() { now += 1000 * cost(rows); bands.push(rows); return this.SIGNALED; },
  };
  for (const name of ["bindFramebuffer", "enable", "disable", "clearColor", "clear", "fenceSync",
    "flush", "deleteSync"]) gl[name] = () => {};
  const told = [], pacer = new Pacer(gl), real = performance.now;
  performance.now = () => now;
  for (const [width, height, compiling, perRow] of frames) {
    let compiled = compiling;
    cost = (high) => { const took = compiled + perRow * high; compiled = 0; return took; };
    bands.length = 0;
    await pacer.inBands({}, width, height, () => {});
    told.push({ bands: [...bands], next: pacer.sizeFor(1280, 720), share: pacer.share });
  }
  performance.now = real;
  return told;
}

const sum = (bands) => bands.reduce((a, b) => a + b);

test("a compiler's time is no frame's", async () => {
  // The first frame, of few pixels, waited for one: the full frame is in few bands all the same,
  // and the movement after it has all pixels
  const [few, full] = await drawn([320, 180, 1, 1e-6], [1280, 720, 0, 4e-6]);
  assert.deepEqual(few.bands, [180]);
  assert.deepEqual(few.next, [320, 180]); // a sixteenth
  assert.equal(sum(full.bands), 720);
  assert.ok(full.bands.length <= 6); // from one row on, four times as many each time
  assert.deepEqual([full.next, full.share], [[1280, 720], 1]);
});

test("bands are as high as a movement may wait for", async () => {
  // 50 ms, whatever the frame before took: here 5 ms and then 0.5 ms for a row
  const [, slow, fast] = await drawn([320, 180, 0, 0.005], [320, 180, 0, 0.005], [320, 180, 0, 0.0005]);
  assert.deepEqual(slow.bands, Array(18).fill(10));
  assert.deepEqual(fast.bands.slice(0, 2), [10, 40]); // at most four times as high as the one before
  assert.ok(Math.max(...fast.bands) <= 100);
  assert.equal(sum(fast.bands), 180);
});

test("a movement has the pixels that a thirtieth of a second allows", async () => {
  const [, { next }] = await drawn([1280, 720, 0, 1e-4], [1280, 720, 0, 1e-4]); // 72 ms for all
  assert.ok(Math.abs((next[0] * next[1]) / (1280 * 720) - 1 / 30 / 0.072) < 0.01);
});
