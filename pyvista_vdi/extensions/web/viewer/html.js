/** Return an element with properties, a name for those who hear the page, and children. */
export function htmlElement(name, { label, ...properties } = {}, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  if (label) made.setAttribute("aria-label", label);
  made.append(...children);
  return made;
}
