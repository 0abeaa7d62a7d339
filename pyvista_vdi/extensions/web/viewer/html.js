/** Return an element with properties, a name for those who hear the page, and children. */
export function htmlElement(name, { label, ...properties } = {}, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  if (label) made.setAttribute("aria-label", label);
  made.append(...children);
  return made;
}

/** The same of SVG, with attributes. */
export function svgElement(name, attributes, ...children) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

/** Return a picture of strokes, as an SVG path in a square of 20 x 20, in the text's colour. */
export function strokes(d) {
  return svgElement("svg", { viewBox: "0 0 20 20", "aria-hidden": "true" }, svgElement("path", { d }));
}

/** Return a slider with a name, beside what stands before it and behind it. */
export function slider(label, limits, take) {
  const made = htmlElement("input", { type: "range", label, ...limits });
  made.addEventListener("input", () => take(Number(made.value)));
  return made;
}

/** Have a slider say where it stands, in words. */
export function setSlider(made, value, words) {
  made.value = value;
  made.setAttribute("aria-valuetext", words);
}

/** Keys that sliders and lists take by themselves. */
export const OF_SLIDERS = /^(Arrow|Page|Home|End)/;

/** A number as people read it. */
export const inShort = (x) => String(Number(x.toPrecision(4)));
