// The choice of layers that the plan and the 3D view draw, which the browser stores.

import { byId } from "./elements.js";

const KEY = "layers"; // key in localStorage

/** Whether each layer is drawn, by the name of its checkbox, such as `radar rays`. */
export const layers = {};

/** Read the layers from the checkboxes of the page, now and when a checkbox changes. */
export function followLayers(changed) {
  const kept = readKept();
  for (const box of byId("layers").querySelectorAll("input")) {
    box.checked = kept[box.name] ?? true;
    layers[box.name] = box.checked;
    box.addEventListener("change", () => {
      layers[box.name] = box.checked;
      keep();
      changed();
      // The checkbox loses the focus after a click, so that Space stops robots again.
      if (!box.matches(":focus-visible")) box.blur();
    });
  }
}

// If the browser forbids storage, the choice lasts until the page is closed.
function readKept() {
  try {
    return JSON.parse(localStorage.getItem(KEY)) ?? {};
  } catch {
    return {};
  }
}

function keep() {
  try {
    localStorage.setItem(KEY, JSON.stringify(layers));
  } catch { /* as above */ }
}
