// What is done to a view beside turning it: a bar of buttons that fades, and panels that they open.
import { lookingAt } from "./camera.js";
import { EDITOR_STYLE, transferEditor } from "./editor.js";
import { htmlElement, strokes } from "./html.js";
import { AS_MADE } from "./look.js";
import { drawMarks, inShort, viewAt } from "./marks.js";

/** Milliseconds after the picture and the last sign of somebody, from which the bar fades. */
const FADES = 3000;
/** Milliseconds from the last movement of a pointer until its place is looked up. */
const POINTER_RESTS = 60;
/** Milliseconds from a touch until its click has come. */
const CLICK_LATER = 400;
/** Pixels that the controls of a series are high. */
const PLAYER = 40;
/** Pixels that a finger or a hand trembles by. */
const TREMBLING = 4;

/** Keys that sliders take by themselves. */
const OF_SLIDER = /^(Arrow|Page|Home|End)/;

/** The directions that standard views look from, and what is up there. */
const VIEWS = [
  ["+x", [1, 0, 0], [0, 0, 1]], ["\u2212x", [-1, 0, 0], [0, 0, 1]],
  ["+y", [0, 1, 0], [0, 0, 1]], ["\u2212y", [0, -1, 0], [0, 0, 1]],
  ["+z", [0, 0, 1], [0, 1, 0]], ["\u2212z", [0, 0, -1], [0, 1, 0]],
  ["iso", [1, 1, 1], [0, 0, 1]],
];

const KEYS = [
  ["drag, one finger, arrow keys", "turn"],
  ["drag with Shift, two fingers, arrow keys with Shift", "move"],
  ["drag with Ctrl, two fingers that turn", "spin"],
  ["wheel, pinch, + and \u2212", "come nearer, go away"],
  ["R", "back to the first view"],
  ["F", "full screen"],
  ["right button", "menu: save the picture"],
  ["?", "this help"],
  ["Esc", "close"],
];
const KEYS_OF_VALUES = [["arrow keys at a point of the curve", "move it"],
  ["+, Delete there", "add a point, remove it"], ["Ctrl Z in the editor", "undo"]];
const KEYS_OF_SERIES = [["space bar", "play, pause"], [", and .", "a step back, a step on"]];

const ICONS = {
  reset: "M4 9a6 6 0 1 1 1 5M4 4v5h5",
  views: "M10 2.5l6.5 3.7v7.6L10 17.5l-6.5-3.7V6.2zM3.5 6.2l6.5 3.7 6.5-3.7M10 9.9v7.6",
  look: "M3 6h7M14 6h3M3 14h3M10 14h7M12 4v4M8 12v4",
  save: "M10 3v9M6.5 8.5L10 12l3.5-3.5M3.5 16.5h13",
  link: "M8.5 11.5a3.2 3.2 0 0 0 4.6 0l2.5-2.5a3.2 3.2 0 0 0-4.6-4.6l-1 1M11.5 8.5a3.2 3.2 0 0 0-4.6 0" +
    "l-2.5 2.5a3.2 3.2 0 0 0 4.6 4.6l1-1",
  full: "M3.5 7.5v-4h4M12.5 3.5h4v4M16.5 12.5v4h-4M7.5 16.5h-4v-4",
  help: "M7.5 7.5a2.5 2.5 0 1 1 3.6 2.2c-.8.4-1.1.9-1.1 1.8M10 14.5v.1",
};

/** What the panel of the look is called, of VDIs that have colours and of those that keep values. */
const OF_COLORS = "Brightness, opacity and clipping", OF_VALUES = "Transfer function and clipping";

