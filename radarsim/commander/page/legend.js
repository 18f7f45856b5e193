// The legend of the scene, and the finding: what there is to see, in one sentence.

import { swatch } from "./beam_panel.js";
import { byId, element, setText } from "./elements.js";

const MARKS = [
  ["ray", "radar ray, fainter with less power"],
  ["dot", "reads this behind"],
  ["hole", "hole it came through"],
  ["cross", "power spent"],
  ["square", "laser reading"],
];

const CELLS = {
  material: [
    ["#9aa3ad", "not sensed"], ["#ffffff", "free"], ["#191818", "solid"],
    ["#a5c262", "foliage"], ["#ebd3b0", "smoke, dust, rain"],
  ],
  usarcommander: [
    ["#0000ff", "unknown"], ["#ffffff", "sensed"], ["#a0a0a0", "free, near"], ["#000000", "beams end"],
  ],
};

/** List the materials of the scene, and the marks of the view. */
export function updateLegend(world, view) {
  const materials = new Map();
  for (const part of world.scene?.parts ?? []) {
    if (part.outline.length) materials.set(part.material, part.colour);
  }
  const rows = [...materials].map(([name, colour]) => element("li", {}, swatch(colour), name));
  const marks = view === "plan" ? MARKS : [];
  byId("legend").replaceChildren(
    ...marks.map(([mark, text]) => element("li", {}, element("i", { className: `mark ${mark}` }), text)),
    ...(view === "map" ? mapRows(world.maps.get(world.chosen)) : rows),
  );
}

/** List the colours of the cells of a map, if there is one. */
function mapRows(map) {
  const cells = map ? CELLS[map.colours] : [];
  return [
    ...cells.map(([colour, text]) => element("li", {}, swatch(colour), text)),
    element("li", {}, element("i", { className: "mark true" }), "what is truly there"),
  ];
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
    const count = `${through || "none"} of ${beams}`;
    return place ? `${one.kind} with ${count}` : `${one.kind} sees through with ${count} beams`;
  });
  return parts.length ? `${robot.name}: ${parts.join(" · ")}` : `${robot.name} has no scan yet.`;
}
