// Saves a picture of the view as a file.

/** Save stacked canvases, with a line of text below, as a PNG file. */
export async function savePicture(canvases, name, { text, paper, ink }) {
  const [first] = canvases;
  const density = first.width / Math.max(first.clientWidth, 1);
  const line = Math.round(26 * density);
  const picture = document.createElement("canvas");
  picture.width = first.width;
  picture.height = first.height + line;
  const pen = picture.getContext("2d");
  pen.fillStyle = paper;
  pen.fillRect(0, 0, picture.width, picture.height);
  for (const canvas of canvases) pen.drawImage(canvas, 0, 0, first.width, first.height);
  pen.fillStyle = ink;
  pen.font = `${13 * density}px system-ui, sans-serif`;
  pen.fillText(text, 10 * density, first.height + 18 * density, picture.width - 20 * density);
  const blob = await new Promise((resolve) => picture.toBlob(resolve, "image/png"));
  const anchor = document.createElement("a");
  anchor.href = URL.createObjectURL(blob);
  anchor.download = name;
  anchor.click();
  setTimeout(() => URL.revokeObjectURL(anchor.href), 60_000);
}
