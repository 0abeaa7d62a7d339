// The editor of a transfer function: a curve of opacities over a histogram, colours, window and level.
import { COLORMAPS } from "./colormaps.js";
import { htmlElement, svgElement } from "./html.js";
import { inShort } from "./marks.js";

/** Shares that an arrow key moves a point by, and with Shift. */
const NUDGE = 0.01, STRIDE = 0.1;
/** Pixels from a point within which a finger or a pointer takes it. */
const NEAR = 14;

/** Curves to begin with: shares of the window and opacities. */
const PRESETS = {
  Ramp: [0, 0, 1, 1],
  Soft: [0, 0, 0.3, 0.03, 0.5, 0.2, 0.7, 0.5, 1, 0.8],
  Peak: [0, 0, 0.4, 0, 0.5, 0.6, 0.6, 0, 1, 0],
  Step: [0, 0, 0.49, 0, 0.51, 0.9, 1, 0.9],
};

/** In a viewer's sheet of styles. */
export const EDITOR_STYLE = `
.curve { position: relative; height: 120px; margin: 6px 0; touch-action: none; cursor: crosshair;
  box-shadow: 0 0 0 1px var(--edge); }
.curve svg { position: absolute; inset: 0; width: 100%; height: 100%; overflow: clip;
  overflow-clip-margin: 2px; }
.curve path { vector-effect: non-scaling-stroke; }
.curve .lengths { fill: #8886; }
.curve .line { fill: none; stroke: currentColor; stroke-width: 2; }
.point { position: absolute; width: 24px; height: 24px; margin: -12px; border-radius: 12px; cursor: move; }
.point::after { content: ""; position: absolute; inset: 6px; border: 2px solid currentColor;
  border-radius: 50%; background: var(--paper); }
.point.last::after { background: var(--mark); }
.colors { height: 10px; margin: 6px 0; }
.ends { display: flex; justify-content: space-between; min-height: 20px; font-size: 12px;
  font-variant-numeric: tabular-nums; }
.editor .row { display: flex; gap: 4px; margin: 4px 0; }
.editor .row button { flex: 1; min-width: 0; padding: 0 2px; border: 1px solid var(--edge); }
.editor button:disabled { opacity: 0.6; cursor: default; }
.editor select { flex: 1; min-width: 0; height: 32px; font: inherit; color: inherit;
  background: var(--paper); border: 1px solid var(--edge); border-radius: 6px; }
@container (max-width: 479px) { .panel:has(.editor:not([hidden])) { inset: auto 6px 6px; width: auto; max-height: 40%; } }`;

const thousandths = (x) => Math.round(1000 * Math.min(Math.max(x, 0), 1)) / 1000;

/**
 * The editor of what a viewer shows of a VDI that keeps values.
 *
 * @param {HTMLElement} viewer The element.
 * @param {function(string, function(), string): HTMLElement} button Makes one: its name, what it
 *   does and what stands on it.
 * @returns {{element: HTMLElement, show: function(), key: function(KeyboardEvent, EventTarget): boolean,
 *   undo: function(KeyboardEvent, EventTarget): boolean, reset: function()}} `show` what the viewer has;
 *   whether a `key` is taken, and one with Ctrl by `undo`; `reset`: to what the file begins with.
 */
