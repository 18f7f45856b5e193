// The connection to the commander: opens with the token, and opens again when lost.

const FIRST_WAIT = 500; // ms
const LONGEST_WAIT = 4000;
const WRONG_TOKEN = 4401;

export class Link extends EventTarget {
  /** Open a connection. Events: `message` (detail: the message), `state` (detail: text). */
  constructor() {
    super();
    this.token = takeToken();
    this.wait = FIRST_WAIT;
    this.open();
  }

  open() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    this.socket = new WebSocket(`${scheme}://${location.host}/ws`);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => {
      this.tell("open");
      this.send("hello", { token: this.token });
    };
    this.socket.onmessage = ({ data }) => this.receive(data);
    this.socket.onclose = ({ code }) => this.reopen(code);
  }

  receive(data) {
    this.wait = FIRST_WAIT;
    const detail = typeof data === "string" ? JSON.parse(data) : data;
    this.dispatchEvent(new CustomEvent("message", { detail }));
  }

  reopen(code) {
    if (code === WRONG_TOKEN) {
      this.tell("refused");
      return;
    }
    this.tell("lost");
    setTimeout(() => this.open(), this.wait);
    this.wait = Math.min(2 * this.wait, LONGEST_WAIT);
  }

  tell(detail) {
    this.dispatchEvent(new CustomEvent("state", { detail }));
  }

  /** Send a message; return whether there is a connection. */
  send(op, fields = {}) {
    if (this.socket.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify({ op, ...fields }));
    return true;
  }
}

/** Take the token out of the address bar, and keep it for reloads of this tab. */
function takeToken() {
  const given = new URLSearchParams(location.hash.slice(1)).get("token");
  try {
    if (given) {
      sessionStorage.setItem("token", given);
      history.replaceState(null, "", location.pathname);
    }
    return given ?? sessionStorage.getItem("token") ?? "";
  } catch {
    return given ?? ""; // storage may be forbidden; the address then keeps the token
  }
}
