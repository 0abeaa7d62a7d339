// A viewer whose VDIs a server makes: `pyvista-vdi serve`. docs/web.md, "Served", has the protocol.
//
// The viewer draws what it has. Where its view rests that is told to the server, which sends another
// VDI; that is swapped whole.
import { htmlElement } from "./html.js";

/** Milliseconds without a movement after which a view rests. */
const VIEW_RESTS = 150;
/** Milliseconds until a lost connection is tried again: twice as long each time, up to the last. */
const FIRST_RETRY = 500;
const LAST_RETRY = 16000;
/** The server's longest edge of a picture, pixels. */
const LONGEST_EDGE = 8192;
/** Why a server ends a connection for good: the client has said something wrong. */
const REFUSED = 1008;
/** Code of a connection that has ended, or was not made, without a word. */
const UNSAID = 1006;
/** Status of an ordinary request of the socket's address, and of one that is not let in. */
const NO_SOCKET = 426;
const FORBIDDEN = 403;

/**
 * The VDIs of a server in a viewer.
 *
 * Events: `hello` (detail: what the server offers), `status` (detail: {doing, text}).
 */
export class RemoteVDI extends EventTarget {
  #socket = null;
  #incoming = null; // a VDI that comes
  #next = null; // the file of the last that has
  #showing = false;
  #said = new Map(); // the last message of each kind, said again to a new connection
  #timer = 0; // until the view rests
  #retrying = 0; // another timer
  #retry = FIRST_RETRY;
  #closing = new AbortController();

  /** What the server offers; null before it has said so. */
  hello = null;
  received = { vdis: 0, bytes: 0 };

  /**
   * @param {HTMLElement} viewer - A `<vdi-viewer>`.
   * @param {string} url - Of the socket, with the token.
   */
  constructor(viewer, url) {
    super();
    [this.viewer, this.url] = [viewer, url];
    const moved = () => {
      clearTimeout(this.#timer);
      this.#timer = setTimeout(() => this.#sendView(), VIEW_RESTS);
    };
    const sizes = new ResizeObserver(moved), { signal } = this.#closing;
    sizes.observe(viewer);
    signal.addEventListener("abort", () => sizes.disconnect());
    viewer.addEventListener("camerachange", moved, { signal });
    this.#connect();
  }

  /** Change the transfer function: {cmap, opacity, clim}; what is left out is the server's. */
  setLook(look) {
    this.#say({ type: "look", ...look });
  }

  /** Show a time step, counted from 0. */
  setStep(step) {
    this.#say({ type: "time", step });
  }

  /** End the connection for good. The viewer goes on drawing what it has. */
  close() {
    this.#closing.abort();
    clearTimeout(this.#timer);
    clearTimeout(this.#retrying);
    this.#socket.close();
  }

  #connect() {
    const socket = this.#socket = new WebSocket(this.url);
    socket.binaryType = "arraybuffer";
    this.#incoming = null;
    socket.onmessage = ({ data }) => {
      if (typeof data === "string") this.#hear(JSON.parse(data));
      else this.#take(new Uint8Array(data));
    };
    socket.onclose = async (event) => {
      const { why, forGood } = this.#closing.signal.aborted ? {} : await whyNot(event, this.url);
      if (this.#closing.signal.aborted) return;
      if (forGood) {
        this.#status(null, why);
        return;
      }
      this.#status(null, `${why}; trying again in ${Math.ceil(this.#retry / 1000)} s`);
      this.#retrying = setTimeout(() => this.#connect(), this.#retry);
      this.#retry = Math.min(2 * this.#retry, LAST_RETRY);
    };
  }

  #hear(message) {
    const { viewer } = this;
    if (message.type === "hello") {
      const first = this.hello === null;
      this.hello = message;
      if (first) viewer.home = message.camera;
      if (first && !viewer.camera) viewer.camera = message.camera; // no link has said another
      this.#status(null, "");
      this.dispatchEvent(new CustomEvent("hello", { detail: message })); // a panel may take room
      this.#said.forEach((said) => this.#send(said));
      this.#sendView();
    } else if (message.type === "vdi") {
      this.#retry = FIRST_RETRY; // not at once: a server may fail whenever it is asked for one
      // One that has not come whole is given up by the server
      this.#incoming = { file: new Uint8Array(message.bytes), filled: 0 };
    } else if (message.type === "status") {
      this.#status(message.doing, "");
    } else if (message.type === "error") {
      this.#status(null, message.message);
    }
  }

  #take(part) {
    const incoming = this.#incoming;
    if (incoming === null || incoming.filled + part.length > incoming.file.length) return;
    incoming.file.set(part, incoming.filled);
    incoming.filled += part.length;
    this.received.bytes += part.length;
    if (incoming.filled < incoming.file.length) return;
    [this.#incoming, this.#next] = [null, incoming.file];
    if (!this.#showing) this.#show();
  }

  // Decode and swap what has come, one after the other: the last one counts.
  async #show() {
    this.#showing = true;
    while (this.#next !== null) {
      const file = this.#next;
      this.#next = null;
      try {
        await this.viewer.showBytes(file);
        this.received.vdis += 1;
      } catch (error) {
        this.#status(null, error.message);
      }
    }
    this.#showing = false;
  }

  #sendView() {
    const { viewer } = this;
    if (!this.#listens) return;
    const density = globalThis.devicePixelRatio || 1;
    const edge = (length) => Math.min(LONGEST_EDGE, Math.max(1, Math.round(length * density)));
    const size = [edge(viewer.clientWidth), edge(viewer.clientHeight)];
    const { position, focal_point, view_up, view_angle, parallel_scale } = viewer.camera;
    const lens = parallel_scale === undefined ? { view_angle } : { parallel_scale };
    clearTimeout(this.#timer);
    this.#send({ type: "view", camera: { position, focal_point, view_up, ...lens }, size });
  }

  get #listens() {
    return this.hello !== null && this.#socket.readyState === WebSocket.OPEN;
  }

  #send(message) {
    this.#socket.send(JSON.stringify(message));
  }

  #say(message) {
    this.#said.set(message.type, message);
    if (this.#listens) this.#send(message);
  }

  #status(doing, text) {
    this.dispatchEvent(new CustomEvent("status", { detail: { doing, text } }));
  }
}