/** In a viewer's sheet of styles. */
export const CONTROLS_STYLE = `
:host { --bar: #f8f8f8e0; --ink: #181818; --edge: #0003; --mark: #0b57d0; --paper: #fff; }
@media (prefers-color-scheme: dark) {
  :host { --bar: #1c1c1ee0; --ink: #f2f2f2; --edge: #fff4; --mark: #a8c7fa; --paper: #2c2c2e; }
}
.frame { position: absolute; inset: 0; pointer-events: none; container-type: size;
  font: 14px/1.4 sans-serif; color: var(--ink); }
.bar, .panel, .place { position: absolute; background: var(--bar); border-radius: 6px;
  box-shadow: 0 0 0 1px var(--edge); }
.bar { top: 6px; right: 6px; display: flex; opacity: 0; pointer-events: auto; transition: opacity .3s; }
.awake .bar, .bar:hover, .bar:has(:focus-visible) { opacity: 1; }
@media (hover: none) { .frame:not(.awake) .bar { pointer-events: none; } }
.waking .bar { pointer-events: none; }
.frame button { min-width: 36px; min-height: 36px; margin: 0; padding: 0 8px; border: 0;
  border-radius: 6px; font: inherit; color: inherit; background: none; cursor: pointer; }
.frame button:hover, .frame [aria-expanded="true"] { background: #8884; }
.frame :focus-visible, .controls :focus-visible { outline: 2px solid var(--mark); outline-offset: -2px; }
.bar svg { display: block; width: 20px; height: 20px; fill: none; stroke: currentColor;
  stroke-width: 1.6; stroke-linecap: round; stroke-linejoin: round; }
.panel { top: 48px; right: 6px; box-sizing: border-box; max-width: calc(100% - 12px); width: 300px;
  max-height: calc(100% - 54px); overflow: auto; padding: 8px 12px; pointer-events: auto; }
.panel.menu { width: auto; padding: 4px; }
.panel > button { border: 1px solid var(--edge); }
.menu > button { display: block; width: 100%; border: 0; text-align: start; }
.panel .views { display: grid; grid-template-columns: repeat(7, 1fr); margin: 0 -6px; }
.panel .views button { min-width: 0; padding: 0; }
.panel label, .panel fieldset { display: flex; gap: 8px; align-items: center; min-height: 32px; }
.panel fieldset { min-width: 0; margin: 0; padding: 0; border: 0; }
.panel legend { float: inline-start; min-width: 80px; padding: 0; }
.panel label > span:first-child { min-width: 80px; }
.panel input { accent-color: var(--mark); }
.panel input[type="range"] { flex: 1; width: 0; min-width: 0; height: 32px; margin: 0; }
.panel input[type="checkbox"] { width: 18px; height: 18px; margin: 0; }
.panel .said { min-width: 44px; text-align: end; font-variant-numeric: tabular-nums; }
.panel small { display: block; padding: 4px 0; font-size: 12px; }
.panel dl { display: grid; grid-template-columns: 3fr 2fr; gap: 4px 12px; margin: 4px 0; }
.panel dd { margin: 0; }
.place { left: 6px; top: 6px; padding: 4px 8px; font-variant-numeric: tabular-nums; }
:host([controls="none"]) :is(.frame, .controls) { display: none; }
@container (max-width: 479px) { .place { top: 48px; z-index: -1; } }
@container (max-width: 279px) or (max-height: 139px) { .bar, .panel { display: none; } }
@media (prefers-reduced-motion: reduce) { .bar { transition: none; } }
@media print { .frame { display: none; } }
${EDITOR_STYLE ?? ""}`;

/**
 * The bar of a viewer, its panels and its marks.
 *
 * @param {HTMLElement} frame Covers the picture, and gets them.
 * @param {HTMLCanvasElement} canvas Is what is turned.
 * @param {CanvasRenderingContext2D} marks Of a canvas over it.
 * @param {HTMLElement} viewer The element.
 * @param {object} host `background()` in CSS; `camera(width, height)` as it is drawn; `hasLink()`,
 *   whether the page's address shares what is seen, and that `link()`; `say(text)` for a while.
 * @param {AbortSignal} signal Ends it.
 * @returns {{show: function(), drawn: function(), key: function(KeyboardEvent, EventTarget): boolean,
 *   undo: function(KeyboardEvent, EventTarget): boolean}} `show` what has changed, `drawn`: a frame;
 *   whether a `key` is taken, and one with Ctrl by `undo`.
 */
