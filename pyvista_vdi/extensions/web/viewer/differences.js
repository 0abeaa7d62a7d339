// A step's lists from the numbers that were written for them: by themselves, or by another step's.
// To the last bit what pyvista_vdi/extensions/series/differences.py decodes, whose names these are: the same
// operations on doubles in the same order, list by list.
import { DEPTH_CODES, GRID, TAU_CODES } from "./decode.js";
import { damaged } from "./unpack.js";

// How a list is written; 0: by itself
const SAME = 1;
const PLACED = 2;
const KEPT = 3;
const HOW = 3;
const END = 4; // added where the last face is guessed to be where it was

const TAU_BASE = (127 - 18) << 7;
const MOST_IN_LIST = 1 << 16;
const FARTHEST = 1 << 20;
const LIMIT = 2 ** 40;
const MAGIC = 1.5 * 2 ** 52; // sums with it are whole: rounded to even, as all sums are
const SHORT_RUN = 48; // supersegments that a loop copies sooner than a call

const contradict = (what) => damaged(`the numbers of ${what} contradict each other`);

const rounded = (value, unit) => {
  const quotient = value / unit + MAGIC - MAGIC;
  if (quotient > LIMIT) return LIMIT;
  if (quotient < -LIMIT) return -LIMIT;
  return quotient === quotient ? quotient : 0;
};

// 0, 1, 2, 3, 4 … as 0, -1, 1, -2, 2 …
const unfolded = (value) => value < 2 ** 32 ? (value >>> 1) ^ -(value & 1)
  : value % 2 ? -(value + 1) / 2 : value / 2;

const bitOf = (bits, k) => (bits[k >> 3] >> (7 - (k & 7))) & 1;

/**
 * Steps of the depth grid from sample to sample, per list.
 *
 * @param {number[]|null} samples Nine coefficients, docs/series.md.
 * @param {number[]} windowSize Lists along each edge.
 * @param {number} step Of the depth grid, world units.
 * @returns {Float64Array|null} null where they are of no use.
 */
export function pitchesOf(samples, [width, height], step) {
  if (!samples) return null;
  const [x0, y0, z0, x1, y1, z1, x2, y2, z2] = samples;
  const pitches = new Float64Array(width * height);
  for (let j = 0, list = 0; j < height; ++j) {
    const v = (2 * j + 1) / height - 1;
    for (let i = 0; i < width; ++i, ++list) {
      const u = (2 * i + 1) / width - 1;
      const x = x0 + u * x1 + v * x2;
      const y = y0 + u * y1 + v * y2;
      const z = z0 + u * z1 + v * z2;
      const pitch = (pitches[list] = 1 / (Math.sqrt(x * x + y * y + z * z) * step));
      if (!(pitch > 2 ** -8 && pitch < LIMIT)) return null;
    }
  }
  return pitches;
}

/**
 * Decode the arrays of a step of lists.
 *
 * @param {object} arrays Typed arrays of whole numbers >= 0 by their names in the file.
 * @param {object} said step (of the depth grid), windowSize, pitches ({@link pitchesOf}), colors:
 *   Uint8Array(768) and extinctions: Float32Array(256).
 * @param {object|null} before What this returned for the step that this one is written by.
 * @returns {object} `said` and, for W H lists and n supersegments, offsets: Uint32Array(W H + 1),
 *   origin: Int32Array, stride: Uint16Array; front, back, tau: Uint16Array(n), codes;
 *   color: Uint32Array(n), 0xbbggrr; entries: Uint8Array(n).
 * @throws {VDIFileError} If no step gives such arrays.
 */
