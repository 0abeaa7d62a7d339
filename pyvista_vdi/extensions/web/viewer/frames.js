// Where the frames of a .vdis file lie (docs/series.md, "The members of a .vdis file").
import { KIND } from "./steps.js";
import { REMEDY, VDIFileError, crc32 } from "./unpack.js";

const MAGIC_BYTES = [0x89, 0x56, 0x44, 0x49, 0x53, 0x0d, 0x0a, 0x1a];
const SET_MAGIC_BYTES = MAGIC_BYTES.map((byte, k) => k === 4 ? 0x56 : byte); // .vdiset
const HEADER_BYTES = 40;
const ENTRY_BYTES = 8 + HEADER_BYTES;
const STEP = 0x50455453; // "STEP", as a little-endian number
const INDX = 0x58444e49;

/** Bytes at a file's end that say where its index is. */
export const TRAILER_BYTES = 16;

const beginsBy = (bytes, magic) =>
  magic.every((byte, k) => bytes[k] === byte || k >= bytes.length);

/** Whether bytes, or base64 text, are the beginning of a series, or of a set. */
export function beginsAsSeries(piece) {
  if (typeof piece === "string") return /^\s*iVZE/.test(piece);
  return piece.length > 0 && [MAGIC_BYTES, SET_MAGIC_BYTES].some((magic) => beginsBy(piece, magic));
}

function broken(why) {
  throw new VDIFileError(`the series is damaged: ${why}; ${REMEDY}`);
}

/** How many bytes a file's head takes; 0 where there are too few bytes to say so. */
export function headBytes(bytes) {
  if (bytes.length < 20) return 0;
  return 20 + new DataView(bytes.buffer, bytes.byteOffset, 20).getUint32(12, true);
}

/**
 * What a file begins with.
 *
 * @param {Uint8Array} bytes From the file's begin.
 * @returns {{begin: number, codec: string, set: object|null}|null} Where frames begin, and their
 *   codec; of a set views, bounds and the camera to begin with. null where there are too few bytes
 *   to say so.
 * @throws {VDIFileError} If it is of a newer version, or damaged.
 */
export function headOf(bytes) {
  if (bytes.length && !beginsAsSeries(bytes)) {
    throw new VDIFileError("this is no series of VDIs: it begins with other bytes than one");
  }
  if (bytes.length < 20) return null;
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const [version, size, checksum] = [8, 12, 16].map((at) => view.getUint32(at, true));
  if (version > 1) {
    throw new VDIFileError(
      `the series is of format version ${version}, and this viewer reads version 1: ` +
        "upgrade by pip install -U pyvista-vdi");
  }
  if (size > 1 << 26) broken("its head is not what was written");
  if (bytes.length < 20 + size) return null;
  const text = bytes.subarray(20, 20 + size);
  const said = new Uint8Array(8 + size);
  said.set(bytes.subarray(8, 16));
  said.set(text, 8);
  if (version < 1 || crc32(said) !== checksum) broken("its head is not what was written");
  let told;
  try {
    told = JSON.parse(new TextDecoder().decode(text));
  } catch {
    broken("its head is no JSON");
  }
  const { codec } = told ?? {};
  if (codec !== "deflate") broken("its head names no codec");
  const set = beginsBy(bytes, MAGIC_BYTES) ? null : setOf(told);
  return { begin: 20 + size, codec, set };
}

// What a set's head says beside that.
function setOf({ views, bounds, about }) {
  const numbers = (values, n) => Array.isArray(values) && values.length === n &&
    values.every(Number.isFinite);
  const good = (view) => view !== null && typeof view === "object" && numbers(view.position, 3) &&
    numbers(view.focal_point, 3) && numbers(view.view_up, 3) &&
    (view.model_transform === undefined || (Array.isArray(view.model_transform) &&
      view.model_transform.length === 4 && view.model_transform.every((row) => numbers(row, 4))));
  const camera = about?.camera ?? views?.[0];
  if (!Array.isArray(views) || !views.length || ![...views, camera].every(good) ||
      !numbers(bounds, 6)) {
    broken("its head does not say from where it was made");
  }
  return { views, bounds, camera };
}

