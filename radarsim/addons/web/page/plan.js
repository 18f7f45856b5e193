// The plan: the scene from above, with robots, rays by remaining power, readings, paths.

import { beamPoint, scanOf, sensorName } from "./beams.js";
import { prepareCanvas } from "./elements.js";
import { drawLabel } from "./label.js";
import { layers } from "./layers.js";
import { drawMarks, edgeColour } from "./marks.js";
import { readingColour, Readings } from "./readings.js";
import { drawRobot } from "./robot_mark.js";
import { drawHeading, drawRuns } from "./run_marks.js";
import { drawStarts, startAt } from "./starts.js";
import { sensorColour, theme } from "./theme.js";

const LEVELS = 6; // levels of opacity for the remaining power of a ray
const LABEL = "12px system-ui, sans-serif";

export class Plan {
  constructor(canvas, world, viewport, clearance, measure) {
    Object.assign(this, { canvas, world, viewport, clearance, measure });
    this.shapes = []; // shapes of the scene: {part, areas, lines}
    this.still = document.createElement("canvas"); // the scene as last drawn
    this.stillKey = "";
    this.readings = new Readings();
  }

  /** Replace the outlines of the scene. */
  takeScene(scene) {
    this.shapes = (scene?.parts ?? []).map(shapeOf);
    this.stillKey = "";
  }

  /**
   * Draw everything; `picking` is what the next click places, or null, and `aim` the pose
   * that is being picked, [x, y, heading], or null.
   */
  draw(view, picking, aim) {
    const surface = prepareCanvas(this.canvas);
    this.viewport.measure();
    const { pen } = surface;
    pen.fillStyle = theme.paper;
    pen.fillRect(0, 0, surface.width, surface.height);
    if (view === "map") this.drawMap(pen);
    this.drawStill(surface, view);
    const { robot, pointer } = this.world;
    if (view === "plan") drawStarts(pen, this.viewport, this.world, picking ? undefined : this.pointedStart);
    this.readings.begin(this.canvas.width, this.canvas.height);
    for (const one of this.world.frame.robots) this.addReadings(surface.density, one, view);
    this.readings.draw(pen, surface.width, surface.height);
    if (robot && view === "plan") this.drawRays(pen);
    drawRuns(pen, this.viewport, this.world);
    for (const one of this.world.frame.robots) drawRobot(pen, this.viewport, one, one === robot);
    const explained = this.world.explained();
    if (explained) this.drawBeam(pen, explained);
    if (aim && picking !== "robot") this.clearance.draw(pen, this.viewport, robot, aim);
    if (aim) drawHeading(pen, this.viewport, aim, theme.goal);
    this.measure.draw(pen, this.viewport, picking === "measure" ? pointer : null);
    this.drawScale(pen, surface);
  }

  /** The free start under the pointer, or undefined. */
  get pointedStart() {
    const { pointer } = this.world;
    return pointer ? startAt(this.world, this.viewport, ...pointer) : undefined;
  }

  /** Draw the fixed scene from a cached canvas, which a changed view or colour renews. */
  drawStill(surface, view) {
    const { width, height, density } = surface;
    const { scale, centre } = this.viewport;
    const key = [width, height, density, scale, ...centre, view, theme.dark, layers.truth].join();
    if (key !== this.stillKey) {
      this.stillKey = key;
      this.still.width = this.canvas.width;
      this.still.height = this.canvas.height;
      const pen = this.still.getContext("2d");
      pen.setTransform(density, 0, 0, density, 0, 0);
      if (view === "plan") this.drawGrid(pen, width, height);
      for (const shape of layers.truth ? this.shapes : []) this.drawShape(pen, shape, density, view);
    }
    surface.pen.drawImage(this.still, 0, 0, width, height);
  }

  drawGrid(pen, width, height) {
    const step = this.viewport.scale > 22 ? 1 : this.viewport.scale > 5 ? 5 : 25;
    const [x0, y1] = this.viewport.toWorld(0, 0);
    const [x1, y0] = this.viewport.toWorld(width, height);
    pen.strokeStyle = theme.faint;
    pen.lineWidth = 1;
    pen.beginPath();
    for (let x = Math.ceil(x0 / step) * step; x <= x1; x += step) {
      const left = Math.round(this.viewport.toScreen(x, 0)[0]) + 0.5;
      pen.moveTo(left, 0);
      pen.lineTo(left, height);
    }
    for (let y = Math.ceil(y0 / step) * step; y <= y1; y += step) {
      const top = Math.round(this.viewport.toScreen(0, y)[1]) + 0.5;
      pen.moveTo(0, top);
      pen.lineTo(width, top);
    }
    pen.stroke();
  }

