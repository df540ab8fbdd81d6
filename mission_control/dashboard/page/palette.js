// The colours in use, read from the style sheet, so that drawings follow the theme; and which theme that is.

import { get, mark, tell } from "./dom.js";

const NAMES = ["ground", "panel", "sunk", "line", "grid", "ink", "soft", "faint", "accent", "good", "bad", "warn", "heat"];
const THEMES = ["auto", "light", "dark"];
const dark = window.matchMedia("(prefers-color-scheme: dark)");

export const ink = { tasks: [] };
export const FONT = 'Inter, system-ui, -apple-system, "Segoe UI", Roboto, sans-serif';

let chosen = "auto";
try {
  chosen = THEMES.includes(localStorage.getItem("theme")) ? localStorage.getItem("theme") : "auto";
} catch {
  // A browser that keeps nothing follows the system.
}

function apply() {
  mark(document.documentElement, "data-theme", chosen === "auto" ? (dark.matches ? "dark" : "light") : chosen);
  tell(get("theme").lastChild, chosen);
  const style = getComputedStyle(document.documentElement);
  const read = (name) => style.getPropertyValue(`--${name}`).trim();
  for (const name of NAMES) ink[name] = read(name);
  ink.tasks = [0, 1, 2, 3, 4, 5].map((number) => read(`c${number}`));
}

/** Follow the system and the switch; `changed` is called after each change. */
export function beginTheme(changed) {
  apply();
  dark.addEventListener("change", () => (apply(), changed()));
  get("theme").addEventListener("click", () => {
    chosen = THEMES[(THEMES.indexOf(chosen) + 1) % THEMES.length];
    try {
      localStorage.setItem("theme", chosen);
    } catch {
      // See above.
    }
    apply();
    changed();
  });
}

/** The colour of a task: the same wherever it is shown. */
export function colour(mission, task) {
  const place = mission.taskPlace.get(task) ?? 0;
  return ink.tasks[place % ink.tasks.length];
}

/** Red, green and blue of a colour, from 0 to 255. */
export function channels(hex) {
  const value = parseInt(hex.slice(1), 16);
  return [value >> 16, (value >> 8) & 255, value & 255];
}

/** A colour, as transparent as `share` says. */
export function tint(hex, share) {
  return `rgb(${channels(hex).join(" ")} / ${share})`;
}
