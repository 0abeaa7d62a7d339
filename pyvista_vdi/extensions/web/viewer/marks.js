// What is drawn over a picture by the page itself: axes, a cube that says where one looks from, the
// bounds with numbers, a colour bar.
import { cameraAxes, halfExtent, isParallel } from "./rays.js";
import { cross, dot, subtract } from "./vectors.js";

const AXIS_COLORS = ["#ff6b5e", "#5fd35f", "#6da4ff"];
const AXIS_NAMES = ["x", "y", "z"];
/** Lengths in CSS pixels: of an axis, half of the cube's edge, of the colour bar, and from the picture's edges. */
const ARM = 28, HALF = 20, BAR = [12, 120], EDGE = 12;
const LEGIBLE = 0.4; // the part of a face's height, seen from the side, from which its name is read
const NEAREST = 1e-6; // view depth, world units: what is nearer is behind the eye

/** A number as people read it. */
export const inShort = (x) => String(Number(x.toPrecision(4)));

/**
 * Draw marks.
 *
 * @param {CanvasRenderingContext2D} on Scaled to CSS pixels, and empty.
 * @param {number[]} size Width and height, CSS pixels.
 * @param {object} camera The view, as it is drawn.
 * @param {object} marks `axes`: whether there are some; `cube`: the views that its faces name
 *   ([name, from, up]), or null; `bounds`: a box of the world, or null; `colors`: a transfer function
 *   ({colors, scalar_range}), or null. `below`: how high what lies over the picture's lower edge is.
 */
export function drawMarks(on, size, camera, { axes, cube, bounds, colors, below = 0 }) {
  on.font = "12px sans-serif";
  on.lineJoin = on.lineCap = "round";
  if (bounds) drawBounds(on, size, camera, bounds);
  const free = [size[0], size[1] - below];
  if (axes) drawAxes(on, free, camera, cube ? 3.5 * HALF : 0);
  if (cube) drawCube(on, free, camera, cube);
  if (colors) drawColors(on, free, colors);
}

// Letters that are read on whatever is behind them.
function write(on, text, x, y, color = "white") {
  on.strokeStyle = "#000b";
  on.lineWidth = 3;
  on.strokeText(text, x, y);
  on.fillStyle = color;
  on.fillText(text, x, y);
}

function line(on, from, to, color, width) {
  for (const [style, wide] of [["#000a", width + 2], [color, width]]) {
    [on.strokeStyle, on.lineWidth] = [style, wide];
    on.beginPath();
    on.moveTo(...from);
    on.lineTo(...to);
    on.stroke();
  }
}

// The faces of the cube that are seen, in pixels: where `points` of a face ([right, up], 1 at its edges) are.
function facesOf(views, [, height], camera) {
  const [right, up, forward] = cameraAxes(camera);
  const middle = [EDGE + 1.75 * HALF, height - EDGE - 1.75 * HALF];
  const onScreen = (v) => [HALF * dot(v, right), -HALF * dot(v, up)];
  return views.flatMap((view) => {
    const [name, from, top] = view, facing = -dot(from, forward);
    if (Math.hypot(...from) > 1 || facing < 1e-6) return []; // views from between the axes have no face
    const [along, upwards, out] = [cross(top, from), top, from].map(onScreen);
    const at = (x, y) => [0, 1].map((k) => middle[k] + out[k] + x * along[k] + y * upwards[k]);
    return [{ view, name, facing, along, upwards, middle: at(0, 0),
      corners: [[-1, -1], [1, -1], [1, 1], [-1, 1]].map((corner) => at(...corner)) }];
  });
}

/** The view, of those that a cube's faces name, whose face is at a place of the picture; or null. */
export function viewAt(views, size, camera, [x, y]) {
  const isIn = ({ corners }) => {
    const sides = corners.map(([cx, cy], k) => {
      const [nx, ny] = corners[(k + 1) % 4];
      return (nx - cx) * (y - cy) - (ny - cy) * (x - cx);
    });
    return sides.every((side) => side <= 0);
  };
  return facesOf(views, size, camera).find(isIn)?.view ?? null;
}

function drawCube(on, size, camera, views) {
  on.textAlign = "center";
  on.textBaseline = "middle";
  for (const { view, name, facing, along, upwards, middle, corners } of facesOf(views, size, camera)) {
    on.beginPath();
    corners.forEach((corner) => on.lineTo(...corner));
    on.closePath();
    const grey = 20 + 50 * facing;
    on.fillStyle = `rgb(${grey} ${grey} ${grey} / 85%)`;
    on.fill();
    [on.strokeStyle, on.lineWidth] = ["#fffc", 1];
    on.stroke();
    if (facing < LEGIBLE) continue;
    on.save();
    on.transform(...along.map((x) => x / HALF), ...upwards.map((x) => -x / HALF), ...middle);
    on.fillStyle = AXIS_COLORS[view[1].findIndex(Boolean)];
    on.font = "bold 18px sans-serif";
    on.fillText(name, 0, 1);
    on.restore();
  }
}

