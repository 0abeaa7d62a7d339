// Pure functions of the viewer, by Node: node --test in this folder. No browser is needed.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { pathToFileURL } from "node:url";

// Of an installation, where it is named
const named = process.env.PYVISTA_VDI_VIEWER;
const viewer = named ? pathToFileURL(named).href
  : new URL("../../../../pyvista_vdi/extensions/web/viewer", import.meta.url).href;
const textOf = (name) => readFileSync(new URL(`${viewer}/${name}`), "utf-8");
const { checkedCamera, lookingAt } = await import(`${viewer}/camera.js`);
const { textOfView, viewOfText } = await import(`${viewer}/link.js`);
const { AS_MADE, checkedLook, isAsMade } = await import(`${viewer}/look.js`);
const { inShort } = await import(`${viewer}/html.js`);
const { checkedTransfer, editedFrom } = await import(`${viewer}/values.js`);

const camera = checkedCamera({
  position: [2.1, 1 / 3, -1.7e-9], focal_point: [0, 0, 0], view_up: [0, 1, 0], view_angle: 30,
});

test("a view goes into text and comes back with every bit", () => {
  const look = checkedLook({ brightness: 2 ** 0.35, clip: [0.1, 1, 0, 1, 0, 0.7] });
  const state = { camera, look, time: -2.5 };
  assert.deepEqual(viewOfText(textOfView(state)), state);
});

test("a transfer function goes into text and comes back", () => {
  for (const cmap of [null, "bone"]) {
    const transfer = { cmap, clim: [-1 / 3, 1e6], points: [0, 0.125, 0.5, 1] };
    const state = { camera, look: checkedLook({ transfer }), time: null };
    assert.deepEqual(viewOfText(textOfView(state)), state);
  }
});

test("what is no transfer function is refused by name", () => {
  for (const [transfer, why] of [
    [{ cmap: "no", clim: [0, 1], points: [0, 1] }, /colour map is one of gray/],
    [{ clim: [1, 0], points: [0, 1] }, /clim is two numbers/],
    [{ clim: [0, 1], points: [0.5, 1, 0.4, 1] }, /1 to 64 points/],
    [{ clim: [0, 1], points: [0, 2] }, /1 to 64 points/], [{ clim: [0, 1], points: [] }, /1 to 64 points/],
  ]) assert.throws(() => checkedTransfer(transfer), { name: "TypeError", message: why });
});

test("a curve becomes few points, which are on it", () => {
  const opacities = Array.from({ length: 257 }, (_, k) => Math.max(0, 1 - Math.abs(k - 128) / 32));
  const { points, clim } = editedFrom({ opacities, scalar_range: [2, 5] });
  assert.deepEqual(clim, [2, 5]);
  assert.deepEqual(points, [0, 0, 0.375, 0, 0.5, 1, 0.625, 0, 1, 0]);
  assert.deepEqual(editedFrom({ opacities: [0.3], scalar_range: [4, 4] }),
    { cmap: null, clim: [3.5, 4.5], points: [0, 0.3, 1, 0.3] });
});

test("what is as it was made is not said", () => {
  const text = textOfView({ camera, look: AS_MADE });
  assert.doesNotMatch(text, /brightness|opacity|clip|time/);
  assert.deepEqual(viewOfText(text), { camera, look: checkedLook({}), time: null });
});

test("what is no view is refused by name", () => {
  for (const [text, why] of [
    ["", /no ""/], ["__proto__:1", /no "__proto__"/], ["position:1,2", /position .* 3 numbers/],
    ["position:1,,3", /position .* 3 numbers/], ["time:soon", /time .* 1 numbers/],
  ]) assert.throws(() => viewOfText(text), { name: "TypeError", message: why });
});

test("a look has factors and shares in order", () => {
  assert.ok(isAsMade(checkedLook({})));
  assert.ok(!isAsMade(checkedLook({ opacity: 2 })));
  for (const look of [{ brightness: 17 }, { opacity: NaN }, { clip: [1, 0, 0, 1, 0, 1] }, { clip: [] }]) {
    assert.throws(() => checkedLook(look), TypeError);
  }
});

test("a standard view sees all of a box", () => {
  const seen = lookingAt(camera, [0, 2, 0, 4, 0, 4], [1, 0, 0], [0, 0, 1]);
  assert.deepEqual(seen.focal_point, [1, 2, 2]);
  const distance = seen.position[0] - 1;
  assert.ok(Math.abs(distance * Math.sin(Math.PI / 12) - 3) < 1e-12); // half the diagonal
  assert.equal(lookingAt({ parallel_scale: 9 }, [0, 2, 0, 4, 0, 4], [1, 0, 0], [0, 0, 1]).parallel_scale, 3);
});

test("numbers are said in short", () => {
  assert.deepEqual([90.15912, 1e-7, 0, 123456].map(inShort), ["90.16", "1e-7", "0", "123500"]);
});

test("types and manifest have what the element has", () => {
  const source = textOf("element.js"), types = textOf("element.d.ts");
  const [{ declarations: [told] }] = JSON.parse(textOf("custom-elements.json")).modules;
  const members = new Set([...source.matchAll(/^  (?:async )?(?:[gs]et )?(\w+)\(.*\) \{$/gm)]
    .map(([, name]) => name).filter((name) => !/Callback$|^constructor$|^if$|^for$|^while$/.test(name)));
  // For what is beside the viewer in this package
  for (const own of ["showBytes", "setPrepared", "invalidate"]) members.delete(own);
  const names = told.members.map(({ name }) => name);
  assert.deepEqual([...members].sort(), names.toSorted());
  for (const name of names) assert.match(types, new RegExp(`\\b${name}[?]?[(:]`), name);
  const observed = source.match(/observedAttributes = \[(.*)\]/)[1].match(/[\w-]+/g);
  const attributes = told.attributes.map(({ name }) => name);
  for (const name of observed) assert.ok(attributes.includes(name), name);
  const events = new Set([...source.matchAll(/new CustomEvent\("(\w+)"/g)].map(([, name]) => name));
  assert.deepEqual([...events].sort(), told.events.map(({ name }) => name).sort());
});

test("what the package exports is there", () => {
  const { exports } = JSON.parse(textOf("package.json"));
  for (const entry of Object.values(exports)) {
    for (const path of typeof entry === "string" ? [entry] : Object.values(entry)) textOf(path);
  }
});
