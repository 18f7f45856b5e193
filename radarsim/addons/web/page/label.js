// Texts on canvases.

import { theme } from "./theme.js";

/** Write a text with an outline of paper, readable on everything. */
export function drawLabel(pen, text, left, top) {
  pen.lineJoin = "round";
  pen.lineWidth = 3.5;
  pen.strokeStyle = theme.paper;
  pen.strokeText(text, left, top);
  pen.fillStyle = theme.ink;
  pen.fillText(text, left, top);
}
