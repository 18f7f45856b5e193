// The panel of tasks: drive to a goal, explore, and build a map.

import { byId, element, setOptions, setText } from "./elements.js";

const WORDS = { running: "running", done: "done", failed: "failed", cancelled: "cancelled" };

export class TasksPanel extends EventTarget {
  /** Fires `pick` when the user wants to click a goal on the plan. */
  constructor(world, link) {
    super();
    Object.assign(this, { world, link });
    this.goto = byId("goto");
    this.explore = byId("explore");
    this.mapping = byId("mapping");
    this.goto.addEventListener("submit", (event) => {
      event.preventDefault();
      this.go(this.goto.x.valueAsNumber, this.goto.y.valueAsNumber);
    });
    this.explore.addEventListener("submit", (event) => {
      event.preventDefault();
      this.map(true); // sends the chosen colours
      link.send("explore", { robot: world.chosen, strategy: this.explore.strategy.value });
    });
    this.mapping.addEventListener("submit", (event) => event.preventDefault());
    this.mapping.addEventListener("change", () => this.map(this.mapping.on.checked));
    byId("goal-pick").addEventListener("click", () => this.dispatchEvent(new Event("pick")));
  }

  /** Show the algorithms and strategies of the commander. */
  takeHello({ algorithms, strategies }) {
    setOptions(this.goto.algorithm, algorithms);
    setOptions(this.explore.strategy, strategies);
  }

  /** The heading in the form, rad, or null. */
  get heading() {
    const degrees = this.goto.heading.valueAsNumber;
    return Number.isNaN(degrees) ? null : (degrees * Math.PI) / 180;
  }

  /** Send the selected robot to a goal, m; a heading, rad, replaces the form's heading. */
  go(x, y, heading) {
    if (heading !== undefined) this.goto.heading.value = Math.round((heading * 180) / Math.PI);
    this.goto.x.value = x.toFixed(2);
    this.goto.y.value = y.toFixed(2);
    const { chosen, robot } = this.world;
    if (!robot?.mine) return;
    if (robot.hindrance) {
      setText(byId("error"), `${chosen} cannot drive autonomously: ${robot.hindrance}`);
      return;
    }
    setText(byId("error"), ""); // of an earlier goal
    this.world.goal = [x, y, this.heading];
    const { algorithm } = this.goto;
    this.link.send("goto", { robot: chosen, algorithm: algorithm.value, goal: [x, y], heading: this.heading });
  }

  /** Start or end a map of the selected sensor's scans, or change its colours. */
  map(on) {
    const scanner = this.world.scan?.scanner ?? null;
    this.link.send("map", { robot: this.world.chosen, on, colours: this.mapping.colours.value, scanner });
  }

  /** Show whether the selected robot has a map. */
  updateMap() {
    this.mapping.on.checked = this.world.maps.has(this.world.chosen);
  }

  update() {
    const tasks = [...this.world.tasks.values()].reverse();
    const list = byId("tasks");
    list.replaceChildren(...tasks.map((task) => this.row(task)));
  }

  row({ id, robot, kind, state, text }) {
    const told = [robot, text || kind, WORDS[state] ?? state].join(" · ");
    const row = element("li", { className: state }, element("span", { textContent: told }));
    if (state === "running") {
      const cancel = element("button", { type: "button", textContent: "Cancel", "aria-label": `Cancel ${told}` });
      cancel.addEventListener("click", () => this.link.send("cancel", { task: id }));
      row.append(cancel);
    }
    return row;
  }
}

/** Return the number of running tasks, as a text for the status line. */
export function countTasks(world) {
  const running = [...world.tasks.values()].filter((task) => task.state === "running").length;
  return running === 1 ? "1 task" : `${running} tasks`;
}