export function transferEditor(viewer, button) {
  const before = []; // that undo goes back to
  let last = 0; // the point that was used last
  let dragged = null; // a pointer's number
  let gesture = null; // what changes as one: a pointer, a slider, or repeats of a key

  const current = () => viewer.look.transfer ?? viewer.values.start;
  const pointsOf = () => {
    const { points } = current();
    return Array.from({ length: points.length / 2 }, (_, k) => [points[2 * k], points[2 * k + 1]]);
  };
  const give = (transfer) => (viewer.look = { ...viewer.look, transfer });
  const change = (changes, by = null) => {
    if (by === null || by !== gesture) before.push(viewer.look.transfer ?? null);
    gesture = by;
    give(changes && { ...current(), ...changes });
  };
  const back = () => {
    if (!before.length) return;
    gesture = null;
    give(before.pop());
  };

  // -- points ------------------------------------------------------------------------------------

  const valueOf = (x) => {
    const [low, high] = current().clim;
    return low + x * (high - low);
  };
  const shareOf = (value) => { // of the values that are kept
    const [low, high] = viewer.values.range;
    return (value - low) / (high - low);
  };
  const move = (k, x, y, by) => { // between its neighbours
    const points = pointsOf();
    const [low, high] = [points[k - 1]?.[0] ?? 0, points[k + 1]?.[0] ?? 1];
    points[k] = [Math.min(Math.max(thousandths(x), low), high), thousandths(y)];
    change({ points: points.flat() }, by);
  };
  const add = (x, y, by) => {
    const points = pointsOf();
    let k = points.findIndex(([other]) => other > x);
    if (k < 0) k = points.length;
    points.splice(k, 0, [thousandths(x), thousandths(y)]);
    last = k;
    change({ points: points.flat() }, by);
  };
  const addBehind = () => { // in the middle of what follows the point, or of what is before the last
    const points = pointsOf(), k = Math.min(last, Math.max(points.length - 2, 0));
    const [a, b] = [points[k], points[k + 1] ?? points[k]];
    add((a[0] + b[0]) / 2, (a[1] + b[1]) / 2);
    marks[last].focus();
  };
  const remove = () => {
    const points = pointsOf();
    if (points.length < 2) return;
    points.splice(last, 1);
    last = Math.min(last, points.length - 1);
    change({ points: points.flat() });
    if (marks.includes(viewer.shadowRoot.activeElement)) marks[last].focus();
  };

  const lengths = svgElement("path", { class: "lengths" }), line = svgElement("path", { class: "line" });
  const drawing = svgElement("svg", { viewBox: "0 0 1 1", preserveAspectRatio: "none", "aria-hidden": "true" },
    lengths, line);
  const curve = htmlElement("div", { className: "curve", role: "group",
    label: "Opacity over values: press to add a point, drag to move one" }, drawing);
  const marks = []; // of points
  const markOf = (k) => {
    const mark = htmlElement("div", { className: "point", role: "slider", tabIndex: 0 });
    mark.addEventListener("focus", () => {
      last = k;
      show();
    });
    curve.append(mark);
    return mark;
  };

  const placeOf = ({ clientX, clientY }) => {
    const { left, top, width, height } = curve.getBoundingClientRect();
    const [low, high] = viewer.values.range, [first, end] = current().clim;
    const value = low + (clientX - left) / width * (high - low);
    return { x: (value - first) / (end - first), y: 1 - (clientY - top) / height, width, height };
  };
  const nearest = ({ x, y, width, height }) => {
    const [first, end] = current().clim, wide = width * (shareOf(end) - shareOf(first));
    const far = ([px, py]) => Math.hypot((px - x) * wide, (py - y) * height);
    const points = pointsOf();
    const k = points.reduce((best, point, i) => (far(point) < far(points[best]) ? i : best), 0);
    return far(points[k]) <= NEAR ? k : -1;
  };
  let number = 0; // of the gesture
  curve.addEventListener("pointerdown", (event) => {
    if (event.button || dragged !== null) return;
    event.preventDefault(); // the focus is given below
    const place = placeOf(event), k = nearest(place);
    dragged = event.pointerId;
    curve.setPointerCapture(dragged);
    ++number;
    if (k >= 0) last = k;
    else add(place.x, place.y, number);
    marks[last].focus({ preventScroll: true });
  });
  curve.addEventListener("pointermove", (event) => {
    if (event.pointerId !== dragged) return;
    const { x, y } = placeOf(event);
    move(last, x, y, number);
  });
  for (const name of ["pointerup", "pointercancel"]) {
    curve.addEventListener(name, (event) => {
      if (event.pointerId === dragged) dragged = gesture = null;
    });
  }

  // -- colours, window and level -----------------------------------------------------------------

  const colors = htmlElement("div", { className: "colors" });
  const span = (...text) => htmlElement("span", {}, ...text);
  const said = span(), lowest = span(), highest = span();
  const ends = htmlElement("div", { className: "ends" }, lowest, said, highest);
  const maps = htmlElement("select", {}, ...["", ...COLORMAPS].map((name) =>
    htmlElement("option", { value: name }, name || "as it was made")));
  maps.addEventListener("change", () => change({ cmap: maps.value || null }));
  const labelled = (text, control) => htmlElement("label", {}, span(text), control);
  const range = (label, limits, read, told, write) => {
    const input = htmlElement("input", { type: "range", label, ...limits });
    input.addEventListener("input", () => change({ clim: write(Number(input.value)) }, label));
    input.addEventListener("change", () => (gesture = null));
    return [labelled(label, input), () => {
      input.value = read();
      input.setAttribute("aria-valuetext", told());
    }];
  };
  const extent = () => viewer.values.range[1] - viewer.values.range[0];
  const middle = () => (current().clim[0] + current().clim[1]) / 2;
  const width = () => current().clim[1] - current().clim[0];
  const climOf = (centre, wide) => [centre - wide / 2, centre + wide / 2].map((value) =>
    Number(value.toPrecision(7)));
  const sliders = [
    range("Level", { min: 0, max: 1, step: 0.005 }, () => shareOf(middle()), () => inShort(middle()),
      (share) => climOf(viewer.values.range[0] + share * extent(), width())),
    range("Window", { min: 0.01, max: 1.5, step: 0.005 }, () => width() / extent(), () => inShort(width()),
      (share) => climOf(middle(), share * extent())),
  ];

  // -- all of it ---------------------------------------------------------------------------------

  const presets = Object.entries(PRESETS).map(([name, points]) =>
    button(`Opacity: ${name}`, () => change({ points }), name));
  const undoing = button("Undo", back, "Undo");
  const removing = button("Remove the point", remove, "\u2212 Point");
  const row = (...content) => htmlElement("div", { className: "row" }, ...content);
  const element = htmlElement("div", { className: "editor" }, curve, colors, ends,
    row(button("Add a point", addBehind, "+ Point"), removing, undoing),
    labelled("Colours", maps), ...sliders.map(([label]) => label), row(...presets));

  const textOf = ([x, y]) => `value ${inShort(valueOf(x))}, opacity ${y}`;
  let histogram = null; // that is drawn
  const show = () => {
    const { values, transferFunction } = viewer;
    element.hidden = !values;
    if (!values) return;
    if (values.histogram !== histogram) {
      ({ histogram } = values);
      const most = Math.max(...histogram), n = histogram.length; // by roots: what is rare is seen, too
      const tops = Array.from(histogram, (length, k) =>
        `V${1 - Math.sqrt(most ? length / most : 0)}H${(k + 1) / n}`);
      lengths.setAttribute("d", `M0 1${tops.join("")}V1Z`);
    }
    const points = pointsOf();
    last = Math.min(last, points.length - 1);
    const places = points.map(([x, y]) => [shareOf(valueOf(x)), 1 - y]);
    line.setAttribute("d", `M-9 ${places[0][1]}${places.map(([x, y]) => `L${x} ${y}`).join("")}H10`);
    while (marks.length < points.length) marks.push(markOf(marks.length));
    const held = marks.indexOf(viewer.shadowRoot.activeElement);
    while (marks.length > points.length) marks.pop().remove();
    if (held >= marks.length) marks.at(-1).focus();
    marks.forEach((mark, k) => {
      mark.style.left = `${100 * Math.min(Math.max(places[k][0], 0), 1)}%`;
      mark.style.top = `${100 * places[k][1]}%`;
      mark.classList.toggle("last", k === last);
      for (const [name, told] of Object.entries({ label: `Point ${k + 1} of ${points.length}`,
        valuemin: 0, valuemax: 1, valuenow: points[k][1], valuetext: textOf(points[k]) })) {
        mark.setAttribute(`aria-${name}`, told);
      }
    });
    said.textContent = textOf(points[last]);
    [lowest.textContent, highest.textContent] = values.range.map(inShort);
    const table = transferFunction.colors, [first, end] = transferFunction.scalar_range.map(shareOf);
    const count = Math.min(table.length, 32);
    const stops = Array.from({ length: count }, (_, k) => {
      const at = count > 1 ? k / (count - 1) : 0;
      const shade = table[Math.round(at * (table.length - 1))].map((c) => `${100 * c}%`).join(" ");
      return `rgb(${shade}) ${100 * (first + at * (end - first))}%`;
    });
    colors.style.background = stops.length > 1 ? `linear-gradient(to right, ${stops})` : "";
    maps.value = viewer.look.transfer?.cmap ?? "";
    undoing.disabled = !before.length;
    removing.disabled = points.length < 2;
    sliders.forEach(([, take]) => take());
  };

  const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1],
    Home: [-Infinity, 0], End: [Infinity, 0] };
  const key = (event, target) => {
    const k = marks.indexOf(target), arrow = ARROWS[event.key];
    if (k < 0) return false;
    last = k;
    if (arrow) {
      const step = event.shiftKey ? STRIDE : NUDGE, [x, y] = pointsOf()[k];
      move(k, x + arrow[0] * step, y + arrow[1] * step, event.repeat ? `key ${k}` : null);
      gesture = `key ${k}`;
    } else if (event.key === "+") addBehind();
    else if (["Delete", "Backspace", "-"].includes(event.key)) remove();
    else return false;
    return true;
  };
  const undo = (event, target) => {
    const asked = (event.ctrlKey || event.metaKey) && !event.altKey && event.key.toLowerCase() === "z";
    if (!asked || !element.contains(target)) return false;
    event.preventDefault();
    back();
    return true;
  };
  return { element, show, key, undo, reset: () => viewer.look.transfer && change(null) };
}
