// Bytes of a .vdi file to a VDI (docs/files.md). Nothing that a file says is trusted before it is
// checked: checksums of all members, sizes that are declared against those that are there, codes
// and depths against a VDI's rules; and nothing is allocated for a mere declaration.
import { GrowingBytes, REMEDY, VDIFileError, crc32, damaged, inflate } from "./bytes.js";

/** The version of files that are compressed with deflate, which browsers inflate by themselves. */
const VERSION = 4;
const MOST_COMPRESSED = 1032; // deflate makes no more bytes of one
const CHUNK_ROWS = 1 << 16;
/** Constants of docs/dev/conventions.md, "Packed supersegments". */
const DEPTH_CODES = 16383, TAU_CODES = 4095, GRID = 2 ** 24 - 2 ** 15;
const MAX_EDGE = 65536;
const DESCRIPTION = "vdi.json", COARSE = "coarse.vdi";
const WITH_VALUES = "pyvista-vdi-deferred";

/** Takes a .vdi file piece by piece; gives its coarse level as soon as that is there. */
export class LevelDecoder {
  #bytes = new GrowingBytes();
  #beginning = true; // whether a coarse level may still come

  /**
   * @param {(vdi: object) => void} onLevel Called with the VDI of each level, "coarse" before "full";
   *   before one of 8 bytes with an empty one, "begun", by which what draws it can be compiled.
   */
  constructor(onLevel) {
    this.onLevel = onLevel;
  }

