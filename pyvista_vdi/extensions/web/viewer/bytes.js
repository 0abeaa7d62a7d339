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

/** What a base64 text holds. */
export function bytesOfBase64(text) {
  try {
    if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
    const letters = atob(text), bytes = new Uint8Array(letters.length);
    for (let k = 0; k < bytes.length; ++k) bytes[k] = letters.charCodeAt(k);
    return bytes;
  } catch {
    return damaged("its text is no base64");
  }
}

const CRC_TABLE = Uint32Array.from({ length: 256 }, (_, n) => {
  for (let bit = 0; bit < 8; ++bit) n = n & 1 ? 0xedb88320 ^ (n >>> 1) : n >>> 1;
  return n;
});

/** The CRC-32 of bytes, as ZIP has it. */
export function crc32(bytes) {
  let c = -1;
  for (let k = 0; k < bytes.length; ++k) c = CRC_TABLE[(c ^ bytes[k]) & 255] ^ (c >>> 8);
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