export function viewerControls(frame, canvas, marks, viewer, host, signal) {
  const shown = { axes: false, cube: false, bounds: false, colors: false, place: false };
  const listen = (target, name, listener) => target.addEventListener(name, listener, { signal });
  const button = (label, act, ...content) => {
    const made = htmlElement("button", { type: "button", title: label, label }, ...content);
    made.addEventListener("click", act);
    return made;
  };

  // -- what is done ------------------------------------------------------------------------------

  const save = async () => {
    try {
      const file = await pictureOf(viewer, host.background(), drawOver);
      const url = URL.createObjectURL(file);
      const name = document.title.replace(/[^\p{L}\p{N} _-]+/gu, "").trim() || "vdi";
      htmlElement("a", { href: url, download: `${name}.png` }).click();
      setTimeout(() => URL.revokeObjectURL(url), 60000);
    } catch (error) {
      host.say(error.message);
    }
  };
  const share = async () => {
    try {
      await navigator.clipboard.writeText(host.link());
      host.say("The link to what is seen is in the clipboard.");
    } catch {
      host.say("The page's address is the link to what is seen: copy it there.");
    }
  };
  const goFull = () => {
    const done = document.fullscreenElement ? document.exitFullscreen() : viewer.requestFullscreen();
    done.catch((error) => host.say(`No full screen here: ${error.message}`));
  };
  const canFill = document.fullscreenEnabled;

  // -- panels ------------------------------------------------------------------------------------

  const panel = (label, ...content) =>
    htmlElement("div", { className: "panel", role: "group", label, hidden: true }, ...content);

  const lookFrom = ([, from, up]) =>
    (viewer.camera = lookingAt(viewer.camera, viewer.bounds, from, up));
  const choices = VIEWS.map((view) => button(
    view[0] === "iso" ? "Seen iso, from between the axes" : `Seen from ${view[0]}`,
    () => lookFrom(view), view[0]));
  const checks = Object.entries({ axes: "Axes", cube: "Orientation cube", bounds: "Bounds",
    colors: "Colour bar", place: "Position under the pointer" }).map(([name, text]) => {
    const input = htmlElement("input", { type: "checkbox" });
    input.addEventListener("change", () => {
      shown[name] = input.checked;
      show();
    });
    return [name, htmlElement("label", {}, input, text)];
  });
  const viewsPanel = panel("View and marks", htmlElement("div", { className: "views" }, ...choices),
    ...checks.map(([, label]) => label));

  const sliders = []; // each with what takes the viewer's look to it
  const slider = (label, limits, read, told, change) => {
    const input = htmlElement("input", { type: "range", label, ...limits });
    input.addEventListener("input", () => (viewer.look = change(Number(input.value), viewer.look)));
    sliders.push(() => {
      input.value = read(viewer.look);
      input.setAttribute("aria-valuetext", told(viewer.look));
    });
    return input;
  };
  const factor = (name, label) => {
    const told = (look) => `\u00d7${inShort(Number(look[name].toPrecision(3)))}`;
    const output = htmlElement("span", { className: "said" });
    sliders.push(() => (output.textContent = told(viewer.look)));
    return htmlElement("label", {}, htmlElement("span", {}, label),
      slider(label, { min: -3, max: 3, step: 0.05 }, (look) => Math.log2(look[name]), told,
        (value, look) => ({ ...look, [name]: 2 ** value })), output);
  };
  const cut = (axis) => htmlElement("fieldset", {}, htmlElement("legend", {}, `Clip ${"xyz"[axis]}`),
    ...[0, 1].map((end) => {
      const k = 2 * axis + end;
      // In the world where the box lies along it, as bounds do; else as shares
      const told = ({ clip }) => {
        const [low, high] = (viewer.bounds ?? [0, 1, 0, 1, 0, 1]).slice(2 * axis, 2 * axis + 2);
        return inShort(low + clip[k] * (high - low));
      };
      return slider(`Clip ${"xyz"[axis]} ${end ? "to" : "from"}`, { min: 0, max: 1, step: 0.01 },
        ({ clip }) => clip[k], told, (value, look) => {
          const clip = [...look.clip];
          clip[k] = end ? Math.max(value, clip[k - 1]) : Math.min(value, clip[k + 1]);
          return { ...look, clip };
        });
    }));
  const editor = transferEditor?.(viewer, button); // in pages that keep values; others have colours
  const ofColors = [factor("brightness", "Brightness"), factor("opacity", "Opacity"),
    htmlElement("small", {}, "Colours and opacities were chosen when this picture's data was made: " +
      "the sliders make all of it brighter or denser.")];
  const reset = button("As it was made", () => {
    editor?.reset(); // which can be undone
    viewer.look = AS_MADE;
  }, "As it was made");
  const lookPanel = panel(OF_COLORS, ...(editor ? [editor.element] : []), ...ofColors.slice(0, 2),
    ...[0, 1, 2].map(cut), ofColors[2], reset);

  const keysShown = htmlElement("dl");
  const helpPanel = panel("Keys and gestures", keysShown);
  helpPanel.tabIndex = 0; // it may have to be scrolled

  const saving = "Save the picture (PNG)", sharing = "Copy a link to what is seen";
  const entries = [[saving, save], [sharing, share], ["Reset the view", () => viewer.resetCamera()]]
    .map(([label, act]) => button(label, () => { open(null); act(); }, label));
  const menu = panel("Picture", ...entries);
  menu.classList.add("menu");

  // -- the bar -----------------------------------------------------------------------------------

  const opens = (label, which, icon) => {
    const made = button(label, () => open(which.hidden ? which : null, made), strokes(icon));
    made.setAttribute("aria-expanded", "false");
    return [which, made];
  };
  const openers = new Map([
    opens("View and marks", viewsPanel, ICONS.views),
    opens(OF_COLORS, lookPanel, ICONS.look),
    opens("Keys and gestures", helpPanel, ICONS.help),
  ]);
  const linking = button(sharing, share, strokes(ICONS.link));
  const bar = htmlElement("div", { className: "bar", role: "group", label: "Controls of the picture" },
    button("Reset the view", () => viewer.resetCamera(), strokes(ICONS.reset)),
    openers.get(viewsPanel), openers.get(lookPanel),
    button(saving, save, strokes(ICONS.save)), linking,
    ...(canFill ? [button("Full screen", goFull, strokes(ICONS.full))] : []), openers.get(helpPanel));
  const place = htmlElement("div", { className: "place", hidden: true });
  // Behind the button that opens it, for who goes through by Tab
  frame.replaceChildren(bar, viewsPanel, lookPanel, helpPanel, menu, place);

  const panels = [viewsPanel, lookPanel, helpPanel, menu];
  let before = null; // what had the focus
  const open = (which, by = null) => {
    const closed = panels.find((each) => !each.hidden);
    for (const each of panels) {
      each.hidden = each !== which;
      openers.get(each)?.setAttribute("aria-expanded", String(each === which));
    }
    if (which) {
      before = by ?? canvas;
      show();
      wake();
    } else if (closed?.contains(viewer.shadowRoot.activeElement)) before?.focus();
  };
  const isOpen = () => panels.some((each) => !each.hidden);

  let sleeps = 0, loading = true; // until there is a picture, however long that takes
  const wake = (event) => {
    // A finger that finds no bar presses none of its buttons: its click is still to come
    if (event?.pointerType === "touch" && !frame.classList.contains("awake")) {
      frame.classList.add("waking");
      setTimeout(() => frame.classList.remove("waking"), CLICK_LATER);
    }
    frame.classList.add("awake");
    clearTimeout(sleeps);
    sleeps = setTimeout(() => isOpen() || loading ? wake() : frame.classList.remove("awake"), FADES);
  };
  signal.addEventListener("abort", () => clearTimeout(sleeps));
  for (const name of ["pointermove", "pointerdown", "focusin", "keydown"]) listen(viewer, name, wake);
  wake();
  const begin = () => {
    loading = false;
    wake();
  };
  viewer.ready.then(begin, begin);

  // A right button that has not been dragged opens the menu, on all systems alike; another one, or a
  // finger, on a face of the cube goes to the view that it names
  const faceUnder = ({ offsetX, offsetY }) => {
    const size = [canvas.clientWidth, canvas.clientHeight];
    return shown.cube && viewer.bounds && viewAt(VIEWS, [size[0], size[1] - below()],
      host.camera(...size), [offsetX, offsetY]);
  };
  let pressed = null;
  listen(canvas, "pointermove", (event) => (canvas.style.cursor = faceUnder(event) ? "pointer" : ""));
  listen(canvas, "pointerdown", (event) => {
    open(null);
    const face = event.button === 0 && event.isPrimary ? faceUnder(event) : null;
    pressed = event.button === 2 || face ? { at: [event.offsetX, event.offsetY], face } : null;
  });
  listen(canvas, "pointerup", ({ offsetX, offsetY }) => {
    const { at, face } = pressed ?? {};
    pressed = null;
    if (!at || Math.hypot(offsetX - at[0], offsetY - at[1]) > TREMBLING || isOff()) return;
    if (face) {
      lookFrom(face);
      return;
    }
    open(menu);
    const { clientWidth, clientHeight } = frame;
    menu.style.inset = `${Math.max(0, Math.min(offsetY, clientHeight - menu.offsetHeight - 6))}px auto ` +
      `auto ${Math.max(0, Math.min(offsetX, clientWidth - menu.offsetWidth - 6))}px`;
    entries[0].focus();
  });

  // -- marks -------------------------------------------------------------------------------------

  const below = () => (viewer.series ? PLAYER : 0);
  const drawOver = (on, size) => viewer.camera && drawMarks(on, size, host.camera(...size), {
    axes: shown.axes, cube: shown.cube ? VIEWS : null, bounds: shown.bounds ? viewer.bounds : null,
    colors: shown.colors ? viewer.transferFunction : null, below: below(),
  });
  const drawn = () => {
    const any = !isOff() && (shown.axes || shown.cube || shown.bounds || shown.colors);
    if (marks.canvas.hidden && !any) return;
    marks.canvas.hidden = !any;
    const density = window.devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    [marks.canvas.width, marks.canvas.height] = [width, height].map((edge) => Math.round(edge * density));
    marks.scale(density, density);
    if (any) drawOver(marks, [width, height]);
  };

  let looking = 0;
  const lookUp = (event) => {
    if (!shown.place) return;
    clearTimeout(looking);
    const { offsetX, offsetY } = event;
    looking = setTimeout(() => {
      const point = viewer.pointAt(offsetX, offsetY);
      place.textContent = point
        ? point.map((x, k) => `${"xyz"[k]} ${inShort(x)}`).join("  ") : "nothing there";
    }, POINTER_RESTS);
  };
  for (const name of ["pointermove", "pointerdown"]) listen(canvas, name, lookUp);
  signal.addEventListener("abort", () => clearTimeout(looking));

  // -- what the viewer tells ---------------------------------------------------------------------

  const isOff = () => viewer.getAttribute("controls") === "none";
  const show = () => {
    sliders.forEach((take) => take());
    editor?.show();
    ofColors.forEach((each) => (each.hidden = Boolean(viewer.values)));
    const called = viewer.values ? OF_VALUES : OF_COLORS;
    for (const each of [lookPanel, openers.get(lookPanel)]) each.setAttribute("aria-label", called);
    openers.get(lookPanel).title = called;
    const { bounds, transferFunction, scene } = viewer;
    choices.forEach((each) => (each.disabled = !bounds));
    const known = { axes: true, cube: true, bounds, colors: transferFunction, place: !scene };
    checks.forEach(([name, label]) => (label.hidden = !known[name]));
    linking.hidden = entries[1].hidden = !host.hasLink();
    place.hidden = !shown.place || Boolean(scene);
    keysShown.replaceChildren(...[...KEYS, ...(viewer.series ? KEYS_OF_SERIES : []),
      ...(viewer.values ? KEYS_OF_VALUES : [])].flatMap(
      ([key, does]) => [htmlElement("dt", {}, key), htmlElement("dd", {}, does)]));
    drawn();
  };
  const key = (event, target) => {
    if (isOff()) return false;
    if (event.key === "Escape" && isOpen()) {
      open(null);
    } else if (target === canvas) {
      if (event.key === "?") open(helpPanel.hidden ? helpPanel : null, canvas);
      else if (canFill && event.key.toLowerCase() === "f") goFull();
      else return false;
    } else if (!editor?.key(event, target)) { // buttons and sliders do it by themselves
      return frame.contains(target) && ([" ", "Enter"].includes(event.key) ||
        (["range", "select-one"].includes(target.type) && OF_SLIDER.test(event.key)));
    }
    event.preventDefault();
    return true;
  };
  show();
  return { show, drawn, key, undo: (event, target) => !isOff() && !!editor?.undo(event, target) };
}

