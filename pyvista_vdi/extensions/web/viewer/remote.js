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

/** The VDIs of a server, at the URL of a socket with the token, in a `<vdi-viewer>`. */
class RemoteVDI {
  #socket = null;
  #incoming = null; // a VDI that comes, and how many of its bytes have
  #next = null; // the file of the last that has
  #showing = false;
  #step = 0; // said again to a new connection
  #host;
  #resting = 0; // a timer: until the view rests
  #retry = FIRST_RETRY;

  /** What the server offers; null before it has said so. */
  hello = null;
  received = 0; // VDIs

  /** Of the host `offered(hello)` is called when the server has said so, `says(text)` for a line. */
  constructor(viewer, url, host) {
    [this.viewer, this.url, this.#host] = [viewer, url, host];
    const moved = () => {
      clearTimeout(this.#resting);
      this.#resting = setTimeout(() => this.#sendView(), VIEW_RESTS);
    };
    new ResizeObserver(moved).observe(viewer);
    viewer.addEventListener("camerachange", moved);
    this.#connect();
  }

  /** Show a time step, counted from 0. */
  setStep(step) {
    this.#step = step;
    if (this.#isHeard) this.#send({ type: "time", step });
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
      const { why, forGood } = await whyNot(event, this.url);
      const again = forGood ? "" : `; trying again in ${Math.ceil(this.#retry / 1000)} s`;
      this.#host.says(why + again);
      if (forGood) return;
      setTimeout(() => this.#connect(), this.#retry);
      this.#retry = Math.min(2 * this.#retry, LAST_RETRY);
    };
  }

  #hear(message) {
    const { viewer } = this;
    if (message.type === "hello") {
      if (this.hello === null) viewer.home = message.camera;
      viewer.camera ??= message.camera; // where no link has said another
      this.hello = message;
      this.#host.says("");
      this.#host.offered(message); // a panel may take room
      if (this.#step) this.setStep(this.#step);
      this.#sendView();
    } else if (message.type === "vdi") {
      this.#retry = FIRST_RETRY; // not at once: a server may fail whenever it is asked for one
      // One that has not come whole is given up by the server
      this.#incoming = { file: new Uint8Array(message.bytes), filled: 0 };
    } else if (message.type === "status") {
      this.#host.says(message.doing === "vdi" ? "making a VDI of this view" : "");
    } else if (message.type === "error") this.#host.says(message.message);
  }

  #take(part) {
    const incoming = this.#incoming;
    if (incoming === null || incoming.filled + part.length > incoming.file.length) return;
    incoming.file.set(part, incoming.filled);
    incoming.filled += part.length;
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
        this.received += 1;
      } catch (error) {
        this.#host.says(error.message);
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

/** Connect a page's viewer to the server that the page came from; return the connection. */
export function connectPage(viewer, panel, line) {
  const url = new URL("socket", location.href);
  url.protocol = location.protocol === "https:" ? "wss:" : "ws:";
  url.search = location.search;
  let known = "";
  const remote = new RemoteVDI(viewer, url.href, {
    says: (text) => (line.textContent = text),
    offered(hello) {
      const offer = JSON.stringify(hello), limits = { min: 0, max: hello.steps - 1, value: 0 };
      if (known && offer !== known) location.reload(); // another volume is served there by now
      else if (!known && hello.steps > 1) {
        const time = slider("Time step", limits, (step) => remote.setStep(step));
        panel.replaceChildren(htmlElement("label", {}, "Time", time));
      }
      known = offer;
    },
  });
  return remote;
}
