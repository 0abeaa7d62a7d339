// Zstandard (RFC 8878): a frame to the bytes that it stands for. Names are the RFC's.

const MAX_BLOCK = 1 << 17;
const HUFFMAN_BITS = 11;
const LONG = 48; // bytes that are copied sooner by a call than by a loop
const POWERS = Uint32Array.from({ length: 32 }, (_, code) => 2 ** code);

// Length codes: extra bits of each; their bases follow, as every code begins where the last ends.
const LITERALS = lengthCodes([...Array(16).fill(0), 1, 1, 1, 1, 2, 2, 3, 3, 4, 6, 7, 8, 9, 10, 11,
  12, 13, 14, 15, 16], 0);
const MATCHES = lengthCodes([...Array(32).fill(0), 1, 1, 1, 1, 2, 2, 3, 3, 4, 4, 5, 7, 8, 9, 10, 11,
  12, 13, 14, 15, 16], 3);

// What sequences are coded by: most accuracy, symbols and the distribution where none is given.
const SEQUENCE_CODES = [
  { most: 9, symbols: 36, log: 6, given: [4, 3, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 1, 1, 1, 2, 2, 2,
    2, 2, 2, 2, 2, 2, 3, 2, 1, 1, 1, 1, 1, -1, -1, -1, -1] },
  { most: 8, symbols: 32, log: 5, given: [1, 1, 1, 1, 1, 1, 2, 2, 2, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1,
    1, 1, 1, 1, 1, -1, -1, -1, -1, -1] },
  { most: 9, symbols: 53, log: 6, given: [1, 4, 3, 2, 2, 2, 2, 2, 2, ...Array(37).fill(1), -1, -1,
    -1, -1, -1, -1, -1] },
];

function lengthCodes(bits, first) {
  const base = new Uint32Array(bits.length);
  for (let code = 0, next = first; code < bits.length; ++code) {
    base[code] = next;
    next += 2 ** bits[code];
  }
  return { base, bits: Uint8Array.from(bits) };
}

function wrong() {
  throw new RangeError("no frame of Zstandard");
}

/**
 * Decompress a frame.
 *
 * @param {Uint8Array} from The frame, without a dictionary.
 * @param {Uint8Array} out What it stands for: it is filled exactly, and never written beyond.
 * @returns {boolean} Whether it was such a frame.
 */
export function unzstd(from, out) {
  try {
    return new ZstdFrame(from, out).read() === out.length;
  } catch (error) {
    if (error instanceof RangeError || error instanceof TypeError) return false;
    throw error;
  }
}

// A frame while it is read. Bits are taken by words of four bytes, of which 25 bits are whole
// wherever they begin.
class ZstdFrame {
  constructor(from, out) {
    this.from = from;
    this.view = new DataView(from.buffer, from.byteOffset, from.byteLength);
    this.out = out;
    this.at = 0; // in the frame
    this.to = 0; // in what it stands for
    this.offsets = [1, 4, 8];
    this.tables = [null, null, null];
    this.huffman = null;
    this.literals = new Uint8Array(MAX_BLOCK);
  }

  read() {
    const { from, view, out } = this;
    if (view.getUint32(0, true) !== 0xfd2fb528) wrong();
    const flags = from[4];
    const single = flags & 32;
    if (flags & 3 || flags & 8) wrong(); // a dictionary, or what is reserved
    this.at = 5 + (single ? 0 : 1) + [single ? 1 : 0, 2, 4, 8][flags >> 6];
    for (let last = 0; !last;) {
      if (this.at + 3 > from.length) wrong();
      const head = from[this.at] | (from[this.at + 1] << 8) | (from[this.at + 2] << 16);
      const size = head >> 3;
      this.at += 3;
      last = head & 1;
      const kind = (head >> 1) & 3;
      const end = this.at + (kind === 1 ? 1 : size);
      if (kind === 3 || size > MAX_BLOCK || end > from.length) wrong();
      if (kind < 2 && this.to + size > out.length) wrong();
      if (kind === 0) out.set(from.subarray(this.at, end), this.to);
      if (kind === 1) out.fill(from[this.at], this.to, this.to + size);
      if (kind < 2) this.to += size;
      else this.block(end);
      this.at = end;
    }
    if (this.at + (flags & 4 ? 4 : 0) !== from.length) wrong();
    return this.to;
  }