export function decodedStep(arrays, said, before) {
  const { windowSize, pitches, colors, extinctions } = said;
  const nLists = windowSize[0] * windowSize[1];
  const { how } = arrays;
  if (how?.length !== nLists) contradict("how lists are written");
  const { offsets, nOccupied, nHas, nKept, nThere } = lengths(arrays, nLists, before);
  const take = (name, n) => {
    if (arrays[name]?.length !== n) contradict(name);
    return arrays[name];
  };
  const n = offsets[nLists];
  const nCoded = take("entry", arrays.entry?.length).length;
  const entryLeft = arrays.entry;
  const originLeft = take("origin", nOccupied), strideLeft = take("stride", nOccupied);
  const endLeft = take("end", nOccupied);
  const frontLeft = take("front", nCoded), backLeft = take("back", nCoded);
  const red = take("red", nCoded), green = take("green", nCoded), blue = take("blue", nCoded);
  const tauLeft = take("optical_depth", nCoded);
  const shifts = before ? take("shift", nHas) : null;
  const kept = before ? take("kept", (nKept + 7) >> 3) : null;
  const keptThere = before ? take("kept_there", (nThere + 7) >> 3) : null;
  const { gap: gaps, length: lengthsOf } = arrays;
  if (!gaps || gaps.length !== lengthsOf?.length) contradict("gap");

  const origin = new Int32Array(nLists), stride = new Uint16Array(nLists);
  const front = new Uint16Array(n), back = new Uint16Array(n), tau = new Uint16Array(n);
  const color = new Uint32Array(n), entries = new Uint8Array(n);
  // Of one list, in samples; and which supersegment of the other step each one is, or -1
  const backs = new Float64Array(MOST_IN_LIST), long = new Float64Array(MOST_IN_LIST);
  const sources = new Int32Array(MOST_IN_LIST);
  const float = new Float32Array(1), bits = new Uint32Array(float.buffer);
  let at = 0, occupied = 0, moves = 0, fresh = 0, keptAt = 0, thereAt = 0; // read so far
  let lastOrigin = 0, lastStride = 0; // of lists by themselves

  for (let list = 0; list < nLists; ++list) {
    const first = offsets[list];
    const way = how[list] & HOW;
    if (way === SAME) {
      let next = list + 1;
      while (next < nLists && (how[next] & HOW) === SAME) ++next;
      const from = before.offsets[list], to = before.offsets[next];
      origin.set(before.origin.subarray(list, next), list);
      stride.set(before.stride.subarray(list, next), list);
      if (to - from <= SHORT_RUN) {
        for (let k = from, l = first; k < to; ++k, ++l) {
          front[l] = before.front[k];
          back[l] = before.back[k];
          tau[l] = before.tau[k];
          color[l] = before.color[k];
          entries[l] = before.entries[k];
        }
      } else {
        front.set(before.front.subarray(from, to), first);
        back.set(before.back.subarray(from, to), first);
        tau.set(before.tau.subarray(from, to), first);
        color.set(before.color.subarray(from, to), first);
        entries.set(before.entries.subarray(from, to), first);
      }
      list = next - 1;
      continue;
    }
    const count = offsets[list + 1] - first;
    if (count === 0) continue;
    const has = way >= PLACED;
    let oldOrigin = 0, oldStride = 0, oldEnd = 0, shift = 0, oldRow = 0, oldLast = 0;
    if (has) {
      oldOrigin = before.origin[list];
      oldStride = before.stride[list];
      oldRow = before.offsets[list] - 1;
      oldLast = before.offsets[list + 1] - 1;
      oldEnd = oldOrigin + before.back[oldLast] * oldStride;
      shift = unfolded(shifts[moves++]);
      if (!(Math.abs(shift) < FARTHEST)) contradict("shift");
    }
    const movedBy = pitches ? pitches[list] : oldStride;

    // Where supersegments end, in samples
    const bitsOfOld = thereAt - oldRow - 1;
    let end = 0;
    for (let i = 0; i < count; ++i) {
      if (way === KEPT && bitOf(kept, keptAt++)) {
        do ++oldRow; while (oldRow <= oldLast && !bitOf(keptThere, bitsOfOld + oldRow));
        if (oldRow > oldLast) contradict("what is kept");
        const begin = rounded(before.front[oldRow] * oldStride, movedBy) - shift;
        end = rounded(before.back[oldRow] * oldStride, movedBy) - shift;
        long[i] = end - begin;
        sources[i] = oldRow;
      } else {
        const length = lengthsOf[fresh];
        end += gaps[fresh++] + length;
        long[i] = length;
        sources[i] = -1;
      }
      backs[i] = end;
    }
    if (way === KEPT) {
      while (++oldRow <= oldLast) {
        if (bitOf(keptThere, bitsOfOld + oldRow)) contradict("what is kept");
      }
      thereAt = bitsOfOld + oldLast + 1;
    }

    // Where the list begins, and the steps that a code takes
    let begins = unfolded(originLeft[occupied]);
    if (has) begins += oldOrigin + rounded(shift * movedBy, 1);
    else begins = lastOrigin += begins;
    const asItWas = (how[list] & END) !== 0;
    if (asItWas && !has) contradict("ends");
    let perCode = unfolded(strideLeft[occupied]);
    if (pitches) {
      const span = asItWas ? oldEnd - begins : end * pitches[list];
      perCode += Math.max(1, Math.ceil(Math.min(Math.max(span, 0), LIMIT) / DEPTH_CODES));
    } else if (has) {
      perCode += oldStride;
    } else {
      perCode = lastStride += perCode;
    }
    if (!(perCode > 0 && perCode < 65536)) contradict("strides");
    if (!(Math.abs(begins) < 2 ** 31)) contradict("origins");
    origin[list] = begins;
    stride[list] = perCode;

    // Codes of faces, and what is between them
    const unit = pitches ? pitches[list] : perCode;
    const perSample = perCode / unit;
    let codeBefore = 0, sampleBefore = 0;
    for (let i = 0, k = first; i < count; ++i, ++k, ++at) {
      const guessed = rounded(backs[i] * unit, perCode);
      let code = guessed + unfolded(backLeft[at]);
      if (i === count - 1) {
        code = (asItWas ? rounded(oldEnd - begins, perCode) : guessed) +
          unfolded(endLeft[occupied]);
      }
      const sample = backs[i] - long[i];
      const begin = (sample === sampleBefore ? codeBefore : rounded(sample * unit, perCode)) +
        unfolded(frontLeft[at]);
      if (!(begin >= codeBefore && begin < code && code < 65536)) contradict("faces");
      const source = sources[i];
      const left = entryLeft[at] & 255;
      const entry = source < 0 ? left : (left + before.entries[source]) & 255;
      let guess, medium;
      if (source >= 0 && left === 0) {
        guess = before.tau[source];
        medium = before.color[source];
      } else {
        float[0] = extinctions[entry] * Math.fround(long[i] + (code - guessed) * perSample);
        guess = (bits[0] >>> 16) + ((bits[0] >>> 15) & 1) - TAU_BASE + 1;
        guess = guess < 0 ? 0 : guess > TAU_CODES ? TAU_CODES : guess;
        medium = colors[3 * entry] | (colors[3 * entry + 1] << 8) | (colors[3 * entry + 2] << 16);
      }
      guess += unfolded(tauLeft[at]);
      if (!(guess >= 0 && guess <= TAU_CODES)) contradict("optical depth");
      front[k] = begin;
      back[k] = code;
      tau[k] = guess;
      color[k] = ((medium + red[at]) & 255) | ((((medium >> 8) + green[at]) & 255) << 8) |
        ((((medium >> 16) + blue[at]) & 255) << 16);
      entries[k] = entry;
      codeBefore = code;
      sampleBefore = backs[i];
    }
    ++occupied;
  }
  if (fresh !== gaps.length) contradict("gap");
  return { ...said, offsets, origin, stride, front, back, tau, color, entries };
}

