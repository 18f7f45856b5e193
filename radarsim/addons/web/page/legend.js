// The legend of the scene, and the finding: one sentence on what the sensors detect.

import { swatch } from "./beam_panel.js";
import { sensorName } from "./beams.js";
import { byId, element, setText } from "./elements.js";
import { layers } from "./layers.js";
import { freeStarts } from "./starts.js";
import { theme } from "./theme.js";

const KEPT = 3000; // ms that a mark stays in the legend, as single beams come and go

let shown = ""; // key of the listed rows
let subject = ""; // key of the view, the robot and the layers
const drawnAt = new Map(); // time when each mark was drawn last, ms, by its text

/** Update the list of drawn marks and of the materials of the scene. */
export function updateLegend(world, view) {
  const map = world.maps.get(world.chosen);
  const now = performance.now();
  const about = `${view} ${world.chosen} ${Object.values(layers)}`;
  if (about !== subject) drawnAt.clear();
  subject = about;
  const known = marksOf(world, view);
  for (const [, text, drawn] of known) if (drawn) drawnAt.set(text, now);
  const marks = known
    .filter(([, text]) => now - drawnAt.get(text) < KEPT)
    .map(([mark, text]) => ["mark", mark, text]);
  const patches = view === "map" ? (map?.legend ?? []) : materialsOf(world);
  const rows = [...marks, ...patches.map(([colour, text]) => ["patch", colour, text])];
  const key = JSON.stringify([rows, theme.dark]);
  if (key === shown) return;
  shown = key;
  byId("legend").replaceChildren(...rows.map(([kind, sign, text]) => {
    const icon = kind === "mark" ? element("i", { className: `mark ${sign}` }) : swatch(sign);
    return element("li", {}, icon, text);
  }));
}

/** Return the marks that a view can draw: [sign, text, whether it is drawn now]. */
function marksOf(world, view) {
  const marks = [];
  const scans = world.robot?.scans ?? [];
  const traced = world.scan ?? scans[0]; // the scan whose rays are drawn
  if (traced && view !== "map" && layers[`${traced.kind} rays`]) {
    const { beams, through, spent } = world.countBeams(traced);
    marks.push([`ray ${traced.kind}`, `${traced.kind} ray; opacity shows power`, beams]);
    if (view === "plan") {
      marks.push(
        [`dot ${traced.kind}`, "reading behind a penetrated object", layers[`${traced.kind} readings`] && through],
        [`hole ${traced.kind}`, "ray inside a penetrated object", through],
        [`cross ${traced.kind}`, "power depleted", spent],
      );
    }
  }
  for (const [kind, sign] of [["radar", view === "space" ? "box" : "reading"], ["laser", "square"]]) {
    const reads = (scan) => {
      const { returned, spent } = world.countBeams(scan);
      return scan.kind === kind && returned > (view === "plan" && layers[`${kind} rays`] ? spent : 0);
    };
    marks.push([sign, `${kind} reading`, layers[`${kind} readings`] && scans.some(reads)]);
  }
  if (view === "map") marks.push(["true", "true outlines", layers.truth && world.scene?.parts.length]);
  if (view !== "space") {
    const path = world.paths.get(world.chosen);
    const goal = world.goal ?? (world.stateOfGoal(world.chosen) === "cancelled" ? null : path?.goal);
    marks.push(
      ["path", "path of the robot", path?.points.length],
      ["hit", "hit point", path?.hits?.length],
      ["leave", "leave point", path?.leaves?.length],
      ["goal", "goal", goal],
    );
  }
  if (view === "plan") marks.push(["start", "free start; click to add a robot", freeStarts(world).length]);
  return marks;
}

function materialsOf(world) {
  const materials = new Map();
  for (const part of (layers.truth && world.scene?.parts) || []) {
    if (part.outline.length) materials.set(part.material, part.colour);
  }
  return [...materials].map(([name, colour]) => [colour, name]);
}

/** Write how many beams of the selected robot pass through objects, or what is missing. */
export function writeFinding(world, view) {
  const { robot } = world;
  if (!world.hello) return;
  if (!robot) setText(byId("finding"), "There is no robot yet. Add one.");
  else if (view === "map" && !world.maps.has(robot.name)) {
    setText(byId("finding"), `${robot.name} has no map yet. Tick “Build a map” and drive, or press “Explore”.`);
  } else setText(byId("finding"), sentence(world));
}

/** Return a sentence on the beams of each sensor, the selected sensor first. */
function sentence(world) {
  const { robot, scan } = world;
  const scans = [...robot.scans].sort((one, other) => (other === scan) - (one === scan));
  let verb = "pass through objects";
  const parts = scans.map((one) => {
    const { beams, through, returned } = world.countBeams(one);
    if (!returned) return `no ${one.kind} readings${one.max ? ` within ${+one.max.toFixed(1)} m` : ""}`;
    const told = robot.echoes?.some((echoes) => echoes.scanner === one.scanner && echoes.objects.length);
    if (!told) return `${sensorName(one)}: ${returned} of ${beams} beams have a reading`; // echoes have not arrived yet
    const text = `${through || "none"} of ${beams} ${one.kind} beams ${verb}`;
    verb = "do";
    return text;
  });
  if (!parts.length) return `${robot.name} has no scan yet.`;
  const rest = world.hello.watch ? "" : "; this server does not report echoes";
  return `${robot.name}: ${parts.join(" · ")}${rest}`;
}
