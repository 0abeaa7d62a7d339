// What is done to a view beside turning it: a bar of buttons, one of which opens the settings.
import { lookingAt } from "./camera.js";
import { transferEditor } from "./editor.js";
import { htmlElement, inShort, setSlider, slider, strokes } from "./html.js";
import { AS_MADE } from "./look.js";

/** Keys that sliders and lists take by themselves. */
const OF_SLIDER = /^(Arrow|Page|Home|End)/;

/** The directions that standard views look from, and what is up there. */
const VIEWS = {
  "+x": [[1, 0, 0], [0, 0, 1]], "\u2212x": [[-1, 0, 0], [0, 0, 1]],
  "+y": [[0, 1, 0], [0, 0, 1]], "\u2212y": [[0, -1, 0], [0, 0, 1]],
  "+z": [[0, 0, 1], [0, 1, 0]], "\u2212z": [[0, 0, -1], [0, 1, 0]],
  iso: [[1, 1, 1], [0, 0, 1]],
};

const KEYS = {
  "drag, one finger, arrow keys": "turn",
  "with Shift, two fingers": "move",
  "with Ctrl, two fingers that turn": "spin",
  "wheel, pinch, + and \u2212": "come nearer, go away",
  "R, F": "first view, full screen",
  "space bar, comma, period": "play, step back and on",
};

const ICONS = {
  reset: "M4 9a6 6 0 1 1 1 5M4 4v5h5",
  settings: "M3 6h7M14 6h3M3 14h3M10 14h7M12 4v4M8 12v4",
  save: "M10 3v9M6.5 8.5L10 12l3.5-3.5M3.5 16.5h13",
  full: "M3.5 7.5v-4h4M12.5 3.5h4v4M16.5 12.5v4h-4M7.5 16.5h-4v-4",
};

/**
 * The bar of a viewer and its settings, in the frame that covers the canvas; `say(text)` for a while.
 *
 * @returns {{show: function(), key: function(KeyboardEvent, EventTarget): boolean}} `show` what has
 *   changed; whether a `key` is taken.
 */