// What is seen, over its background, as a PNG file.
async function pictureOf(viewer, background, drawOver) {
  const { width, height, data } = await viewer.screenshot();
  const paper = () => {
    const canvas = htmlElement("canvas", { width, height });
    return [canvas, canvas.getContext("2d")];
  };
  for (let k = 0; k < data.length; k += 4) { // straight colours are what ImageData has
    const opacity = data[k + 3] / 255;
    if (opacity > 0) for (let c = k; c < k + 3; ++c) data[c] = data[c] / opacity;
  }
  const [picture, on] = paper(), [whole, under] = paper();
  on.putImageData(new ImageData(data, width, height), 0, 0);
  under.fillStyle = fillOf(background, under, width, height);
  under.fillRect(0, 0, width, height);
  under.drawImage(picture, 0, 0);
  const density = width / viewer.clientWidth;
  under.scale(density, density);
  drawOver(under, [viewer.clientWidth, viewer.clientHeight]);
  return new Promise((resolve, reject) => whole.toBlob((file) => file ? resolve(file)
    : reject(new Error("This browser has made no picture of it.")), "image/png"));
}

// A background of CSS on a canvas: a colour, or one of the gradients that scenes have.
function fillOf({ color, image }, on, width, height) {
  const stops = image.match(/rgba?\([^)]*\)/g);
  if (!image.includes("gradient") || !stops) return color;
  const radius = Math.hypot(width, height) / 2;
  const shades = image.startsWith("radial")
    ? on.createRadialGradient(width / 2, height / 2, 0, width / 2, height / 2,
      image.includes("side") ? Math.max(width, height) / 2 : radius)
    : image.includes("right") || image.includes("90deg") ? on.createLinearGradient(0, 0, width, 0)
    : image.includes("top") || image.includes("(0deg") ? on.createLinearGradient(0, height, 0, 0)
    : on.createLinearGradient(0, 0, 0, height);
  stops.forEach((stop, k) => shades.addColorStop(stops.length > 1 ? k / (stops.length - 1) : 0, stop));
  return shades;
}
