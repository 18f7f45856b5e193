// The page of the commander: receives messages, sends requests of the user, and draws.

import { BeamPanel, updateMaterials } from "./beam_panel.js";
import { beamTowards } from "./beams.js";
import { Drive, followStick } from "./drive.js";
import { byId, isTyping, setText } from "./elements.js";
import { Clearance } from "./clearance.js";
import { decodeFrame } from "./frame.js";
import { followLayers } from "./layers.js";
import { updateLegend, writeFinding } from "./legend.js";
import { Link } from "./link.js";
import { Measure } from "./measure.js";
import { describePlan, Plan } from "./plan.js";
import { Polar } from "./polar.js";
import { RobotsPanel } from "./robots_panel.js";
import { savePicture } from "./screenshot.js";
import { SettingsPanel } from "./settings_panel.js";
import { Space } from "./space.js";
import { startAt } from "./starts.js";
import { countTasks, TasksPanel } from "./tasks_panel.js";
import { followTheme, theme } from "./theme.js";
import { TimePanel } from "./time_panel.js";
import { Viewport } from "./viewport.js";
import { World } from "./world.js";

const world = new World();
const link = new Link();
const viewport = new Viewport(byId("plan"), () => [Math.max(depthOf("finding"), depthOf("zoom")), byId("legend").offsetHeight]);
const clearance = new Clearance();
const measure = new Measure();
const plan = new Plan(byId("plan"), world, viewport, clearance, measure);
const space = new Space(byId("space"), byId("labels"), world);
const polars = ["radar", "laser"].map((kind) => new Polar(byId(kind), world, kind));
const robots = new RobotsPanel(world, link);
const settings = new SettingsPanel(world, link);
const tasks = new TasksPanel(world, link);
const beam = new BeamPanel(world);
const time = new TimePanel(world, link);
const drive = new Drive(link, () => (world.robot?.mine ? world.chosen : null), stopAll);

const touch = matchMedia("(pointer: coarse), (max-width: 800px)");
const MARGIN = 10; // px above the elements at the top of the stage
let view = "plan";
let picking = null; // what the next click on the scene places: "robot", "goal", "measure"
let shown = { frames: 0, since: performance.now(), rate: 0 };
let unacknowledged = null; // time of a frame that is not drawn yet
let waiting = false;

// --- messages -------------------------------------------------------------------------

const takers = {
  hello(message) {
    world.hello = message;
    for (const panel of [robots, settings, tasks]) panel.takeHello(message);
    setText(byId("level"), message.level ?? "");
    setText(byId("notice"), "");
    setText(byId("error"), "");
    tellLink("connected", "connected");
    if (world.chosen) select(world.chosen);
    tellWhetherSeen();
  },
  scene(message) {
    world.takeScene(message);
    plan.takeScene(message);
    clearance.takeScene(message);
    fit();
    if (view === "space") link.send("triangles");
  },
  triangles(message) {
    world.triangles = message;
    space.takeTriangles(message);
  },
  map(message) {
    world.takeMap(message, () => {
      tasks.updateMap();
      fit();
    });
  },
  path(message) {
    world.paths.set(message.robot, message);
    if (message.robot === world.chosen) world.goal = null;
  },
  task(message) {
    world.takeTask(message);
    if (message.state !== "running") world.goal = null;
    if (message.state === "failed") setText(byId("error"), `${message.robot}: ${message.text}`);
    tasks.update();
  },
  spawned({ robot }) {
    world.wanted = robot;
    setText(byId("notice"), "");
  },
  viewer: () => {},
  time(message) {
    world.time = message;
    time.take();
  },
  recording({ on, text }) {
    byId("record").setAttribute("aria-pressed", String(on));
    setText(byId("notice"), text);
  },
  notice: ({ text }) => setText(byId("notice"), text),
  error({ text }) {
    setText(byId("error"), text);
    world.goal = null;
  },
  lost: ({ text }) => showLost(text || "The connection to the server is lost. Reconnecting…"),
  found: () => showLost(null),
};

function receive(message) {
  if (message instanceof ArrayBuffer) takeFrame(decodeFrame(message));
  else takers[message.op]?.(message);
  redraw();
}

function takeFrame(frame) {
  const driven = drive.driven;
  const first = !world.frame.robots.length;
  const chose = world.takeFrame(frame);
  if (driven && !frame.robots.some((robot) => robot.name === driven)) {
    drive.forget(driven);
    setText(byId("error"), `${driven} was removed; driving has ended.`);
  }
  if (chose) select(world.chosen);
  if (first) fit();
  unacknowledged = frame.t ?? 0;
}

