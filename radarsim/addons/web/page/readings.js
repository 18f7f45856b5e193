// Where beams end: dots of radars, squares of lasers, each a small picture that is copied.

import { sensorColour } from "./theme.js";

const sprites = new Map(); // by shape, colour, size and density

/**
 * Draw the readings of a scan.
 *
 * `hides` says of a beam whether its reading is left out; `size` is half the width, px.
 */
export function drawScan(pen, viewport, scan, { colour, size, alpha, density, hides }) {
  const sprite = spriteOf(scan.kind, colour, size, density);
  const { points } = scan;
  const { scale } = viewport;
  const [left, top] = viewport.toScreen(0, 0);
  const [width, height] = viewport.size;
  const side = 2 * (size + 1);
  const shift = size + 1;
  pen.globalAlpha = alpha;
  for (let beam = 0; beam < scan.count; beam++) {
    const x = left + points[2 * beam] * scale;
    const y = top - points[2 * beam + 1] * scale;
    // Without a reading it is not a number, and so neither inside nor outside.
    if (!(x > -side && x < width + side && y > -side && y < height + side)) continue;
    if (hides?.(beam)) continue;
    pen.drawImage(sprite, x - shift, y - shift, side, side);
  }
  pen.globalAlpha = 1;
}

/** Return the colour of the readings of a robot: of its sensors, or its own among others. */
export function readingColour(robot, scan, chosen) {
  return chosen || !robot.colour ? sensorColour(scan.kind) : robot.colour;
}

function spriteOf(kind, colour, size, density) {
  const key = [kind === "radar", colour, size, density].join();
  if (!sprites.has(key)) sprites.set(key, paint(kind, colour, size, density));
  return sprites.get(key);
}

function paint(kind, colour, size, density) {
  const side = 2 * (size + 1);
  const sprite = document.createElement("canvas");
  sprite.width = sprite.height = Math.ceil(side * density);
  const pen = sprite.getContext("2d");
  pen.scale(density, density);
  pen.fillStyle = colour;
  if (kind === "radar") {
    pen.beginPath();
    pen.arc(side / 2, side / 2, size, 0, 2 * Math.PI);
    pen.fill();
  } else pen.fillRect(side / 2 - 0.85 * size, side / 2 - 0.85 * size, 1.7 * size, 1.7 * size);
  return sprite;
}
