// The editor of a transfer function: a curve of opacities over a histogram, colours, window and level.
import { COLORMAPS } from "./colormaps.js";
import { htmlElement, inShort, setSlider, slider, svgElement } from "./html.js";

/** Shares that an arrow key moves a point by, and with Shift. */
const NUDGE = 0.01, STRIDE = 0.1;
/** Pixels from a point within which a finger or a pointer takes it. */
const NEAR = 14;

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1],
  Home: [-Infinity, 0], End: [Infinity, 0] };

const clamped = (x, low = 0, high = 1) => Math.min(Math.max(x, low), high);
const thousandths = (x) => Math.round(1000 * clamped(x)) / 1000;

/**
 * The editor of what a viewer shows of a VDI that keeps values.
 *
 * @param {HTMLElement} viewer The element.
 * @param {function(string, function(), string): HTMLElement} button Makes one: its name, what it
 *   does and what stands on it.
 * @returns {{element: HTMLElement, show: function(), key: function(KeyboardEvent, EventTarget): boolean}}
 *   `show` what the viewer has; whether a `key` is taken.
 */
export function transferEditor(viewer, button) {
  let last = 0; // the point that was used last
  let dragged = null; // a pointer's number

  const current = () => viewer.look.transfer ?? viewer.values.start;
  const change = (changes) =>
    (viewer.look = { ...viewer.look, transfer: { ...current(), ...changes } });
  const shareOf = (value) => { // of the values that are kept
    const [low, high] = viewer.values.range;
    return (value - low) / (high - low);
  };
  const valueOf = (x) => {
    const [low, high] = current().clim;
    return low + x * (high - low);
  };

  // -- points ------------------------------------------------------------------------------------

  const pointsOf = () => {
    const { points } = current();
    return Array.from({ length: points.length / 2 }, (_, k) => [points[2 * k], points[2 * k + 1]]);
  };
  const move = (k, x, y) => { // between its neighbours
    const points = pointsOf();
    points[k] = [clamped(thousandths(x), points[k - 1]?.[0], points[k + 1]?.[0]), thousandths(y)];
    change({ points: points.flat() });
  };
  const add = (x, y) => {
    const points = pointsOf(), k = points.findIndex(([other]) => other > x);
    last = k < 0 ? points.length : k;
    points.splice(last, 0, [thousandths(x), thousandths(y)]);
    change({ points: points.flat() });
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
  const curve = htmlElement("div", { className: "curve", role: "group",
    label: "Opacity over values: press to add a point, drag to move one" },
  svgElement("svg", { viewBox: "0 0 1 1", preserveAspectRatio: "none", "aria-hidden": "true" }, lengths, line));
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
  const placeOf = ({ clientX, clientY }) => { // share of the window, opacity, and pixels of both
    const { left, top, width, height } = curve.getBoundingClientRect();
    const [first, end] = current().clim.map(shareOf), wide = width * (end - first);
    return { x: ((clientX - left) - width * first) / wide, y: 1 - (clientY - top) / height, wide, height };
  };
  const pressed = (event) => { // takes the nearest point, or makes one
    const { x, y, wide, height } = placeOf(event);
    const far = pointsOf().map(([px, py]) => Math.hypot((px - x) * wide, (py - y) * height));
    const nearest = Math.min(...far);
    if (nearest <= NEAR) last = far.indexOf(nearest);
    else add(x, y);
    marks[last].focus({ preventScroll: true });
  };
  curve.addEventListener("pointerdown", (event) => {
    if (event.button || dragged !== null) return;
    event.preventDefault(); // the focus is given by hand
    dragged = event.pointerId;
    curve.setPointerCapture(dragged);
    pressed(event);
  });
  curve.addEventListener("pointermove", (event) => {
    if (event.pointerId !== dragged) return;
    const { x, y } = placeOf(event);
    move(last, x, y);
  });
  curve.addEventListener("lostpointercapture", () => (dragged = null));

  // -- colours, window and level -----------------------------------------------------------------

  const span = () => htmlElement("span");
  const colors = htmlElement("div", { className: "colors" });
  const said = span(), lowest = span(), highest = span();
  const maps = htmlElement("select", {}, ...["", ...COLORMAPS].map((name) =>
    htmlElement("option", { value: name }, name || "as it was made")));
  maps.addEventListener("change", () => change({ cmap: maps.value || null }));
  const labelled = (text, control) => htmlElement("label", {}, htmlElement("span", {}, text), control);
  const middle = () => valueOf(0.5), width = () => current().clim[1] - current().clim[0];
  const climOf = (centre, wide) => change({ clim: [centre - wide / 2, centre + wide / 2].map((value) =>
    Number(value.toPrecision(7))) });
  const valueAt = (share) => viewer.values.range[0] + share * extent();
  const extent = () => viewer.values.range[1] - viewer.values.range[0];
  const level = slider("Level", { min: 0, max: 1, step: 0.005 }, (share) => climOf(valueAt(share), width()));
  const window_ = slider("Window", { min: 0.01, max: 1.5, step: 0.005 },
    (share) => climOf(middle(), share * extent()));

  // -- all of it ---------------------------------------------------------------------------------

  const removing = button("Remove the point", remove, "\u2212 Point");
  const element = htmlElement("div", { className: "editor" }, curve, colors,
    htmlElement("div", { className: "ends" }, lowest, said, highest),
    htmlElement("div", { className: "row" }, button("Add a point", addBehind, "+ Point"), removing),
    labelled("Colours", maps), labelled("Level", level), labelled("Window", window_));

  const textOf = ([x, y]) => `value ${inShort(valueOf(x))}, opacity ${y}`;
  const showPoints = () => {
    const points = pointsOf();
    last = Math.min(last, points.length - 1);
    const places = points.map(([x, y]) => [shareOf(valueOf(x)), 1 - y]);
    line.setAttribute("d", `M-9 ${places[0][1]}${places.map(([x, y]) => `L${x} ${y}`).join("")}H10`);
    while (marks.length < points.length) marks.push(markOf(marks.length));
    const held = marks.indexOf(viewer.shadowRoot.activeElement);
    while (marks.length > points.length) marks.pop().remove();
    if (held >= marks.length) marks.at(-1).focus();
    marks.forEach((mark, k) => {
      mark.style.left = `${100 * clamped(places[k][0])}%`;
      mark.style.top = `${100 * places[k][1]}%`;
      mark.classList.toggle("last", k === last);
      for (const [name, told] of Object.entries({ label: `Point ${k + 1} of ${points.length}`,
        valuemin: 0, valuemax: 1, valuenow: points[k][1], valuetext: textOf(points[k]) })) {
        mark.setAttribute(`aria-${name}`, told);
      }
    });
    said.textContent = textOf(points[last]);
    removing.disabled = points.length < 2;
  };
  const show = () => {
    const { values, transferFunction } = viewer;
    element.hidden = !values;
    if (!values) return;
    const { histogram } = values, most = Math.max(...histogram) || 1;
    const tops = Array.from(histogram, (length, k) => // by roots: what is rare is seen, too
      `V${1 - Math.sqrt(length / most)}H${(k + 1) / histogram.length}`);
    lengths.setAttribute("d", `M0 1${tops.join("")}V1Z`);
    showPoints();
    const table = transferFunction.colors, [first, end] = transferFunction.scalar_range.map(shareOf);
    const stops = Array.from({ length: 32 }, (_, k) => {
      const shade = table[Math.round(k / 31 * (table.length - 1))].map((c) => `${100 * c}%`).join(" ");
      return `rgb(${shade}) ${100 * (first + k / 31 * (end - first))}%`;
    });
    colors.style.background = `linear-gradient(to right, ${stops})`;
    [lowest.textContent, highest.textContent] = values.range.map(inShort);
    maps.value = viewer.look.transfer?.cmap ?? "";
    setSlider(level, shareOf(middle()), inShort(middle()));
    setSlider(window_, width() / extent(), inShort(width()));
  };

  const key = ({ key: name, shiftKey }, target) => {
    const k = marks.indexOf(target), arrow = ARROWS[name];
    if (k < 0) return false;
    last = k;
    if (arrow) {
      const step = shiftKey ? STRIDE : NUDGE, [x, y] = pointsOf()[k];
      move(k, x + arrow[0] * step, y + arrow[1] * step);
    } else if (name === "+") addBehind();
    else if (["Delete", "Backspace", "-"].includes(name)) remove();
    else return false;
    return true;
  };
  return { element, show, key };
}
