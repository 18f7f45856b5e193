// The scene in 3D, drawn by three.js, which is loaded when the view is first opened.

import { beamPoint } from "./beams.js";
import { prepareCanvas } from "./elements.js";
import { drawLabel } from "./label.js";
import { layers } from "./layers.js";
import { readingColour } from "./readings.js";
import { freeStarts } from "./starts.js";
import { sensorColour, theme } from "./theme.js";

const HULL = 0.25; // m; height of the hull of a robot
const TALL = 0.9; // m; taller parts that are also long are drawn transparent, as walls
const WIDE = 1.4; // aspect ratio of a view that the scene fits into
const NEAR = 1.5; // m; starts closer to a robot have no name
const LONG = 0.4; // least length of walls, as a share of the scene's larger side

export class Space extends EventTarget {
  /** Fires `tap` (detail: {x, y, shift}, m, on the horizontal plane of the sensor). */
  constructor(canvas, labels, world) {
    super();
    Object.assign(this, { canvas, labels, world, three: null, robots: new Map() });
  }

  /** Load three.js and build the scene, from its triangles if they have arrived. */
  async open() {
    if (this.three) return;
    this.three = await import("./three.bundle.js");
    this.build();
    this.takeTriangles(this.world.triangles);
  }

  build() {
    const T = this.three;
    this.renderer = new T.WebGLRenderer({ canvas: this.canvas, antialias: true });
    this.scene = new T.Scene();
    this.camera = new T.PerspectiveCamera(42, 1, 0.1, 2000);
    this.camera.up.set(0, 0, 1);
    this.controls = new T.OrbitControls(this.camera, this.canvas);
    this.controls.maxPolarAngle = 0.495 * Math.PI;
    this.controls.addEventListener("change", () => this.dispatchEvent(new Event("change")));
    this.scene.add(new T.HemisphereLight("#ffffff", "#777788", 2.4));
    this.sun = new T.DirectionalLight("#ffffff", 1.6);
    this.scene.add(this.sun);
    this.solids = new T.Group();
    this.lines = lineSegments(T);
    this.points = new T.Points(new T.BufferGeometry(), new T.PointsMaterial({ size: 7, sizeAttenuation: false, vertexColors: true }));
    this.points.frustumCulled = false;
    this.scene.add(this.solids, this.lines, this.points);
    this.canvas.addEventListener("click", (event) => this.click(event));
    this.fit();
  }

  /** Move the camera to a view of the whole scene from above, from the south-west. */
  fit() {
    if (!this.three) return;
    const [x0, y0, x1, y1] = this.world.extent();
    const size = Math.max(x1 - x0, y1 - y0);
    const middle = [(x0 + x1) / 2, (y0 + y1) / 2];
    // In a narrow view, the camera is farther away to show the whole width.
    const away = size * Math.max(1, (WIDE * this.canvas.clientHeight) / Math.max(this.canvas.clientWidth, 1));
    // The target is slightly south of the centre, so that the legend covers no part.
    const [x, y] = [middle[0], middle[1] - 0.06 * away];
    this.camera.position.set(x - 0.32 * away, y - 0.98 * away, 0.9 * away);
    this.controls.target.set(x, y, 0);
    this.controls.update();
    this.sun.position.set(middle[0] - size, middle[1] - 0.6 * size, 2 * size);
  }

  zoom(factor) {
    if (!this.three) return;
    const { target } = this.controls;
    this.camera.position.sub(target).multiplyScalar(1 / factor).add(target);
    this.controls.update();
  }

  /** Replace the triangles of the scene. */
  takeTriangles(triangles) {
    if (!this.three) return;
    this.solids.traverse((solid) => solid.geometry?.dispose());
    this.solids.clear();
    const [x0, y0, x1, y1] = this.world.extent();
    const size = Math.max(x1 - x0, y1 - y0);
    for (const part of triangles?.parts ?? []) this.solids.add(this.solid(part, size));
    this.fit();
  }

  solid(part, size) {
    const T = this.three;
    const shape = new T.BufferGeometry();
    shape.setAttribute("position", new T.BufferAttribute(new Float32Array(part.vertices), 3));
    shape.setIndex(part.faces);
    const flat = shape.toNonIndexed(); // keeps edges sharp
    flat.computeVertexNormals();
    flat.computeBoundingBox();
    shape.dispose();
    const { min, max } = flat.boundingBox;
    const encloses = max.z - min.z > TALL && Math.max(max.x - min.x, max.y - min.y) > LONG * size;
    const opacity = encloses ? 0.22 : part.opaque ? 1 : 0.5;
    const material = new T.MeshLambertMaterial({
      color: part.colour, opacity, transparent: opacity < 1, depthWrite: opacity === 1, side: T.DoubleSide,
    });
    return new T.Mesh(flat, material);
  }

  draw() {
    if (!this.three || !this.canvas.clientWidth) return;
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    this.renderer.setPixelRatio(window.devicePixelRatio || 1);
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.scene.background = new this.three.Color(theme.paper);
    this.solids.visible = layers.truth;
    this.placeRobots();
    this.placeReadings();
    this.renderer.render(this.scene, this.camera);
    this.drawLabels();
  }

