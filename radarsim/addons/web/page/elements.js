// Helpers for the document. Texts from the network are inserted as text, never as markup.

export const byId = (id) => document.getElementById(id);

/** Create an element with properties, data-* and aria-* attributes, and children. */
export function element(tag, properties = {}, ...children) {
  const made = document.createElement(tag);
  for (const [key, value] of Object.entries(properties)) {
    if (key.includes("-")) made.setAttribute(key, value);
    else made[key] = value;
  }
  made.append(...children);
  return made;
}

/** Set a text only if it differs, so that screen readers do not repeat unchanged texts. */
export function setText(target, text) {
  if (target.textContent !== text) target.textContent = text;
}

/** Replace the options of a select element; an option is a text or {name, label}. */
export function setOptions(select, options) {
  const chosen = select.value;
  select.replaceChildren(
    ...options.map((option) => {
      const value = option.name ?? option;
      return element("option", { value, textContent: option.label ?? value });
    }),
  );
  if ([...select.options].some((option) => option.value === chosen)) select.value = chosen;
}

/** Fill the body of a table; a row is a list of cells, which are texts or nodes. */
export function fillTable(table, rows) {
  table.tBodies[0].replaceChildren(
    ...rows.map((row) => element("tr", {}, ...row.map((cell) => element("td", {}, cell)))),
  );
}

/** Whether the focused element uses key presses itself, such as a text field. */
export function isTyping(target) {
  return target.matches?.("input:not([type=checkbox]):not([type=range]), select, textarea");
}

export function isControl(target) {
  return target.matches?.("input, select, textarea, button, summary, a");
}

/** Clear a canvas; return its context in CSS pixels, at the pixel density of the screen. */
export function prepareCanvas(canvas) {
  const density = window.devicePixelRatio || 1;
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  const [columns, rows] = [Math.round(width * density), Math.round(height * density)];
  if (canvas.width !== columns || canvas.height !== rows) {
    canvas.width = columns;
    canvas.height = rows;
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(density, 0, 0, density, 0, 0);
  pen.clearRect(0, 0, width, height);
  return { pen, width, height, density };
}
