// The motivations of one robot: a curve per task up to the threshold at which it starts, and the factors behind each.

import { cut, get, make, mark, offer, paper, seconds, sizeOf, tell } from "./dom.js";
import { colour, FONT, ink } from "./palette.js";

const SPAN = 30; // seconds
const LATE = 2; // seconds after which what was heard last is told to be old
const NAMED = 5; // curves with a name at their end
const COLUMNS = ["task", "motivation", "per s", "own time", "best", "why"];

export class Motivation {
  constructor(mission) {
    this.mission = mission;
    this.select = get("robot");
    this.select.addEventListener("change", () => mission.choose(this.select.value));
    this.canvas = get("curves");
    this.rows = new Map();
    get("factors").tHead.append(make("tr", {}, ...COLUMNS.map((name) => make("th", { scope: "col" }, name))));
  }

  render() {
    const { mission } = this;
    offer(this.select, mission.robots);
    if (!mission.chosen && mission.robots.length) mission.choose(mission.robots[0]);
    if (this.select.value !== mission.chosen) this.select.value = mission.chosen;
    const curves = mission.shownCurves;
    const fits = curves.robot === mission.chosen;
    this.draw(fits ? curves.points : []);
    this.fill(fits ? curves.factors : Object.create(null));
    const heard = fits ? curves.points.at(-1)?.[0] : undefined;
    const late = heard !== undefined && mission.shownAt - heard > LATE;
    tell(get("motivation-note"), late ? `last heard at ${seconds(mission.place(heard).elapsed)}` : "");
  }

  draw(points) {
    const width = sizeOf(this.canvas.parentElement).width - 28;
    const height = 168;
    if (width <= 0) return;
    const pen = paper(this.canvas, width, height);
    const to = Math.max(this.mission.shownAt, SPAN);
    const shown = points.filter(([at]) => at >= to - SPAN - 1 && at <= to + 0.5);
    const threshold = this.mission.about?.threshold ?? 1;
    const most = Math.max(threshold * 1.25, ...shown.flatMap(([, sets]) => Object.values(sets)));
    const [left, right, top, bottom] = [26, width - 92, 10, height - 20];
    const x = (at) => left + ((at - to + SPAN) / SPAN) * (right - left);
    const y = (value) => bottom - (value / most) * (bottom - top);
    this.grid(pen, { left, right, top, bottom, x, y, to, threshold });
    const tasks = [...new Set(shown.flatMap(([, sets]) => Object.keys(sets)))].filter((task) => shown.some(([, sets]) => sets[task] > 0));
    const last = shown.at(-1)?.[1] ?? {};
    tasks.sort((a, b) => (last[b] ?? 0) - (last[a] ?? 0));
    pen.save();
    pen.beginPath();
    pen.rect(left, 0, right - left + 2, bottom + 2);
    pen.clip();
    for (const task of [...tasks].reverse()) this.curve(pen, shown, task, x, y);
    pen.restore();
    this.nameThreshold(pen, left, y(threshold));
    this.names(pen, tasks.slice(0, NAMED).filter((task) => (last[task] ?? 0) > 0), last, right, y, width);
    if (!shown.length) {
      pen.fillStyle = ink.faint;
      pen.font = `450 12px ${FONT}`;
      pen.fillText("No motivations were heard of this robot at this instant.", left + 10, bottom - 12);
    }
  }

  grid(pen, { left, right, top, bottom, x, y, to, threshold }) {
    pen.font = `450 10.5px ${FONT}`;
    pen.textAlign = "right";
    for (const value of [0, threshold / 2, threshold]) {
      pen.fillStyle = ink.grid;
      pen.fillRect(left, Math.round(y(value)), right - left, 1);
      pen.fillStyle = ink.faint;
      pen.fillText(String(Number(value.toFixed(2))), left - 6, y(value));
    }
    pen.textAlign = "center";
    for (let at = Math.ceil((to - SPAN) / 10) * 10; at <= to; at += 10) {
      pen.fillStyle = ink.faint;
      if (x(at) < right - 4) pen.fillText(`${this.mission.place(at).elapsed.toFixed(0)} s`, x(at), bottom + 12);
    }
    pen.textAlign = "left";
    pen.strokeStyle = ink.soft;
    pen.setLineDash([5, 4]);
    pen.beginPath();
    pen.moveTo(left, y(threshold));
    pen.lineTo(right, y(threshold));
    pen.stroke();
    pen.setLineDash([]);
  }