// An error is shown until the user clicks a button.
document.addEventListener("click", ({ target }) => {
  if (target.closest?.("button")) setText(byId("error"), "");
}, true);
link.addEventListener("message", ({ detail }) => receive(detail));
link.addEventListener("state", ({ detail }) => {
  if (detail === "open") {
    world.wanted ??= world.chosen;
    world.reset();
    plan.takeScene(null);
    clearance.takeScene(null);
  } else if (detail === "refused") {
    tellLink("refused", link.token ? "wrong token" : "no token");
    showLost(`${link.token ? "The token belongs to another commander." : "There is no token."} Open the whole address that radarsim printed at its start.`);
  } else {
    tellLink("lost", "connection lost");
    showLost("The connection to the commander is lost. Reconnecting…");
    drive.forget(drive.driven);
  }
});

function tellLink(state, text) {
  byId("link").dataset.state = state;
  setText(byId("link"), text);
  if (state === "connected") showLost(null);
}

function showLost(text) {
  byId("lost").hidden = !text;
  setText(byId("lost"), text ?? "");
  document.body.classList.toggle("stale", Boolean(text));
}

/** Report whether the page is visible; the server sends no frames to a hidden page. */
function tellWhetherSeen() {
  link.send("look", { on: !document.hidden });
}

// --- drawing --------------------------------------------------------------------------

function redraw() {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(draw);
}

function draw() {
  waiting = false;
  if (view === "space") space.draw();
  else if (view !== "scans") plan.draw(view, picking, aimedAt());
  for (const polar of polars) polar.draw();
  for (const panel of [robots, settings, beam]) panel.update();
  updateMaterials(world);
  updateLegend(world, view);
  writeFinding(world, view);
  byId("stick").hidden = !(touch.matches && world.robot?.mine);
  byId("plan").setAttribute("aria-label", describePlan(world));
  time.update();
  writeStatus();
  if (unacknowledged !== null) acknowledge();
}

/** Acknowledge a frame that is drawn, so that the server sends the next frame. */
function acknowledge() {
  link.send("ack", { t: unacknowledged });
  document.dispatchEvent(new CustomEvent("drawn", { detail: { t: unacknowledged } }));
  unacknowledged = null;
  shown.frames += 1;
}

function writeStatus() {
  const now = performance.now();
  if (now - shown.since > 1000) {
    shown = { frames: 0, since: now, rate: (shown.frames * 1000) / (now - shown.since) };
  }
  const count = world.frame.robots.length;
  const robotsText = count === 1 ? "1 robot" : `${count} robots`;
  setText(byId("status"), `${robotsText} · ${shown.rate.toFixed(0)} frames/s · ${countTasks(world)}`);
}

// --- user actions ---------------------------------------------------------------------

function select(name) {
  world.choose(name);
  link.send("select", { robot: name });
  tasks.updateMap();
  fit();
}

function stopAll() {
  drive.release();
  link.send("stop");
  world.goal = null;
  pick(null);
  setText(byId("notice"), "Stopped.");
}

function selectBeam(scanner, number) {
  const scan = world.robot?.scans.find((one) => one.scanner === scanner);
  if (!scan) return;
  world.scanner = scanner;
  world.beam = Math.min(Math.max(number, 0), scan.count - 1);
  world.held = null;
  redraw();
}

/** Handle a click on the scene: place a robot or goal, use a start, or select a beam. */
function tap({ x, y, heading, shift }) {
  const start = view === "plan" && !picking ? startAt(world, viewport, x, y) : undefined;
  if (picking === "measure") {
    measure.tap(x, y);
    writeAim(measure.text || "Click the other end (Esc cancels).");
  } else if (shift || picking === "goal") {
    if (goTo(x, y, heading)) pick(null);
  } else {
    if (picking === "robot") robots.setPlace(x, y, heading);
    else if (start) robots.spawnAt(start.name);
    else if (world.scan) selectBeam(world.scan.scanner, beamTowards(world.scan, x, y));
    pick(null);
  }
  redraw();
}

/** Send the selected robot to a goal; return false if it is too close to an obstacle. */
function goTo(x, y, heading) {
  world.pointer = [x, y]; // fingers do not hover, so it is set here
  const problem = clearance.problem(world.robot, [x, y]);
  if (problem) {
    setText(byId("error"), `The goal is too near to an obstacle: ${problem}.`);
    pick("goal");
    return false;
  }
  tasks.go(x, y, heading);
  return true;
}

function pick(what) {
  picking = what;
  viewport.turning = what === "goal" || what === "robot";
  viewport.pressed = viewport.aim = null;
  if (what !== "measure") measure.clear();
  byId("measure").setAttribute("aria-pressed", String(what === "measure"));
  if (what && view !== "plan" && (view !== "space" || what !== "goal")) show("plan");
  const drag = view === "plan" ? ", or drag to set the heading" : "";
  const words = { robot: `Click the start position${drag}`, goal: `Click the goal${drag}`, measure: "Click two points to measure" };
  writeAim(what ? `${words[what]} (Esc cancels).` : "");
  byId("stage").classList.toggle("picking", Boolean(what));
  redraw();
}

