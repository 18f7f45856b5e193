// Which layers of the plan and of the 3D view are drawn; the browser keeps the choice.

import { byId } from "./elements.js";

const KEY = "layers"; // in the storage of the browser

/** Whether each layer is drawn, by the name of its box: `radar rays`, `names` and so on. */
export const layers = {};

/** Take the layers from the boxes of the page, now and when one changes. */
export function followLayers(changed) {
  const kept = readKept();
  for (const box of byId("layers").querySelectorAll("input")) {
    box.checked = kept[box.name] ?? true;
    layers[box.name] = box.checked;
    box.addEventListener("change", () => {
      layers[box.name] = box.checked;
      keep();
      changed();
      // After a click of the pointer, Space has to stop robots again.
      if (!box.matches(":focus-visible")) box.blur();
    });
  }
}

// A browser may forbid to store anything: then the choice holds for this page.
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