  // A compressed block: literals, and sequences of literals to take and matches to repeat.
  block(end) {
    const literals = this.literalsOf(end);
    const { from } = this;
    let n = from[this.at++];
    if (n > 127) n = n === 255 ? from[this.at++] + (from[this.at++] << 8) + 0x7f00
      : ((n - 128) << 8) + from[this.at++];
    if (this.at > end) wrong();
    let taken = 0;
    if (n > 0) {
      const modes = from[this.at++];
      for (let k = 0; k < 3; ++k) this.table(k, (modes >> (6 - 2 * k)) & 3, end);
      taken = this.sequences(n, literals, end);
    } else if (this.at !== end) {
      wrong();
    }
    const rest = literals.subarray(taken);
    if (this.to + rest.length > this.out.length) wrong();
    this.out.set(rest, this.to);
    this.to += rest.length;
  }

  // -- literals ----------------------------------------------------------------------------------

  literalsOf(end) {
    const { from, at } = this;
    const kind = from[at] & 3;
    const format = (from[at] >> 2) & 3;
    if (kind < 2) { // as they are, or one of them
      const bytes = [1, 2, 1, 3][format];
      let size = 0;
      for (let k = 0; k < bytes; ++k) size += from[at + k] * 2 ** (8 * k);
      size = Math.floor(size / (format & 1 ? 16 : 8));
      this.at = at + bytes + (kind ? 1 : size);
      if (this.at > end || size > MAX_BLOCK) wrong();
      return kind ? this.literals.fill(from[at + bytes], 0, size).subarray(0, size)
        : from.subarray(at + bytes, this.at);
    }
    const bytes = [3, 3, 4, 5][format];
    const bits = [10, 10, 14, 18][format];
    let sizes = 0;
    for (let k = 0; k < bytes; ++k) sizes += from[at + k] * 2 ** (8 * k);
    sizes = Math.floor(sizes / 16);
    const size = sizes % 2 ** bits;
    const last = at + bytes + Math.floor(sizes / 2 ** bits);
    this.at = at + bytes;
    if (last > end || size > MAX_BLOCK) wrong();
    if (kind === 2) this.readHuffman(last);
    if (!this.huffman) wrong();
    if (format === 0) {
      this.stream(this.at, last, 0, size);
    } else {
      let begin = this.at + 6;
      const quarter = (size + 3) >> 2;
      for (let k = 0; k < 4; ++k) {
        const next = k < 3 ? begin + this.view.getUint16(this.at + 2 * k, true) : last;
        if (next > last) wrong();
        this.stream(begin, next, Math.min(k * quarter, size), k < 3 ? (k + 1) * quarter : size);
        begin = next;
      }
    }
    this.at = last;
    return this.literals.subarray(0, size);
  }

  readHuffman(last) {
    const { from } = this;
    const weights = new Uint8Array(256);
    const head = from[this.at++];
    let n;
    if (head < 128) {
      const end = this.at + head;
      if (end > last) wrong();
      const table = fseTable(...this.distribution(6, 13, end));
      n = this.weights(table, weights, end);
    } else {
      n = head - 127;
      if (this.at + ((n + 1) >> 1) > last) wrong();
      for (let k = 0; k < n; ++k) weights[k] = (from[this.at + (k >> 1)] >> (k & 1 ? 0 : 4)) & 15;
      this.at += (n + 1) >> 1;
    }
    let sum = 0;
    for (let k = 0; k < n; ++k) sum += weights[k] ? 2 ** (weights[k] - 1) : 0;
    if (!sum) wrong();
    const log = 32 - Math.clz32(sum); // of the power of two above
    const left = 2 ** log - sum;
    if (log > HUFFMAN_BITS || n > 255 || left & (left - 1)) wrong();
    weights[n++] = 32 - Math.clz32(left);
    const table = new Uint16Array(1 << log); // symbol, and bits in the four lowest bits
    let place = 0;
    for (let weight = 1; weight <= log; ++weight) {
      for (let symbol = 0; symbol < n; ++symbol) {
        if (weights[symbol] !== weight) continue;
        table.fill((symbol << 4) | (log + 1 - weight), place, (place += 1 << (weight - 1)));
      }
    }
    if (place !== table.length) wrong();
    this.huffman = { table, log };
  }

