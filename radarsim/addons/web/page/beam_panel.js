// The panel that explains one beam: its reading, its echoes and its remaining power.

import { sensorName } from "./beams.js";
import { byId, element, fillTable, prepareCanvas, setOptions, setText } from "./elements.js";
import { drawLabel } from "./label.js";
import { drawMarks, edgeColour, KINDS } from "./marks.js";
import { sensorColour, theme } from "./theme.js";

export class BeamPanel extends EventTarget {
  /** Fires `beam` when the user selects a beam (detail: {scanner, beam}). */
  constructor(world) {
    super();
    Object.assign(this, { world, scanners: "" });
    this.form = byId("beam");
    this.form.addEventListener("submit", (event) => event.preventDefault());
    this.form.scanner.addEventListener("change", () => this.choose());
    this.form.beam.addEventListener("input", () => this.choose());
    this.form.hold.addEventListener("change", () => world.hold(this.form.hold.checked));
  }

  choose() {
    const { scanner, beam } = this.form;
    if (!Number.isInteger(beam.valueAsNumber)) return;
    const detail = { scanner: scanner.value, beam: beam.valueAsNumber };
    this.dispatchEvent(new CustomEvent("beam", { detail }));
  }

  update() {
    const { robot, scan, beam } = this.world;
    const scanners = JSON.stringify((robot?.scans ?? []).map((one) => ({ name: one.scanner, label: sensorName(one) })));
    if (scanners !== this.scanners) {
      this.scanners = scanners;
      setOptions(this.form.scanner, JSON.parse(scanners));
    }
    for (const control of this.form.elements) control.disabled = !scan;
    if (scan) {
      this.form.scanner.value = scan.scanner;
      this.form.beam.max = scan.count - 1;
      if (beam !== null && document.activeElement !== this.form.beam) this.form.beam.value = beam;
    }
    this.form.hold.checked = this.world.held !== null;
    const explained = this.world.explained();
    this.write(explained);
    this.drawPower(explained);
  }

  /** Write the reading and the echoes of the beam, or how to select a beam. */
  write(explained) {
    byId("reading").classList.toggle("quiet", !explained);
    byId("rows").hidden = !explained;
    if (!explained) {
      setText(byId("reading"), this.world.scan ? "Click a beam in the plan or in a scan." : "There is no scan yet.");
      return;
    }
    const { number, beam } = explained;
    const reads = Number.isFinite(beam.range) ? `reads ${beam.range.toFixed(2)} m` : "has no reading";
    setText(byId("reading"), `Beam ${number} ${reads}`);
    const rows = beam.echoes.map((echo) => [
      echo.range.toFixed(2),
      KINDS[echo.kind]?.word ?? echo.kind,
      objectOf(echo),
      echo.power === null || echo.power < 0 ? "–" : echo.power.toFixed(3),
    ]);
    const text = JSON.stringify(rows);
    if (text === this.written) return; // unchanged rows keep the text selection of the user
    this.written = text;
    fillTable(byId("rows"), rows);
  }

  /** Draw the remaining power of the beam over the range. */
  drawPower(explained) {
    const canvas = byId("power");
    canvas.hidden = !explained;
    if (!explained) return;
    const { scan, beam } = explained;
    const { pen, width, height } = prepareCanvas(canvas);
    const [left, right, top, bottom] = [34, width - 12, 12, height - 20];
    const far = Math.max(beam.length, 0.1);
    const x = (range) => left + ((right - left) * range) / far;
    const y = (power) => bottom - (bottom - top) * power;
    pen.font = "11px system-ui, sans-serif";
    pen.strokeStyle = theme.line;
    pen.lineWidth = 1;
    pen.beginPath();
    for (const share of [0, 0.5, 1]) {
      pen.moveTo(left, Math.round(y(share)) + 0.5);
      pen.lineTo(right, Math.round(y(share)) + 0.5);
    }
    pen.stroke();
    pen.fillStyle = theme.quiet;
    for (const share of [0, 0.5, 1]) pen.fillText(String(share), 8, y(share) + 4);
    pen.textAlign = "right";
    pen.fillText(`${far.toFixed(1)} m`, right, height - 5);
    pen.textAlign = "left";
    pen.fillText("0 m", left, height - 5);
    pen.beginPath();
    for (const [range, power] of beam.power) pen.lineTo(x(range), y(power));
    pen.strokeStyle = sensorColour(scan.kind);
    pen.lineWidth = 2;
    pen.stroke();
    pen.lineTo(x(beam.power.at(-1)[0]), bottom);
    pen.lineTo(left, bottom);
    pen.globalAlpha = 0.16;
    pen.fillStyle = sensorColour(scan.kind);
    pen.fill();
    pen.globalAlpha = 1;
    drawMarks(pen, beam.echoes.map((echo) => ({ ...echo, x: x(Math.min(echo.range, far)), y: y(Math.min(Math.max(echo.power ?? 1, 0), 1)) })), 5);
    drawLabel(pen, "remaining power", left + 4, top + 12);
  }
}

const objectOf = ({ object, material }) => (object === material ? object : `${object} (${material})`);

/** List the echoes of a scan by material. */
export function updateMaterials(world) {
  const found = new Map();
  for (const { echoes } of world.scan ? world.beamsOf(world.scan) : []) {
    for (const { material, colour, range } of echoes) {
      const row = found.get(material) ?? { colour, count: 0, near: Infinity, far: 0 };
      row.count += 1;
      row.near = Math.min(row.near, range);
      row.far = Math.max(row.far, range);
      found.set(material, row);
    }
  }
  const rows = [...found].sort(([, one], [, other]) => other.count - one.count);
  fillTable(byId("materials"), rows.map(([material, { colour, count, near, far }]) => [
    element("span", {}, swatch(colour), material), String(count), `${near.toFixed(1)} – ${far.toFixed(1)}`,
  ]));
}

/** Return an element that shows the colour of a material. */
export function swatch(colour) {
  const patch = element("i", { className: "swatch" });
  patch.style.background = colour ?? theme.quiet;
  patch.style.borderColor = edgeColour(colour);
  return patch;
}
