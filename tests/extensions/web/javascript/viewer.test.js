// Pure functions of the viewer, by Node: node --test in this folder. No browser is needed.
import assert from "node:assert/strict";
import { test } from "node:test";
import { viewerModule } from "./viewer.js";

const { checkedCamera, checkedPlane, fitted, nearer, panned, rotated } = await viewerModule("camera.js");
const { dragOf, dragged, keyed } = await viewerModule("interaction.js");
const { textOfView, viewOfText } = await viewerModule("link.js");
const { checkedLook, isAsMade } = await viewerModule("look.js");
const { frameOf, listSpace, pixelRays, modelPoint, pixelsOfBoxes } = await viewerModule("rays.js");
const { prepare } = await viewerModule("prepare.js");
const { editedFrom } = await viewerModule("values.js");
const { GrowingBytes, crc32 } = await viewerModule("bytes.js");

const camera = checkedCamera({
  position: [2.1, 1 / 3, -1.7e-9], focal_point: [0, 0, 0], view_up: [0, 1, 0], view_angle: 30,
});

test("a view goes into text and comes back with every bit", () => {
  for (const cmap of [null, "bone"]) {
    const transfer = { cmap, clim: [-1 / 3, 1e6], points: [0, 0.125, 0.5, 1] };
    const look = checkedLook({ brightness: 2 ** 0.35, clip: [0.1, 1, 0, 1, 0, 0.7], transfer });
    assert.deepEqual(viewOfText(textOfView({ camera, look })), { camera, look });
  }
});

test("a curve becomes few points, which are on it", () => {
  const opacities = Array.from({ length: 257 }, (_, k) => Math.max(0, 1 - Math.abs(k - 128) / 32));
  const { points, clim } = editedFrom({ opacities, scalar_range: [2, 5] });
  assert.deepEqual(clim, [2, 5]);
  assert.deepEqual(points, [0, 0, 0.375, 0, 0.5, 1, 0.625, 0, 1, 0]);
  const bump = Array.from({ length: 101 }, (_, k) => (k === 50 ? 0.01 : 0));
  assert.ok(editedFrom({ opacities: bump, scalar_range: [0, 1] }).points.includes(0.01));
  assert.deepEqual(editedFrom({ opacities: [0.3], scalar_range: [4, 4] }),
    { cmap: null, clim: [3.5, 4.5], points: [0, 0.3, 1, 0.3] });
});

test("what is no view is refused", () => {
  const texts = ["", "%", "x", "null", "{}", '{"camera":{"position":[1,2]}}', `${textOfView({ camera })}x`];
  for (const text of texts) assert.throws(() => viewOfText(text), Error, text);
});

test("looks, views and planes that show nothing are refused by name", () => {
  assert.ok(isAsMade(checkedLook({})));
  assert.ok(!isAsMade(checkedLook({ opacity: 2 })));
  const lens = { view_angle: undefined };
  for (const [check, given, why] of [
    [checkedLook, { brightness: 17 }, /brightness is a factor from 1\/16 to 16; got 17/],
    [checkedLook, { opacity: NaN }, /opacity is a factor/], [checkedLook, { clip: [0, 1] }, /clip is six finite/],
    [checkedLook, { clip: [0.6, 0.5, 0, 1, 0, 1] }, /lower to a higher share/],
    [checkedLook, { transfer: { clim: [0, 1], points: [0.5, 0, 0.4, 1] } }, /shares that grow/],
    [checkedCamera, {}, /position is three finite numbers/],
    [checkedCamera, { ...camera, position: camera.focal_point }, /are the same point/],
    [checkedCamera, { ...camera, view_angle: 180 }, /view_angle is a positive number below 180/],
    [checkedCamera, { ...camera, ...lens, parallel_scale: -1 }, /parallel_scale is/],
    [checkedCamera, { ...camera, view_up: camera.position }, /view_up is not parallel/],
    [checkedCamera, { ...camera, window_center: [0, NaN] }, /window_center is two finite numbers/],
    [checkedPlane, { origin: [0, 0, 0], normal: [0, 0, 0] }, /normal is not zero/],
    [checkedPlane, { normal: [1, 0, 0] }, /origin is three finite numbers; got undefined/],
  ]) assert.throws(() => check(given), { name: "TypeError", message: why });
});