export function viewerControls({ frame, canvas }, viewer, say, signal) {
  const button = (label, act, ...content) => {
    const made = htmlElement("button", { type: "button", title: label, label }, ...content);
    made.addEventListener("click", act);
    return made;
  };

  const save = async () => {
    try {
      const url = URL.createObjectURL(await pictureOf(viewer));
      const name = document.title.replace(/[^\p{L}\p{N} _-]+/gu, "").trim() || "vdi";
      htmlElement("a", { href: url, download: `${name}.png` }).click();
      setTimeout(() => URL.revokeObjectURL(url), 60000);
    } catch (error) {
      say(error.message);
    }
  };
  const goFull = () => {
    const done = document.fullscreenElement ? document.exitFullscreen() : viewer.requestFullscreen();
    done.catch((error) => say(`No full screen here: ${error.message}`));
  };
  const canFill = document.fullscreenEnabled;

  // -- settings ----------------------------------------------------------------------------------

  const choices = Object.entries(VIEWS).map(([name, [from, up]]) => button(`Seen from ${name}`,
    () => (viewer.camera = lookingAt(viewer.camera, viewer.bounds, from, up)), name));

  const takes = []; // what takes the viewer's look to a slider
  const change = (changes) => (viewer.look = { ...viewer.look, ...changes });
  const factor = (name, label) => {
    const made = slider(label, { min: -3, max: 3, step: 0.05 }, (x) => change({ [name]: 2 ** x }));
    takes.push((look) => setSlider(made, Math.log2(look[name]), `\u00d7${inShort(look[name])}`));
    return htmlElement("label", {}, htmlElement("span", {}, label), made);
  };
  const cut = (axis) => htmlElement("fieldset", {}, htmlElement("legend", {}, `Clip ${axis}`),
    ...["from", "to"].map((end, isHigh) => {
      const k = 2 * "xyz".indexOf(axis) + isHigh, low = k - isHigh;
      const made = slider(`Clip ${axis} ${end}`, { min: 0, max: 1, step: 0.01 }, (x) => {
        const { clip } = viewer.look;
        clip[k] = isHigh ? Math.max(x, clip[low]) : Math.min(x, clip[low + 1]);
        change({ clip });
      });
      takes.push(({ clip }) => { // in the world where the box lies along it, as bounds do
        const { bounds } = viewer, ends = bounds ? [bounds[low], bounds[low + 1]] : [0, 1];
        setSlider(made, clip[k], inShort(ends[0] + clip[k] * (ends[1] - ends[0])));
      });
      return made;
    }));
  const editor = transferEditor(viewer, button);
  const ofColors = [factor("brightness", "Brightness"), factor("opacity", "Opacity")];
  const keys = Object.entries(KEYS).flatMap(([key, does]) =>
    [htmlElement("dt", {}, key), htmlElement("dd", {}, does)]);
  const panel = htmlElement("div", { className: "panel", tabIndex: 0, role: "group", label: "Settings" },
    htmlElement("div", { className: "views" }, ...choices), editor.element,
    ...ofColors, ..."xyz".split("").map(cut),
    button("As it was made", () => (viewer.look = AS_MADE), "As it was made"),
    htmlElement("dl", {}, ...keys));

  const opener = htmlElement("summary", { title: "Settings", label: "Settings" }, strokes(ICONS.settings));
  const settings = htmlElement("details", { label: "Settings of the picture" }, opener, panel);
  settings.addEventListener("toggle", () => show());
  canvas.addEventListener("pointerdown", () => (settings.open = false), { signal });
  frame.replaceChildren(htmlElement("div", { className: "bar", role: "group", label: "Controls of the picture" },
    button("Reset the view", () => viewer.resetCamera(), strokes(ICONS.reset)),
    button("Save the picture (PNG)", save, strokes(ICONS.save)),
    ...(canFill ? [button("Full screen", goFull, strokes(ICONS.full))] : []), settings));

  // -- what the viewer tells ---------------------------------------------------------------------

  const show = () => {
    if (!settings.open) return;
    const { bounds, look, values } = viewer;
    takes.forEach((take) => take(look));
    editor.show();
    ofColors.forEach((each) => (each.hidden = Boolean(values)));
    choices.forEach((each) => (each.disabled = !bounds));
  };
  const key = (event, target) => {
    if (viewer.getAttribute("controls") === "none") return false;
    if (event.key === "Escape" && settings.open) {
      if (panel.contains(target)) opener.focus();
      settings.open = false;
    } else if (target === canvas && canFill && event.key.toLowerCase() === "f") goFull();
    else if (!editor.key(event, target)) { // buttons and sliders do it by themselves
      return frame.contains(target) && ([" ", "Enter"].includes(event.key) ||
        (["range", "select-one"].includes(target.type) && OF_SLIDER.test(event.key)));
    }
    event.preventDefault();
    return true;
  };
  return { show, key };
}

// What is seen, over its background, as a PNG file.
async function pictureOf(viewer) {
  const { width, height, data } = await viewer.screenshot();
  for (let k = 0; k < data.length; k += 4) { // straight colours are what ImageData has
    const opacity = data[k + 3] / 255;
    if (opacity > 0) for (let c = k; c < k + 3; ++c) data[c] = data[c] / opacity;
  }
  const picture = await createImageBitmap(new ImageData(data, width, height));
  const canvas = new OffscreenCanvas(width, height), on = canvas.getContext("2d");
  on.fillStyle = fillOf(getComputedStyle(viewer), on, width, height);
  on.fillRect(0, 0, width, height);
  on.drawImage(picture, 0, 0);
  return canvas.convertToBlob({ type: "image/png" });
}

// A background of CSS on a canvas: a colour, or one of the gradients that scenes have.
function fillOf({ backgroundColor, backgroundImage: image }, on, width, height) {
  const stops = image.match(/rgba?\([^)]*\)/g);
  if (!image.includes("gradient") || !stops) return backgroundColor;
  const radius = image.includes("side") ? Math.max(width, height) / 2 : Math.hypot(width, height) / 2;
  const shades = image.startsWith("radial")
    ? on.createRadialGradient(width / 2, height / 2, 0, width / 2, height / 2, radius)
    : image.includes("right") ? on.createLinearGradient(0, 0, width, 0)
    : on.createLinearGradient(0, height, 0, 0);
  stops.forEach((stop, k) => shades.addColorStop(stops.length > 1 ? k / (stops.length - 1) : 0, stop));
  return shades;
}
