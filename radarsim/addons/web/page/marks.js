// Draws marks of echoes; the shape shows the kind, and the colour shows the material.

import { theme } from "./theme.js";

export const KINDS = {
  enter: { word: "enters", shape: "up" },
  leave: { word: "leaves", shape: "down" },
  sheet: { word: "crosses a sheet", shape: "diamond" },
  hit: { word: "hits", shape: "square" },
  spent: { word: "is depleted in", shape: "cross" },
  rain: { word: "is reflected by rain", shape: "star" },
};

const SHAPES = {
  up: [[0, -1], [0.9, 0.8], [-0.9, 0.8]],
  down: [[0, 1], [0.9, -0.8], [-0.9, -0.8]],
  diamond: [[0, -1], [0.8, 0], [0, 1], [-0.8, 0]],
  square: [[-0.8, -0.8], [0.8, -0.8], [0.8, 0.8], [-0.8, 0.8]],
};

/** Add the outline of a mark to the path of a pen; return whether to fill it. */
export function traceMark(pen, kind, x, y, size) {
  const { shape } = KINDS[kind] ?? KINDS.hit;
  if (shape === "cross" || shape === "star") {
    pen.moveTo(x - size, y - size);
    pen.lineTo(x + size, y + size);
    pen.moveTo(x - size, y + size);
    pen.lineTo(x + size, y - size);
    if (shape === "star") {
      pen.moveTo(x, y - 1.3 * size);
      pen.lineTo(x, y + 1.3 * size);
    }
    return false;
  }
  SHAPES[shape].forEach(([right, down], corner) => {
    const to = [x + right * size, y + down * size];
    if (corner) pen.lineTo(...to);
    else pen.moveTo(...to);
  });
  pen.closePath();
  return shape === "square";
}

/**
 * Draw marks, with one stroke for all marks of the same kind and colour.
 *
 * Each mark is {kind, colour, x, y}, with x and y in px.
 */
export function drawMarks(pen, marks, size) {
  const groups = new Map();
  for (const mark of marks) {
    const key = `${mark.kind} ${mark.colour}`;
    if (!groups.has(key)) groups.set(key, []);
    groups.get(key).push(mark);
  }
  pen.save();
  pen.lineWidth = 1.3;
  for (const group of groups.values()) {
    pen.beginPath();
    let filled = false;
    for (const { kind, x, y } of group) filled = traceMark(pen, kind, x, y, size);
    const colour = edgeColour(group[0].colour);
    pen.strokeStyle = colour;
    pen.fillStyle = colour;
    if (filled) pen.fill();
    pen.stroke();
  }
  pen.restore();
}

/** Return an edge colour that contrasts with the colour of a material. */
export function edgeColour(colour) {
  if (!colour) return theme.ink;
  const share = theme.dark ? 0.3 : -0.42; // towards white, or black
  const parts = [1, 3, 5].map((start) => parseInt(colour.slice(start, start + 2), 16));
  const mixed = parts.map((part) => Math.round(share < 0 ? part * (1 + share) : part + (255 - part) * share));
  return `rgb(${mixed.join(" ")})`;
}
