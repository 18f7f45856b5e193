// Draws drives to goals: the path so far, its hit and leave points, and the goal.

import { drawDistance } from "./clearance.js";
import { drawLabel } from "./label.js";
import { theme } from "./theme.js";

const REACH = 13; // px from the centre of a goal to the ends of its cross
const ARROW = 30; // px from the centre to the tip of the arrow of the heading

/** Draw the paths of all robots, and the clicked goal with its safety distance. */
export function drawRuns(pen, viewport, world) {
  const goal = goalOf(world);
  if (goal && world.robot?.safety) drawDistance(pen, viewport, goal, world.robot.safety, theme.goal);
  for (const [robot, path] of world.paths) {
    drawPath(pen, viewport, path, robot === world.chosen ? 2.5 : 1.2);
    drawPoints(pen, viewport, path.hits ?? [], "hit", "H");
    drawPoints(pen, viewport, path.leaves ?? [], "leave", "L");
    if (path.goal) drawEndedGoal(pen, viewport, [...path.goal, path.heading], world.stateOfGoal(robot));
  }
  if (world.goal) drawGoal(pen, viewport, world.goal, theme.goal);
}

/** Return the goal to which the selected robot drives, [x, y, ...], m, or null. */
function goalOf(world) {
  const goal = world.stateOfGoal(world.chosen) === "running" ? world.paths.get(world.chosen)?.goal : null;
  return world.goal ?? goal ?? null;
}

/** Draw a goal by the state of its task; a cancelled goal is not drawn. */
function drawEndedGoal(pen, viewport, goal, state) {
  if (state === "cancelled") return;
  drawGoal(pen, viewport, goal, state === "failed" ? theme.alarm : theme.goal);
  if (state === "running") return;
  const [left, top] = viewport.toScreen(...goal);
  pen.font = "600 11px system-ui, sans-serif";
  drawLabel(pen, state === "failed" ? "not reached" : "reached", left + REACH + 3, top - 6);
}

function drawPath(pen, viewport, path, width) {
  pen.beginPath();
  for (const [x, y] of path.points ?? []) pen.lineTo(...viewport.toScreen(x, y));
  pen.lineJoin = "round";
  for (const [wide, colour] of [[width + 2.5, theme.paper], [width, theme.path]]) {
    pen.lineWidth = wide;
    pen.strokeStyle = colour;
    pen.stroke();
  }
}

/** Mark hit or leave points, with the labels H1, L1 and so on. */
function drawPoints(pen, viewport, points, colour, letter) {
  points.forEach(([x, y], number) => {
    const [left, top] = viewport.toScreen(x, y);
    pen.beginPath();
    pen.arc(left, top, 5, 0, 2 * Math.PI);
    pen.lineWidth = 1;
    pen.strokeStyle = theme.ink;
    pen.fillStyle = theme[colour];
    pen.fill();
    pen.stroke();
    pen.font = "600 11px system-ui, sans-serif";
    drawLabel(pen, `${letter}${number + 1}`, left + 8, top + 4);
  });
}

function drawGoal(pen, viewport, goal, ring) {
  const [left, top] = viewport.toScreen(...goal);
  for (const [width, colour] of [[6, theme.paper], [2.5, ring]]) {
    pen.lineWidth = width;
    pen.strokeStyle = colour;
    pen.beginPath();
    pen.arc(left, top, 9, 0, 2 * Math.PI);
    pen.moveTo(left - REACH, top);
    pen.lineTo(left + REACH, top);
    pen.moveTo(left, top - REACH);
    pen.lineTo(left, top + REACH);
    pen.stroke();
  }
  drawHeading(pen, viewport, goal, ring);
}

/** Draw the heading of a pose, [x, y, heading], as an arrow; none without a heading. */
export function drawHeading(pen, viewport, [x, y, heading], colour) {
  if (!Number.isFinite(heading)) return;
  pen.save();
  pen.translate(...viewport.toScreen(x, y));
  pen.rotate(-heading);
  pen.lineJoin = "round";
  for (const [width, ink] of [[6, theme.paper], [2.5, colour]]) {
    pen.lineWidth = width;
    pen.strokeStyle = pen.fillStyle = ink;
    pen.beginPath();
    pen.moveTo(0, 0);
    pen.lineTo(ARROW - 8, 0);
    pen.moveTo(ARROW, 0);
    pen.lineTo(ARROW - 10, 6);
    pen.lineTo(ARROW - 10, -6);
    pen.closePath();
    pen.stroke();
    pen.fill();
  }
  pen.restore();
}
