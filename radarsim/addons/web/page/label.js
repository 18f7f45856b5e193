// Draws texts on canvases.

import { theme } from "./theme.js";

/** Write a text with an outline in the paper colour, so that it is readable anywhere. */
export function drawLabel(pen, text, left, top) {
  pen.lineJoin = "round";
  pen.lineWidth = 3.5;
  pen.strokeStyle = theme.paper;
  pen.strokeText(text, left, top);
  pen.fillStyle = theme.ink;
  pen.fillText(text, left, top);
}
