// The state of the page: robots and their scans, maps, tasks, and the selection.

import { describeBeams, scanOf } from "./beams.js";

export class World {
  constructor() {
    this.hello = null;
    this.scene = null;
    this.triangles = null;
    this.frame = { t: 0, robots: [] };
    this.framed = false; // whether a frame has arrived
    this.maps = new Map(); // by robot: the last message `map`, with its decoded image
    this.paths = new Map(); // by robot
    this.tasks = new Map(); // by id
    this.drives = new Map(); // by robot: the state of its newest drive to a goal
    this.chosen = null; // name of the selected robot
    this.wanted = null; // name of a robot to select as soon as it appears
    this.scanner = null; // name of the scanner whose beam is explained
    this.beam = null;
    this.held = null; // result of `explained` that is kept by `hold`
    this.time = { refusal: "", paused: false, speed: 1, start: 0, end: null };
    this.pointer = null; // position of the pointer in the plan, [x, y], m
    this.goal = null; // clicked goal, [x, y, heading], until its path arrives
    this.described = new Map(); // beams of the selected robot by scanner
    this.colours = new Map(); // by material
  }

  /** The selected robot, or undefined. */
  get robot() {
    return this.frame.robots.find((robot) => robot.name === this.chosen);
  }

  /** The scan whose beams are explained, or undefined. */
  get scan() {
    return scanOf(this.robot, this.scanner) ?? this.robot?.scans[0];
  }

  /** Store a frame; return whether it selected another robot. */
  takeFrame(frame) {
    this.frame = frame;
    this.framed = true;
    this.described.clear();
    const { robots } = frame;
    const wanted = robots.find((robot) => robot.name === this.wanted);
    if (!wanted && (this.robot || !robots.length)) return false;
    this.choose((wanted ?? robots.find((robot) => robot.mine) ?? robots[0]).name);
    if (wanted) this.wanted = null;
    return true;
  }

  /** Remove the state of a former connection. */
  reset() {
    for (const told of [this.maps, this.paths, this.tasks, this.drives, this.described]) told.clear();
    this.hello = this.scene = this.triangles = this.goal = this.held = null;
    this.frame = { t: 0, robots: [] };
    this.framed = false;
  }

  takeScene(scene) {
    this.scene = scene;
    for (const part of scene.parts) this.colours.set(part.material, part.colour);
  }

  choose(name) {
    this.chosen = name;
    this.held = null;
    this.described.clear();
    const scans = this.robot?.scans ?? [];
    if (!scans.some((scan) => scan.scanner === this.scanner)) {
      this.scanner = (scans.find((scan) => scan.kind === "radar") ?? scans[0])?.scanner ?? null;
    }
  }

  /** Describe the beams of a scan of the selected robot; the result is cached per frame. */
  beamsOf(scan) {
    if (!this.described.has(scan.scanner)) {
      this.described.set(scan.scanner, describeBeams(this.robot, scan, this.colours));
    }
    return this.described.get(scan.scanner);
  }

  /** Return the explained beam, {scan, number, beam}, or null. */
  explained() {
    const { scan, beam: number } = this;
    if (this.held) return this.held;
    const beam = scan && number !== null ? this.beamsOf(scan)[number] : undefined;
    return beam ? { scan, number, beam } : null;
  }

  /** Keep the explained beam of the present scan, or follow new scans again. */
  hold(on) {
    this.held = null;
    this.held = on ? this.explained() : null;
  }

  /** Count the beams of a scan: {beams, through, spent, returned}. */
  countBeams(scan) {
    const beams = this.beamsOf(scan);
    return {
      beams: beams.length,
      through: beams.filter((beam) => beam.through).length,
      spent: beams.filter((beam) => beam.end?.kind === "spent").length,
      returned: beams.filter((beam) => Number.isFinite(beam.range)).length,
    };
  }

  /** Store the image of a map; `drawn` is called once the image is decoded. */
  takeMap(message, drawn) {
    if (!message.png) {
      this.maps.delete(message.robot);
      drawn();
      return;
    }
    const image = new Image();
    image.onload = () => {
      this.maps.set(message.robot, { ...message, image });
      drawn();
    };
    image.src = `data:image/png;base64,${message.png}`;
  }

  takeTask(task) {
    this.tasks.delete(task.id); // moves the newest task to the end
    this.tasks.set(task.id, task);
    if (task.kind === "goto") this.drives.set(task.robot, task.state);
    const ended = [...this.tasks.values()].filter((one) => one.state !== "running");
    for (const old of ended.slice(0, -4)) this.tasks.delete(old.id);
  }

  /** Return the state of a robot's newest drive to a goal. */
  stateOfGoal(robot) {
    return this.drives.get(robot) ?? "running";
  }

  /** Return the extent of the scene and of the selected map; see `extent`. */
  extentWithMap() {
    const [x0, y0, x1, y1] = this.extent();
    const map = this.maps.get(this.chosen);
    if (!map) return [x0, y0, x1, y1];
    const [x, y] = map.origin;
    const [right, top] = [x + map.width * map.resolution, y + map.height * map.resolution];
    return [Math.min(x0, x), Math.min(y0, y), Math.max(x1, right), Math.max(y1, top)];
  }

  /** Return the extent of the scene, or of robots and readings, [x0, y0, x1, y1], m. */
  extent() {
    if (this.scene) return this.scene.bounds;
    const points = this.frame.robots.flatMap((robot) => [
      [robot.x - 3, robot.y - 3],
      [robot.x + 3, robot.y + 3],
      ...robot.scans.flatMap((scan) => {
        const far = Math.max(0, ...[...scan.ranges].filter(Number.isFinite));
        return [[scan.x - far, scan.y - far], [scan.x + far, scan.y + far]];
      }),
    ]);
    if (!points.length) return [-5, -5, 5, 5];
    const [xs, ys] = [points.map((point) => point[0]), points.map((point) => point[1])];
    return [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)];
  }
}