  drawShape(pen, { part, areas, lines }, density, view) {
    const { scale } = this.viewport;
    const [left, top] = this.viewport.toScreen(0, 0);
    pen.save();
    pen.setTransform(scale * density, 0, 0, -scale * density, left * density, top * density);
    pen.lineWidth = 1 / scale;
    if (view === "map") {
      pen.strokeStyle = theme.true;
      pen.stroke(areas);
    } else {
      pen.fillStyle = part.colour;
      pen.globalAlpha = (part.opaque ? 1 : 0.72) * (theme.dark ? 0.8 : 1);
      pen.fill(areas, "evenodd");
      pen.globalAlpha = 1;
      pen.strokeStyle = edgeColour(part.colour);
      pen.stroke(areas);
    }
    pen.stroke(lines);
    pen.restore();
  }

  drawMap(pen) {
    const map = this.world.maps.get(this.world.chosen);
    if (!map) return;
    const [x, y] = map.origin;
    const size = [map.width * map.resolution, map.height * map.resolution];
    const [left, top] = this.viewport.toScreen(x, y + size[1]);
    pen.imageSmoothingEnabled = false;
    const { scale } = this.viewport;
    pen.drawImage(map.image, left, top, size[0] * scale, size[1] * scale);
  }

  /** Add the readings of a robot. */
  addReadings(density, robot, view) {
    const chosen = robot.name === this.world.chosen;
    for (const scan of robot.scans) {
      if (!layers[`${scan.kind} readings`]) continue;
      const crossed = chosen && view === "plan" && layers[`${scan.kind} rays`];
      const beams = crossed ? this.world.beamsOf(scan) : null;
      this.readings.add(this.viewport, scan, {
        colour: readingColour(robot, scan, chosen),
        size: chosen ? 3 : 2,
        alpha: chosen ? 0.9 : 0.7,
        density,
        hides: beams && ((beam) => beams[beam].end?.kind === "spent"),
      });
    }
  }

  /** Draw the rays of the selected scan, or of the robot's first scan. */
  drawRays(pen) {
    const { robot } = this.world;
    const scan = this.world.scan ?? robot.scans[0];
    if (!scan || !layers[`${scan.kind} rays`]) return;
    const beams = this.world.beamsOf(scan);
    const colour = sensorColour(scan.kind);
    this.strokeRays(pen, scan, beams, false, colour);
    this.strokeRays(pen, scan, beams, true, colour);
    this.drawEnds(pen, scan, beams, colour);
  }

  /** Stroke rays with an opacity by their remaining power. */
  strokeRays(pen, scan, beams, through, colour) {
    const levels = Array.from({ length: LEVELS + 1 }, () => new Path2D());
    const start = this.viewport.toScreen(scan.x, scan.y);
    beams.forEach((beam, number) => {
      if (beam.through !== through) return;
      const end = this.viewport.toScreen(...beamPoint(scan, number, 1));
      const along = (range) => [
        start[0] + (end[0] - start[0]) * range,
        start[1] + (end[1] - start[1]) * range,
      ];
      for (const [from, to, power] of stretches(beam.power)) {
        const level = levels[Math.round(power * LEVELS)];
        level.moveTo(...along(from));
        level.lineTo(...along(to));
      }
    });
    pen.strokeStyle = colour;
    pen.lineWidth = through ? 1.5 : 1;
    levels.forEach((level, number) => {
      pen.globalAlpha = (through ? 0.95 : 0.3) * (0.25 + 0.75 * (number / LEVELS));
      pen.stroke(level);
    });
    pen.globalAlpha = 1;
  }

  /** Mark beams without power, passages through objects, and the readings behind them. */
  drawEnds(pen, scan, beams, colour) {
    const crosses = [];
    pen.lineCap = "round";
    beams.forEach((beam, number) => {
      if (beam.end?.kind === "spent" && Number.isFinite(beam.range)) {
        const [x, y] = this.viewport.toScreen(...beamPoint(scan, number, beam.range));
        crosses.push({ kind: "spent", x, y });
      }
      if (!beam.through) return;
      for (const hole of beam.holes) this.drawHole(pen, scan, number, hole);
      if (layers[`${scan.kind} readings`]) this.drawDot(pen, scan, number, beam.range, colour);
    });
    pen.lineCap = "butt";
    pen.strokeStyle = colour;
    pen.lineWidth = 1.2;
    pen.beginPath();
    for (const { x, y } of crosses) {
      pen.moveTo(x - 3, y - 3);
      pen.lineTo(x + 3, y + 3);
      pen.moveTo(x - 3, y + 3);
      pen.lineTo(x + 3, y - 3);
    }
    pen.stroke();
  }