// Why there is no connection, and whether there will be none. Of a socket that is refused a browser
// says nothing; an ordinary request of its address is told.
async function whyNot({ code, reason }, url) {
  if (reason || code !== UNSAID) {
    return { why: reason || "the connection was lost", forGood: code === REFUSED };
  }
  try {
    const signal = AbortSignal.timeout(LAST_RETRY);
    const answer = await fetch(url.replace(/^ws/, "http"), { cache: "no-store", signal });
    if (answer.status === NO_SOCKET) return { why: "the connection was lost" };
    return { why: (await answer.text()).trim(), forGood: answer.status === FORBIDDEN };
  } catch {
    return { why: "no connection to the server" };
  }
}

// Fill a panel with plain controls of what the server offers; `complain` is told what is wrong.
function fillPanel(panel, remote, { cmaps, opacities, look, range, steps }, complain) {
  const labelled = (text, ...inputs) => htmlElement("label", {}, text, ...inputs);
  const choice = (label, names, value) => {
    const known = names.includes(value);
    const options = names.map((name) => htmlElement("option", {}, name));
    const select = htmlElement("select", { label }, ...options);
    if (!known) select.prepend(htmlElement("option", { value: "" }, "as started"));
    select.value = known ? value : "";
    return select;
  };
  const controls = [];
  if (cmaps.length > 0) {
    const cmap = choice("Colours", cmaps, look.cmap), opacity = choice("Opacity", opacities, look.opacity);
    const ends = range.map((value, k) => htmlElement("input", { type: "number", step: "any",
      placeholder: String(value), label: `${["Lowest", "Highest"][k]} value of the range` }));
    let clim; // the last that was one
    const tell = ({ target }) => {
      const [low, high] = ends.map((end, k) => (end.value ? Number(end.value) : range[k]));
      const wrong = ends.some((end) => end.validity.badInput) ? "the range is two numbers" : low < high
        ? "" : `the range is from the lower value to the higher: ${low} is not below ${high}`;
      for (const end of ends) {
        end.setCustomValidity(wrong);
        end.setAttribute("aria-invalid", wrong !== "");
      }
      complain(wrong);
      if (wrong && ends.includes(target)) return;
      if (!wrong) clim = ends.some((end) => end.value) ? [low, high] : undefined;
      const wanted = Object.entries({ cmap: cmap.value, opacity: opacity.value, clim });
      remote.setLook(Object.fromEntries(wanted.filter(([, value]) => value)));
    };
    for (const input of [cmap, opacity, ...ends]) input.addEventListener("change", tell);
    // What is wrong is right as soon as it is: of letters that are deleted there is no change
    for (const end of ends) end.addEventListener("input", (event) => end.validity.valid || tell(event));
    controls.push(labelled("Colours", cmap), labelled("Opacity", opacity), labelled("Range", ...ends));
  }
  if (steps > 1) {
    const time = htmlElement("input", {
      type: "range", min: 0, max: steps - 1, value: 0, label: "Time step",
    });
    time.addEventListener("input", () => remote.setStep(Number(time.value)));
    controls.push(labelled("Time", time));
  }
  panel.replaceChildren(...controls);
}

/**
 * Connect a page's viewer to the server that the page came from.
 *
 * @param {HTMLElement} viewer - A `<vdi-viewer>`.
 * @param {HTMLElement} panel - Gets the controls.
 * @param {HTMLElement} line - Gets what goes on, as text.
 * @returns {RemoteVDI} The connection.
 */
export function connectPage(viewer, panel, line) {
  const url = new URL("socket", location.href);
  url.protocol = location.protocol === "https:" ? "wss:" : "ws:";
  url.search = location.search;
  const remote = new RemoteVDI(viewer, url.href);
  const said = { wrong: "", going: "" };
  const say = (what) => {
    Object.assign(said, what);
    line.textContent = [said.wrong, said.going].filter(Boolean).join("; ");
  };
  let offered = "";
  remote.addEventListener("hello", ({ detail }) => {
    const offer = JSON.stringify(detail);
    if (offered && offer !== offered) location.reload(); // another volume is served there by now
    else if (!offered) fillPanel(panel, remote, detail, (wrong) => say({ wrong }));
    offered = offer;
  });
  const words = { vdi: "making a VDI of this view" };
  remote.addEventListener("status", ({ detail }) => {
    say({ going: detail.text || words[detail.doing] || "" });
  });
  return remote;
}
