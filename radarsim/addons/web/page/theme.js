// The colours of canvases, read from the style sheet, for light and dark mode.

const NAMES = [
  "paper", "ink", "quiet", "line", "faint", "radar", "laser", "goal", "path", "true",
  "hit", "leave", "robot", "alarm",
];

export const theme = {};

/** Read the colours of the style sheet, now and when the colour scheme changes. */
export function followTheme(changed) {
  const scheme = matchMedia("(prefers-color-scheme: dark)");
  const read = () => {
    const style = getComputedStyle(document.documentElement);
    for (const name of NAMES) theme[name] = style.getPropertyValue(`--${name}`).trim();
    theme.dark = scheme.matches;
    changed();
  };
  scheme.addEventListener("change", read);
  read();
}

export const sensorColour = (kind) => (kind === "radar" ? theme.radar : theme.laser);
