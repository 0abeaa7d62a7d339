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
  /**
   * @param {HTMLElement} viewer - A `<vdi-viewer>`.
   * @param {string} url - Of the socket, with the token.
   */
  constructor(viewer, url) {
    super();
    this.viewer = viewer;
    this.url = url;
    this.hello = null;
    this.received = { vdis: 0, bytes: 0 };
    this._said = new Map(); // the last message of each kind, said again to a new connection
    this._retry = FIRST_RETRY;
    this._showing = false;
    this._next = null;
    this._restTimer = 0;
    this._onCamera = () => this._viewMoved();
    viewer.addEventListener("camerachange", this._onCamera);
    this._sizes = new ResizeObserver(this._onCamera);
    this._sizes.observe(viewer);
    this._connect();
  }

  /** Change the transfer function: {cmap, opacity, clim}; what is left out is the server's. */
  setLook(look) {
    this._say({ type: "look", ...look });
  }

  /** Show a time step, counted from 0. */
  setStep(step) {
    this._say({ type: "time", step });
  }

  /** End the connection for good. The viewer goes on drawing what it has. */
  close() {
    this.viewer.removeEventListener("camerachange", this._onCamera);
    this._sizes.disconnect();
    clearTimeout(this._restTimer);
    clearTimeout(this._retryTimer);
    this._closed = true;
    this._socket.close();
  }

  _connect() {
    const socket = new WebSocket(this.url);
    socket.binaryType = "arraybuffer";
    this._socket = socket;
    this._incoming = null;
    socket.onmessage = ({ data }) => {
      if (typeof data === "string") this._hear(JSON.parse(data));
      else this._take(new Uint8Array(data));
    };
    socket.onclose = async (event) => {
      const { why, forGood } = this._closed ? {} : await whyNot(event, this.url);
      if (this._closed) return;
      if (forGood) {
        this._status(null, why);
        return;
      }
      this._status(null, `${why}; trying again in ${Math.ceil(this._retry / 1000)} s`);
      this._retryTimer = setTimeout(() => this._connect(), this._retry);
      this._retry = Math.min(2 * this._retry, LAST_RETRY);
    };
  }

  _hear(message) {
    if (message.type === "hello") {
      const first = this.hello === null;
      this.hello = message;
      if (first) this.viewer.home = message.camera;
      if (first && !this.viewer.camera) this.viewer.camera = message.camera; // no link has said another
      this._status(null, "");
      this.dispatchEvent(new CustomEvent("hello", { detail: message })); // a panel may take room
      this._said.forEach((said) => this._send(said));
      this._sendView();
    } else if (message.type === "vdi") {
      this._retry = FIRST_RETRY; // not at once: a server may fail whenever it is asked for one
      // One that has not come whole is given up by the server
      this._incoming = { ...message, file: new Uint8Array(message.bytes), filled: 0 };
    } else if (message.type === "status") {
      this._status(message.doing, "");
    } else if (message.type === "error") {
      this._status(null, message.message);
    }
  }

  _take(part) {
    const incoming = this._incoming;
    if (incoming === null || incoming.filled + part.length > incoming.file.length) return;
    incoming.file.set(part, incoming.filled);
    incoming.filled += part.length;
    this.received.bytes += part.length;
    if (incoming.filled < incoming.file.length) return;
    this._incoming = null;
    this._next = incoming;
    if (!this._showing) this._show();
  }

  /** Decode and swap what has come, one after the other: the last one counts. */
  async _show() {
    this._showing = true;
    while (this._next !== null) {
      const { file } = this._next;
      this._next = null;
      try {
        await this.viewer.showBytes(file);
        this.received.vdis += 1;
      } catch (error) {
        this._status(null, error.message);
      }
    }
    this._showing = false;
  }

  _viewMoved() {
    clearTimeout(this._restTimer);
    this._restTimer = setTimeout(() => this._sendView(), VIEW_RESTS);
  }

  _sendView() {
    const { viewer } = this;
    if (this.hello === null || this._socket.readyState !== WebSocket.OPEN) return;
    const density = globalThis.devicePixelRatio || 1;
    const edge = (length) => Math.min(LONGEST_EDGE, Math.max(1, Math.round(length * density)));
    const size = [edge(viewer.clientWidth), edge(viewer.clientHeight)];
    const { position, focal_point, view_up, view_angle, parallel_scale } = viewer.camera;
    const lens = parallel_scale === undefined ? { view_angle } : { parallel_scale };
    const camera = { position, focal_point, view_up, ...lens };
    clearTimeout(this._restTimer);
    this._send({ type: "view", camera, size });
  }

  _send(message) {
    this._socket.send(JSON.stringify(message));
  }

  _say(message) {
    this._said.set(message.type, message);
    if (this.hello !== null && this._socket.readyState === WebSocket.OPEN) this._send(message);
  }

  _status(doing, text) {
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

/** Fill a panel with plain controls of what the server offers; `complain` is told what is wrong. */
function fillPanel(panel, remote, hello, complain) {
  const labelled = (text, ...inputs) => htmlElement("label", {}, text, ...inputs);
  const choice = (label, names, value) => {
    const options = names.map((name) => htmlElement("option", {}, name));
    const select = htmlElement("select", { label }, ...options);
    if (!names.includes(value)) select.prepend(htmlElement("option", { value: "" }, "as started"));
    select.value = names.includes(value) ? value : "";
    return select;
  };
  const controls = [];
  if (hello.cmaps.length > 0) {
    const cmap = choice("Colours", hello.cmaps, hello.look.cmap);
    const opacity = choice("Opacity", hello.opacities, hello.look.opacity);
    const [low, high] = hello.range.map((value, k) => htmlElement("input", {
      type: "number", step: "any", placeholder: String(value),
      label: `${["Lowest", "Highest"][k]} value of the range`,
    }));
    let clim; // the last that was one
    const takeRange = () => {
      const ends = [low, high].map((end, k) => (end.value ? Number(end.value) : hello.range[k]));
      const wrong = [low, high].some((end) => end.validity.badInput)
        ? "the range is two numbers"
        : ends[0] < ends[1] ? ""
        : `the range is from the lower value to the higher: ${ends[0]} is not below ${ends[1]}`;
      for (const end of [low, high]) {
        end.setCustomValidity(wrong);
        end.setAttribute("aria-invalid", wrong !== "");
      }
      complain(wrong);
      if (!wrong) clim = low.value || high.value ? ends : undefined;
      return !wrong;
    };
    const tell = () => {
      const look = { cmap: cmap.value, opacity: opacity.value, clim };
      remote.setLook(Object.fromEntries(Object.entries(look).filter(([, value]) => value)));
    };
    [cmap, opacity].forEach((input) => input.addEventListener("change", tell));
    for (const end of [low, high]) {
      end.addEventListener("change", () => takeRange() && tell());
      // What is wrong is right as soon as it is: of letters that are deleted there is no change
      end.addEventListener("input", () => end.validity.valid || (takeRange() && tell()));
    }
    controls.push(labelled("Colours", cmap), labelled("Opacity", opacity));
    controls.push(labelled("Range", low, high));
  }
  if (hello.steps > 1) {
    const time = htmlElement("input", {
      type: "range", min: 0, max: hello.steps - 1, value: 0, label: "Time step",
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
