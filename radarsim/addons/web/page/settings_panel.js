// The settings of a scanner, with one control for each setting of the commander's list.

import { sensorName } from "./beams.js";
import { byId, element, setText } from "./elements.js";

const PAUSE = 90; // ms between two values that a moving slider sends
const OWN = 1500; // ms that a control keeps a value of the user
const UNLIMITED = "unlimited";

export class SettingsPanel {
  constructor(world, link) {
    Object.assign(this, { world, link, controls: [] });
    byId("settings").addEventListener("submit", (event) => event.preventDefault());
  }

  /** Create the controls for the settings of a server. */
  takeHello({ settings }) {
    const controls = settings.map((setting) => this.control(setting));
    const last = settings.findLastIndex((setting) => setting.slides);
    const main = controls.filter(({ setting }, i) => i <= last || setting.key === "return_mode");
    const more = controls.filter((control) => !main.includes(control));
    byId("main-settings").replaceChildren(...main.map((control) => control.label));
    byId("more-settings").lastElementChild.replaceChildren(...more.map((control) => control.label));
    byId("more-settings").hidden = !more.length;
    this.controls = controls;
  }

  control(setting) {
    const input = makeInput(setting);
    // An <output> element would take the label from the input.
    const output = element("span", { className: "value", "aria-hidden": "true" });
    const name = setting.unit ? `${setting.label}, ${setting.unit}` : setting.label;
    const className = input.type === "number" ? "field" : setting.type;
    const label = element("label", { className }, element("span", { textContent: name }), output, input);
    const control = { setting, input, output, label, touched: -Infinity, timer: 0 };
    input.addEventListener(input.type === "number" ? "change" : "input", () => this.change(control));
    return control;
  }

  /** Send a new value; of quick changes, only the last value in each pause is sent. */
  change(control) {
    control.touched = performance.now();
    showValue(control, readValue(control));
    control.timer ||= setTimeout(() => {
      control.timer = 0;
      const value = readValue(control);
      const [robot, scanner] = [this.world.chosen, this.world.scan?.scanner];
      if (!robot || !scanner || value === null) return;
      this.link.send("setting", { robot, scanner, key: control.setting.key, value });
    }, PAUSE);
  }

  /** Show the values of the selected scanner. */
  update() {
    const { robot, scan } = this.world;
    setText(byId("settings-heading"), scan ? `Sensor: ${sensorName(scan)}` : "Sensor");
    setText(byId("settings-note"), noteOf(robot, scan));
    byId("settings").hidden = !scan;
    for (const control of this.controls) {
      const value = scan?.settings?.[control.setting.key];
      control.label.hidden = value === undefined;
      control.input.disabled = !robot?.mine;
      const busy = performance.now() - control.touched < OWN || isEdited(control.input);
      if (value === undefined || busy) continue;
      writeValue(control, value);
      showValue(control, value);
    }
  }
}

function noteOf(robot, scan) {
  if (!robot) return "Select a robot to see its sensors.";
  if (!scan) return "This robot has no range scanner.";
  return robot.mine ? "Changes apply from the next scan." : "Only the client that spawned the robot can change these.";
}

const isEdited = (input) => input.type === "number" && document.activeElement === input;

function makeInput({ type, min, max, step, choices, slides }) {
  if (type === "choice") {
    const options = choices.map((choice) => element("option", { value: choice, textContent: choice }));
    return element("select", {}, element("option", { value: "", textContent: "default", disabled: true }), ...options);
  }
  if (type === "boolean") return element("input", { type: "checkbox" });
  const input = element("input", { type: slides ? "range" : "number", step: step ?? "any", placeholder: UNLIMITED });
  if (min !== null && min !== undefined) input.min = min;
  if (max !== null && max !== undefined) input.max = max;
  return input;
}

/** Return the value of a control, or null if it has none. */
function readValue({ setting: { type, choices }, input }) {
  if (type === "choice") return choices.find((choice) => String(choice) === input.value) ?? null;
  if (type === "boolean") return input.checked;
  return Number.isFinite(input.valueAsNumber) ? input.valueAsNumber : null;
}

function writeValue({ setting: { type }, input }, value) {
  const text = String(value ?? "");
  if (type === "boolean") input.checked = Boolean(value);
  else if (input.value !== text && (value !== null || input.type !== "range")) input.value = text;
}

/** Write the value of a slider next to it. */
function showValue({ input, output }, value) {
  if (input.type !== "range") return;
  setText(output, value === null ? UNLIMITED : String(+Number(value).toPrecision(4)));
}
