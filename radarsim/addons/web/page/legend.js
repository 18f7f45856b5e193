// The legend of the scene, and the finding: what there is to see, in one sentence.

import { swatch } from "./beam_panel.js";
import { sensorName } from "./beams.js";
import { byId, element, setText } from "./elements.js";
import { freeStarts } from "./starts.js";
import { theme } from "./theme.js";

const RADAR = [
  ["ray", "radar ray, fainter with less power"],
  ["reading", "radar reading"],
  ["dot", "reading behind what the ray passed"],
  ["hole", "ray inside of it"],
  ["cross", "power used up"],
];
const LASER = [["square", "laser reading"]];
const SPACE = [["ray", "ray, fainter with less power"]];
const SPACE_RADAR = [["box", "radar reading"]]; // points are square in 3D
const STARTS = [["start", "free start: click adds a robot"]];
const RUN = [
  ["path", "its way"],
  ["hit", "hits an obstacle"],
  ["leave", "leaves it"],
  ["goal", "goal"],
];

let shown = ""; // what the legend lists

/** List the marks of the view that can be there, and the materials of the scene. */
export function updateLegend(world, view) {
  const map = world.maps.get(world.chosen);
  const marks = marksOf(world, view).map(([mark, text]) => ["mark", mark, text]);
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

function marksOf(world, view) {
  const kinds = new Set(world.robot?.scans.map((scan) => scan.kind));
  const path = world.paths.get(world.chosen);
  const run = path?.goal ? RUN : path?.points.length ? RUN.slice(0, 1) : [];
  if (view === "map") return [["true", "what is truly there"], ...run];
  const lasers = kinds.has("laser") ? LASER : [];
  if (view === "space") return [...(kinds.size ? SPACE : []), ...(kinds.has("radar") ? SPACE_RADAR : []), ...lasers];
  return [...(kinds.has("radar") ? RADAR : []), ...lasers, ...run, ...(freeStarts(world).length ? STARTS : [])];
}

function materialsOf(world) {
  const materials = new Map();
  for (const part of world.scene?.parts ?? []) {
    if (part.outline.length) materials.set(part.material, part.colour);
  }
  return [...materials].map(([name, colour]) => [colour, name]);
}

/** Say what the selected robot's sensors see through, or what is missing. */
export function writeFinding(world, view) {
  const { robot } = world;
  if (!world.hello) return;
  if (!robot) setText(byId("finding"), "No robot yet: add one.");
  else if (view === "map" && !world.maps.has(robot.name)) {
    setText(byId("finding"), `${robot.name} has no map yet: tick “Build a map” and drive, or explore.`);
  } else setText(byId("finding"), sentence(world));
}

/** Say how many beams of each sensor see through, the selected sensor first. */
function sentence(world) {
  const { robot, scan } = world;
  const scans = [...robot.scans].sort((one, other) => (other === scan) - (one === scan));
  const parts = scans.map((one, place) => {
    const { beams, through, returned } = world.countBeams(one);
    if (!returned) return `${one.kind} reads nothing${one.max ? ` within ${+one.max.toFixed(1)} m` : ""}`;
    const told = robot.echoes?.some((echoes) => echoes.scanner === one.scanner && echoes.objects.length);
    if (!told) return `${sensorName(one)} reads ${returned} of ${beams} beams`; // and nothing more is known yet
    const count = through || "none";
    return place ? `${one.kind} with ${count}` : `${one.kind} sees through with ${count} of ${beams} beams`;
  });
  if (!parts.length) return `${robot.name} has no scan yet.`;
  const rest = world.hello.watch ? "" : "; this server does not tell what they meet";
  return `${robot.name}: ${parts.join(" · ")}${rest}`;
}
