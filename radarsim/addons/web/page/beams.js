// Geometry of beams: their angles, their remaining power, and which pass through objects.

const BESIDE = 0.2; // m; a hit closer to a passed object is not counted as behind it
const ENDS = new Set(["hit", "spent", "rain"]);
const PASSES = new Set(["leave", "sheet"]);

/** Return the angle of a beam in the map frame, rad. */
export function beamAngle(scan, beam) {
  return scan.yaw - scan.fov / 2 + beam * scan.resolution;
}

/** Return the point at a range along a beam, [x, y], m, map frame. */
export function beamPoint(scan, beam, range) {
  const angle = beamAngle(scan, beam);
  return [scan.x + range * Math.cos(angle), scan.y + range * Math.sin(angle)];
}

/** Return the number of the beam that points closest to a point of the map. */
export function beamTowards(scan, x, y) {
  const ahead = Math.atan2(y - scan.y, x - scan.x) - scan.yaw;
  const turned = Math.atan2(Math.sin(ahead), Math.cos(ahead));
  const beam = Math.round((turned + scan.fov / 2) / scan.resolution);
  return Math.min(Math.max(beam, 0), scan.count - 1);
}

/** Return the label of a sensor: its kind, and its name on the robot. */
export const sensorName = ({ kind, scanner }) => `${kind} “${scanner}”`;

/** Return the scan of a robot by the name of the scanner; `scanOfKind` by its kind. */
export function scanOf(robot, name) {
  return robot?.scans.find((scan) => scan.scanner === name);
}

export function scanOfKind(robot, kind) {
  return robot?.scans.find((scan) => scan.kind === kind);
}

/**
 * Group the echoes of a scanner by beam.
 *
 * Returns a list of echoes for each beam, nearest first: {range, kind, power, strength,
 * object, material, colour}.
 */
function echoesByBeam(robot, scan, colours) {
  const beams = Array.from({ length: scan.count }, () => []);
  const told = robot.echoes?.find((echoes) => echoes.scanner === scan.scanner);
  for (const { name, material, colour, echoes } of told?.objects ?? []) {
    const seen = { object: name, material, colour: colour ?? colours.get(material) ?? null };
    for (const [beam, range, kind, power, strength] of echoes) {
      beams[beam]?.push({ range, kind, power, strength, ...seen });
    }
  }
  for (const echoes of beams) echoes.sort((one, other) => one.range - other.range);
  return beams;
}

/**
 * Describe each beam of a scan by its reading and echoes.
 *
 * Returns for each beam {range, length, end, echoes, power, through, holes}. `range` is the
 * reading, m, Infinity without return. `length` is the drawn length, m. `end` is the echo
 * that ended the beam, if known. `power` has points [range, remaining power]. `through` is
 * true if the beam hit an object behind a passed one. `holes` are the intervals
 * [from, to], m, inside passed objects.
 */
export function describeBeams(robot, scan, colours) {
  return echoesByBeam(robot, scan, colours).map((echoes, beam) => {
    const range = scan.ranges[beam];
    const end = echoes.findLast((echo) => ENDS.has(echo.kind));
    const length = Number.isFinite(range) ? range : scan.max;
    return { range, end, length, echoes, ...trace(echoes, end, length) };
  });
}

function trace(echoes, end, length) {
  const power = [[0, 1]];
  const holes = [];
  let entered = null;
  let passed = null;
  for (const echo of echoes) {
    if (echo.range > length + BESIDE) break;
    power.push([Math.min(echo.range, length), clampShare(echo.power)]);
    if (echo.kind === "enter") entered ??= echo.range;
    if (PASSES.has(echo.kind)) {
      holes.push([entered ?? echo.range, echo.range]);
      entered = null;
      passed = echo;
    }
  }
  const last = power.at(-1);
  if (last[0] < length) power.push([length, last[1]]);
  const behind = passed !== null && length > passed.range + BESIDE;
  const through = behind && end !== undefined && end.kind === "hit" && end.material !== passed.material;
  return { power, holes: through ? holes : [], through };
}

function clampShare(power) {
  return power === null || power < 0 ? 1 : Math.min(power, 1);
}
