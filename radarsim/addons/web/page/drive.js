// Driving: keys, touch stick and gamepad become orders, repeated while they are held.

import { isControl, isTyping } from "./elements.js";

const PERIOD = 150; // ms between orders; the commander stops a robot 400 ms after the last
const DEAD_ZONE = 0.15; // of a stick of a gamepad
const KEYS = { KeyW: [1, 0], KeyS: [-1, 0], KeyA: [0, 0.5], KeyD: [0, -0.5] };

export class Drive {
  /** Drive the robot that `chosen` returns; `halt` stops everything. */
  constructor(link, chosen, halt) {
    Object.assign(this, { link, chosen, halt });
    this.held = new Set();
    this.stick = [0, 0];
    this.driven = null; // name of the robot of the last order that was not zero
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

  /** Let go of everything, and stop the robot at once if it was driven. */
  release() {
    this.held.clear();
    this.stick = [0, 0];
    if (!this.driven) return;
    this.link.send("drive", { robot: this.driven, v: 0, w: 0 });
    this.driven = null;
  }

  /** Forget a robot that is gone; return whether it was driven. */
  forget(robot) {
    const driven = this.driven === robot;
    if (driven) {
      this.held.clear();
      this.driven = null;
    }
    return driven;
  }

  /** Send what is held, or once that nothing is any more. */
  order() {
    const [v, w] = this.wanted();
    const robot = this.chosen();
    if (this.driven && this.driven !== robot) this.release();
    if (!robot || (!v && !w && !this.driven)) return;
    this.link.send("drive", { robot, v, w });
    this.driven = v || w ? robot : null;
  }

  /** Return what is wanted: ahead and counter-clockwise, -1 to 1 of the top speed. */
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

/** Make an element a stick for touch: up is ahead; it springs back. */
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
