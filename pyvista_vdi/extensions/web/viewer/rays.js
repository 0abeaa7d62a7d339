// Rays and list space in float64 (docs/dev/conventions.md, "Rays", "List coordinates").
//
// Along the ray of pixel (x, y) of a window every quantity that the shader needs is affine in the
// pixel and in t, the view depth of the ray's camera less a reference depth near the data: six
// numbers, (c0 + a c1 + b c2) + t (d0 + a d1 + b d2) with a = x + 1/2 - W/2, b = y + 1/2 - H/2 and
// row 0 at the bottom. They are formed here, so that float32 is enough in the shader.
//
// All is done in a frame of its own, in which the VDI's bounds are about 1 large and at the origin:
// model' = (model - centre) / diagonal, world' = world * scale.
import { add, cross, dot, subtract, times, unit } from "./vectors.js";

const NEAREST_DEPTH = 1e-6; // before it nothing is looked up in perspective, in diagonals

const column = (m, k) => m.map((row) => row[k]);
const product = (a, b) => a.map((row) => b[0].map((_, k) => dot(row, column(b, k))));

/** Whether a camera projects in parallel: it says so, or gives a parallel scale alone. */
export function isParallel(camera) {
  return camera.parallel_projection ?? camera.parallel_scale !== undefined;
}

/** Unit vectors right, up and forward of a camera, world coordinates. */
export function cameraAxes(camera) {
  const forward = unit(subtract(camera.focal_point, camera.position));
  const right = unit(cross(forward, unit(camera.view_up)));
  return [right, cross(right, forward), forward];
}

/** Half the viewport's width and height: tangents, or world units in parallel projection. */
export function halfExtent(camera, [width, height]) {
  const aspect = width / height;
  if (isParallel(camera)) return [camera.parallel_scale * aspect, camera.parallel_scale];
  const tangent = Math.tan((camera.view_angle * Math.PI) / 360);
  if (camera.use_horizontal_view_angle) return [tangent, tangent / aspect];
  return [tangent * aspect, tangent];
}

// The same, in parallel projection in world'.
function halfExtentIn(frame, camera, size) {
  return times(halfExtent(camera, size), isParallel(camera) ? frame.scale : 1);
}

/** The frame of a VDI: model transform, bounds and scale, from its camera and bounds. */
export function frameOf(vdi) {
  const { bounds } = vdi;
  const low = [bounds[0], bounds[2], bounds[4]];
  const high = [bounds[1], bounds[3], bounds[5]];
  const centre = times(add(low, high), 0.5);
  const diagonal = Math.hypot(...subtract(high, low)) || 1;
  const m = vdi.camera.model_transform ?? [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]];
  const linear = m.slice(0, 3).map((row) => row.slice(0, 3));
  // The largest stretch of M, from above: by its Frobenius norm, which is at most sqrt(3) more
  const scale = 1 / (diagonal * Math.hypot(...linear.flat()));
  return {
    scale,
    linear: linear.map((row) => times(row, diagonal * scale)), // model' to world', without
    offset: [0, 1, 2].map((k) => (dot(linear[k], centre) + m[k][3]) * scale),
    half: times(subtract(high, low), 0.5 / diagonal),
  };
}

// Model' to view space of a camera: rows of 4 numbers. The eye is subtracted before the rotation.
function modelToView(frame, camera) {
  const axes = cameraAxes(camera);
  const from = subtract(frame.offset, times(camera.position, frame.scale));
  const linear = product(axes, frame.linear);
  return linear.map((row, k) => [...row, dot(axes[k], from)]);
}

function inverse3(m) {
  const [a, b, c] = m;
  const rows = [cross(b, c), cross(c, a), cross(a, b)];
  const determinant = dot(a, rows[0]);
  return [0, 1, 2].map((i) => [0, 1, 2].map((j) => rows[j][i] / determinant));
}

function depthRange(frame, toView) {
  const [x, y, z, middle] = toView[2];
  const reach = Math.abs(x) * frame.half[0] + Math.abs(y) * frame.half[1] +
    Math.abs(z) * frame.half[2];
  return [middle - reach, middle + reach];
}

function windowCentre(camera) {
  return camera.window_center ?? [0, 0];
}

/**
 * The list space of a VDI's generating view.
 *
 * @returns {{rows: number[][], parallel: boolean, depths: number[], reciprocals: number[],
 *   range: number[], nearest: number, perDepth: number[][]}} `rows`: model' to u, v (pixels from the
 *   window's centre), depth coordinate and denominator; `depths`: a, b, c, d of the depth coordinate
 *   (a x + b) / (c x + d) of an offset x from the depth origin, and `reciprocals`: e, f of 1 / Z = e +
 *   f z; `range`: offsets of the bounds, world'; `nearest`: the least in front of the eye;
 *   `perDepth`: rows 1, a, b of the centre rays' model' direction per unit of view depth.
 */
export function listSpace(frame, vdi) {
  const { camera, windowSize } = vdi;
  const toView = modelToView(frame, camera);
  const parallel = isParallel(camera);
  const [near, far] = depthRange(frame, toView);
  const origin = vdi.depthOrigin * frame.scale;
  const shifted = !parallel && far > 0 && far <= 2 * Math.min(near, origin);
  const [halfWidth, halfHeight] = halfExtentIn(frame, camera, windowSize);
  const denominator = parallel ? [0, 0, 0, 1] : toView[2];
  const [cx, cy] = windowCentre(camera);
  const side = (row, half, centre, lists) =>
    row.map((x, k) => (x / half - centre * denominator[k]) * lists * 0.5);
  const depth = parallel || shifted
    ? [...toView[2].slice(0, 3), toView[2][3] - origin] : [0, 0, 0, -1];
  // Z - Z_ref; (Z - Z_ref) / Z, for long lenses; else -1 / Z
  const [depths, reciprocals] = parallel ? [[1, 0, 0, 1], [1, 0]]
    : shifted ? [[1, 0, 1, origin], [1 / origin, -1 / origin]] : [[0, -1, 1, origin], [0, -1]];
  return {
    rows: [
      side(toView[0], halfWidth, cx, windowSize[0]),
      side(toView[1], halfHeight, cy, windowSize[1]),
      depth,
      denominator,
    ],
    parallel, depths, reciprocals, range: [near - origin, far - origin],
    nearest: parallel ? -1e30 : NEAREST_DEPTH - origin,
    perDepth: pixelRays(frame, camera, windowSize).direction,
  };
}

