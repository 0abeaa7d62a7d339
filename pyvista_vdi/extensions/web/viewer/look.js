// How a VDI is shown beside its camera: brighter, denser, or a part of its box.
import { checkedNumbers } from "./camera.js";
import { checkedTransfer } from "./values.js";

/** As it was made. */
export const AS_MADE = Object.freeze({
  brightness: 1, opacity: 1, clip: Object.freeze([0, 1, 0, 1, 0, 1]),
});

// Factors go from 1 over this to this
const MOST_FACTOR = 16;

/**
 * Return a look as the viewer keeps it: see element.d.ts; what is left out is as the VDI was made. A
 * TypeError refuses others.
 */
export function checkedLook(look) {
  const { brightness, opacity, clip, transfer } = { ...AS_MADE, ...look };
  for (const [name, value] of Object.entries({ brightness, opacity })) {
    if (!(value >= 1 / MOST_FACTOR && value <= MOST_FACTOR)) {
      throw new TypeError(`A look's ${name} is a factor from 1/${MOST_FACTOR} to ${MOST_FACTOR}; ` +
        `got ${value}.`);
    }
  }
  const ends = checkedNumbers("look", { clip }, "clip", 6);
  if (!ends.every((end, k) => end >= 0 && end <= 1 && (k % 2 || end <= ends[k + 1]))) {
    throw new TypeError("A look's clip goes from a lower to a higher share of the bounds, 0 to 1, " +
      `along x, y and z; got ${ends}.`);
  }
  return { brightness: Number(brightness), opacity: Number(opacity), clip: ends,
    ...(transfer && { transfer: checkedTransfer(transfer) }) };
}

/** Whether a look is the one that the VDI was made with. */
export const isAsMade = (look) => JSON.stringify(look) === JSON.stringify(AS_MADE);
