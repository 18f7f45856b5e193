// Drives a robot by keys, touch stick and gamepad; commands repeat while they are held.

import { isControl, isTyping } from "./elements.js";

const PERIOD = 150; // ms between commands; a robot stops 400 ms after the last command
const DEAD_ZONE = 0.15; // deflection of a gamepad stick that is ignored
const KEYS = { KeyW: [1, 0], KeyS: [-1, 0], KeyA: [0, 0.5], KeyD: [0, -0.5] };

export class Drive {
  /** Drive the robot whose name `chosen` returns; `halt` stops all robots. */
  constructor(link, chosen, halt) {
    Object.assign(this, { link, chosen, halt });
    this.held = new Set();
    this.stick = [0, 0];
    this.driven = null; // name of the robot of the last command that was not zero
    addEventListener("keydown", (event) => this.press(event));
    addEventListener("keyup", (event) => this.lift(event));
    addEventListener("blur", () => this.release());
    document.addEventListener("visibilitychange", () => document.hidden && this.release());
    addEventListener("pagehide", () => this.release());
    setInterval(() => this.order(), PERIOD);
  }

  press(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.code === "Escape" || (event.code === "Space" && !isControl(event.target))) {
      event.preventDefault();
      this.halt();
    } else if (KEYS[event.code] && !isTyping(event.target)) {
      event.preventDefault();
      if (event.repeat) return; // after a stop, the key has to be pressed again
      this.held.add(event.code);
      this.order();
    }
  }

  lift(event) {
    if (this.held.delete(event.code)) this.order();
  }

  /** Release all keys and the stick, and stop the driven robot at once. */
  release() {
    this.held.clear();
    this.stick = [0, 0];
    if (!this.driven) return;
    this.link.send("drive", { robot: this.driven, v: 0, w: 0 });
    this.driven = null;
  }

  /** Stop driving a robot that was removed; return whether it was driven. */
  forget(robot) {
    const driven = this.driven === robot;
    if (driven) {
      this.held.clear();
      this.driven = null;
    }
    return driven;
  }

  /** Send a drive command while keys or sticks are held, and one stop afterwards. */
  order() {
    const [v, w] = this.wanted();
    const robot = this.chosen();
    if (this.driven && this.driven !== robot) this.release();
    if (!robot || (!v && !w && !this.driven)) return;
    this.link.send("drive", { robot, v, w });
    this.driven = v || w ? robot : null;
  }

  /** Return forward speed and turn rate to the left, as shares of the top speeds, -1 to 1. */
  wanted() {
    const pad = readGamepad();
    let [v, w] = [this.stick[0] + pad[0], this.stick[1] + pad[1]];
    for (const key of this.held) {
      v += KEYS[key][0];
      w += KEYS[key][1];
    }
    return [v, w].map((part) => Math.min(Math.max(part, -1), 1));
  }
}

function readGamepad() {
  const pad = [...(navigator.getGamepads?.() ?? [])].find((one) => one?.connected);
  if (!pad || document.hidden || !document.hasFocus()) return [0, 0];
  const bare = (value) => (Math.abs(value) < DEAD_ZONE ? 0 : -value);
  return [bare(pad.axes[1] ?? 0), bare(pad.axes[0] ?? 0)];
}

/** Make an element a touch stick: up drives ahead; it returns to the centre on release. */
export function followStick(pad, drive) {
  const knob = pad.firstElementChild;
  const set = (ahead, left) => {
    drive.stick = [ahead, left];
    const reach = pad.clientWidth / 3;
    knob.style.transform = `translate(${-left * reach}px, ${-ahead * reach}px)`;
    drive.order();
  };
  const follow = (event) => {
    const box = pad.getBoundingClientRect();
    const [right, down] = [event.clientX - box.x - box.width / 2, event.clientY - box.y - box.height / 2];
    const reach = Math.max(box.width / 2, Math.hypot(right, down));
    set(-down / reach, -right / reach);
  };
  pad.addEventListener("pointerdown", (event) => {
    pad.setPointerCapture(event.pointerId);
    follow(event);
  });
  pad.addEventListener("pointermove", (event) => pad.hasPointerCapture(event.pointerId) && follow(event));
  for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
    pad.addEventListener(end, () => set(0, 0));
  }
}
