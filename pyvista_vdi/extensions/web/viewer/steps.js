// Frames of a .vdis file to VDIs (docs/series.md); what others are written by is kept.
import { decodeVDI, checkedView } from "./decode.js";
import { decodedStep, packedStep, pitchesOf } from "./differences.js";
import {
  REMEDY, VDIFileError, crc32, damaged, inflateText, unpackChunk,
} from "./unpack.js";

/** Kinds of steps: a whole .vdi file; lists; the supersegments of another step. */
export const KIND = { file: 0, lists: 1, again: 2 };

const FRAME_CHUNK_ROWS = 1 << 18;
const KEPT_STEPS = 3;
const MOST_TEXT = 1 << 26;
const TYPES = {
  "|u1": Uint8Array, "<u2": Uint16Array, "<u4": Uint32Array, "<u8": BigUint64Array,
  "<f4": Float32Array,
};

/** Decodes steps of one series. */
export class StepDecoder {
  #kept = new Map(); // number -> {description, step or vdi}; what was used last is last

  /**
   * Decode a step.
   *
   * @param {string} codec The series'.
   * @param {object[]} frames The step's, then that of the step that it is written by, and so on:
   *   {number, kind, checksum, content: Uint8Array, needed: whether others are written by it}.
   * @returns {Promise<object>} As decode.js gives it.
   * @throws {VDIFileError} A sentence that names the step that is damaged.
   */
  async decode(codec, frames) {
    let known = null;
    for (let k = frames.length - 1; k >= 0; --k) {
      const { number, needed } = frames[k];
      let found = this.#kept.get(number);
      this.#kept.delete(number);
      found ??= await ofStep(number, () => decodedFrame(codec, frames[k], known));
      if (needed) this.#kept.set(number, found);
      if (this.#kept.size > KEPT_STEPS) this.#kept.delete(this.#kept.keys().next().value);
      known = found;
    }
    return ofStep(frames[0].number, () => vdiOf(known));
  }
}

// Whatever is wrong with a step, with its number.
async function ofStep(number, decode) {
  try {
    return await decode();
  } catch (error) {
    if (error instanceof VDIFileError) {
      const why = error.message.replace(`; ${REMEDY}`, "").replace(/^.* is damaged: /, "");
      throw new VDIFileError(`step ${number} of the series is damaged: ${why}; ${REMEDY}`);
    }
    if (error instanceof RangeError) {
      throw new VDIFileError(
        `step ${number} of the series takes more memory than the browser gives (${error.message})`);
    }
    throw error;
  }
}

async function vdiOf({ description, step, vdi }) {
  const view = checkedView(description);
  const found = vdi ?? { ...packedStep(step), precision: "8-byte" };
  if (found.offsets.length !== view.windowSize[0] * view.windowSize[1] + 1) {
    damaged("it is written by a step of another window");
  }
  return { ...found, ...view, level: "full" };
}

async function decodedFrame(codec, { kind, checksum, content }, before) {
  if (crc32(content) !== checksum) damaged("its checksum differs");
  const text = await textOf(content);
  if (kind === KIND.file) {
    const vdi = await decodeVDI((await arraysOf(content, text, "none")).vdi);
    const { windowSize, camera, bounds, depthOrigin, metadata } = vdi;
    const description = {
      window_size: windowSize, camera, bounds, depth_origin: depthOrigin, metadata,
    };
    return { description, vdi };
  }
  const description = text.description ?? before?.description;
  if (description === null || typeof description !== "object") damaged("it is not described");
  if (kind === KIND.again) return { ...before, description };
  if (before && !before.step) damaged("it is written by a step that holds no lists");
  const arrays = await arraysOf(content, text, codec);
  const said = saidOf(text, arrays, checkedView(description).windowSize, before?.step);
  return { description, step: decodedStep(arrays, said, before?.step ?? null) };
}

// What lists are decoded by: grid, samples and tables, those of the step before where there is one.
function saidOf({ step, samples }, arrays, windowSize, before) {
  for (const [name, array] of Object.entries(arrays)) {
    if (array instanceof Float32Array && name !== "extinctions") damaged(`${name} are no numbers`);
  }
  if (!Number.isInteger(Math.log2(step))) damaged(`the step of its depths is ${step}`);
  if (before) {
    if (before.windowSize.some((edge, k) => edge !== windowSize[k])) {
      damaged("it is written by a step of another window");
    }
    const { colors, extinctions } = before;
    const pitches = step === before.step ? before.pitches
      : pitchesOf(before.samples, windowSize, step);
    return { step, samples: before.samples, pitches, windowSize, colors, extinctions };
  }
  const good = samples === null ||
    (Array.isArray(samples) && samples.length === 9 && samples.every(Number.isFinite));
  if (!good) damaged("its samples are not nine finite numbers");
  const { colors } = arrays;
  const extinctions = Float32Array.from(arrays.extinctions ?? []);
  if (!(colors instanceof Uint8Array) || colors.length !== 768 || extinctions.length !== 256 ||
      !extinctions.every((x) => x >= 0 && x < Infinity)) {
    damaged("its tables are not those of a series");
  }
  const pitches = pitchesOf(samples, windowSize, step);
  return { step, samples, pitches, windowSize, colors, extinctions };
}

async function textOf(content) {
  if (content.length < 8) damaged("its content is too short");
  const size = new DataView(content.buffer, content.byteOffset).getUint32(0, true);
  if (8 + size > content.length) damaged("its content is shorter than it says");
  let text;
  try {
    text = JSON.parse(await inflateText(content.subarray(8, 8 + size), MOST_TEXT));
  } catch (error) {
    if (error instanceof VDIFileError) throw error;
  }
  if (text?.arrays === null || typeof text?.arrays !== "object") {
    damaged("its content is not described");
  }
  return text;
}

// The arrays of a content by their names; 64-bit numbers as doubles.
async function arraysOf(content, { arrays }, codec) {
  const view = new DataView(content.buffer, content.byteOffset, content.byteLength);
  let index = 8 + view.getUint32(0, true);
  const chunksEnd = index + 8 * view.getUint32(4, true);
  let at = chunksEnd;
  if (at > content.length) damaged("its content is shorter than it says");
  const found = {};
  for (const [name, said] of Object.entries(arrays)) {
    const [kind, rows] = Array.isArray(said) ? said : [];
    const Kind = Object.hasOwn(TYPES, kind) ? TYPES[kind] : null;
    if (!Kind || !Number.isInteger(rows) || rows < 0 || rows >= 2 ** 40) {
      damaged(`its array ${name} is of a kind that is unknown`);
    }
    const chunks = [];
    const size = Kind.BYTES_PER_ELEMENT;
    for (let first = 0; first < rows; first += FRAME_CHUNK_ROWS, index += 8) {
      if (index + 8 > chunksEnd) damaged(`its array ${name} is cut off`);
      const packed = view.getUint32(index, true);
      const raw = Math.min(FRAME_CHUNK_ROWS, rows - first) * size;
      if (raw > 1032 * packed || at + packed > content.length) {
        damaged(`${packed} bytes cannot hold the ${raw} of a chunk of its array ${name}`);
      }
      const bytes = content.subarray(at, (at += packed));
      if (crc32(bytes) !== view.getUint32(index + 4, true)) {
        damaged(`the checksum of a chunk of its array ${name} differs`);
      }
      chunks.push({ bytes, begin: first * size, raw });
    }
    const out = new Uint8Array(rows * size);
    for (const { bytes, begin, raw } of chunks) {
      await unpackChunk(bytes, out.subarray(begin, begin + raw), size);
    }
    found[name] = new Kind(out.buffer);
    if (Kind === BigUint64Array) found[name] = Float64Array.from(found[name], Number);
  }
  return found;
}