// Where lists begin, and how much belongs to those that are written, those that were there, those
// that have kept something, and those that they were.
function lengths(arrays, nLists, before) {
  const { how, counts } = arrays;
  const offsets = new Uint32Array(nLists + 1);
  let given = 0, coded = 0, nOccupied = 0, nHas = 0, nKept = 0, nThere = 0, sum = 0;
  for (let list = 0; list < nLists; ++list) {
    const way = how[list] & HOW;
    if (way && !before) contradict("how lists are written");
    const old = before ? before.offsets[list + 1] - before.offsets[list] : 0;
    let count = old;
    if (way !== SAME) {
      count = counts[given++];
      if (way >= PLACED) {
        if (old === 0) contradict("lists placed as they were");
        count = unfolded(count) + old;
      }
      if (!(count >= 0 && count <= MOST_IN_LIST)) contradict("counts");
      coded += count;
      if (count > 0) {
        ++nOccupied;
        if (way >= PLACED) ++nHas;
        if (way === KEPT) {
          nKept += count;
          nThere += old;
        }
      }
    }
    offsets[list + 1] = sum += count;
  }
  if (given !== counts?.length || coded !== arrays.entry?.length) contradict("counts");
  return { offsets, nOccupied, nHas, nKept, nThere };
}

/**
 * A decoded step in the packed form that decode.js gives: {words, origin, stride, depthStep,
 * offsets}, of docs/conventions.md, "Packed supersegments".
 *
 * @param {object} step Of {@link decodedStep}.
 * @throws {VDIFileError} If packing gives no such codes.
 */
export function packedStep({ step, offsets, origin, stride, front, back, tau, color }) {
  const words = new Uint32Array(2 * front.length);
  for (let list = 0; list < origin.length; ++list) {
    const end = offsets[list + 1];
    let k = offsets[list];
    if (k === end) continue;
    const first = origin[list];
    if (Math.abs(first) > GRID || first + stride[list] * DEPTH_CODES > GRID + DEPTH_CODES + 1) {
      damaged("a list's depths lie beyond the VDI's grid");
    }
    const zero = front[k]; // codes begin with a list
    if (back[end - 1] - zero > DEPTH_CODES) damaged("a code of depth is beyond its largest");
    for (; k < end; ++k) {
      words[2 * k] = (front[k] - zero) | ((back[k] - zero) << 14) | (tau[k] << 28);
      words[2 * k + 1] = (tau[k] >> 4) | (color[k] << 8);
    }
  }
  return { words, origin, stride, depthStep: step, offsets };
}
