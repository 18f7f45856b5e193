// Draws readings: dots for radars and squares for lasers.
//
// They are written as pixels of one image, as thousands of canvas calls would be slow.

import { sensorColour } from "./theme.js";

export class Readings {
  constructor() {
    this.canvas = document.createElement("canvas");
    this.pen = this.canvas.getContext("2d", { willReadFrequently: true }); // kept in main memory
    this.image = null;
    this.stamps = new Map(); // by shape, colour, size and density
  }

  /** Start an empty image with a number of columns and rows. */
  begin(columns, rows) {
    if (this.image?.width === columns && this.image.height === rows) {
      this.pixels.fill(0);
      return;
    }
    this.canvas.width = columns;
    this.canvas.height = rows;
    this.image = this.pen.createImageData(columns, rows);
    this.pixels = new Uint32Array(this.image.data.buffer);
  }

  /**
   * Add the readings of a scan.
   *
   * `hides` returns whether the reading of a beam is left out; `size` is half the width, px.
   */
  add(viewport, scan, { colour, size, alpha, density, hides }) {
    const { side, marks } = this.stampOf(scan.kind, colour, size, alpha, density);
    const { points } = scan;
    const { pixels } = this;
    const { width, height } = this.image;
    const scale = viewport.scale * density;
    const [left, top] = viewport.toScreen(0, 0).map((place) => place * density - side / 2);
    for (let beam = 0; beam < scan.count; beam++) {
      const x = Math.round(left + points[2 * beam] * scale);
      const y = Math.round(top - points[2 * beam + 1] * scale);
      // NaN, of a beam without reading, fails all of these comparisons.
      if (!(x >= 0 && x <= width - side && y >= 0 && y <= height - side)) continue;
      if (hides?.(beam)) continue;
      for (const { right, down, pixel } of marks) {
        const place = (y + down) * width + x + right;
        // The more opaque pixel is kept, so that no edge cuts into an adjacent mark.
        if (pixel >>> 24 >= pixels[place] >>> 24) pixels[place] = pixel;
      }
    }
  }

  /** Draw the image with all added readings. */
  draw(pen, width, height) {
    if (!this.image.width || !this.image.height) return;
    this.pen.putImageData(this.image, 0, 0);
    pen.drawImage(this.canvas, 0, 0, width, height);
  }

  stampOf(kind, colour, size, alpha, density) {
    const key = [kind === "radar", colour, size, alpha, density].join();
    if (!this.stamps.has(key)) this.stamps.set(key, makeStamp(kind, colour, size, alpha, density));
    return this.stamps.get(key);
  }
}

/** Return the colour of readings: that of the sensor, or of a robot among several. */
export function readingColour(robot, scan, chosen) {
  return chosen || !robot.colour ? sensorColour(scan.kind) : robot.colour;
}

/** Return the pixels of a mark, {side, marks: [{right, down, pixel}]}. */
function makeStamp(kind, colour, size, alpha, density) {
  const side = Math.ceil(2 * (size + 1) * density);
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = side;
  const pen = canvas.getContext("2d", { willReadFrequently: true });
  pen.fillStyle = colour;
  pen.globalAlpha = alpha;
  const [middle, reach] = [side / 2, size * density];
  if (kind === "radar") {
    pen.beginPath();
    pen.arc(middle, middle, reach, 0, 2 * Math.PI);
    pen.fill();
  } else pen.fillRect(middle - 0.85 * reach, middle - 0.85 * reach, 1.7 * reach, 1.7 * reach);
  const pixels = new Uint32Array(pen.getImageData(0, 0, side, side).data.buffer);
  const marks = [];
  pixels.forEach((pixel, place) => {
    if (pixel) marks.push({ right: place % side, down: Math.floor(place / side), pixel });
  });
  return { side, marks };
}
