// A polar plot of a scan, with ahead up: its readings, and its echoes by material.

import { scanOf, scanOfKind, sensorName } from "./beams.js";
import { prepareCanvas, setText } from "./elements.js";
import { drawLabel } from "./label.js";
import { drawMarks } from "./marks.js";
import { sensorColour, theme } from "./theme.js";

const RANGES = [2, 5, 10, 15, 20, 30, 50, 100, 200, 500]; // m; of the outermost ring
const MARGIN = 14; // px
const LEFT_OUT = 0.01; // share of the beams of a scan that may end beyond the outermost ring
const KEPT = 3000; // ms before the rings shrink to a smaller range
const outermost = new Map(); // by robot: {range, m; needed: last time it was needed, ms}

export class Polar extends EventTarget {
  /** Show scans of a kind in a figure. Fires `beam` (detail: {scanner, beam}) on a click. */
  constructor(figure, world, kind) {
    super();
    Object.assign(this, { figure, world, kind });
    this.canvas = figure.querySelector("canvas");
    this.canvas.addEventListener("click", (event) => this.click(event));
  }

  /** The shown scan: the scan with the explained beam, or the first of this kind. */
  get scan() {
    const chosen = scanOf(this.world.robot, this.world.scanner);
    return chosen?.kind === this.kind ? chosen : scanOfKind(this.world.robot, this.kind);
  }

  draw() {
    const { scan } = this;
    const { pen, width, height } = prepareCanvas(this.canvas);
    const outer = scan ? outerRange(this.world.robot) : 0;
    this.write(scan, outer);
    if (!scan || Math.min(width, height) < 3 * MARGIN) return; // the canvas is hidden
    this.layout = layOut(scan, width, height, outer);
    this.drawRings(pen, scan);
    const outline = this.fillReadings(pen, scan);
    this.drawEchoes(pen, scan);
    pen.lineWidth = 1.5;
    pen.strokeStyle = sensorColour(scan.kind);
    pen.stroke(outline);
    this.drawBeyond(pen, scan);
    if (scan === this.world.scan && this.world.beam !== null) this.drawBeam(pen, scan);
    this.drawRanges(pen, scan); // drawn last, so that readings do not cover the labels
  }

  /** Write the caption: the sensor, and the numbers of its readings. */
  write(scan, outer) {
    const caption = this.figure.querySelector(".name");
    const what = this.figure.querySelector(".what");
    const title = scan ? sensorName(scan) : `no ${this.kind}`;
    setText(caption, title[0].toUpperCase() + title.slice(1));
    if (!scan) {
      setText(what, this.world.robot ? "on this robot" : "");
      return;
    }
    const { beams, spent, returned } = this.world.countBeams(scan);
    const lost = spent ? `, ${spent} depleted` : "";
    const beyond = scan.ranges.filter((range) => range > outer && Number.isFinite(range)).length;
    const far = beyond ? `, ${beyond} beyond ${outer} m` : "";
    const text = `${returned} of ${beams} beams return${lost}${far}`;
    setText(what, text);
    this.canvas.setAttribute("aria-label", `${title}: ${text}`);
  }

  /** Return the position of a range along a beam, px. */
  place(scan, beam, range) {
    const { left, top, scale } = this.layout;
    const angle = beam * scan.resolution - scan.fov / 2;
    return [left - range * scale * Math.sin(angle), top - range * scale * Math.cos(angle)];
  }

  drawRings(pen, scan) {
    const { left, top, scale, outer } = this.layout;
    const half = Math.min(scan.fov / 2, Math.PI);
    pen.strokeStyle = theme.line;
    pen.lineWidth = 1;
    const step = ringStep(outer);
    for (let range = step; range <= outer * 1.001; range += step) {
      pen.beginPath();
      pen.arc(left, top, range * scale, -Math.PI / 2 - half, -Math.PI / 2 + half);
      pen.stroke();
    }
    pen.beginPath();
    for (const turn of [-half, 0, half]) {
      pen.moveTo(left, top);
      pen.lineTo(left - outer * scale * Math.sin(turn), top - outer * scale * Math.cos(turn));
    }
    pen.stroke();
  }

  /** Label the rings; on a full circle diagonally, to keep the forward direction free. */
  drawRanges(pen, scan) {
    const { left, top, scale, outer } = this.layout;
    const half = Math.min(scan.fov / 2, Math.PI);
    const step = ringStep(outer);
    pen.font = "11px system-ui, sans-serif";
    const turn = half > 3 ? Math.PI / 4 : half;
    const [across, ahead] = [Math.sin(turn), Math.cos(turn)];
    pen.textAlign = "center";
    for (let range = step; range <= outer * 1.001; range += step) {
      const label = `${+range.toFixed(1)}${range >= outer ? " m" : ""}`;
      drawLabel(pen, label, left + range * scale * across, top - range * scale * ahead + 13);
    }
    pen.textAlign = "left";
  }

