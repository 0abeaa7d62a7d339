// A viewer whose VDIs a server makes: `pyvista-vdi serve`. docs/web.md, "Served", has the protocol.
//
// The viewer draws what it has. Where its view rests that is told to the server, which sends another
// VDI; that is swapped whole.
import { htmlElement, slider } from "./html.js";

/** Milliseconds without a movement after which a view rests. */
const VIEW_RESTS = 150;
/** Milliseconds until a lost connection is tried again: twice as long each time, up to the last. */
const FIRST_RETRY = 500, LAST_RETRY = 16000;
/** The server's longest edge of a picture, pixels. */
const LONGEST_EDGE = 8192;
/** Codes of a socket's end: the client has said something wrong; and none was said. */
const REFUSED = 1008, UNSAID = 1006;
/** Status of an ordinary request of the socket's address, and of one that is not let in. */
const NO_SOCKET = 426, FORBIDDEN = 403;

/**
 * The VDIs of a server, at the URL of a socket with the token, in a `<vdi-viewer>`.
 *
 * Events: `hello` (detail: what the server offers), `status` (detail: {doing, text}).
 */
export class RemoteVDI extends EventTarget {
  #socket = null;
  #incoming = null; // a VDI that comes, and how many of its bytes have
  #next = null; // the file of the last that has
  #showing = false;
  #said = new Map(); // the last message of each kind, said again to a new connection
  #resting = 0; // timers: until the view rests
  #retrying = 0; // and until the connection is tried again
  #retry = FIRST_RETRY;
  #closing = new AbortController();

  /** What the server offers; null before it has said so. */
  hello = null;
  received = { vdis: 0, bytes: 0 };

  constructor(viewer, url) {
    super();
    [this.viewer, this.url] = [viewer, url];
    const moved = () => {
      clearTimeout(this.#resting);
      this.#resting = setTimeout(() => this.#sendView(), VIEW_RESTS);
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
    clearTimeout(this.#resting);
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
      if (this.#closing.signal.aborted) return;
      const { why, forGood } = await whyNot(event, this.url);
      if (this.#closing.signal.aborted) return;
      const again = forGood ? "" : `; trying again in ${Math.ceil(this.#retry / 1000)} s`;
      this.#status(null, why + again);
      if (forGood) return;
      this.#retrying = setTimeout(() => this.#connect(), this.#retry);
      this.#retry = Math.min(2 * this.#retry, LAST_RETRY);
    };
  }

  #hear(message) {
    const { viewer } = this;
    if (message.type === "hello") {
      if (this.hello === null) viewer.home = message.camera;
      viewer.camera ??= message.camera; // where no link has said another
      this.hello = message;
      this.#status(null, "");
      this.dispatchEvent(new CustomEvent("hello", { detail: message })); // a panel may take room
      this.#said.forEach((said) => this.#send(said));
      this.#sendView();
    } else if (message.type === "vdi") {
      this.#retry = FIRST_RETRY; // not at once: a server may fail whenever it is asked for one
      // One that has not come whole is given up by the server
      this.#incoming = { file: new Uint8Array(message.bytes), filled: 0 };
    } else if (message.type === "status") this.#status(message.doing, "");
    else if (message.type === "error") this.#status(null, message.message);
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
    for (let file; (file = this.#next) !== null;) {
      this.#next = null;
      try {
        await this.viewer.load(file);
        this.received.vdis += 1;
      } catch (error) {
        this.#status(null, error.message);
      }
    }
    this.#showing = false;
  }

  #sendView() {
    if (!this.#isHeard) return;
    const { clientWidth, clientHeight, camera } = this.viewer;
    delete camera.window_center; // of the picture, not of the view
    const density = globalThis.devicePixelRatio || 1;
    const size = [clientWidth, clientHeight].map((edge) =>
      Math.min(LONGEST_EDGE, Math.max(1, Math.round(edge * density))));
    clearTimeout(this.#resting);
    this.#send({ type: "view", camera, size });
  }

  get #isHeard() {
    return this.hello !== null && this.#socket.readyState === WebSocket.OPEN;
  }

  #send(message) {
    this.#socket.send(JSON.stringify(message));
  }

  #say(message) {
    this.#said.set(message.type, message);
    if (this.#isHeard) this.#send(message);
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

// Plain controls of what the server offers; `complain` is told what is wrong.
function controlsOf(remote, { cmaps, opacities, look, range, steps }, complain) {
  const labelled = (text, ...inputs) => htmlElement("label", {}, text, ...inputs);
  const choice = (label, names, value) => {
    const known = names.includes(value);
    const option = (name, more) => htmlElement("option", more, name);
    const select = htmlElement("select", { label }, ...(known ? [] : [option("as started", { value: "" })]),
      ...names.map((name) => option(name)));
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
    const limits = { min: 0, max: steps - 1, value: 0 };
    controls.push(labelled("Time", slider("Time step", limits, (step) => remote.setStep(step))));
  }
  return controls;
}

/** Connect a page's viewer to the server that the page came from; return the connection. */
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
    else if (!offered) panel.replaceChildren(...controlsOf(remote, detail, (wrong) => say({ wrong })));
    offered = offer;
  });
  remote.addEventListener("status", ({ detail: { text, doing } }) =>
    say({ going: text || (doing === "vdi" ? "making a VDI of this view" : "") }));
  return remote;
}
