// What is shown of series and sets, and when, with VDIs, a clock and frames of this file's own.
import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";
import { viewerModule } from "./viewer.js";

const { Player } = await viewerModule("player.js");
const { Series, beginsAsSeries } = await viewerModule("series.js");
const { Surround } = await viewerModule("surround.js");
const { VDIFileError, crc32 } = await viewerModule("bytes.js");

let now = 0, frame = null;
globalThis.requestAnimationFrame = (draw) => { frame = draw; };
globalThis.cancelAnimationFrame = () => { frame = null; };
beforeEach(() => { [now, frame] = [0, null]; });
performance.now = () => now;

const settled = () => new Promise((resolve) => setImmediate(resolve));

// A series whose VDIs are there at once, but for those that are broken or held back.
function seriesOf(length, { broken = [], held = new Map(), complete = true } = {}) {
  return {
    length, complete, asked: [], times: Array.from({ length }, (_, k) => k / 2),
    async prepared(i, signal) {
      this.asked.push(i);
      await held.get(i);
      signal.throwIfAborted();
      if (broken.includes(i)) throw new VDIFileError(`step ${i} is broken`);
      return `vdi ${i}`;
    },
  };
}

function playing(series) {
  const shown = [], failures = [];
  const player = new Player(series, { show: (prepared, step) => shown.push(step), changed() {},
    failed: ({ message }) => failures.push(message) });
  const pass = async (seconds) => {
    now += 1000 * seconds;
    frame?.();
    await settled();
  };
  return { player, shown, failures, pass };
}

test("steps are shown in their time, in order, from the first again, and it stops where it is paused", async () => {
  const { player, shown, pass } = playing(seriesOf(3));
  await settled();
  player.play({ rate: 10 });
  for (let k = 0; k < 8; ++k) await pass(0.101);
  assert.deepEqual(shown, [0, 1, 2, 0, 1, 2, 0, 1].slice(0, shown.length));
  assert.ok(shown.length >= 7);
  const { step } = player;
  player.pause();
  await pass(1);
  assert.deepEqual([player.step, player.playing, player.settled], [step, false, true]);
});

test("what is not ready in its time is left out", async () => {
  let come;
  const held = new Map([[1, new Promise((resolve) => { come = resolve; })]]);
  const { player, shown, pass } = playing(seriesOf(6, { held, complete: false }));
  await settled();
  player.play({ rate: 10 });
  await pass(0);
  await pass(0.3);
  come();
  await settled();
  for (let k = 0; k < 4; ++k) await pass(0.101); // and waits for more at its end
  assert.deepEqual([shown[0], shown.at(-1)], [0, 5]);
  assert.ok(!shown.includes(2));
});

test("a broken step is left out while it plays, and named when it is asked for", async () => {
  const { player, shown, failures, pass } = playing(seriesOf(4, { broken: [2, 3] }));
  await settled();
  player.play({ rate: 10 });
  for (let k = 0; k < 6; ++k) await pass(0.101);
  player.pause();
  assert.deepEqual([shown, failures], [[0, 1, 0, 1], []]);
  player.step = 2;
  await settled();
  assert.deepEqual([player.settled, failures], [false, ["step 2 is broken"]]);
  player.step = 1;
  assert.ok(player.settled);
});

test("the last step that is asked for counts, and what was given up comes later", async () => {
  const series = seriesOf(9), { player, shown, failures } = playing(series);
  await settled();
  for (const step of [7, -4, 99]) player.step = step;
  await settled();
  assert.deepEqual([shown, player.time], [[0, 8], 4]);
  player.step = 4;
  player.close();
  await settled();
  assert.equal(player.settled, false);
  player.resume();
  await settled();
  assert.deepEqual([shown, failures], [[0, 8, 4], []]);
  assert.throws(() => player.play({ rate: 0 }), /above 0/);
});

test("of a set the nearest is shown, and its neighbours are there", async () => {
  const view = (angle, distance = 4) => ({ position: [distance * Math.cos(angle), distance * Math.sin(angle), 0],
    view_angle: 30, model_transform: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]] });
  const views = [0, 0.5, 1, 1.5, 2, 2.5, 3].map((angle) => view(angle));
  const set = { ...seriesOf(views.length, { broken: [3] }), views, bounds: [-1, 1, -1, 1, -1, 1] };
  const shown = [], failures = [];
  const surround = new Surround(set, { show: (prepared, i) => shown.push(i), changed() {},
    failed: ({ message }) => failures.push(message) });
  surround.look(view(0.55));
  assert.equal(surround.step, 1);
  await settled();
  assert.deepEqual([shown.at(-1), surround.settled, set.asked], [1, true, [1, 2, 0, 3, 4]]);
  surround.look(view(0.1));
  assert.deepEqual([shown.at(-1), failures], [0, []]); // it was there
  surround.look(view(1.5));
  await settled();
  assert.deepEqual([surround.settled, failures], [false, ["step 3 is broken"]]);
  assert.equal(surround.step, 3);
  surround.look(view(3.1, 400)); // as far away as none of them
  assert.equal(surround.step, 6);
  views.push(view(0, 40)); // in one line with the first
  const further = new Surround({ ...set, length: 8, views }, { show() {}, changed() {}, failed() {} });
  further.look(view(0.1, 30));
  assert.equal(further.step, 7);
  further.look({ ...view(0.1, 4), parallel_scale: 30 * Math.tan(Math.PI / 12) }); // VTK's lens
  assert.equal(further.step, 7);
});

// A ZIP of plainly stored members, without its directory.
function zipped(members) {
  const parts = Object.entries(members).flatMap(([name, bytes]) => {
    const head = new DataView(new ArrayBuffer(30));
    head.setUint32(0, 0x04034b50, true);
    head.setUint32(14, crc32(bytes), true);
    head.setUint32(18, bytes.length, true);
    head.setUint32(22, bytes.length, true);
    head.setUint16(26, name.length, true);
    return [new Uint8Array(head.buffer), new TextEncoder().encode(name), bytes];
  });
  return Uint8Array.from(parts.flatMap((part) => [...part]));
}

const SERIES = { format: "pyvista-vdi-series", version: 1, times: [0, 0.5, 2] };
const json = (head) => new TextEncoder().encode(JSON.stringify(head));

test("a series is read from its beginning, as its steps come", async () => {
  const file = (k) => new Uint8Array(100).fill(k);
  const bytes = zipped({ "series.json": json(SERIES), "000000.vdi": file(0), "000001.vdi": file(1) });
  assert.ok(beginsAsSeries(bytes) && !beginsAsSeries(file(7)));
  let series = null, begun = 0;
  const lengths = [];
  async function* pieces() {
    yield bytes.subarray(90, 300);
    lengths.push(series.length, series.complete);
    yield bytes.subarray(300);
  }
  await Series.ofPieces(bytes.subarray(0, 90), pieces(), (first) => {
    series = first;
    ++begun;
  });
  assert.equal(begun, 1);
  assert.deepEqual([lengths, series.length, series.complete, series.times], [[1, false], 2, true, [0, 0.5]]);
  assert.deepEqual([-1, 0.25, 0.3, 9].map((time) => series.nearest(time)), [0, 0, 1, 1]);
  await assert.rejects(Series.ofPieces(bytes.subarray(0, 90), [], () => {}), /no whole VDI/);
});