  /** The name of the threshold lies over the curves, on ground of its own. */
  nameThreshold(pen, left, at) {
    pen.font = `450 10.5px ${FONT}`;
    const text = "threshold θ";
    pen.fillStyle = ink.panel;
    pen.fillRect(left + 4, at - 6, pen.measureText(text).width + 8, 12);
    pen.fillStyle = ink.soft;
    pen.fillText(text, left + 8, at);
  }

  curve(pen, shown, task, x, y) {
    const active = this.mission.scene.robots[this.mission.chosen]?.task === task;
    pen.strokeStyle = colour(this.mission, task);
    pen.lineWidth = active ? 2.6 : 1.6;
    pen.lineJoin = "round";
    pen.beginPath();
    let before = null;
    for (const [at, sets] of shown) {
      const value = sets[task] ?? 0;
      if (before === null || at - before > 2.5) pen.moveTo(x(at), y(value));
      else pen.lineTo(x(at), y(value));
      before = at;
    }
    pen.stroke();
  }

  names(pen, tasks, last, right, y, width) {
    pen.font = `500 11px ${FONT}`;
    let free = -Infinity;
    for (const task of tasks) {
      const at = Math.max(y(last[task]), free + 13);
      free = at;
      pen.fillStyle = colour(this.mission, task);
      pen.fillRect(right + 6, at - 1, 8, 3);
      pen.fillStyle = ink.ink;
      pen.fillText(cut(pen, task, width - right - 20), right + 18, at);
    }
  }

  fill(factors) {
    const body = get("factors").tBodies[0];
    const names = this.mission.tasks.filter((task) => task in factors);
    for (const [task, row] of this.rows) {
      if (!(task in factors)) {
        row.remove();
        this.rows.delete(task);
      }
    }
    names.forEach((task, place) => {
      if (!this.rows.has(task)) {
        const row = make("tr", {}, ...COLUMNS.map((_, i) => make("td", {}, ...(i ? [] : [make("i"), make("span", {}, task)]))));
        body.insertBefore(row, body.children[place] ?? null);
        this.rows.set(task, row);
      }
      this.fillRow(this.rows.get(task), task, factors[task]);
    });
  }

  fillRow(row, task, factor) {
    const hue = colour(this.mission, task);
    const swatch = row.cells[0].firstChild;
    if (swatch.dataset.hue !== hue) {
      swatch.dataset.hue = hue;
      swatch.style.background = hue;
    }
    const number = (value, digits) => (typeof value === "number" ? value.toFixed(digits) : "–");
    tell(row.cells[1], number(factor.motivation, 2));
    tell(row.cells[2], number(factor.rate, 3));
    tell(row.cells[3], number(factor.own_time, 1));
    tell(row.cells[4], number(factor.best_time, 1));
    const why = this.mission.scene.tasks[task]?.complete ? "complete" : reason(factor);
    tell(row.cells[5], why);
    mark(row.cells[5], "title", why);
  }
}

const HELD = {
  sensory_feedback: "does not apply now",
  activity_suppression: "busy with another task",
  impatience_reset: "a teammate has just been heard on it",
  acquiescence: "it yields",
  learned_robot_influence: "a teammate would be better",
};
const PACES = {
  fast: "grows fast: nobody is on it, or patience has ended",
  slow: "grows slowly: a teammate is on it",
  random: "grows at random: active learning",
  waiting: "waits for the roster",
  working: "it is on it",
  undefined: "a time is not known",
};

/** What speaks for or against a task, in words. */
function reason(factor) {
  for (const [name, words] of Object.entries(HELD)) if (factor[name] === 0) return words;
  return Object.hasOwn(PACES, factor.pace) ? PACES[factor.pace] : "";
}
