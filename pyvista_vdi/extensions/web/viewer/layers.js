// In what order several VDIs are drawn, one over the other, so that nearer ones are in front.
//
// Boxes that a plane separates have an order. Where boxes overlap, their media are mixed; then space
// is cut into thin slabs by depth, and within each slab one is drawn over the other: which one,
// alternates, so that what that gets wrong cancels from slab to slab.
import { cameraAxes, isParallel } from "./rays.js";
import { cross, dot, subtract } from "./vectors.js";

/** Slabs over the depths at which VDIs overlap. With more of them the roundings to 8 bits add up. */
export const THIN_SLABS = 32;

const normalTo = (a, b) => {
  const n = cross(a, b);
  const length = Math.hypot(...n);
  return length > 1e-12 * Math.hypot(...a) * Math.hypot(...b) ? n.map((x) => x / length) : null;
};

/**
 * The corners of a box in the world.
 *
 * @param {number[]} bounds Model frame: low and high of x, y and z.
 * @param {number[][]} matrix (4, 4), from there to the world.
 * @returns {number[][]} Eight points; the first, and those one edge along x, y and z from it, are
 *   numbers 0, 1, 2 and 4.
 */
export function cornersOf(bounds, matrix) {
  return Array.from({ length: 8 }, (_, k) => {
    const p = [bounds[k & 1], bounds[2 + (k >> 1 & 1)], bounds[4 + (k >> 2)]];
    return [0, 1, 2].map((i) => dot(matrix[i], p) + matrix[i][3]);
  });
}

/**
 * Which of two boxes is nearer: -1 the first, 1 the second, 0 either, and NaN where they overlap.
 */
export function nearerOf(a, b, camera) {
  const edges = [a, b].map((c) => [1, 2, 4].map((k) => subtract(c[k], c[0])));
  const axes = edges.flatMap(([x, y, z]) => [normalTo(y, z), normalTo(z, x), normalTo(x, y)]);
  for (const one of edges[0]) for (const other of edges[1]) axes.push(normalTo(one, other));
  const [, , forward] = cameraAxes(camera);
  let separated = false;
  for (const axis of axes.filter(Boolean)) {
    const [[lowA, highA], [lowB, highB]] = [a, b].map((corners) => {
      const along = corners.map((p) => dot(axis, p));
      return [Math.min(...along), Math.max(...along)];
    });
    const rounding = 1e-9 * (highA - lowA + highB - lowB);
    const aIsLow = highA <= lowB + rounding;
    if (!aIsLow && highB > lowA + rounding) continue;
    separated = true;
    const middle = aIsLow ? (highA + lowB) / 2 : (highB + lowA) / 2;
    const side = isParallel(camera) ? -dot(axis, forward) : dot(axis, camera.position) - middle;
    // A plane that the eye is in tells nothing
    if (Math.abs(side) > rounding * 1e-3) return (side < 0) === aIsLow ? -1 : 1;
  }
  return separated ? 0 : NaN;
}

/**
 * What is drawn, one after the other, the farthest first.
 *
 * @param {number[][][]} boxes Corners of each VDI's box, of {@link cornersOf}.
 * @param {object} camera
 * @param {number} [slabs] Over the depths at which VDIs overlap.
 * @returns {{body: number, near: number, far: number}[]} Which VDI, and between which view depths,
 *   world units; -Infinity and Infinity where it is drawn whole.
 */
export function layersOf(boxes, camera, slabs = THIN_SLABS) {
  const count = boxes.length;
  if (count < 2) return boxes.map((_, body) => ({ body, near: -Infinity, far: Infinity }));
  const nearer = boxes.map((a, i) => boxes.map((b, j) => (i < j ? nearerOf(a, b, camera) : 0)));
  const overlap = (i, j) => Number.isNaN(nearer[Math.min(i, j)][Math.max(i, j)]);
  // Whether i is to be drawn before j; `turn` decides for those that overlap
  const before = (i, j, turn) => {
    const [a, b] = [Math.min(i, j), Math.max(i, j)];
    const order = overlap(a, b) ? (turn ? -1 : 1) : nearer[a][b];
    return order * (i < j ? 1 : -1) > 0;
  };
  const all = boxes.map((_, k) => k);
  const ordered = (bodies, turn) => {
    const left = [...bodies], order = [];
    while (left.length) {
      const next = left.find((i) => left.every((j) => i === j || !before(j, i, turn)));
      if (next === undefined) return null;
      left.splice(left.indexOf(next), 1);
      order.push(next);
    }
    return order;
  };
  const whole = all.some((i) => all.some((j) => i < j && overlap(i, j))) ? null : ordered(all, 0);
  if (whole) return whole.map((body) => ({ body, near: -Infinity, far: Infinity }));
  const [, , forward] = cameraAxes(camera);
  const depths = boxes.map((corners) => {
    const along = corners.map((p) => dot(forward, subtract(p, camera.position)));
    const least = isParallel(camera) ? -Infinity : 0;
    return [Math.max(Math.min(...along), least), Math.max(...along)];
  });
  const cuts = [...new Set(depths.flat())].sort((a, b) => a - b);
  const parts = cuts.slice(1).map((far, k) => {
    const near = cuts[k];
    return { near, far, bodies: all.filter((i) => depths[i][0] < far && depths[i][1] > near) };
  });
  const mixed = ({ bodies }) => bodies.length > 1;
  const length = parts.filter(mixed).reduce((sum, { near, far }) => sum + far - near, 0);
  const layers = [];
  for (const part of parts.reverse()) {
    const { near, far, bodies } = part;
    const pieces = mixed(part) ? Math.max(1, Math.ceil(slabs * (far - near) / length)) : 1;
    for (let k = pieces; k-- > 0; ) {
      const ends = [near + (far - near) * k / pieces, near + (far - near) * (k + 1) / pieces];
      for (const body of ordered(bodies, k & 1) ?? bodies) {
        layers.push({ body, near: ends[0], far: ends[1] });
      }
    }
  }
  return layers;
}
