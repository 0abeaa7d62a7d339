// Bytes of files: they come piece by piece, have checksums, and are inflated.

/** What to do about a file that is not as it was written. */
export const REMEDY = "load it again, or copy it from its source again";

/** What is wrong with a file, as a sentence. */
export class VDIFileError extends Error {
  name = "VDIFileError";
}

/** Throw a {@link VDIFileError} that says why a file is not what was written. */
export function damaged(why) {
  throw new VDIFileError(`the VDI file is damaged: ${why}; ${REMEDY}`);
}

/** Bytes that come piece by piece, as such or as base64 text. */
export class GrowingBytes {
  #bytes = new Uint8Array(1 << 16);
  #length = 0;
  #text = ""; // that is not yet four characters

  /** Those that have come. */
  get whole() {
    return this.#bytes.subarray(0, this.#length);
  }

  /** Whether text ended within a byte. */
  get broken() {
    return this.#text !== "";
  }

  /** @param {Uint8Array|string} piece Bytes that follow, or base64 text. */
  push(piece) {
    if (typeof piece === "string") {
      const text = this.#text + piece.replace(/\s+/g, "");
      this.#text = text.slice(text.length & ~3);
      piece = bytesOfBase64(text.slice(0, text.length & ~3));
    }
    const length = this.#length + piece.length;
    if (length > this.#bytes.length) {
      const larger = new Uint8Array(Math.max(length, 2 * this.#bytes.length));
      larger.set(this.whole);
      this.#bytes = larger;
    }
    this.#bytes.set(piece, this.#length);
    this.#length = length;
  }
}

function bytesOfBase64(text) {
  try {
    if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
    const letters = atob(text), bytes = new Uint8Array(letters.length);
    for (let k = 0; k < bytes.length; ++k) bytes[k] = letters.charCodeAt(k);
    return bytes;
  } catch {
    return damaged("its text is no base64");
  }
}

// Four tables, by which four bytes are taken in at once
let crcTables = null;

function makeCrcTables() {
  const tables = [0, 1, 2, 3].map(() => new Uint32Array(256));
  for (let n = 0; n < 256; ++n) {
    let c = n;
    for (let bit = 0; bit < 8; ++bit) c = c & 1 ? 0xedb88320 ^ (c >>> 1) : c >>> 1;
    tables[0][n] = c;
  }
  for (let k = 1; k < 4; ++k) {
    for (let n = 0; n < 256; ++n) {
      const c = tables[k - 1][n];
      tables[k][n] = tables[0][c & 255] ^ (c >>> 8);
    }
  }
  return tables;
}

/** The CRC-32 of bytes, as ZIP has it. */
export function crc32(bytes) {
  const [t0, t1, t2, t3] = (crcTables ??= makeCrcTables());
  let c = -1;
  let k = 0;
  for (; k + 4 <= bytes.length; k += 4) {
    c ^= bytes[k] | (bytes[k + 1] << 8) | (bytes[k + 2] << 16) | (bytes[k + 3] << 24);
    c = t3[c & 255] ^ t2[(c >>> 8) & 255] ^ t1[(c >>> 16) & 255] ^ t0[c >>> 24];
  }
  for (; k < bytes.length; ++k) c = t0[(c ^ bytes[k]) & 255] ^ (c >>> 8);
  return ~c >>> 0;
}

/** Decompress a zlib stream to exactly as many bytes as belong; nothing more is ever unpacked. */
export async function inflate(bytes, length) {
  const out = new Uint8Array(length);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const reader = stream.getReader();
  let at = 0;
  try {
    for (let next; !(next = await reader.read()).done; at += next.value.length) out.set(next.value, at);
  } catch {
    at = -1; // it is no such stream, or goes on
  } finally {
    reader.cancel().catch(() => {});
  }
  if (at !== length) damaged(`a chunk does not decompress to the ${length} bytes that it stands for`);
  return out;
}