  drawHole(pen, scan, number, [from, to]) {
    const [a, b] = [from, to].map((range) => this.viewport.toScreen(...beamPoint(scan, number, range)));
    pen.lineWidth = 3;
    pen.strokeStyle = sensorColour(scan.kind);
    pen.beginPath();
    pen.moveTo(...a);
    pen.lineTo(...b);
    pen.stroke();
  }

  drawDot(pen, scan, number, range, colour) {
    const [left, top] = this.viewport.toScreen(...beamPoint(scan, number, range));
    pen.beginPath();
    pen.arc(left, top, 5, 0, 2 * Math.PI);
    pen.fillStyle = colour;
    pen.strokeStyle = theme.paper;
    pen.lineWidth = 1.5;
    pen.fill();
    pen.stroke();
  }

  /** Draw the explained beam, with a mark for each echo. */
  drawBeam(pen, { scan, number, beam }) {
    const start = this.viewport.toScreen(scan.x, scan.y);
    const end = this.viewport.toScreen(...beamPoint(scan, number, beam.length));
    for (const [width, colour] of [[5, theme.paper], [2.5, theme.ink]]) {
      pen.lineWidth = width;
      pen.strokeStyle = colour;
      pen.beginPath();
      pen.moveTo(...start);
      pen.lineTo(...end);
      pen.stroke();
    }
    const marks = beam.echoes.map((echo) => {
      const [x, y] = this.viewport.toScreen(...beamPoint(scan, number, echo.range));
      return { ...echo, colour: null, x, y };
    });
    drawMarks(pen, marks, 6);
    pen.font = `600 ${LABEL}`;
    const text = Number.isFinite(beam.range) ? `${number}: ${beam.range.toFixed(2)} m` : `${number}: –`;
    const right = end[0] + 9 + pen.measureText(text).width;
    const turned = right > this.canvas.clientWidth; // the label would be cut off
    pen.textAlign = turned ? "right" : "left";
    drawLabel(pen, text, ...(turned ? [end[0] - 9, end[1] + 20] : [end[0] + 9, end[1] - 9]));
    pen.textAlign = "left";
  }

  drawScale(pen, { width, height }) {
    const { scale } = this.viewport;
    const metres = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100].findLast((length) => length * scale < 130) ?? 0.1;
    const [right, bottom] = [width - 14, height - 14];
    pen.strokeStyle = theme.ink;
    pen.lineWidth = 2;
    pen.beginPath();
    pen.moveTo(right - metres * scale, bottom);
    pen.lineTo(right, bottom);
    pen.stroke();
    pen.font = LABEL;
    pen.textAlign = "right";
    drawLabel(pen, `${metres} m`, right, bottom - 6);
    pen.textAlign = "left";
  }
}

/** Cut points [range, power] into intervals [from, to, power] of almost equal power. */
function* stretches(knots) {
  for (let i = 1; i < knots.length; i++) {
    const [[from, before], [to, after]] = [knots[i - 1], knots[i]];
    const pieces = Math.max(1, Math.ceil(Math.abs(before - after) * LEVELS));
    for (let piece = 0; piece < pieces; piece++) {
      const [start, stop] = [piece / pieces, (piece + 1) / pieces];
      const middle = (start + stop) / 2;
      yield [from + (to - from) * start, from + (to - from) * stop, before + (after - before) * middle];
    }
  }
}

/** Return the outline of a part as paths in metres: areas to fill, and open lines. */
function shapeOf(part) {
  const [areas, lines] = [new Path2D(), new Path2D()];
  for (const outline of part.outline) {
    const first = outline[0];
    const last = outline.at(-1);
    const closed = outline.length > 3 && first[0] === last[0] && first[1] === last[1];
    const path = closed ? areas : lines;
    outline.forEach(([x, y], corner) => (corner ? path.lineTo(x, y) : path.moveTo(x, y)));
    if (closed) path.closePath();
  }
  return { part, areas, lines };
}

/** Return a description of the canvas for screen readers. */
export function describePlan(world) {
  const { robot, scan } = world;
  if (!robot) return "Plan: no robot is selected";
  const place = `${robot.name} at x ${robot.x.toFixed(1)} m, y ${robot.y.toFixed(1)} m`;
  const beam = scanOf(robot, scan?.scanner) && world.beam !== null ? `, beam ${world.beam} of ${sensorName(scan)}` : "";
  return `Plan: ${place}${beam}`;
}
