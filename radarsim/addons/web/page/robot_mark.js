// Draws a robot from above, with its name.

import { drawLabel } from "./label.js";
import { layers } from "./layers.js";
import { theme } from "./theme.js";

const SMALLEST = 18; // px; least length of a robot, so that it is visible at any zoom

/** Draw a robot: its footprint, its wheels, an arrow that points ahead, and its name. */
export function drawRobot(pen, viewport, robot, chosen) {
  const [left, top] = viewport.toScreen(robot.x, robot.y);
  const [length, width] = robot.size ?? [0.6, 0.5];
  const scale = Math.max(viewport.scale, SMALLEST / length);
  const [half, side] = [(length * scale) / 2, (width * scale) / 2];
  pen.save();
  pen.translate(left, top);
  pen.rotate(-robot.yaw);
  if (chosen) drawRing(pen, Math.hypot(half, side) + 5);
  drawHull(pen, half, side, robot.touch ? theme.alarm : (robot.colour ?? theme.robot));
  pen.restore();
  if (!layers.names) return;
  pen.font = `${chosen ? 600 : 400} 12px system-ui, sans-serif`;
  const name = robot.touch ? `${robot.name} (touches)` : robot.name;
  pen.textAlign = "center";
  drawLabel(pen, name, left, top + Math.hypot(half, side) + 17);
  pen.textAlign = "left";
}

/** Stroke a path in the paper colour, for contrast with the background, such as a map. */
function strokeHalo(pen, path) {
  pen.strokeStyle = theme.paper;
  pen.lineWidth = 4.5;
  pen.stroke(path);
}

function drawRing(pen, radius) {
  const ring = new Path2D();
  ring.arc(0, 0, radius, 0, 2 * Math.PI);
  strokeHalo(pen, ring);
  pen.strokeStyle = theme.ink;
  pen.lineWidth = 1.5;
  pen.setLineDash([4, 3]);
  pen.stroke(ring);
  pen.setLineDash([]);
}

function drawHull(pen, half, side, colour) {
  const [wheels, hull] = [new Path2D(), new Path2D()];
  for (const along of [-1, 1]) {
    for (const across of [-1, 1]) {
      const wheel = [half * 0.62, side * 0.42];
      wheels.rect(along * half * 0.52 - wheel[0] / 2, across * side * 0.8 - wheel[1] / 2, ...wheel);
    }
  }
  hull.rect(-half, -side * 0.62, 2 * half, side * 1.24);
  for (const path of [wheels, hull]) strokeHalo(pen, path);
  pen.fillStyle = theme.ink;
  pen.fill(wheels);
  pen.fillStyle = colour;
  pen.strokeStyle = theme.ink;
  pen.lineWidth = 1.5;
  pen.fill(hull);
  pen.stroke(hull);
  pen.beginPath();
  pen.moveTo(half * 0.85, 0);
  pen.lineTo(half * 0.15, -side * 0.45);
  pen.lineTo(half * 0.15, side * 0.45);
  pen.closePath();
  pen.fillStyle = theme.ink;
  pen.fill();
}
