// The WebSocket to the commander, which sends the token and reconnects when it is lost.

const FIRST_WAIT = 500; // ms
const LONGEST_WAIT = 4000;
const WRONG_TOKEN = 4401;

export class Link extends EventTarget {
  /** Open a connection. Fires `message` (detail: the message) and `state` (detail: text). */
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

  /** Send a message; return false if there is no connection. */
  send(op, fields = {}) {
    if (this.socket.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify({ op, ...fields }));
    return true;
  }
}

/** Move the token from the address bar to the session storage, for reloads of the tab. */
function takeToken() {
  const given = new URLSearchParams(location.hash.slice(1)).get("token");
  try {
    if (given) {
      sessionStorage.setItem("token", given);
      history.replaceState(null, "", location.pathname);
    }
    return given ?? sessionStorage.getItem("token") ?? "";
  } catch {
    return given ?? ""; // storage is forbidden, so the address keeps the token
  }
}
