// What a transfer function makes of lists that keep values: a table by mean and spread, which the
// shader looks up (docs/dev/conventions.md, "Values in place of colours").
import { COLORMAPS, colorsOf } from "./colormaps.js";

/** Steps of the mean over the range of values: those of 8 bytes. */
export const MEAN_STEPS = 3825;
/** Rows of the table: a spread of 0, and 8 in each octave from 2^-11 to 1/2, as 8 bytes have. */
export const SPREADS = 82;
/** Of the upper 12 bits of a spread's float32, that of the first row. */
export const FIRST_SPREAD = (127 - 11) * 8 - 1;

/** Cells that a transfer function is integrated in, over the range of values. */
const CELLS = 1 << 14;
/** What a step that is opaque lets through. */
const OPAQUE_LEAVES = Math.exp(-30);
const ROOT_OF_3 = Math.sqrt(3);
/** Most points of a curve. */
const MOST_POINTS = 64;

/** Return a transfer function as the viewer keeps it: see element.d.ts; a TypeError refuses others. */
export function checkedTransfer({ cmap = null, clim, points }) {
  if (cmap !== null && !COLORMAPS.includes(cmap)) {
    throw new TypeError(`A colour map is one of ${COLORMAPS.join(", ")}; got ${cmap}.`);
  }
  if (!(clim?.length === 2 && clim.every(Number.isFinite) && clim[0] < clim[1])) {
    throw new TypeError(`A transfer function's clim is two numbers, the smaller first; got ${clim}.`);
  }
  const isShare = (x) => x >= 0 && x <= 1;
  if (!(points?.length >= 2 && points.length <= 2 * MOST_POINTS && points.length % 2 === 0 &&
    points.every((x, k) => isShare(x) && (k % 2 || k < 2 || x >= points[k - 2])))) {
    throw new TypeError(`A transfer function has 1 to ${MOST_POINTS} points: shares that grow, and ` +
      `opacities, 0 to 1; got ${points}.`);
  }
  return { cmap, clim: [...clim], points: [...points] };
}

/** The transfer function that a VDI with values starts with: its file's, or a ramp over all. */
export function startOf({ values, metadata }) {
  const told = metadata.transfer_function;
  return told?.colors?.length && told.opacities?.length === told.colors.length && told.scalar_range
    ? told : { colors: colorsOf("viridis"), opacities: [0, 1], scalar_range: values.range };
}

/** The same as one that is edited: few points for its opacities. */
export function editedFrom({ opacities, scalar_range: [low, high] }) {
  const last = Math.max(1, opacities.length - 1), kept = [0, last];
  const at = (k) => opacities[Math.min(k, opacities.length - 1)];
  while (kept.length < MOST_POINTS) { // one where the curve is farthest from those there are
    let worst = 0.004, place = 0;
    for (let k = 1, next = 1; k < last; ++k) {
      if (k > kept[next]) ++next;
      const [a, b] = [kept[next - 1], kept[next]];
      const off = Math.abs(at(a) + (k - a) / (b - a) * (at(b) - at(a)) - at(k));
      if (off > worst) [worst, place] = [off, k];
    }
    if (!place) break;
    kept.push(place);
    kept.sort((a, b) => a - b);
  }
  const rounded = (x) => Math.round(1000 * x) / 1000;
  return {
    cmap: null, clim: low < high ? [low, high] : [low - 0.5, high + 0.5],
    points: kept.flatMap((k) => [rounded(k / last), rounded(at(k))]),
  };
}

/** A transfer function as files have it: `colors`, `opacities`, `scalar_range`. */
export function toldOf(prepared, transfer) {
  const start = startOf(prepared);
  if (!transfer) return start;
  return { ...start, colors: transfer.cmap ? colorsOf(transfer.cmap) : start.colors,
    opacities: null, points: transfer.points, scalar_range: transfer.clim };
}

// Entries at the low end and at the middles of cells, by places, 0 to 1, that grow; beyond them those of the ends.
function sampled(places, entries, xOf) {
  const out = new Float64Array(CELLS + 1), last = places.length - 1;
  for (let cell = 0, next = 0; cell <= CELLS; ++cell) {
    const x = xOf(cell);
    while (next <= last && places[next] <= x) ++next;
    if (next === 0 || next > last) out[cell] = entries[Math.min(next, last)];
    else {
      const from = places[next - 1], share = (x - from) / (places[next] - from);
      out[cell] = entries[next - 1] + share * (entries[next] - entries[next - 1]);
    }
  }
  return out;
}