  /** Fill the area that the beams cross; return the outline of their ends. */
  fillReadings(pen, scan) {
    const { left, top, outer } = this.layout;
    const [area, outline] = [new Path2D(), new Path2D()];
    area.moveTo(left, top);
    let before = false;
    scan.ranges.forEach((range, beam) => {
      const place = this.place(scan, beam, Math.min(range, scan.max, outer));
      area.lineTo(...place);
      if (before && range <= outer) outline.lineTo(...place);
      else outline.moveTo(...place);
      before = range <= outer;
    });
    area.closePath();
    pen.fillStyle = sensorColour(scan.kind);
    pen.globalAlpha = 0.16;
    pen.fill(area);
    pen.globalAlpha = 1;
    return outline;
  }

  /** Mark beams that end beyond the outermost ring with triangles that point outward. */
  drawBeyond(pen, scan) {
    const { outer, scale } = this.layout;
    pen.beginPath();
    scan.ranges.forEach((range, beam) => {
      if (!(range > outer && Number.isFinite(range))) return;
      const aside = 4 / (outer * scale * scan.resolution); // 4 px, in beams
      pen.moveTo(...this.place(scan, beam, outer + 10 / scale));
      pen.lineTo(...this.place(scan, beam - aside, outer + 3 / scale));
      pen.lineTo(...this.place(scan, beam + aside, outer + 3 / scale));
      pen.closePath();
    });
    pen.fillStyle = sensorColour(scan.kind);
    pen.fill();
  }

  drawEchoes(pen, scan) {
    const marks = [];
    this.world.beamsOf(scan).forEach((beam, number) => {
      for (const echo of beam.echoes) {
        if (echo.range > this.layout.outer) continue;
        const [x, y] = this.place(scan, number, echo.range);
        marks.push({ kind: echo.kind, colour: echo.colour, x, y });
      }
    });
    drawMarks(pen, marks, scan.count > 400 ? 1.6 : 2.4);
  }

  drawBeam(pen, scan) {
    const beam = this.world.beamsOf(scan)[this.world.beam];
    if (!beam) return;
    pen.beginPath();
    pen.moveTo(this.layout.left, this.layout.top);
    pen.lineTo(...this.place(scan, this.world.beam, Math.min(beam.length, this.layout.outer)));
    pen.strokeStyle = theme.ink;
    pen.lineWidth = 2;
    pen.stroke();
  }

  click(event) {
    const { scan, layout } = this;
    if (!scan || !layout) return;
    const angle = Math.atan2(layout.left - event.offsetX, layout.top - event.offsetY);
    const beam = Math.round((angle + scan.fov / 2) / scan.resolution);
    const detail = { scanner: scan.scanner, beam: Math.min(Math.max(beam, 0), scan.count - 1) };
    this.dispatchEvent(new CustomEvent("beam", { detail }));
  }
}

/** Return the distance between two rings, m. */
function ringStep(outer) {
  return outer / (outer % 4 && outer % 5 === 0 ? 5 : 4);
}

/**
 * Return the range of the outermost ring, m, which all scans of a robot share.
 *
 * A single far beam does not change it. It shrinks only after a delay, as far beams come
 * and go from scan to scan.
 */
export function outerRange(robot, now = performance.now()) {
  const farthest = Math.max(1, ...robot.scans.map(({ ranges }) => mostRange(ranges)));
  const range = RANGES.find((each) => each >= farthest) ?? farthest;
  const before = outermost.get(robot.name);
  if (before && range < before.range && now - before.needed < KEPT) return before.range;
  outermost.set(robot.name, { range, needed: now });
  return range;
}

/** Return the largest range, m, without the farthest 1 % of beams, or at least one beam. */
function mostRange(ranges) {
  const sorted = ranges.filter(Number.isFinite).sort();
  return sorted.at(-1 - Math.max(1, Math.floor(LEFT_OUT * sorted.length))) ?? sorted[0] ?? 0;
}

/** Return the position of the sensor, px, the scale, px/m, and the outermost range, m. */
function layOut(scan, width, height, outer) {
  const half = Math.min(scan.fov / 2, Math.PI);
  const across = half < Math.PI / 2 ? Math.sin(half) : 1;
  const down = Math.max(0, -Math.cos(half));
  const scale = Math.min((width - 2 * MARGIN) / (2 * across), (height - 2 * MARGIN) / (1 + down)) / outer;
  const top = (height + outer * scale * (1 - down)) / 2;
  return { left: width / 2, top, scale, outer };
}