// A frame's header; null where there is none.
function headerAt(view, at) {
  if (at + HEADER_BYTES > view.byteLength) return null;
  const bytes = new Uint8Array(view.buffer, view.byteOffset + at, HEADER_BYTES - 4);
  if (crc32(bytes) !== view.getUint32(at + HEADER_BYTES - 4, true)) return null;
  return {
    what: view.getUint32(at, true), number: view.getUint32(at + 4, true),
    kind: view.getUint32(at + 8, true), by: view.getInt32(at + 12, true),
    time: view.getFloat64(at + 16, true), size: Number(view.getBigUint64(at + 24, true)),
    checksum: view.getUint32(at + 32, true),
  };
}

// Whether a header is one of a step behind another.
function follows(header, before) {
  const { what, number, kind, by, time } = header;
  return what === STEP && Object.values(KIND).includes(kind) && by >= -1 && by < number &&
    (by >= 0 || kind !== KIND.again) && (by < 0 || kind !== KIND.file) && Number.isFinite(time) &&
    (!before || (before.number < number && before.time < time));
}

/**
 * Look for frames one behind the other.
 *
 * @param {Uint8Array} bytes The file, or its beginning.
 * @param {object[]} frames Those that are known, to which others are added: number, kind, by,
 *   time, size, checksum, and place of the content.
 * @param {number} begin Where to go on.
 * @param {boolean} whole Whether no more bytes come: then what is damaged is stepped over.
 * @returns {number} Where to go on next time.
 */
export function findFrames(bytes, frames, begin, whole) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  for (let at = begin; ;) {
    const header = headerAt(view, at);
    if (!header || !follows(header, frames.at(-1))) {
      if (!whole || at + HEADER_BYTES > bytes.length) return at;
      at = bytes.indexOf(0x53, at + 1); // of "STEP"
      if (at < 0) return bytes.length;
      continue;
    }
    const place = at + HEADER_BYTES;
    if (place + header.size > bytes.length) return at; // still to come, or cut off
    frames.push({ ...header, place });
    at = place + header.size;
  }
}

/**
 * Where the index of a file begins.
 *
 * @param {Uint8Array} trailer The file's last bytes.
 * @param {number} size Of the file.
 * @returns {number} -1 where there is none.
 */
export function indexPlace(trailer, size) {
  if (trailer.length < TRAILER_BYTES) return -1;
  const end = trailer.subarray(trailer.length - TRAILER_BYTES);
  const view = new DataView(end.buffer, end.byteOffset, TRAILER_BYTES);
  const place = Number(view.getBigUint64(0, true));
  const named = String.fromCharCode(...end.subarray(8)) === "VDISEND\n";
  return named && place + HEADER_BYTES + TRAILER_BYTES <= size ? place : -1;
}

/**
 * The frames that an index names.
 *
 * @param {Uint8Array} bytes From the index' begin on.
 * @param {number} begin Where frames begin.
 * @param {number} place Where the index begins, which is where frames end.
 * @returns {object[]|null} As {@link findFrames} finds them; null where the index is damaged.
 */
export function indexedFrames(bytes, begin, place) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const index = headerAt(view, 0);
  if (index?.what !== INDX || index.size !== index.number * ENTRY_BYTES) return null;
  const content = bytes.subarray(HEADER_BYTES, HEADER_BYTES + index.size);
  if (content.length !== index.size || crc32(content) !== index.checksum) return null;
  const frames = [];
  let last = begin;
  for (let k = 0, at = HEADER_BYTES; k < index.number; ++k, at += ENTRY_BYTES) {
    const header = headerAt(view, at + 8);
    if (Number(view.getBigUint64(at, true)) !== last) return null;
    if (!header || !follows(header, frames.at(-1))) return null;
    frames.push({ ...header, place: last + HEADER_BYTES });
    last += HEADER_BYTES + header.size;
  }
  return last === place ? frames : null;
}
