// The controls of time: pause, step and speed, and the timeline of a recording.

import { byId, setText } from "./elements.js";

const STEP = 0.1; // s, as most scanners scan ten times a second
const PAUSE = 100; // ms between two requests while the timeline is dragged

export class TimePanel {
  constructor(world, link) {
    Object.assign(this, { world, link, timer: 0 });
    this.slider = byId("seek");
    byId("pause").addEventListener("click", () => this.toggle());
    byId("step").addEventListener("click", () => this.step());
    byId("speed").addEventListener("change", ({ target }) => link.send("pace", { speed: Number(target.value) }));
    this.slider.addEventListener("input", () => this.seek());
  }

  /** Pause or resume. */
  toggle() {
    if (!this.world.time.refusal) this.link.send("pace", { paused: !this.world.time.paused });
  }

  /** Step by the time of one scan, and pause. */
  step() {
    if (!this.world.time.refusal) this.link.send("pace", { step: STEP });
  }

  /** Jump to the time of the dragged timeline, at most once in each pause. */
  seek() {
    this.timer ||= setTimeout(() => {
      this.timer = 0;
      this.link.send("seek", { t: this.slider.valueAsNumber });
    }, PAUSE);
  }

  /** Show speed and pause from the message `time`, which all browsers receive. */
  take() {
    const { refusal, paused, speed, start, end } = this.world.time;
    for (const name of ["pause", "step", "speed"]) {
      byId(name).disabled = Boolean(refusal);
      byId(name).title = refusal || byId(name).dataset.title;
    }
    byId("clock").dataset.state = paused ? "paused" : "running";
    const word = paused ? (end === null ? "Resume" : "Play") : "Pause";
    setText(byId("pause").lastElementChild, word);
    byId("pause").setAttribute("aria-label", word);
    this.showSpeed(speed);
    byId("timeline").hidden = end === null;
    if (end === null) return;
    this.slider.min = start;
    this.slider.max = end;
    setText(byId("end"), `${end.toFixed(1)} s`);
  }

  /** Show a speed; a speed that is not in the list, such as of a server, is added to it. */
  showSpeed(speed) {
    const select = byId("speed");
    const known = [...select.options].some((option) => Number(option.value) === speed);
    if (!known) select.add(new Option(`× ${+speed.toPrecision(3)}`, String(speed)));
    select.value = String(speed);
  }

  update() {
    const t = this.world.frame.t ?? 0;
    const { paused, end } = this.world.time;
    setText(byId("time"), `${t.toFixed(paused ? 2 : 1)} s${paused ? ", paused" : ""}`);
    if (end !== null && !this.timer) {
      this.slider.value = t;
      this.slider.setAttribute("aria-valuetext", `${t.toFixed(1)} s`);
    }
  }
}