/** Return the pose that is being picked, [x, y, heading], or null. */
function aimedAt() {
  const hovered = picking === "goal" && world.pointer ? [...world.pointer, tasks.heading] : null;
  return viewport.aim ?? hovered;
}

function writeAim(text) {
  byId("aim").hidden = !text;
  setText(byId("aim"), text);
}

/** Save the view as a picture. */
function takePicture() {
  if (view === "scans") show("plan");
  draw(); // WebGL clears its canvas after each frame
  const canvases = view === "space" ? [byId("space"), byId("labels")] : [byId("plan")];
  const level = world.hello?.level || "radarsim";
  const when = `${(world.frame.t ?? 0).toFixed(2)} s`;
  const text = [level, when, byId("finding").textContent].filter(Boolean).join(" · ");
  savePicture(canvases, `${level}_${when.replace(" ", "")}.png`.replace(/[^\w.-]+/g, "_"), { text, paper: theme.paper, ink: theme.ink });
}

/** Return the bottom of an element at the top of the stage, px below the margin. */
function depthOf(name) {
  const [part, stage] = [byId(name), byId("stage")].map((one) => one.getBoundingClientRect());
  return part.bottom - stage.top - MARGIN;
}

async function show(name) {
  view = name;
  for (const button of document.querySelectorAll("[data-view]")) {
    button.setAttribute("aria-pressed", String(button.dataset.view === name));
  }
  byId("plan").hidden = name === "space";
  byId("space").hidden = byId("labels").hidden = name !== "space";
  document.body.classList.toggle("only-scans", name === "scans");
  if (name === "space") {
    if (!world.triangles && world.scene) link.send("triangles");
    await space.open();
  }
  fit();
}

/** Fit the view to the whole scene, unless the user has moved it. */
function fit() {
  if (viewport.fitted) viewport.fit(view === "map" ? world.extentWithMap() : world.extent());
  redraw();
}

function zoom(step) {
  if (view === "space") {
    if (step) space.zoom(step > 0 ? 1.25 : 0.8);
    else space.fit();
  } else if (step) {
    if (step > 0) viewport.zoomIn();
    else viewport.zoomOut();
  } else {
    viewport.fitted = true;
    fit();
  }
  redraw();
}

const KEYS = {
  "1": () => show("plan"),
  "2": () => show("space"),
  "3": () => show("map"),
  "4": () => show("scans"),
  p: () => time.toggle(),
  ".": () => time.step(),
  l: () => byId("layers").toggleAttribute("open"),
  m: () => pick(picking === "measure" ? null : "measure"),
  "+": () => zoom(1),
  "=": () => zoom(1),
  "-": () => zoom(-1),
  "0": () => zoom(0),
};

addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || isTyping(event.target)) return;
  const step = { ArrowLeft: 1, ArrowRight: -1 }[event.key]; // beams are numbered from the right
  if (step && event.target.matches("canvas") && world.scan) {
    event.preventDefault();
    const count = world.scan.count;
    const number = world.beam ?? Math.floor(count / 2) - step;
    selectBeam(world.scan.scanner, (number + step + count) % count);
  } else if (KEYS[event.key]) {
    KEYS[event.key]();
  }
});

// The scene gets the focus after a click on a button, so that Space stops robots.
addEventListener("click", ({ target, detail }) => {
  if (detail && target.closest("button, summary")) {
    byId(view === "space" ? "space" : "plan").focus({ preventScroll: true });
  }
});

for (const button of document.querySelectorAll("[data-view]")) {
  button.addEventListener("click", () => show(button.dataset.view));
}
byId("stop").addEventListener("click", stopAll);
byId("record").addEventListener("click", (event) => {
  link.send("record", { on: event.currentTarget.getAttribute("aria-pressed") !== "true" });
});
byId("zoom-in").addEventListener("click", () => zoom(1));
byId("zoom-out").addEventListener("click", () => zoom(-1));
byId("zoom-fit").addEventListener("click", () => zoom(0));
for (const source of [viewport, space]) {
  source.addEventListener("change", redraw);
  source.addEventListener("tap", ({ detail }) => tap(detail));
}
for (const source of [...polars, beam]) {
  source.addEventListener("beam", ({ detail }) => selectBeam(detail.scanner, detail.beam));
}
viewport.addEventListener("hover", ({ detail }) => {
  world.pointer = detail;
  byId("stage").classList.toggle("pointing", Boolean(!picking && plan.pointedStart && view === "plan"));
  redraw();
});
byId("measure").addEventListener("click", () => KEYS.m());
byId("picture").addEventListener("click", takePicture);
robots.addEventListener("choose", ({ detail }) => select(detail));
robots.addEventListener("pick", () => pick("robot"));
tasks.addEventListener("pick", () => pick("goal"));
followStick(byId("stick"), drive);
document.addEventListener("visibilitychange", tellWhetherSeen);
followTheme(redraw);
followLayers(redraw);
for (const part of ["stage", "legend", "finding", "zoom"]) new ResizeObserver(fit).observe(byId(part));