  /** Write the names of robots and starts, and the reading of the explained beam. */
  drawLabels() {
    const { pen, width, height } = prepareCanvas(this.labels);
    const { robot, beam, scan } = this.world;
    pen.textAlign = "center";
    const write = (text, weight, x, y, z) => {
      const place = new this.three.Vector3(x, y, z).project(this.camera);
      if (place.z > 1) return; // behind the camera
      pen.font = `${weight} 12px system-ui, sans-serif`;
      drawLabel(pen, text, ((place.x + 1) / 2) * width, ((1 - place.y) / 2) * height);
    };
    const near = (start) => this.world.frame.robots.some((one) => Math.hypot(one.x - start.x, one.y - start.y) < NEAR);
    for (const start of freeStarts(this.world)) write(near(start) || !layers.names ? "▲" : `▲ ${start.name}`, 400, start.x, start.y, 0);
    for (const one of layers.names ? this.world.frame.robots : []) write(one.name, one === robot ? 600 : 400, one.x, one.y, 0.8);
    if (scan && beam !== null && beam < scan.count) {
      const range = scan.ranges[beam];
      const text = Number.isFinite(range) ? `${beam}: ${range.toFixed(2)} m` : `${beam}: –`;
      write(text, 600, ...beamPoint(scan, beam, Number.isFinite(range) ? range : scan.max), scan.z + 0.2);
    }
    pen.textAlign = "left";
  }

  placeRobots() {
    const present = new Set();
    for (const robot of this.world.frame.robots) {
      present.add(robot.name);
      if (!this.robots.has(robot.name)) this.robots.set(robot.name, this.model(robot));
      const model = this.robots.get(robot.name);
      model.position.set(robot.x, robot.y, 0);
      model.rotation.z = robot.yaw;
      model.hull.color.set(robot.touch ? theme.alarm : (robot.colour ?? (robot.name === this.world.chosen ? theme.radar : theme.quiet)));
    }
    for (const [name, model] of this.robots) {
      if (present.has(name)) continue;
      this.scene.remove(model);
      this.robots.delete(name);
    }
  }

  /** Build a robot: a hull on four wheels, with a plate that marks its front. */
  model(robot) {
    const T = this.three;
    const [length, width] = robot.size ?? [0.6, 0.5];
    const group = new T.Group();
    group.hull = new T.MeshLambertMaterial();
    const dark = new T.MeshLambertMaterial({ color: theme.ink });
    const add = (shape, material, x, y, z) => {
      const mesh = new T.Mesh(shape, material);
      mesh.position.set(x, y, z);
      group.add(mesh);
    };
    add(new T.BoxGeometry(length, 0.62 * width, HULL), group.hull, 0, 0, 0.1 + HULL / 2);
    add(new T.BoxGeometry(0.3 * length, 0.3 * width, 0.04), dark, 0.3 * length, 0, 0.12 + HULL);
    for (const along of [-1, 1]) {
      for (const across of [-1, 1]) {
        add(new T.CylinderGeometry(0.11, 0.11, 0.1, 16), dark, along * 0.26 * length, across * 0.4 * width, 0.11);
      }
    }
    this.scene.add(group);
    return group;
  }

  /** Place all readings, and the rays of the selected scan. */
  placeReadings() {
    const T = this.three;
    const [ends, colours] = [[], []];
    for (const robot of this.world.frame.robots) {
      for (const scan of robot.scans) {
        if (!layers[`${scan.kind} readings`]) continue;
        const { r, g, b } = new T.Color(readingColour(robot, scan, robot.name === this.world.chosen));
        const { points } = scan;
        for (let beam = 0; beam < scan.count; beam++) {
          if (Number.isNaN(points[2 * beam])) continue;
          ends.push(points[2 * beam], points[2 * beam + 1], scan.z);
          colours.push(r, g, b, 1);
        }
      }
    }
    fill(T, this.points.geometry, ends, colours);
    const { scan } = this.world;
    const rays = layers[`${scan?.kind} rays`] ? this.traceRays(scan) : { places: [], colours: [] };
    fill(T, this.lines.geometry, rays.places, rays.colours);
  }

  /** Return the rays of a scan, fainter with less power, stronger if through objects. */
  traceRays(scan) {
    const [places, colours] = [[], []];
    const [ink, colour] = [theme.ink, sensorColour(scan.kind)].map((name) => new this.three.Color(name));
    this.world.beamsOf(scan).forEach((beam, number) => {
      const chosen = number === this.world.beam;
      const [least, most] = chosen ? [1, 0] : beam.through ? [0.45, 0.55] : [0.08, 0.3];
      for (let knot = 1; knot < beam.power.length; knot++) {
        for (const [range, power] of [beam.power[knot - 1], beam.power[knot]]) {
          places.push(...beamPoint(scan, number, range), scan.z);
          colours.push(...(chosen ? ink : colour), least + most * power);
        }
      }
    });
    return { places, colours };
  }

  /** Convert a click into a `tap` on the plane of the sensor; drags rotate the camera. */
  click(event) {
    const T = this.three;
    const { scan } = this.world;
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    const caster = new T.Raycaster();
    caster.setFromCamera(new T.Vector2((2 * event.offsetX) / width - 1, 1 - (2 * event.offsetY) / height), this.camera);
    const point = caster.ray.intersectPlane(new T.Plane(new T.Vector3(0, 0, 1), -(event.shiftKey ? 0 : (scan?.z ?? 0))), new T.Vector3());
    if (point) this.dispatchEvent(new CustomEvent("tap", { detail: { x: point.x, y: point.y, shift: event.shiftKey } }));
  }
}

function lineSegments(T) {
  const lines = new T.LineSegments(new T.BufferGeometry(), new T.LineBasicMaterial({ vertexColors: true, transparent: true, depthWrite: false }));
  lines.frustumCulled = false;
  return lines;
}

function fill(T, geometry, positions, colours) {
  geometry.dispose();
  geometry.setAttribute("position", new T.BufferAttribute(new Float32Array(positions), 3));
  geometry.setAttribute("color", new T.BufferAttribute(new Float32Array(colours), 4));
}
