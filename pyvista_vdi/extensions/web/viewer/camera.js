// Views as VTK's vtkCamera has them, and its movements: pure functions of plain objects.
import { cameraAxes, isParallel } from "./rays.js";
import { add, dot, subtract, unit } from "./vectors.js";

/** Return a view as the viewer keeps it: see element.d.ts; a TypeError says why one shows nothing. */
export function checkedCamera(camera) {
  const checked = Object.fromEntries(["position", "focal_point", "view_up"]
    .map((name) => [name, checkedNumbers("camera", camera, name)]));
  if (!(Math.hypot(...subtract(checked.focal_point, checked.position)) > 0)) {
    throw new TypeError("A camera's position and focal point differ; these are the same point.");
  }
  const parallel = isParallel(camera);
  const name = parallel ? "parallel_scale" : "view_angle";
  const value = Number(camera[name] ?? NaN);
  if (!(value > 0 && value < (parallel ? Infinity : 180))) {
    throw new TypeError(`A camera's ${name} is a positive number${parallel ? "" : " below 180"}; ` +
      `got ${camera[name]}.`);
  }
  checked[name] = value;
  if (camera.window_center) {
    checked.window_center = checkedNumbers("camera", camera, "window_center", 2);
  }
  if (!cameraAxes(checked).flat().every(Number.isFinite)) {
    throw new TypeError("A camera's view_up is not parallel to its direction; this one is.");
  }
  return checked;
}

/** Return a clipping plane as the viewer keeps it; a TypeError says why nothing is seen by one. */
export function checkedPlane(plane) {
  const [origin, normal] = ["origin", "normal"].map((name) => checkedNumbers("plane", plane, name));
  if (!(Math.hypot(...normal) > 0)) throw new TypeError("A plane's normal is not zero; this one is.");
  return { origin, normal };
}

/** Return an entry of something as an array of so many finite numbers; refuse another one. */
export function checkedNumbers(what, of, name, count = 3) {
  const numbers = of?.[name] && Array.from(of[name]);
  if (numbers?.length !== count || !numbers.every(Number.isFinite)) {
    const many = { 2: "two", 3: "three", 6: "six" }[count];
    throw new TypeError(`A ${what}'s ${name} is ${many} finite numbers; got ${of?.[name]}.`);
  }
  return numbers;
}

// Turn a vector about an axis, degrees (Rodrigues).
function turned(vector, axis, degrees) {
  const [x, y, z] = unit(axis);
  const angle = (degrees * Math.PI) / 180, c = Math.cos(angle), s = Math.sin(angle);
  const along = dot([x, y, z], vector) * (1 - c);
  const [u, v, w] = vector;
  return [
    u * c + (y * w - z * v) * s + x * along,
    v * c + (z * u - x * w) * s + y * along,
    w * c + (x * v - y * u) * s + z * along,
  ];
}

const around = (camera, axis, degrees) => ({
  ...camera,
  position: add(camera.focal_point,
    turned(subtract(camera.position, camera.focal_point), axis, degrees)),
});

const upright = (camera) => ({ ...camera, view_up: cameraAxes(camera)[1] });

/** Turn about the view up, then about the horizontal axis: Azimuth, Elevation; degrees. */
export function rotated(camera, azimuth, elevation) {
  const next = around(camera, camera.view_up, azimuth);
  const [right] = cameraAxes(next);
  return upright(around(next, right, -elevation));
}

/** Turn about the direction of view: Roll; degrees. */
export function rolled(camera, degrees) {
  const [, , forward] = cameraAxes(camera);
  return upright({ ...camera, view_up: turned(camera.view_up, forward, degrees) });
}

/** Come nearer by a factor: Dolly, or in parallel projection a smaller scale. */
export function nearer(camera, factor) {
  if (isParallel(camera)) return { ...camera, parallel_scale: camera.parallel_scale / factor };
  const from = subtract(camera.position, camera.focal_point);
  return { ...camera, position: add(camera.focal_point, from, 1 / factor) };
}

/** Widen a view, so that a picture of some width over height is seen whole in a narrower window. */
export function fitted(camera, aspect, [width, height]) {
  const wider = (aspect * height) / width;
  if (!(wider > 1)) return camera;
  const { view_angle, parallel_scale, window_center: [x, y] = [0, 0] } = camera;
  const lens = isParallel(camera) ? { parallel_scale: wider * parallel_scale }
    : { view_angle: (360 / Math.PI) * Math.atan(wider * Math.tan((view_angle * Math.PI) / 360)) };
  return { ...camera, ...lens, window_center: [x, y / wider] };
}

/** Move with what is in the focal plane: by parts of the viewport's height, right and up. */
export function panned(camera, right, up) {
  const axes = cameraAxes(camera);
  const distance = Math.hypot(...subtract(camera.focal_point, camera.position));
  const height = 2 * (isParallel(camera) ? camera.parallel_scale
    : distance * Math.tan((camera.view_angle * Math.PI) / 360));
  const move = (point) => add(add(point, axes[0], -right * height), axes[1], -up * height);
  return { ...camera, position: move(camera.position), focal_point: move(camera.focal_point) };
}