  weights(table, weights, end) {
    this.bitsOf(this.at, end);
    const states = [this.bits(table.log), this.bits(table.log)];
    let n = 0;
    for (let which = 0; ; which ^= 1) { // until there are no bits for the next state
      const entry = states[which];
      if (n > 253) wrong();
      weights[n++] = table.symbol[entry];
      if (this.left < table.nBits[entry]) {
        weights[n++] = table.symbol[states[which ^ 1]];
        break;
      }
      states[which] = table.base[entry] + this.bits(table.nBits[entry]);
    }
    this.at = end;
    return n;
  }

  // A stream of Huffman codes, from its end to its beginning.
  stream(begin, end, to, last) {
    const { view, literals } = this;
    const { table, log } = this.huffman;
    this.bitsOf(begin, end);
    const first = 8 * begin;
    let bit = first + this.left;
    const one = 25 - log;
    const mask = (1 << log) - 1;
    // Two symbols to a word of 25 bits
    while (to + 1 < last && bit - first >= 25) {
      const from = bit - 25;
      const word = view.getUint32(from >>> 3, true) >>> (from & 7);
      const entry = table[(word >>> one) & mask];
      const used = entry & 15;
      const next = table[(word >>> (one - used)) & mask];
      literals[to] = entry >> 4;
      literals[to + 1] = next >> 4;
      to += 2;
      bit -= used + (next & 15);
    }
    this.left = bit - first;
    while (to < last) {
      const entry = table[this.peek(log)];
      literals[to++] = entry >> 4;
      this.left -= entry & 15;
    }
    if (this.left !== 0) wrong();
  }

  // -- bits that are read backwards -------------------------------------------------------------

  // Begin with a stream, behind the mark that its last byte has.
  bitsOf(begin, end) {
    if (end <= begin || !this.from[end - 1]) wrong();
    this.begin = begin;
    this.left = 8 * (end - begin) - 1 - (Math.clz32(this.from[end - 1]) - 24);
  }

  // The next 25 bits at most; zeros where there are no more.
  peek(n) {
    const { from, begin } = this;
    const at = this.left - n;
    const byte = begin + (at >> 3);
    let word = 0;
    for (let k = 3; k >= 0; --k) word = (word << 8) | (byte + k >= begin ? from[byte + k] : 0);
    return (word >>> (at & 7)) & ((1 << n) - 1);
  }

  bits(n) {
    if (n > 25) {
      const high = this.bits(n - 16);
      return high * 65536 + this.bits(16);
    }
    if (this.left < n) wrong();
    const found = this.peek(n);
    this.left -= n;
    return found;
  }

  // -- sequences ---------------------------------------------------------------------------------

  table(k, mode, end) {
    const { most, symbols, log, given } = SEQUENCE_CODES[k];
    if (mode === 0) this.tables[k] = SEQUENCE_CODES[k].table ??= fseTable(given, log);
    if (mode === 1) this.tables[k] = fseSingle(this.from[this.at++], symbols);
    if (mode === 2) this.tables[k] = fseTable(...this.distribution(most, symbols, end));
    if (!this.tables[k] || this.at > end) wrong();
  }