/**
 * The rays of a window's pixels in the model' frame:
 * P(t) = (1, a, b) origin + t (1, a, b) direction.
 *
 * @returns {{origin: number[][], direction: number[][], reference: number}} rows for 1, a and b;
 *   `reference`: view depth of t = 0, world'.
 */
export function pixelRays(frame, camera, size) {
  const toView = modelToView(frame, camera);
  const [near] = depthRange(frame, toView);
  const parallel = isParallel(camera);
  const reference = parallel ? near : Math.max(near, 0);
  const [halfWidth, halfHeight] = halfExtentIn(frame, camera, size);
  const [cx, cy] = windowCentre(camera);
  const slope = [[cx * halfWidth, cy * halfHeight, 0], [halfWidth, 0, 0], [0, halfHeight, 0]];
  const forward = [[0, 0, 1], [0, 0, 0], [0, 0, 0]];
  const zero = [[0, 0, 0], [0, 0, 0], [0, 0, 0]];
  let [origin, direction] = parallel
    ? [slope, forward] : [zero, slope.map((s, k) => add(s, forward[k]))];
  const perPixel = [1, 2 / size[0], 2 / size[1]];
  origin = origin.map((row, k) => times(add(row, times(direction[k], reference)), perPixel[k]));
  direction = direction.map((row, k) => times(row, perPixel[k]));
  const inverse = inverse3(toView.map((row) => row.slice(0, 3)));
  const toModel = (row) => inverse.map((r) => dot(r, row));
  origin[0] = subtract(origin[0], column(toView, 3));
  return { origin: origin.map(toModel), direction: direction.map(toModel), reference };
}

// Six numbers of the function normal . P + offset of model' points P along pixel rays.
function formOf(rays, normal, offset) {
  const form = [...rays.origin, ...rays.direction].map((row) => dot(row, normal));
  form[0] += offset;
  return form;
}

/** A point, model', at view depth t, less the reference, along the ray of a pixel (a, b). */
export function modelPoint(rays, [a, b], t) {
  const [from, towards] = [rays.origin, rays.direction].map(([one, ofA, ofB]) =>
    add(add(one, ofA, a), ofB, b));
  return add(from, towards, t);
}

/**
 * Forms that a frame needs: list coordinates, and planes that rays are clipped to, of which those of
 * the world keep their normals' sides. `rays` and `parallel` are of the new view; `clip`: the part of
 * the bounds that is seen, low and high of x, y and z as shares.
 */
export function frameForms(frame, space, windowSize, rays, parallel, clippingPlanes, clip) {
  const coordinates = space.rows.map((row) => formOf(rays, row.slice(0, 3), row[3]));
  const [u, v, , denominator] = coordinates;
  const planes = [];
  for (let axis = 0; axis < 3; ++axis) {
    const normal = [0, 1, 2].map((k) => Number(k === axis));
    const [low, high] = clip.slice(2 * axis, 2 * axis + 2);
    planes.push(formOf(rays, normal, frame.half[axis] * (1 - 2 * low)));
    planes.push(formOf(rays, times(normal, -1), frame.half[axis] * (2 * high - 1)));
  }
  for (const [form, lists] of [[u, windowSize[0]], [v, windowSize[1]]]) {
    for (const sign of [1, -1]) {
      planes.push(add(times(form, sign), times(denominator, lists / 2)));
    }
  }
  if (!space.parallel) planes.push(add(denominator, [-NEAREST_DEPTH, 0, 0, 0, 0, 0]));
  if (!parallel) planes.push([rays.reference, 0, 0, 1, 0, 0]);
  for (const plane of clippingPlanes) {
    const normal = unit(plane.normal);
    const from = subtract(frame.offset, times(plane.origin, frame.scale));
    const linear = [0, 1, 2].map((k) => dot(normal, column(frame.linear, k)));
    planes.push(formOf(rays, linear, dot(normal, from)));
  }
  return { coordinates, planes };
}

/**
 * The pixels that boxes of eight points, model', are seen in by a camera: ends along the width and the
 * height of each, two more to each side, row 0 at the bottom; all of the window where one is not in
 * front of the eye.
 */
export function pixelsOfBoxes(frame, camera, size, boxes) {
  const toView = modelToView(frame, camera);
  const half = halfExtentIn(frame, camera, size), centre = windowCentre(camera);
  const parallel = isParallel(camera);
  return boxes.map((corners) => {
    const seen = corners.map((corner) => toView.map((row) => dot(row, [...corner, 1])));
    return [0, 1].map((axis) => {
      const at = seen.map((point) =>
        (point[axis] / (parallel ? 1 : point[2]) / half[axis] - centre[axis] + 1) * size[axis] / 2);
      if (!parallel && seen.some(([, , depth]) => depth <= NEAREST_DEPTH)) return [0, size[axis]];
      return [Math.max(Math.floor(Math.min(...at) - 2), 0),
        Math.min(Math.ceil(Math.max(...at) + 2), size[axis])];
    });
  });
}
