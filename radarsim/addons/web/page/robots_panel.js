// The list of robots, the state of the selected one, and the form that adds one.

import { byId, element, setOptions, setText } from "./elements.js";

const PLACE = "at a pose"; // no start has this name, as their names have no blanks

export class RobotsPanel extends EventTarget {
  /** Fires `choose` (detail: name of the robot), and `pick` to pick a pose on the plan. */
  constructor(world, link) {
    super();
    Object.assign(this, { world, link, names: "" });
    this.list = byId("robots");
    this.form = byId("spawn");
    this.form.addEventListener("submit", (event) => this.spawn(event));
    this.form.where.addEventListener("change", () => this.showPlace());
    byId("spawn-pick").addEventListener("click", () => this.dispatchEvent(new Event("pick")));
    byId("remove").addEventListener("click", () => link.send("remove", { robot: world.chosen }));
  }

  /** Show the robot classes and starts of a server. */
  takeHello({ classes, starts, played }) {
    byId("add").hidden = played;
    setOptions(this.form.elements.class, classes); // the first class has both radar and laser
    const first = starts.length ? [{ name: "", label: "first free start" }] : [];
    setOptions(this.form.where, [...first, ...starts.map((start) => start.name), PLACE]);
    this.showPlace();
  }

  /** Add a robot of the chosen class at a start. */
  spawnAt(start) {
    this.link.send("spawn", { class: this.form.elements.class.value, start });
  }

  showPlace() {
    byId("spawn-place").hidden = this.form.where.value !== PLACE;
  }

  /** Set the pose at which a robot is added, m and rad; yaw may be left unchanged. */
  setPlace(x, y, yaw) {
    this.form.where.value = PLACE;
    this.showPlace();
    this.form.x.value = x.toFixed(2);
    this.form.y.value = y.toFixed(2);
    if (yaw !== undefined) this.form.yaw.value = Math.round((yaw * 180) / Math.PI);
  }

  spawn(event) {
    event.preventDefault();
    const { where, x, y, yaw } = this.form;
    const { class: robotClass, name } = this.form.elements;
    const turned = (yaw.valueAsNumber * Math.PI) / 180;
    const pose = [x.valueAsNumber, y.valueAsNumber, turned];
    const place = where.value === PLACE ? { pose } : where.value ? { start: where.value } : {};
    const named = name.value.trim() ? { name: name.value.trim() } : {};
    this.link.send("spawn", { class: robotClass.value, ...named, ...place });
    name.value = "";
  }

  update() {
    const { robots } = this.world.frame;
    const names = JSON.stringify(robots.map((robot) => robot.name));
    if (names !== this.names && this.world.framed) {
      if (!robots.length || this.names === "[]") byId("add").open = !robots.length;
      this.names = names;
      this.list.replaceChildren(...robots.map((robot) => this.row(robot.name)));
      byId("no-robots").hidden = robots.length > 0;
    }
    if (!this.world.framed) return;
    robots.forEach((robot, number) => this.updateRow(this.list.children[number].firstChild, robot));
    this.updateChosen();
  }

  row(name) {
    const button = element("button", { type: "button" }, element("strong", { textContent: name }), element("span"));
    button.addEventListener("click", () => this.dispatchEvent(new CustomEvent("choose", { detail: name })));
    return element("li", {}, button);
  }

  updateRow(button, robot) {
    const chosen = String(robot.name === this.world.chosen);
    if (button.getAttribute("aria-pressed") !== chosen) button.setAttribute("aria-pressed", chosen);
    button.style.setProperty("--own", robot.colour ?? "transparent");
    setText(button.lastChild, `${robot.class} · ${this.driverOf(robot)}${robot.touch ? " · in contact" : ""}`);
  }

  driverOf({ driver, mine }) {
    if (driver === "task") return "has a task";
    if (driver && driver === this.world.hello?.viewer) return "you drive";
    if (driver) return `${driver} drives`;
    if (this.world.hello?.played) return "recorded";
    return mine ? "idle" : "another client's";
  }

  updateChosen() {
    const { robot } = this.world;
    byId("own").classList.toggle("off", !robot?.mine);
    for (const control of byId("own").querySelectorAll("button, input, select")) {
      control.disabled = !mayUse(control.form?.id, robot);
    }
    const hindrance = robot?.mine ? robot.hindrance : null;
    setText(byId("hindrance"), hindrance ? `The robot cannot drive autonomously: ${hindrance}.` : "");
    setText(byId("driven"), robot?.name ?? "");
    setText(byId("driving"), robot ? describe(robot, this.world.hello?.played) : "Add a robot first.");
  }
}

/** Whether the controls of a form, or outside of forms, can be used for a robot. */
function mayUse(form, robot) {
  if (form === "mapping") return Boolean(robot);
  if (form === "goto" || form === "explore") return Boolean(robot?.mine && !robot.hindrance);
  return Boolean(robot?.mine);
}

function describe(robot, played) {
  const degrees = Math.round((robot.yaw * 180) / Math.PI);
  const place = `x ${robot.x.toFixed(2)} m, y ${robot.y.toFixed(2)} m, heading ${degrees}°`;
  const speed = robot.speeds ? `, ${robot.speeds[0].toFixed(2)} m/s` : "";
  const others = played ? "Its motion was recorded." : "Another client drives it.";
  const hint = robot.mine ? "Hold W A S D to drive." : others;
  return `${place}${speed}. ${hint}`;
}
