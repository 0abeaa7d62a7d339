// A series or a set in a page: a JSON and numbered .vdi files in a ZIP (docs/series.md).
import { GrowingBytes, REMEDY, VDIFileError } from "./bytes.js";
import { checkedMember, isCamera, membersOf } from "./decode.js";
import { withWorker } from "./port.js";

/** The JSON's name, and its entry that has one item for each VDI. */
const LISTED = { "series.json": "times", "set.json": "views" };
/** Where a ZIP has its first member's name. */
const NAME_AT = 30;
/** Bytes that tell what a file is. */
export const BEGIN = 64;
/** Decoded VDIs that are kept. */
const KEPT = 6;

const nameOf = (i) => `${String(i).padStart(6, "0")}.vdi`;

/** Whether bytes are the beginning of a series' ZIP, or of a set's. */
export function beginsAsSeries(bytes) {
  const text = String.fromCharCode(...bytes.subarray(NAME_AT, BEGIN));
  return Object.keys(LISTED).some((name) => text.startsWith(name));
}

/** The VDIs of one scene at several times, or from several views. */
export class Series {
  #read; // async (i) -> the bytes of a VDI's file, which may be handed over
  #times;

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

  /** A VDI as prepare.js makes it; a VDIFileError names the step. */
  async prepared(i, signal) {
    try {
      return await withWorker(signal, async (ask) => {
        const file = await this.#read(i);
        let prepared;
        await ask({ file }, (data) => ({ prepared } = data), [file.buffer]);
        return prepared;
      });
    } catch (error) {
      if (!(error instanceof VDIFileError)) throw error;
      throw new VDIFileError(`${this.views ? "view" : "step"} ${i} cannot be shown: ${error.message}`);
    }
  }

  #take(length, complete = false) {
    [this.length, this.complete] = [Math.min(length, this.#times.length), complete];
    this.changed();
  }

  /**
   * Read a ZIP from its first bytes and the pieces that follow, bytes or base64 text; `onSeries` is
   * called when its first VDI is there.
   */
  static async ofPieces(first, pieces, onSeries) {
    const bytes = new GrowingBytes();
    const places = []; // where each VDI begins and ends
    let series = null, at = 0;
    const take = (piece) => {
      const known = places.length;
      bytes.push(piece);
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
    take(first);
    for await (const piece of pieces) take(piece);
    if (!places.length) {
      throw new VDIFileError("the series has no whole VDI: it was cut off, or none is written yet");
    }
    series.#take(places.length, true);
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

/** Decodes VDIs of a series before they are shown, one after the other. */
export class Ahead {
  #series;
  #host; // show(prepared, i) has one drawn; came(i): it is ready; broken(i, error): it cannot be
  #wanted = []; // indices
  #working = false;
  #stop = new AbortController();

  /** Index of the one that was handed to be drawn. */
  shown = -1;
  /** What prepare.js made, by index, that was shown last behind the others; and what cannot be. */
  ready = new Map();
  broken = new Set();

  constructor(series, host) {
    [this.#series, this.#host] = [series, host];
  }

  /** Show one that is ready. */
  show(i) {
    if (this.shown === i) return;
    this.shown = i;
    const prepared = this.ready.get(i);
    this.ready.delete(i);
    this.ready.set(i, prepared);
    this.#host.show(prepared, i);
  }

  /** Have some ready, the first one first; `again`: those that could not be, too. */
  want(indices, again = false) {
    this.#wanted = indices;
    if (again) this.broken.clear();
    this.#work();
  }

  /** Give up what is being decoded, until something is wanted again. */
  stop() {
    this.#stop.abort();
    this.#stop = new AbortController();
    this.#wanted = [];
  }

  async #work() {
    if (this.#working) return;
    this.#working = true;
    const known = (i) => this.ready.has(i) || this.broken.has(i);
    for (let i; (i = this.#wanted.find((each) => !known(each))) !== undefined;) {
      const { signal } = this.#stop;
      try {
        this.ready.set(i, await this.#series.prepared(i, signal));
      } catch (error) {
        if (signal.aborted) continue;
        this.broken.add(i);
        this.#host.broken(i, error);
        continue;
      }
      for (const old of this.ready.keys()) {
        if (this.ready.size <= KEPT) break;
        if (old !== this.shown && !this.#wanted.includes(old)) this.ready.delete(old);
      }
      this.#host.came(i);
    }
    this.#working = false;
  }
}
