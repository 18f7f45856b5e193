// Distances between goals and obstacles, by the outlines of the plan.

import { drawLabel } from "./label.js";
import { theme } from "./theme.js";

export class Clearance {
  constructor() {
    this.segments = new Float32Array(0); // x0, y0, x1, y1 of each segment, m
    this.names = [];
  }

  /** Store the outlines of obstacles. */
  takeScene(scene) {
    const segments = [];
    this.names = [];
    for (const part of scene?.parts ?? []) {
      if (!part.solid) continue;
      for (const line of part.outline) {
        for (let i = 1; i < line.length; i++) {
          segments.push(...line[i - 1], ...line[i]);
          this.names.push(part.name);
        }
      }
    }
    this.segments = Float32Array.from(segments);
  }

  /** Return the nearest obstacle: {distance, x, y, name}; distance Infinity without one. */
  nearest(x, y) {
    const found = { distance: Infinity, x, y, name: "" };
    const { segments } = this;
    for (let i = 0; i < segments.length; i += 4) {
      const [x0, y0] = [segments[i], segments[i + 1]];
      const [along, up] = [segments[i + 2] - x0, segments[i + 3] - y0];
      const length = along * along + up * up;
      const share = length ? ((x - x0) * along + (y - y0) * up) / length : 0;
      const place = Math.min(Math.max(share, 0), 1);
      const [nearX, nearY] = [x0 + place * along, y0 + place * up];
      const distance = Math.hypot(nearX - x, nearY - y);
      if (distance < found.distance) Object.assign(found, { distance, x: nearX, y: nearY, name: this.names[i / 4] });
    }
    return found;
  }

  /** Return why a goal is too close to an obstacle, as a text; empty if it is not. */
  problem(robot, [x, y]) {
    if (!robot?.clearance) return "";
    const { distance, name } = this.nearest(x, y);
    if (distance >= robot.clearance) return "";
    return `${distance.toFixed(2)} m from ${name}, expected at least ${robot.safety.toFixed(2)} m`;
  }

  /** Draw the safety distance around a goal that is being picked, and an obstacle in it. */
  draw(pen, viewport, robot, [x, y]) {
    if (!robot?.safety) return;
    const goal = [x, y];
    const problem = this.problem(robot, goal);
    const colour = problem ? theme.alarm : theme.goal;
    drawDistance(pen, viewport, goal, robot.safety, colour);
    const [left, top] = viewport.toScreen(...goal);
    if (problem) {
      const near = this.nearest(...goal);
      pen.beginPath();
      pen.moveTo(left, top);
      pen.lineTo(...viewport.toScreen(near.x, near.y));
      pen.stroke();
    }
    pen.font = "600 12px system-ui, sans-serif";
    pen.textAlign = "center";
    const text = problem ? `too near: ${problem}` : `safety distance ${robot.safety.toFixed(2)} m`;
    const half = pen.measureText(text).width / 2 + 6;
    const across = Math.min(Math.max(left, half), viewport.size[0] - half);
    drawLabel(pen, text, across, Math.max(top - robot.safety * viewport.scale - 8, 54));
    pen.textAlign = "left";
  }
}

/** Draw a circle around a point of the map; the pen keeps the colour for further lines. */
export function drawDistance(pen, viewport, [x, y], distance, colour) {
  const [left, top] = viewport.toScreen(x, y);
  pen.beginPath();
  pen.arc(left, top, distance * viewport.scale, 0, 2 * Math.PI);
  pen.globalAlpha = 0.12;
  pen.fillStyle = colour;
  pen.fill();
  pen.globalAlpha = 1;
  pen.strokeStyle = colour;
  pen.lineWidth = 1.5;
  pen.setLineDash([6, 4]);
  pen.stroke();
  pen.setLineDash([]);
}