  /** Take the bytes that follow, or base64 text. */
  async push(piece) {
    this.#bytes.push(piece);
    if (!this.#beginning) return;
    const members = new Map();
    for (const member of membersOf(this.#bytes.whole, true)) {
      members.set(member.name, member);
      if (members.size === 2) break;
    }
    if (members.size < 2) return;
    this.#beginning = false;
    const coarse = members.get(COARSE), { precision, view } = described(members);
    if (coarse || precision === "8-byte") {
      this.onLevel({ ...view, level: "begun", precision: "8-byte", windowSize: [1, 1], depthStep: 1,
        offsets: new Uint32Array(2), words: new Uint32Array(0), origin: new Int32Array(1),
        stride: new Uint16Array(1) });
    }
    if (!coarse) return;
    this.onLevel({ ...await decodeVDI(checkedMember(coarse), "coarse"), metadata: view.metadata });
  }

  /** Say that there are no more bytes; resolves when the full level has been given. */
  async end() {
    if (this.#bytes.broken) damaged("its base64 text ends within a byte");
    if (!this.#bytes.whole.length) damaged("it is empty");
    this.onLevel(await decodeVDI(this.#bytes.whole));
  }
}

/**
 * Decode a whole .vdi file.
 *
 * @param {Uint8Array} bytes The file.
 * @param {"coarse"|"full"} level What the VDI is said to be.
 * @returns {Promise<object>} windowSize [W, H], camera, bounds, depthOrigin, metadata,
 *   values (of lists that keep them, in the places of colours and optical depths), level, precision
 *   ("exact" or "8-byte"), offsets: Uint32Array(W H + 1). Exact: front, back, opticalDepth:
 *   Float32Array(n), color: Float32Array(3 n). 8-byte: words: Uint32Array(2 n), origin:
 *   Int32Array(W H), stride: Uint16Array(W H), depthStep. Units: docs/dev/conventions.md.
 * @throws {VDIFileError} A sentence that says what is wrong.
 */
export async function decodeVDI(bytes, level = "full") {
  try {
    const members = new Map();
    for (const member of membersOf(bytes, false)) {
      if (members.has(member.name)) damaged(`two of its members are called ${member.name}`);
      members.set(member.name, member);
    }
    const file = described(members), arrays = packedArrays(file, members);
    const offsets = offsetsOf(await arrays.counts(), file.n);
    const decode = file.precision === "8-byte" ? decodedCodes : decodedMedia;
    const decoded = await decode(file, arrays, offsets);
    return { ...file.view, level, precision: file.precision, offsets, ...decoded };
  } catch (error) {
    if (!(error instanceof RangeError)) throw error;
    throw new VDIFileError(`the VDI takes more memory than the browser gives (${error.message})`);
  }
}

// -- archive and description ---------------------------------------------------------------------

/**
 * Members in the order in which they lie, by their local headers alone, as a stream brings them: of
 * the beginning of a file those that are whole.
 */
export function* membersOf(bytes, beginning) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const starts = (signature, at) => bytes.length >= at + 4 && view.getUint32(at, true) === signature;
  let at = 0;
  while (bytes.length >= at + 30 && starts(0x04034b50, at)) {
    const nameEnd = at + 30 + view.getUint16(at + 26, true);
    const start = nameEnd + view.getUint16(at + 28, true);
    if (start > bytes.length) break;
    const name = new TextDecoder().decode(bytes.subarray(at + 30, nameEnd));
    const crc = view.getUint32(at + 14, true);
    let size = view.getUint32(at + 22, true);
    if (size === 0xffffffff && start >= nameEnd + 20 && view.getUint16(nameEnd, true) === 1) {
      size = Number(view.getBigUint64(nameEnd + 4, true)); // ZIP64
    }
    if (view.getUint16(at + 8, true) || view.getUint16(at + 6, true) & 9) {
      damaged(`its member ${name} is not stored plainly`);
    }
    if (start + size > bytes.length) break;
    at = start + size;
    yield { name, crc, bytes: bytes.subarray(start, at) };
  }
  if (beginning || (at && starts(0x02014b50, at))) return;
  if (at) damaged(`it is truncated or changed behind its byte ${at}`);
  const head = [...bytes.subarray(0, 4)].map((b) => b.toString(16).padStart(2, "0")).join(" ");
  throw new VDIFileError(
    bytes.length >= 30 && !starts(0x04034b50, 0)
      ? `this is no VDI file: it begins with the bytes ${head}, a .vdi file with 50 4b 03 04`
      : `the VDI file is truncated: it ends after ${bytes.length} bytes; ${REMEDY}`
  );
}

/** A member's bytes, if they are those that were written. */
export function checkedMember({ name, crc, bytes }) {
  if (crc32(bytes) !== crc) damaged(`the checksum of its member ${name} differs`);
  return bytes;
}

// What a file says of itself, checked: its entries, `n` and the `view` that its VDI has.
function described(members) {
  const member = members.get(DESCRIPTION);
  if (!member) throw new VDIFileError(`this is no VDI file: its member ${DESCRIPTION} is missing`);
  const text = new TextDecoder().decode(checkedMember(member));
  let d;
  try {
    d = JSON.parse(text);
  } catch (error) {
    damaged(`its description is no JSON (${error.message})`);
  }
  if (d?.format !== "pyvista-vdi" && d?.format !== WITH_VALUES) {
    throw new VDIFileError(`this is no VDI file: ${DESCRIPTION} does not name the format`);
  }
  const other = ["none", "lz4", "zstd"].includes(d.codec)
    ? `compressed with ${d.codec}, and pages read deflate alone`
    : d.version !== VERSION && `of version ${d.version}, and this viewer reads ${VERSION}`;
  if (other) {
    throw new VDIFileError(`the VDI file is ${other}: write it again by pyvista-vdi convert x.vdi -o ` +
      "y.vdi --compression deflate");
  }
  const n = d.n_supersegments;
  requireAll(d, {
    codec: d.codec === "deflate",
    n_supersegments: Number.isInteger(n) && n >= 0 && n <= 2 ** 30,
    chunk_rows: d.chunk_rows === CHUNK_ROWS,
    precision: ["exact", "8-byte"].includes(d.precision),
    depth_step: d.precision !== "8-byte" || Number.isInteger(Math.log2(d.depth_step)),
    window_size: areNumbers(d.window_size, 2) &&
      d.window_size.every((edge) => Number.isInteger(edge) && edge >= 1 && edge <= MAX_EDGE),
    bounds: areNumbers(d.bounds, 6) && [0, 2, 4].every((k) => d.bounds[k] <= d.bounds[k + 1]),
    depth_origin: Number.isFinite(d.depth_origin),
    camera: isCamera(d.camera),
    metadata: d.metadata !== null && typeof d.metadata === "object",
  });
  const view = {
    windowSize: d.window_size, camera: d.camera, bounds: d.bounds, depthOrigin: d.depth_origin,
    metadata: d.metadata, ...(d.format === WITH_VALUES && { values: checkedValues(d) }),
  };
  return { ...d, view, n };
}

const areNumbers = (x, length) =>
  Array.isArray(x) && x.length === length && x.every(Number.isFinite);

// What is known of lists that keep values: their range, and lengths in model units.
function checkedValues({ deferred }) {
  if (deferred?.version !== 1) {
    throw new VDIFileError(`the VDI file keeps values in version ${deferred?.version}; this viewer reads 1`);
  }
  const isLength = (x) => x > 0 && x < Infinity;
  const { value_range: range, unit_distance: unitDistance, sample_distance: sampleDistance } = deferred;
  requireAll(deferred, {
    value_range: areNumbers(range, 2) && range[0] < range[1],
    unit_distance: isLength(unitDistance),
    sample_distance: isLength(sampleDistance),
  });
  return { range, unitDistance, sampleDistance };
}

function requireAll(d, good) {
  for (const [name, is] of Object.entries(good)) {
    const what = String(JSON.stringify(d[name])).slice(0, 80);
    if (!is) damaged(`its description's ${name} is ${what}`);
  }
}

/** Whether JSON describes a camera. */
export function isCamera(c) {
  return c !== null && typeof c === "object" &&
    ["position", "focal_point", "view_up"].every((name) => areNumbers(c[name], 3)) &&
    c.position.some((x, k) => x !== c.focal_point[k]) &&
    c.view_angle > 0 && c.view_angle < 180 && c.parallel_scale > 0 &&
    c.parallel_scale < Infinity && areNumbers(c.window_center, 2) &&
    areNumbers(c.model_transform?.flat?.(), 16);
}

// -- arrays --------------------------------------------------------------------------------------

const KINDS = { "|u1": Uint8Array, "<u2": Uint16Array, "<u4": Uint32Array };

// Functions that unpack each array; its chunks must be as many and as long as its rows need.
function packedArrays(file, members) {
  const { n, window_size: [wide, high] } = file, lists = wide * high;
  const Counts = KINDS[file.arrays?.counts?.dtype];
  if (!Counts) damaged("the type of its counts is unknown");
  // Rows, what they are of, how many of a row, and what was done to them
  const wanted = file.precision === "8-byte" ? {
    counts: [lists, Counts], origin: [lists, Int32Array], stride: [lists, Uint16Array],
    front: [n, Uint16Array, 1, "difference"], back: [n, Uint16Array, 1, "difference"],
    color: [n, Uint8Array, 3, "channel-difference"], optical_depth: [n, Uint16Array],
  } : {
    counts: [lists, Counts], front: [n, Float32Array, 1, "difference"],
    back: [n, Float32Array, 1, "difference"], color: [n, Float32Array, 3],
    optical_depth: [n, Float32Array],
  };
  const bytesOf = (name) => {
    if (!members.has(name)) damaged(`it is truncated, or its member ${name} is missing`);
    return checkedMember(members.get(name));
  };
  const sizes = new DataView(bytesOf("chunks").slice().buffer);
  let k = 0;
  const arrays = {};
  for (const [name, [rows, Kind, items = 1, filter = "none"]] of Object.entries(wanted)) {
    if (file.arrays[name]?.filter !== filter || file.arrays[name]?.shape?.[0] !== rows) {
      damaged(`array ${name} is not described as its lists need it`);
    }
    const bytes = bytesOf(name), chunks = [], rowBytes = Kind.BYTES_PER_ELEMENT * items;
    let at = 0;
    for (let first = 0; first < rows; first += CHUNK_ROWS, ++k) {
      if (8 * k + 8 > sizes.byteLength) damaged(`it has ${k} chunks where more belong`);
      const size = sizes.getUint32(8 * k, true);
      const raw = Math.min(CHUNK_ROWS, rows - first) * rowBytes;
      if (raw > MOST_COMPRESSED * size || at + size > bytes.length) {
        damaged(`${size} bytes cannot hold the ${raw} of a chunk of array ${name}`);
      }
      chunks.push({ bytes: bytes.subarray(at, at + size), raw });
      at += size;
    }
    if (at !== bytes.length) damaged(`array ${name} has ${bytes.length} bytes, its chunks ${at}`);
    arrays[name] = async () => new Kind((await unpacked(chunks, rows * rowBytes, rowBytes)).buffer);
  }
  if (8 * k !== sizes.byteLength) damaged(`it has ${sizes.byteLength / 8} chunks, not ${k}`);
  return arrays;
}

// Rows of chunks, in which byte planes lie: first the first bytes of all, then the second ones.
async function unpacked(chunks, length, rowBytes) {
  const out = new Uint8Array(length);
  let at = 0;
  for (const { bytes, raw } of chunks) {
    const planes = await inflate(bytes, raw);
    for (let plane = 0, k = 0; plane < rowBytes; ++plane) {
      for (let to = at + plane; to < at + raw; to += rowBytes) out[to] = planes[k++];
    }
    at += raw;
  }
  return out;
}

// Running sum of the lists' lengths, with 0 before it.
function offsetsOf(counts, n) {
  const offsets = new Uint32Array(counts.length + 1);
  let sum = 0;
  for (let list = 0; list < counts.length && sum <= n; ++list) {
    offsets[list + 1] = sum += counts[list];
  }
  if (sum !== n) damaged(`its lists do not hold ${n} supersegments`);
  return offsets;
}

async function decodedCodes({ n, depth_step: depthStep }, arrays, offsets) {
  const origin = await arrays.origin(), stride = await arrays.stride();
  for (let list = 0; list < origin.length; ++list) {
    const first = origin[list], step = stride[list];
    if ((step > 0) !== (offsets[list + 1] > offsets[list]) || (!step && first)) {
      damaged("the lists with a stride are not those with supersegments");
    }
    if (Math.abs(first) > GRID || first + step * DEPTH_CODES > GRID + DEPTH_CODES + 1) {
      damaged("a list's depths lie beyond the VDI's grid");
    }
  }
  const gaps = await arrays.front(), thicknesses = await arrays.back();
  const color = await arrays.color(), tau = await arrays.optical_depth();
  const words = new Uint32Array(2 * n);
  let begun = 0; // the back before, in codes
  for (let k = 0, list = 0; k < n; ++k) {
    while (offsets[list + 1] <= k) ++list;
    if (k === offsets[list] || k % CHUNK_ROWS === 0) begun = 0; // codes begin anew
    const front = begun + gaps[k];
    const back = (begun = front + thicknesses[k]);
    if (back <= front || back > DEPTH_CODES || tau[k] > TAU_CODES) {
      damaged("a supersegment has no thickness, or a code beyond its largest");
    }
    words[2 * k] = front | (back << 14) | (tau[k] << 28);
    const blue = color[3 * k], green = color[3 * k + 1] + blue, red = color[3 * k + 2] + blue;
    words[2 * k + 1] = (tau[k] >> 4) | ((red & 255) << 8) | ((green & 255) << 16) | (blue << 24);
  }
  return { words, origin, stride, depthStep };
}

async function decodedMedia({ n }, arrays, offsets) {
  const front = await arrays.front(), back = await arrays.back();
  // Differences of bit patterns to depths: a front less the back before it, a back less its front
  const [gaps, thicknesses] = [new Uint32Array(front.buffer), new Uint32Array(back.buffer)];
  for (let k = 0, before = 0; k < n; ++k) {
    if (k % CHUNK_ROWS === 0) before = 0;
    gaps[k] += before;
    before = thicknesses[k] += gaps[k];
  }
  const color = await arrays.color(), opticalDepth = await arrays.optical_depth();
  for (let k = 0, list = 0; k < n; ++k) {
    while (offsets[list + 1] <= k) ++list;
    const sorted = k === offsets[list] || back[k - 1] <= front[k];
    if (!(sorted && front[k] < back[k] && Number.isFinite(back[k] - front[k]))) {
      damaged("the depths of a list are not finite, sorted and disjoint");
    }
    if (!(opticalDepth[k] >= 0 && opticalDepth[k] < Infinity)) {
      damaged("an optical depth is not finite and at least 0");
    }
  }
  if (!color.every((c) => c >= 0 && c <= 1)) damaged("a colour is not within 0 and 1");
  return { front, back, color, opticalDepth };
}
