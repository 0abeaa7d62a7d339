// Texts and scalar bars over a picture, drawn by the page's own fonts at the screen's own pixels.

const FAMILIES = { Arial: "Arial, Helvetica, 'Liberation Sans', sans-serif",
  Courier: "'Courier New', Courier, 'Liberation Mono', monospace",
  Times: "'Times New Roman', Times, 'Liberation Serif', serif" };

const css = ([r, g, b, a = 1]) => `rgb(${100 * r}% ${100 * g}% ${100 * b}% / ${a})`;

/**
 * Draw what web/scenes/annotations.py has described.
 *
 * @param {CanvasRenderingContext2D} on A canvas of width x height pixels.
 * @param {object[]} items
 * @param {number[]} from Width and height, pixels, of the window that the items are of.
 * @param {function(object): number[]|null} project Where an item with a place in the world (`at`)
 *   is: parts of the window, from the lower left corner, and its depth; null for what is behind the
 *   eye.
 */
export function annotate(on, items, from, project) {
  const { width, height } = on.canvas;
  on.clearRect(0, 0, width, height);
  const scale = Math.min(width / from[0], height / from[1]);
  const placed = items.map((item) => ({ item, place: item.at ? project(item) : item.place }));
  const depth = ({ item, place }) => (item.alone && place ? place[2] : 0);
  const taken = []; // by labels of a group: what a nearer one overlaps is not written
  for (const { item, place } of placed.sort((a, b) => depth(a) - depth(b))) {
    if (!place) continue;
    on.save();
    if (item.kind === "box") drawBox(on, item, width, height, scale);
    else drawText(on, item, place, width, height, scale, taken);
    on.restore();
  }
}

function drawBox(on, { place, color, colors, upright, outline, line }, width, height, scale) {
  const [x0, y0, x1, y1] = [place[0] * width, place[1] * height, place[2] * width, place[3] * height];
  if (color) {
    on.fillStyle = css(color);
    on.fillRect(x0, height - y1, x1 - x0, y1 - y0);
  }
  const count = (colors?.length ?? 0) / 4;
  for (let k = 0; k < count; ++k) {
    const [r, g, b, a] = colors.slice(4 * k, 4 * k + 4);
    on.fillStyle = `rgb(${r} ${g} ${b} / ${a / 255})`;
    // To whole pixels: two that share one would be seen through
    const ends = (low, high) => [k, k + 1].map((n) => Math.round(low + (high - low) * n / count));
    const [from, to] = upright ? ends(y0, y1) : ends(x0, x1);
    if (upright) on.fillRect(x0, height - to, x1 - x0, to - from);
    else on.fillRect(from, height - y1, to - from, y1 - y0);
  }
  if (outline) {
    on.strokeStyle = css(outline);
    on.lineWidth = line * scale;
    on.strokeRect(x0, height - y1, x1 - x0, y1 - y0);
  }
}

function drawText(on, item, place, width, height, scale, taken) {
  const size = item.size * scale;
  const style = `${item.italic ? "italic " : ""}${item.bold ? "bold " : ""}`;
  on.font = `${style}${size}px ${FAMILIES[item.family] ?? FAMILIES.Arial}`;
  const [dx, dy] = item.shift ?? [0, 0];
  on.translate(place[0] * width + dx * scale, (1 - place[1]) * height - dy * scale);
  on.rotate((-item.angle * Math.PI) / 180);
  on.textBaseline = "alphabetic";
  const lines = item.text.split("\n");
  // As VTK has it: the height of a line is that of the font's letters with what hangs below them
  const measured = on.measureText("_/7Agfy");
  const up = measured.actualBoundingBoxAscent, down = measured.actualBoundingBoxDescent;
  const step = (up + down) * item.spacing * 1.1;
  const high = up + down + step * (lines.length - 1);
  const top = { top: 0, middle: -high / 2, bottom: -high }[item.along];
  const wide = Math.max(...lines.map((line) => on.measureText(line).width));
  const left = { left: 0, center: -wide / 2, right: -wide }[item.across];
  const margin = (item.margin ?? 2) * scale;
  const around = [left - margin, top - margin, wide + 2 * margin, high + 2 * margin];
  if (item.alone) {
    const [x, y] = [place[0] * width + around[0], (1 - place[1]) * height + around[1]];
    const box = [x, y, x + around[2], y + around[3]];
    const beside = taken[item.alone] ??= [];
    if (beside.some((b) => b[0] < box[2] && box[0] < b[2] && b[1] < box[3] && box[1] < b[3])) return;
    beside.push(box);
  }
  if (item.background) {
    on.fillStyle = css(item.background);
    on.beginPath();
    on.roundRect(...around, item.round ? margin : 0);
    on.fill();
  }
  if (item.frame) {
    on.strokeStyle = css(item.frame);
    on.lineWidth = item.frame[3] * scale;
    on.strokeRect(...around);
  }
  const write = (dx, dy, color) => {
    on.fillStyle = css(color);
    on.textAlign = item.across;
    lines.forEach((line, k) => on.fillText(line, dx, top + up + step * k + dy));
  };
  if (item.shadow) {
    const luminance = 0.3 * item.color[0] + 0.59 * item.color[1] + 0.11 * item.color[2];
    const grey = luminance > 0.5 ? 0 : 1;
    write(item.shadow[0] * scale, -item.shadow[1] * scale, [grey, grey, grey, item.color[3]]);
  }
  write(0, 0, item.color);
}
