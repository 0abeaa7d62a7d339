// What is done to a view beside turning it: a bar of buttons, one of which opens the settings.
import { transferEditor } from "./editor.js";
import { OF_SLIDERS, htmlElement, inShort, setSlider, slider, strokes } from "./html.js";
import { AS_MADE } from "./look.js";

const ICONS = {
  reset: "M4 9a6 6 0 1 1 1 5M4 4v5h5",
  settings: "M3 6h7M14 6h3M3 14h3M10 14h7M12 4v4M8 12v4",
  save: "M10 3v9M6.5 8.5L10 12l3.5-3.5M3.5 16.5h13",
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

  // -- settings ----------------------------------------------------------------------------------

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
      takes.push(({ clip }) => setSlider(made, clip[k], `${Math.round(100 * clip[k])} %`));
      return made;
    }));
  const editor = transferEditor(viewer, button);
  const ofColors = [factor("brightness", "Brightness"), factor("opacity", "Opacity")];
  const panel = htmlElement("div", { className: "panel", tabIndex: 0, role: "group", label: "Settings" },
    editor.element, ...ofColors, ..."xyz".split("").map(cut),
    button("As it was made", () => (viewer.look = AS_MADE), "As it was made"));

  const opener = htmlElement("summary", { title: "Settings", label: "Settings" }, strokes(ICONS.settings));
  const settings = htmlElement("details", { label: "Settings of the picture" }, opener, panel);
  settings.addEventListener("toggle", () => show());
  canvas.addEventListener("pointerdown", () => (settings.open = false), { signal });
  frame.replaceChildren(htmlElement("div", { className: "bar", role: "group", label: "Controls of the picture" },
    button("Reset the view", () => viewer.resetCamera(), strokes(ICONS.reset)),
    button("Save the picture (PNG)", save, strokes(ICONS.save)), settings));

  // -- what the viewer tells ---------------------------------------------------------------------

  const show = () => {
    if (!settings.open) return;
    const { look, values } = viewer;
    takes.forEach((take) => take(look));
    editor.show();
    ofColors.forEach((each) => (each.hidden = Boolean(values)));
  };
  const key = (event, target) => {
    if (viewer.getAttribute("controls") === "none") return false;
    if (event.key === "Escape" && settings.open) {
      if (panel.contains(target)) opener.focus();
      settings.open = false;
    } else if (!editor.key(event, target)) { // buttons and sliders do it by themselves
      return frame.contains(target) && ([" ", "Enter"].includes(event.key) ||
        (["range", "select-one"].includes(target.type) && OF_SLIDERS.test(event.key)));
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
  on.fillStyle = fillOf(getComputedStyle(viewer), on, height);
  on.fillRect(0, 0, width, height);
  on.drawImage(picture, 0, 0);
  return canvas.convertToBlob({ type: "image/png" });
}

// A background of CSS on a canvas: a colour, or a gradient to the top, as scenes have.
function fillOf({ backgroundColor, backgroundImage: image }, on, height) {
  const stops = image.match(/rgba?\([^)]*\)/g);
  if (!image.includes("gradient") || !stops) return backgroundColor;
  const shades = on.createLinearGradient(0, height, 0, 0);
  stops.forEach((stop, k) => shades.addColorStop(k / Math.max(1, stops.length - 1), stop));
  return shades;
}
