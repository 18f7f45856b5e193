// A measuring line between two points of the map.

import { drawLabel } from "./label.js";
import { theme } from "./theme.js";

export class Measure {
  constructor() {
    this.ends = []; // up to two points, m
  }

  /** Set the first end of a new line, or the second end of the line. */
  tap(x, y) {
    this.ends = this.ends.length === 1 ? [this.ends[0], [x, y]] : [[x, y]];
  }

  clear() {
    this.ends = [];
  }

  /** The length and angle of the line as a text; empty without a line. */
  get text() {
    if (this.ends.length < 2) return "";
    const [[x0, y0], [x1, y1]] = this.ends;
    return describe(x1 - x0, y1 - y0);
  }

  /** Draw the line; until its second end is set, that end follows the pointer. */
  draw(pen, viewport, pointer) {
    const [from, to] = [this.ends[0], this.ends[1] ?? pointer];
    if (!from) return;
    const start = viewport.toScreen(...from);
    const end = to ? viewport.toScreen(...to) : start;
    for (const [width, colour] of [[5, theme.paper], [2, theme.ink]]) {
      pen.lineWidth = width;
      pen.strokeStyle = colour;
      pen.beginPath();
      pen.moveTo(...start);
      pen.lineTo(...end);
      for (const [left, top] of [start, end]) {
        pen.moveTo(left + 5, top);
        pen.arc(left, top, 5, 0, 2 * Math.PI);
      }
      pen.stroke();
    }
    if (!to) return;
    pen.font = "600 13px system-ui, sans-serif";
    pen.textAlign = "center";
    drawLabel(pen, describe(to[0] - from[0], to[1] - from[1]), (start[0] + end[0]) / 2, (start[1] + end[1]) / 2 - 10);
    pen.textAlign = "left";
  }
}

function describe(along, up) {
  const degrees = Math.round((Math.atan2(up, along) * 180) / Math.PI);
  return `${Math.hypot(along, up).toFixed(2)} m, ${degrees}°`;
}