  sequences(n, literals, end) {
    const { out, offsets, view } = this;
    const [ofLiterals, ofOffsets, ofMatches] = this.tables;
    this.bitsOf(this.at, end);
    const first = 8 * this.begin;
    let literal = this.bits(ofLiterals.log);
    let offset = this.bits(ofOffsets.log);
    let match = this.bits(ofMatches.log);
    let [a, b, c] = offsets;
    let taken = 0;
    let { to } = this;
    let bit = first + this.left;
    // Up to 25 bits, of a word that ends with them
    const take = (count) => {
      const from = bit - 25;
      if (from < first) {
        this.left = bit - first;
        bit -= count;
        return this.left < count ? wrong() : this.peek(count);
      }
      bit -= count;
      const word = view.getUint32(from >>> 3, true) >>> (from & 7);
      return (word >>> (25 - count)) & ((1 << count) - 1);
    };
    for (let k = n - 1; ; --k) {
      const code = ofOffsets.symbol[offset];
      let distance = code > 25 ? take(code - 16) * 65536 + take(16) : take(code);
      distance += POWERS[code];
      const matchCode = ofMatches.symbol[match];
      const length = MATCHES.base[matchCode] + take(MATCHES.bits[matchCode]);
      const literalCode = ofLiterals.symbol[literal];
      const fresh = LITERALS.base[literalCode] + take(LITERALS.bits[literalCode]);
      const repeated = distance > 3 ? 4 : distance + (fresh === 0 ? 1 : 0);
      if (repeated > 1) {
        const chosen = distance > 3 ? distance - 3
          : repeated === 2 ? b : repeated === 3 ? c : a - 1;
        if (repeated > 2) c = b;
        b = a;
        a = chosen;
      }
      if (k > 0) {
        literal = ofLiterals.base[literal] + take(ofLiterals.nBits[literal]);
        match = ofMatches.base[match] + take(ofMatches.nBits[match]);
        offset = ofOffsets.base[offset] + take(ofOffsets.nBits[offset]);
      }
      if (taken + fresh > literals.length || to + fresh + length > out.length) wrong();
      for (const last = taken + fresh; taken < last;) out[to++] = literals[taken++];
      if (!(a > 0 && a <= to)) wrong();
      if (length < LONG || (a > 1 && a < length)) {
        for (const last = to + length; to < last; ++to) out[to] = out[to - a];
      } else {
        if (a === 1) out.fill(out[to - 1], to, to + length);
        else out.copyWithin(to, to - a, to - a + length);
        to += length;
      }
      if (k === 0) break;
    }
    if (bit !== first) wrong();
    this.offsets = [a, b, c];
    this.to = to;
    return taken;
  }

  // How often each symbol stands in a table, and the logarithm of its size.
  distribution(most, symbols, end) {
    const { from } = this;
    let bit = 8 * this.at;
    const take = (n) => {
      const byte = bit >>> 3;
      if (bit + n > 8 * end) wrong();
      const word = from[byte] | (from[byte + 1] << 8) | (from[byte + 2] << 16);
      bit += n;
      return (word >>> ((bit - n) & 7)) & ((1 << n) - 1);
    };
    const log = 5 + take(4);
    if (log > most) wrong();
    const counts = [];
    for (let left = 1 << log; left > 0;) {
      if (counts.length >= symbols) wrong();
      const nBits = 32 - Math.clz32(left + 1);
      const short = (1 << nBits) - 1 - (left + 1); // so many values take a bit less
      let value = take(nBits - 1);
      if (value >= short) {
        value += take(1) << (nBits - 1);
        if (value >= 1 << (nBits - 1)) value -= short;
      }
      const count = value - 1;
      left -= Math.abs(count);
      counts.push(count);
      if (count === 0) {
        for (let more = 3; more === 3;) {
          more = take(2);
          for (let k = 0; k < more; ++k) counts.push(0);
        }
      }
    }
    if (counts.length > symbols) wrong();
    this.at = (bit + 7) >>> 3;
    return [counts, log];
  }
}

function fseTable(counts, log) {
  const size = 1 << log;
  const symbol = new Uint8Array(size);
  const nBits = new Uint8Array(size);
  const base = new Uint16Array(size);
  let high = size;
  counts.forEach((count, which) => {
    if (count === -1) symbol[--high] = which;
  });
  const step = (size >> 1) + (size >> 3) + 3;
  let place = 0;
  counts.forEach((count, which) => {
    for (let k = 0; k < count; ++k) {
      symbol[place] = which;
      do place = (place + step) & (size - 1); while (place >= high);
    }
  });
  if (place !== 0) wrong();
  const next = counts.map(Math.abs);
  for (let state = 0; state < size; ++state) {
    const x = next[symbol[state]]++;
    nBits[state] = log - (31 - Math.clz32(x));
    base[state] = (x << nBits[state]) - size;
  }
  return { symbol, nBits, base, log };
}

function fseSingle(symbol, symbols) {
  if (!(symbol < symbols)) wrong();
  return { symbol: [symbol], nBits: [0], base: [0], log: 0 };
}