function drawAxes(on, [, height], camera, shift) {
  const [right, up, forward] = cameraAxes(camera);
  const middle = [EDGE + ARM + 8 + shift, height - EDGE - ARM - 8];
  const arms = AXIS_NAMES.map((name, k) => ({ name, color: AXIS_COLORS[k], depth: forward[k],
    at: (length) => [middle[0] + length * right[k], middle[1] - length * up[k]] }));
  on.textAlign = "center";
  on.textBaseline = "middle";
  for (const { name, color, at } of arms.sort((a, b) => b.depth - a.depth)) {
    line(on, middle, at(ARM), color, 2.5);
    if (Math.hypot(...subtract(at(1), middle)) > 0.2) write(on, name, ...at(ARM + 9), color);
  }
}

function drawBounds(on, [width, height], camera, bounds) {
  const [halfWidth, halfHeight] = halfExtent(camera, [width, height]);
  const [cx, cy] = camera.window_center ?? [0, 0];
  const axes = cameraAxes(camera);
  const corners = Array.from({ length: 8 }, (_, k) => {
    const world = [bounds[k & 1], bounds[2 + (k >> 1 & 1)], bounds[4 + (k >> 2)]];
    const [x, y, z] = axes.map((axis) => dot(axis, subtract(world, camera.position)));
    const by = isParallel(camera) ? 1 : z > NEAREST ? z : NaN;
    return [(x / by / halfWidth - cx + 1) * width / 2, (1 - y / by / halfHeight + cy) * height / 2];
  });
  for (let k = 0; k < 8; ++k) {
    for (const step of [1, 2, 4]) {
      const ends = [corners[k], corners[k | step]];
      if (!(k & step) && ends.flat().every(Number.isFinite)) line(on, ...ends, "#fffc", 1);
    }
  }
  if (!corners.flat().every(Number.isFinite)) return;
  // Numbers at the edge of each direction that lies farthest outside
  const middle = [0, 1].map((k) => corners.reduce((sum, corner) => sum + corner[k] / 8, 0));
  AXIS_NAMES.forEach((name, axis) => {
    const step = 1 << axis;
    const edges = corners.map((_, k) => k).filter((k) => !(k & step)).map((k) => {
      const ends = [corners[k], corners[k | step]];
      const at = [0, 1].map((i) => (ends[0][i] + ends[1][i]) / 2);
      return { ends, at, out: at[1] - middle[1] + Math.abs(at[0] - middle[0]) / 2 };
    });
    const { ends, at } = edges.reduce((a, b) => (a.out >= b.out ? a : b));
    if (Math.hypot(...subtract(ends[0], ends[1])) < 2 * ARM) return; // seen from its end
    on.textAlign = at[0] < middle[0] - 1 ? "right" : at[0] > middle[0] + 1 ? "left" : "center";
    on.textBaseline = "top";
    const place = ([x, y]) => [x + { left: 5, right: -5, center: 0 }[on.textAlign], y + 3];
    ends.forEach((end, k) => {
      // Not into its neighbour's
      const inwards = end.map((x, i) => x + 0.12 * (ends[1 - k][i] - x));
      write(on, inShort(bounds[2 * axis + k]), ...place(inwards));
    });
    write(on, name, ...place(at), AXIS_COLORS[axis]);
  });
}

function drawColors(on, [width, height], { colors, scalar_range }) {
  const [wide, high] = [BAR[0], Math.min(BAR[1], height - 2 * EDGE - 60)];
  const [left, top] = [width - EDGE - wide, height - EDGE - high - 30];
  const shades = on.createLinearGradient(0, top + high, 0, top);
  const stops = Math.min(colors.length, 64);
  for (let k = 0; k < stops; ++k) {
    const share = stops > 1 ? k / (stops - 1) : 0;
    const [r, g, b] = colors[Math.round(share * (colors.length - 1))].map((c) => 100 * c);
    shades.addColorStop(share, `rgb(${r}% ${g}% ${b}%)`);
  }
  [on.strokeStyle, on.lineWidth] = ["#000a", 3];
  on.strokeRect(left, top, wide, high);
  on.fillStyle = shades;
  on.fillRect(left, top, wide, high);
  on.textAlign = "right";
  scalar_range.forEach((value, end) => {
    on.textBaseline = end ? "top" : "bottom";
    write(on, inShort(value), left - 6, end ? top : top + high);
  });
}