test("buttons and keys have VTK's meanings", () => {
  const held = (shiftKey, ctrlKey) => [0, 1, 2].map((button) => dragOf(button, { shiftKey, ctrlKey }));
  assert.deepEqual(held(false, false), ["rotate", "pan", "dolly"]);
  assert.deepEqual([held(true, false)[0], held(false, true)[0], held(true, true)[0]], ["pan", "spin", "dolly"]);
  assert.deepEqual(keyed(camera, { key: "ArrowLeft" }), rotated(camera, 5, 0));
  assert.deepEqual(keyed(camera, { key: "ArrowUp", shiftKey: true }), panned(camera, 0, 0.05));
  assert.deepEqual(keyed(camera, { key: "-" }), nearer(camera, 1 / 1.1));
  assert.equal(keyed(camera, { key: "a" }), undefined);
  assert.deepEqual(dragged("dolly", camera, [5, 5], [5, 55], [100, 100]), nearer(camera, 1.1 ** 10));
});

test("a narrow window sees all of a picture, a wide one what it is given", () => {
  assert.equal(fitted(camera, 2, [200, 100]), camera);
  const { view_angle } = fitted(camera, 2, [100, 100]);
  const tangent = (angle) => Math.tan((angle * Math.PI) / 360);
  assert.ok(Math.abs(tangent(view_angle) - 2 * tangent(30)) < 1e-12);
  assert.equal(fitted({ ...camera, parallel_scale: 3, view_angle: undefined }, 2, [100, 100]).parallel_scale, 6);
});

test("rays of pixels go through what is seen there", () => {
  const seen = { camera: { ...camera, position: [5, 1, 2] }, bounds: [-1, 1, -1, 1, -1, 1], depthOrigin: 4, windowSize: [40, 30] };
  for (const view of [seen.camera, { ...seen.camera, view_angle: undefined, parallel_scale: 2 }]) {
    const frame = frameOf(seen), rays = pixelRays(frame, view, [40, 30]);
    // On the line from the eye to the focal point, the origin
    const middle = modelPoint(rays, [0, 0], 0);
    const [toEye, toPoint] = [view.position, middle].map((p) => p.map((x) => x / Math.hypot(...p)));
    assert.ok(Math.hypot(...toEye.map((x, k) => x - toPoint[k])) < 1e-9);
    const corners = Array.from({ length: 8 }, (_, k) => frame.half.map((edge, axis) => (k >> axis & 1 ? edge : -edge)));
    const [[[x0, x1], [y0, y1]]] = pixelsOfBoxes(frame, view, [40, 30], [corners]);
    assert.ok(x0 >= 0 && x1 <= 40 && y0 >= 0 && y1 <= 30 && x1 - x0 > 10);
    const [[[moved]]] = pixelsOfBoxes(frame, panned(view, 0.2, 0), [40, 30], [corners]);
    assert.ok(Math.abs(moved - x0 - 6) <= 2);
  }
  const { range, depths: [a, b, c, d], reciprocals: [e, f] } = listSpace(frameOf(seen), seen);
  const z = (a * range[1] + b) / (c * range[1] + d); // of the farthest corner
  assert.ok(Math.abs(1 / (e + f * z) - (range[1] + 4 * frameOf(seen).scale)) < 1e-12);
  const one = { offsets: [0, 1], front: [1], back: [2], color: [0, 0, 0], opticalDepth: [1] };
  assert.ok(prepare({ ...seen, ...one, windowSize: [1, 1] }).masks.every(Boolean)); // both halves
});

test("bytes come in pieces, also as text that ends anywhere", () => {
  const bytes = Uint8Array.from({ length: 200000 }, (_, k) => k * k % 251), growing = new GrowingBytes();
  const text = Buffer.from(bytes.subarray(1000)).toString("base64");
  growing.push(bytes.subarray(0, 1000));
  growing.push(text.slice(0, 7));
  assert.ok(growing.broken);
  growing.push(` \n${text.slice(7)}`);
  assert.ok(!growing.broken);
  assert.deepEqual(growing.whole, bytes);
  assert.throws(() => growing.push("????"), /no base64/);
  assert.equal(crc32(new TextEncoder().encode("123456789")), 0xcbf43926);
});
