// The start poses of the map: which are free, and which is under the pointer.

import { drawLabel } from "./label.js";
import { layers } from "./layers.js";
import { theme } from "./theme.js";

const TAKEN = 0.4; // m; a start closer to a robot is not free
const REACH = 18; // px; radius in which the pointer selects a start
const CROWD = 56; // px; a start closer to a robot has a name only under the pointer
const MOST_NAMES = 12; // with more starts, only the start under the pointer has a name

/** Return the starts without a robot nearby. */
export function freeStarts(world) {
  const near = (start) => (robot) => Math.hypot(robot.x - start.x, robot.y - start.y) < TAKEN;
  return (world.hello?.starts ?? []).filter((start) => !world.frame.robots.some(near(start)));
}

/** Return the free start at a point of the map, m, or undefined. */
export function startAt(world, viewport, x, y) {
  const away = (start) => Math.hypot(start.x - x, start.y - y) * viewport.scale;
  return freeStarts(world)
    .filter((start) => away(start) < REACH)
    .sort((one, other) => away(one) - away(other))[0];
}

/** Draw the free starts as arrows along their yaw, and the action of the pointed start. */
export function drawStarts(pen, viewport, world, pointed) {
  const starts = freeStarts(world);
  pen.textAlign = "center";
  for (const start of starts) {
    const [left, top] = viewport.toScreen(start.x, start.y);
    const chosen = start === pointed;
    drawArrow(pen, left, top, start.yaw, chosen);
    const away = (robot) => Math.hypot(robot.x - start.x, robot.y - start.y) * viewport.scale;
    const crowded = world.frame.robots.some((robot) => away(robot) < CROWD);
    if (!chosen && (!layers.names || crowded || starts.length > MOST_NAMES)) continue;
    pen.font = `${chosen ? 600 : 400} 12px system-ui, sans-serif`;
    drawLabel(pen, chosen ? `Add a robot at ${start.name}` : start.name, left, top - 17);
  }
  pen.textAlign = "left";
}

function drawArrow(pen, left, top, yaw, chosen) {
  pen.save();
  pen.translate(left, top);
  pen.beginPath();
  pen.arc(0, 0, 11, 0, 2 * Math.PI);
  pen.globalAlpha = 0.85;
  pen.fillStyle = chosen ? theme.path : theme.paper;
  pen.fill();
  pen.globalAlpha = 1;
  pen.strokeStyle = theme.path;
  pen.lineWidth = 2;
  pen.setLineDash([3, 3]);
  pen.stroke();
  pen.setLineDash([]);
  pen.rotate(-yaw);
  pen.beginPath();
  pen.moveTo(8, 0);
  pen.lineTo(-5, -6);
  pen.lineTo(-5, 6);
  pen.closePath();
  pen.fillStyle = chosen ? theme.paper : theme.path;
  pen.fill();
  pen.restore();
}
