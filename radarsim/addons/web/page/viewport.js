// The part of the map that a canvas shows, which pointer, wheel and keys move and zoom.

const MARGIN = 14; // px around a fitted extent
const STILL = 5; // px; a pointer that moves less makes a click, not a drag
const STEP = 1.3;
const LIMITS = [2, 4000]; // px per metre

export class Viewport extends EventTarget {
  /**
   * Fires `change`, `tap` (detail: {x, y, shift, heading}, m and rad) and `hover`
   * (detail: [x, y] or null). A drag while `turning` is true, or with Shift, gives a tap
   * with a heading; other drags move the map.
   */
  constructor(canvas, covered) {
    super();
    this.canvas = canvas;
    this.covered = covered; // returns the covered heights at top and bottom, px
    this.scale = 40; // px per metre
    this.centre = [0, 0];
    this.fitted = true; // false once the user has moved the map
    this.measure();
    this.pointers = new Map();
    this.moved = 0;
    this.turning = false;
    this.aim = null; // [x, y, heading], m and rad, while a drag sets a heading
    canvas.addEventListener("pointerdown", (event) => this.press(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    for (const end of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(end, (event) => this.release(event));
    }
    canvas.addEventListener("pointerleave", () => this.hover(null));
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
  }

  /** Cache the size of the canvas, as reading it for each point would be slow. */
  measure() {
    this.size = [this.canvas.clientWidth, this.canvas.clientHeight];
  }

  /** Show an extent, [x0, y0, x1, y1], m, in the part of the canvas that is not covered. */
  fit([x0, y0, x1, y1]) {
    this.measure();
    const [width, height] = this.size;
    const [top, bottom] = this.covered();
    const across = (width - 2 * MARGIN) / Math.max(x1 - x0, 0.1);
    const up = (height - top - bottom - 2 * MARGIN) / Math.max(y1 - y0, 0.1);
    this.scale = Math.min(Math.max(Math.min(across, up), LIMITS[0]), LIMITS[1]);
    const lower = (top - bottom) / 2 / this.scale;
    this.centre = [(x0 + x1) / 2, (y0 + y1) / 2 + lower];
  }

  toScreen(x, y) {
    const [width, height] = this.size;
    return [
      width / 2 + (x - this.centre[0]) * this.scale,
      height / 2 - (y - this.centre[1]) * this.scale,
    ];
  }

  toWorld(left, top) {
    const [width, height] = this.size;
    return [
      this.centre[0] + (left - width / 2) / this.scale,
      this.centre[1] - (top - height / 2) / this.scale,
    ];
  }

  /** Zoom by a factor about a point of the canvas, by default its centre. */
  zoom(factor, left = this.size[0] / 2, top = this.size[1] / 2) {
    const [x, y] = this.toWorld(left, top);
    this.scale = Math.min(Math.max(this.scale * factor, LIMITS[0]), LIMITS[1]);
    const [nowX, nowY] = this.toWorld(left, top);
    this.centre = [this.centre[0] + x - nowX, this.centre[1] + y - nowY];
    this.change();
  }

  zoomIn() {
    this.zoom(STEP);
  }

  zoomOut() {
    this.zoom(1 / STEP);
  }

  change() {
    this.fitted = false;
    this.dispatchEvent(new Event("change"));
  }

  press(event) {
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
    this.aim = null;
    if (this.pointers.size > 1) return;
    this.moved = 0;
    this.pressed = this.turning || event.shiftKey ? this.toWorld(event.offsetX, event.offsetY) : null;
  }

  hover(place) {
    this.dispatchEvent(new CustomEvent("hover", { detail: place }));
  }

  move(event) {
    const before = this.pointers.get(event.pointerId);
    const [x, y] = this.toWorld(event.offsetX, event.offsetY);
    if (!before) {
      this.hover([x, y]);
      return;
    }
    const now = [event.offsetX, event.offsetY];
    const step = [now[0] - before[0], now[1] - before[1]];
    this.moved += Math.hypot(...step);
    this.pointers.set(event.pointerId, now);
    if (this.moved >= STILL) {
      if (this.pointers.size === 2) this.pinch(event.pointerId, before, now);
      else if (this.pressed) this.aim = [...this.pressed, Math.atan2(y - this.pressed[1], x - this.pressed[0])];
      else this.pan(step);
    }
    this.hover([x, y]);
  }

  pan([right, down]) {
    this.centre = [this.centre[0] - right / this.scale, this.centre[1] + down / this.scale];
    this.change();
  }

  pinch(id, before, now) {
    this.pressed = this.aim = null;
    const [, other] = [...this.pointers].find(([key]) => key !== id);
    const apart = (point) => Math.hypot(point[0] - other[0], point[1] - other[1]);
    this.zoom(apart(now) / Math.max(apart(before), 1), ...other);
  }

  release(event) {
    const held = this.pointers.delete(event.pointerId);
    const { aim } = this;
    this.aim = null;
    if (!held || event.type === "pointercancel" || this.pointers.size) return;
    if (this.moved >= STILL && !aim) return;
    const [x, y, heading] = aim ?? this.toWorld(event.offsetX, event.offsetY);
    this.dispatchEvent(new CustomEvent("tap", { detail: { x, y, heading, shift: event.shiftKey } }));
  }

  wheel(event) {
    event.preventDefault();
    this.zoom(Math.exp(-event.deltaY / 400), event.offsetX, event.offsetY);
  }
}
