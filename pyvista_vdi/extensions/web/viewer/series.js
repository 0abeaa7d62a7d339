// A .vdis or .vdiset file in a page: its steps, or views, when they are asked for, by a worker.
import {
  TRAILER_BYTES, findFrames, headBytes, headOf, indexPlace, indexedFrames,
} from "./frames.js";
import { askPort, decodingPort } from "./port.js";
import { GrowingBytes, REMEDY, VDIFileError } from "./unpack.js";

/** Bytes of frames that were fetched and are kept. */
const MOST_FETCHED = 1 << 28;

/** The VDIs of one scene at several times. */
export class Series {
  #frames = [];
  #read; // async (place, size) -> the bytes of a frame's content
  #codec;
  #port = null; // a promise
  #last = Promise.resolve(); // of what was asked for
  #closing = () => {}; // rejects what is being decoded
  #era = 0; // how often it was closed

  /** Whether all of the file's steps are known. */
  complete = false;
  /** Called when there are more steps. */
  changed = () => {};

  /** Of a set the V_Os' cameras by the numbers of its VDIs; else null, as the two that follow. */
  views = null;
  bounds = null;
  camera = null;

  constructor({ codec, set }, read) {
    this.#codec = codec;
    this.#read = read;
    Object.assign(this, set);
  }

  /** The number that a step has in the file: others before it may be lost. */
  numberOf(i) {
    return this.#frames[i].number;
  }

  /** How many steps there are. */
  get length() {
    return this.#frames.length;
  }

  /** The steps' times, ascending. */
  get times() {
    return this.#frames.map(({ time }) => time);
  }

  /** The index of the step nearest in time; of two, the earlier. */
  nearest(time) {
    let best = 0;
    this.#frames.forEach((frame, i) => {
      if (Math.abs(frame.time - time) < Math.abs(this.#frames[best].time - time)) best = i;
    });
    return best;
  }

  /**
   * A step as prepare.js makes it; one is decoded after the other.
   *
   * @param {number} i Its index.
   * @returns {Promise<object>}
   * @throws {VDIFileError} A sentence that names the step.
   */
  prepared(i) {
    const era = this.#era;
    const found = this.#last.then(() => {
      if (era !== this.#era) throw closedError();
      return this.#decoded(i);
    });
    this.#last = found.catch(() => {});
    return found;
  }

  /** End the worker; the next step that is asked for starts another. */
  close() {
    this.#port?.then((port) => port.terminate());
    this.#port = null;
    this.#era += 1;
    this.#closing(closedError());
  }

  async #decoded(i) {
    const closed = new Promise((_, reject) => (this.#closing = reject));
    closed.catch(() => {});
    const unlessClosed = (promise) => Promise.race([promise, closed]);
    const needed = new Set(this.#frames.map(({ by }) => by));
    const chain = [];
    for (let frame = this.#frames[i]; frame;) {
      chain.push(frame);
      const { by } = frame;
      frame = by < 0 ? null : this.#frames.find(({ number }) => number === by);
      if (frame === undefined) {
        throw new VDIFileError(`the series is damaged: step ${this.#frames[i].number} is written ` +
          `by step ${by}, which cannot be found; ${REMEDY}`);
      }
    }
    const read = chain.map(async ({ number, kind, checksum, place, size }) => {
      const content = (await this.#read(place, size)).slice(); // without the rest of its buffer
      return { number, kind, checksum, content, needed: needed.has(number) };
    });
    const frames = await unlessClosed(Promise.all(read));
    const port = await unlessClosed(this.#port ??= decodingPort());
    let prepared;
    const handed = frames.map(({ content }) => content.buffer);
    await unlessClosed(askPort(port, { codec: this.#codec, frames }, (data) => {
      ({ prepared } = data);
    }, handed));
    return prepared;
  }

  #take(frames) {
    if (this.views && frames.some(({ number }) => number >= this.views.length)) {
      throw new VDIFileError(`the set is damaged: it has more VDIs than views; ${REMEDY}`);
    }
    this.#frames = frames;
    this.changed();
  }

  /**
   * Read a series from pieces that come one behind the other.
   *
   * @param {AsyncIterable} pieces Uint8Array or base64 text.
   * @param {(series: Series) => void} onSeries Called when its first step is there.
   * @returns {Promise<void>} When all has been read.
   * @throws {VDIFileError} If there is no step.
   */
  static async ofPieces(pieces, onSeries) {
    const bytes = new GrowingBytes();
    const found = [];
    let series = null, head = null, at = 0;
    const give = (frames) => {
      if (!frames.length || frames.length === series?.length) return;
      const begun = series !== null;
      series ??= new Series(head, async (place, size) =>
        bytes.whole.subarray(place, place + size));
      series.#take([...frames]);
      if (!begun) onSeries(series);
    };
    const look = (whole) => {
      head ??= headOf(bytes.whole);
      if (!head) return;
      at = findFrames(bytes.whole, found, Math.max(at, head.begin), whole);
      give(found);
    };
    for await (const piece of pieces) {
      bytes.push(piece);
      look(false);
    }
    const place = indexPlace(bytes.whole.subarray(-TRAILER_BYTES), bytes.whole.length);
    const indexed = head && place >= 0 &&
      indexedFrames(bytes.whole.subarray(place), head.begin, place);
    if (indexed) give(indexed);
    else look(true);
    if (!series) throw noStep();
    series.complete = true;
    series.changed();
  }

  /**
   * The series in a file that is read by parts.
   *
   * @param {object} file size; first: Uint8Array, its first bytes; read(begin, end): a promise of
   *   other ones.
   * @returns {Promise<Series|null>} null where it has no index, and must be read as a whole.
   */
  static async ofParts({ read, size, first }) {
    const whole = headBytes(first); // of a set of many views it is long
    const head = headOf(whole <= first.length || whole > size ? first : await read(0, whole));
    if (!head) return null;
    const tailAt = Math.max(0, size - first.length);
    let tail = tailAt === 0 ? first : await read(tailAt, size);
    const place = indexPlace(tail, size);
    if (place < 0) return null;
    tail = place < tailAt ? await read(place, size) : tail.subarray(place - tailAt);
    const frames = indexedFrames(tail, head.begin, place);
    if (!frames) return null;
    if (!frames.length) throw noStep();
    const kept = new Map(); // place -> promise of bytes; what was used last is last
    let bytes = 0;
    const series = new Series(head, (at, n) => {
      const known = kept.get(at) ?? read(at, at + n);
      bytes += kept.delete(at) ? 0 : n;
      kept.set(at, known);
      known.catch(() => { // it may be there when it is asked for again
        if (kept.delete(at)) bytes -= n;
      });
      for (const old of kept.keys()) {
        if (bytes <= MOST_FETCHED || old === at) break;
        kept.delete(old);
        bytes -= frames.find((frame) => frame.place === old).size;
      }
      return known;
    });
    series.#take(frames);
    series.complete = true;
    return series;
  }
}

function closedError() {
  return new DOMException("The series is closed.", "AbortError");
}

function noStep() {
  return new VDIFileError(
    "the series has no finished step: it was cut off, or none is written yet");
}