// At the low end of the range, and integrals up to each cell: four numbers, of the colour times the
// opacity of a step, and of that.
function integralsOf({ values, metadata }, { colors, opacities, points, scalar_range }) {
  const [low, high] = values.range, [first, last] = scalar_range;
  const power = values.sampleDistance / (metadata.transfer_function?.unit_distance || values.unitDistance);
  const xOf = (cell) => { // the first is the low end
    const value = low + Math.max(cell - 0.5, 0) / CELLS * (high - low);
    return last > first ? (value - first) / (last - first) : Number(value > first);
  };
  const evenly = ({ length }) => Array.from({ length }, (_, k) => k / Math.max(1, length - 1));
  const placed = points?.filter((_, k) => k % 2 === 0) ?? evenly(opacities);
  const opacity = sampled(placed, points?.filter((_, k) => k % 2) ?? opacities, xOf);
  const color = [0, 1, 2].map((c) => sampled(evenly(colors), colors.map((each) => each[c]), xOf));
  const atLow = new Float64Array(4), sums = new Float64Array(4 * (CELLS + 1));
  for (let cell = 0; cell <= CELLS; ++cell) {
    const ofStep = opacity[cell] > 0 ? -Math.expm1(Math.log1p(-opacity[cell]) * power) : 0;
    for (let c = 0; c < 4; ++c) {
      const here = c < 3 ? ofStep * color[c][cell] : ofStep;
      if (cell) sums[4 * cell + c] = sums[4 * cell - 4 + c] + here;
      else atLow[c] = here;
    }
  }
  return { atLow, sums };
}

/**
 * Fill a table with what a transfer function, or null for what the file starts with, makes of each mean
 * and spread: rows of MEAN_STEPS + 1 entries, one for each of SPREADS, of straight colour and of
 * extinction per model' length.
 */
export function fillTable(prepared, transfer, table) {
  const { atLow, sums } = integralsOf(prepared, toldOf(prepared, transfer));
  const { stepsPerLength } = prepared.values, bits = new DataView(new ArrayBuffer(4));
  for (let row = 0, first = 0; row < SPREADS; ++row, first += 4 * (MEAN_STEPS + 1)) {
    bits.setUint32(0, (FIRST_SPREAD + row) << 20);
    const spread = row ? bits.getFloat32(0) : 0;
    for (let k = 0; k <= MEAN_STEPS; ++k) {
      mediumInto(table, first + 4 * k, atLow, sums, k / MEAN_STEPS, spread, stepsPerLength);
    }
  }
}

// Straight colour and extinction of values that lie as classified of opencl/lib/values.cl has them:
// a share from low to high, one from there to 1, and the others at the low end.
function mediumInto(table, at, atLow, sums, mean, spread, stepsPerLength) {
  const rest = 1 - mean, square = spread * spread, reach = ROOT_OF_3 * spread;
  let low = mean - reach, high = mean + reach, share = 1, above = 0;
  if (reach >= Math.min(mean, rest)) {
    if (mean <= 0.5) {
      low = 0;
      high = mean > 0 ? Math.min(1.5 * (square / mean + mean), 1) : 1;
      share = 2 * mean / high;
    } else {
      const below = rest > 0 ? Math.min(3 * square / rest, mean) : mean;
      low = mean - below;
      high = mean;
      share = rest + below > 0 ? rest / (rest + below) : 1;
      above = 1 - share;
    }
  }
  const empty = 1 - share - above;
  for (let c = 0; c < 4; ++c) means[c] = empty * atLow[c];
  addMean(means, sums, low, high, share);
  if (above > 0) addMean(means, sums, high, 1, above);
  const opacity = means[3];
  table[at + 3] = 0; // whatever colour was there
  if (opacity < 1e-12) return;
  for (let c = 0; c < 3; ++c) table[at + c] = means[c] / opacity;
  const ofStep = opacity < 0.01 ? opacity * (1 + opacity * (1 / 2 + opacity * (1 / 3 + opacity / 4)))
    : -Math.log(Math.max(1 - opacity, OPAQUE_LEAVES));
  table[at + 3] = ofStep * stepsPerLength;
}

const means = new Float64Array(4);

// Add the mean between two places, 0 to 1, that are widened to a cell's distance, times a share.
function addMean(to, sums, low, high, share) {
  const middle = (low + high) / 2, half = Math.max((high - low) / 2, 0.5 / CELLS);
  const from = Math.max(middle - half, 0) * CELLS, end = Math.min(middle + half, 1) * CELLS;
  const a = Math.min(from | 0, CELLS - 1), b = Math.min(end | 0, CELLS - 1);
  const intoA = from - a, intoB = end - b, by = share / (end - from);
  for (let c = 0, i = 4 * a, j = 4 * b; c < 4; ++c, ++i, ++j) {
    to[c] += by * (sums[j] + intoB * (sums[j + 4] - sums[j]) - sums[i] - intoA * (sums[i + 4] - sums[i]));
  }
}
