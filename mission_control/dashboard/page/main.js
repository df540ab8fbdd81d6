// The page: one mission, and a view for each of its sides. What came is drawn once per frame, and acknowledged when it was.

import { Box } from "./box.js";
import { Decisions } from "./decisions.js";
import { get, make, mark, tell } from "./dom.js";
import { Faults } from "./faults.js";
import { Links } from "./links.js";
import { Mission } from "./mission.js";
import { Motivation } from "./motivation.js";
import { beginTheme } from "./palette.js";
import { Tasks } from "./tasks.js";
import { Timeline } from "./timeline.js";
import { Transport } from "./transport.js";

let due = false;
let drawn = 0;

function changed(number) {
  if (number !== undefined) drawn = number;
  if (!due) {
    due = true;
    // A page in the background draws no frames, and still keeps up.
    if (document.hidden) setTimeout(render, 200);
    else requestAnimationFrame(render);
  }
}

const mission = new Mission(changed);
// Drawings first: each asks for fonts, which costs the more the more of the page has been changed just before.
const views = [Timeline, Links, Motivation, Box, Tasks, Decisions, Faults, Transport].map((View) => new View(mission));

function render() {
  due = false;
  const began = performance.now();
  for (const view of views) view.render();
  header();
  mark(document.body, "class", mission.at === null ? "" : "past");
  performance.measure("frame", { start: began, end: performance.now() });
  if (performance.getEntriesByName("frame").length > 600) performance.clearMeasures("frame");
  if (drawn) {
    mission.say({ drawn });
    drawn = 0;
  }
}

function header() {
  const { about, scene } = mission;
  const stage = mission.connected ? (scene.figures.stage ?? "waiting") : "lost";
  tell(get("stage"), mission.connected ? stage : about ? "connection lost" : "connecting");
  mark(get("stage"), "data-is", stage);
  if (!about) return;
  tell(get("mission"), about.mission);
  document.title = `${about.mission} · lalliance`;
  tell(get("about"), [about.live ? "live" : "recording", ...about.facts].join(" · "));
  figures(scene);
}

const FIGURES = ["Time", "Tasks complete", "Robots there", "Takeovers", "Faults in force", "Messages", "Periods missed"];

function figures({ figures, tasks, robots }) {
  const list = get("figures");
  if (!list.children.length) {
    list.append(...FIGURES.map((name) => make("div", {}, make("dt", {}, name), make("dd", {}, make("b"), make("small")))));
  }
  const at = mission.shownAt;
  const past = (items, kind) => [...items.values()].filter((one) => one.kind === kind && one.at <= at + 1e-9).length;
  const done = Object.values(tasks).filter((task) => task.complete).length;
  const there = Object.values(robots).filter((robot) => robot.present).length;
  const inForce = [...mission.faults.values()].filter((one) => mission.begun(one) && (one.to === null || one.to > at)).length;
  const { trial, elapsed } = mission.place(at);
  const trials = figures.trials ?? 1;
  const share = figures.periods ? figures.missed / (figures.periods + figures.missed) : 0;
  const shown = [
    [`${elapsed.toFixed(1)} s`, trials > 1 ? `trial ${trial} of ${trials}` : ""],
    [`${done}`, `of ${mission.tasks.length}`],
    [`${there}`, `of ${mission.robots.length}`],
    [`${past(mission.marks, "takeover")}`, ""],
    [`${inForce}`, ""],
    [(figures.messages ?? 0).toLocaleString("en"), figures.dropped ? `${figures.dropped.toLocaleString("en")} dropped` : ""],
    [`${figures.missed ?? 0}`, figures.periods ? `${(100 * share).toFixed(1)} %` : ""],
  ];
  shown.forEach(([value, more], place) => {
    const [name, cell] = list.children[place].children;
    tell(name, FIGURES[place]);
    tell(cell.firstChild, value);
    tell(cell.lastChild, more);
  });
  mark(list.children[4], "class", inForce ? "bad" : "");
}

beginTheme(() => changed());
new ResizeObserver(() => changed()).observe(document.body);
document.fonts?.ready.then(() => changed());
