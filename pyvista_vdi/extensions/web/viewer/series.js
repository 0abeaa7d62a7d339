// A series or a set in a page: a JSON and numbered .vdi files, in a ZIP or a folder (docs/series.md).
import { checkedMember, isCamera, membersOf } from "./decode.js";
import { askPort, decodingPort } from "./port.js";
import { GrowingBytes, REMEDY, VDIFileError } from "./unpack.js";

/** The JSON's name, and its entry that has one item for each VDI. */
const LISTED = { "series.json": "times", "set.json": "views" };
/** Where a ZIP has its first member's name. */
const NAME_AT = 30;
/** Bytes that tell what a file is. */
export const BEGIN = 64;

const nameOf = (i) => `${String(i).padStart(6, "0")}.vdi`;

/** Whether bytes, or base64 text, are the beginning of a series' ZIP, or of a set's. */
export function beginsAsSeries(piece) {
  const text = typeof piece === "string" ? atob(piece.trimStart().slice(0, BEGIN)) :
    String.fromCharCode(...piece.subarray(0, BEGIN));
  return Object.keys(LISTED).some((name) => text.startsWith(name, NAME_AT));
}

/** The VDIs of one scene at several times, or from several views. */
export class Series {
  #read; // async (i) -> the bytes of a VDI's file, which may be handed over
  #times;
  #of; // what one is called
  #port = null; // a promise
  #last = Promise.resolve(); // of what was asked for
  #closing = () => {}; // rejects what is being decoded
  #era = 0; // how often it was closed

  /** How many VDIs there are, by now. */
  length = 0;
  /** Whether all that there will be are there. */
  complete = false;
  /** Called when there are more. */
  changed = () => {};

  /** Of a set the V_Os' cameras; else null, as the two that follow. */
  views = null;
  bounds = null;
  camera = null;

  constructor(name, text, read) {
    const head = headOf(name, text);
    this.#read = read;
    this.#of = head.views ? "view" : "step";
    this.#times = head.times ?? head.views.map((_, i) => i);
    if (head.views) ({ views: this.views, bounds: this.bounds, camera: this.camera } = head);
  }

  /** The steps' times, ascending. */
  get times() {
    return this.#times.slice(0, this.length);
  }

  /** The index of the step nearest in time; of two, the earlier. */
  nearest(time) {
    const far = this.times.map((at) => Math.abs(at - time));
    return far.indexOf(Math.min(...far));
  }

  /**
   * A VDI as prepare.js makes it; one is decoded after the other.
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

  /** End the worker; the next VDI that is asked for starts another. */
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
    try {
      const file = await unlessClosed(this.#read(i));
      const port = await unlessClosed(this.#port ??= decodingPort());
      let prepared;
      await unlessClosed(askPort(port, { file }, (data) => ({ prepared } = data), [file.buffer]));
      return prepared;
    } catch (error) {
      if (!(error instanceof VDIFileError)) throw error;
      throw new VDIFileError(`${this.#of} ${i} cannot be shown: ${error.message}`);
    }
  }

  #take(length, complete = false) {
    [this.length, this.complete] = [Math.min(length, this.#times.length), complete];
    this.changed();
  }

  /**
   * Read a ZIP from pieces that come one behind the other.
   *
   * @param {AsyncIterable} pieces Uint8Array or base64 text.
   * @param {(series: Series) => void} onSeries Called when its first VDI is there.
   * @returns {Promise<void>} When all has been read.
   * @throws {VDIFileError} If there is no VDI.
   */
  static async ofPieces(pieces, onSeries) {
    const bytes = new GrowingBytes();
    const places = []; // where each VDI begins and ends
    let series = null, at = 0;
    const look = () => {
      const known = places.length;
      for (const member of membersOf(bytes.whole.subarray(at), true)) {
        const begin = member.bytes.byteOffset, end = begin + member.bytes.length;
        if (!series) {
          series = new Series(member.name, checkedMember(member),
            async (i) => bytes.whole.slice(...places[i]));
        } else if (member.name === nameOf(places.length)) places.push([begin, end]);
        at = end;
      }
      if (places.length === known) return;
      series.#take(places.length);
      if (!known) onSeries(series);
    };
    for await (const piece of pieces) {
      bytes.push(piece);
      look();
    }
    if (!places.length) {
      throw new VDIFileError("the series has no whole VDI: it was cut off, or none is written yet");
    }
    series.#take(places.length, true);
  }

  /**
   * The series or set in a folder, of which each VDI is read when it is asked for.
   *
   * @param {string} name Of the JSON: "series.json" or "set.json".
   * @param {(name: string) => Promise<Uint8Array>} read Returns the bytes of one of the files.
   * @returns {Promise<Series>}
   */
  static async ofFolder(name, read) {
    const series = new Series(name, await read(name), (i) => read(nameOf(i)));
    if (!series.#times.length) throw new VDIFileError("the series has no step yet");
    series.#take(Infinity, true);
    return series;
  }
}

// What the JSON says, checked.
function headOf(name, text) {
  let head = null;
  try {
    head = JSON.parse(new TextDecoder().decode(text));
  } catch { /* said below */ }
  const format = `pyvista-vdi-${name.replace(".json", "")}`;
  const listed = head?.[LISTED[name]];
  if (head?.format !== format || !Array.isArray(listed)) {
    throw new VDIFileError(`this is no series of VDIs: its ${name} is not that of one; ${REMEDY}`);
  }
  if (head.version !== 1) {
    throw new VDIFileError(
      `the series is of version ${head.version}, and this viewer reads version 1`);
  }
  const finite = (list) => list.every(Number.isFinite);
  const good = head.views ? [...listed, head.camera].every(isCamera) && listed.length > 0 &&
    Array.isArray(head.bounds) && head.bounds.length === 6 && finite(head.bounds) : finite(listed);
  if (!good) throw new VDIFileError(`the series is damaged: its ${name} says what cannot be; ${REMEDY}`);
  return head;
}

function closedError() {
  return new DOMException("The series is closed.", "AbortError");
}
