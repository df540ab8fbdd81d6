// What the timeline draws: rows and names, the axis, faults, bars and signs. Each function draws into `pen` at the `place` that
// the timeline has laid out, and keeps what can be pointed at.

import { cut, seconds } from "./dom.js";
import { colour, FONT, ink, tint } from "./palette.js";
import { sign } from "./signs.js";

/** Heights of the axis and of the lane of faults, in pixels. */
export const AXIS = 26;
export const LANE = 20;
const TICKS = [0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 1800, 3600, 7200];

export class Drawing {
  /** `current` is what is pointed at; what can be pointed at is in `items` afterwards. */
  constructor(mission, place, current) {
    this.mission = mission;
    this.place = place;
    this.current = current;
    this.items = [];
    this.rowOf = new Map(mission.robots.map((robot, i) => [robot, i]));
  }

  draw(pen) {
    const { place } = this;
    this.drawRows(pen, place);
    clip(pen, place, AXIS + LANE, () => {
      this.drawAbsence(pen, place);
      this.drawBars(pen, place);
      this.drawMarks(pen, place);
    });
    this.drawNames(pen, place);
    this.drawAxis(pen, place);
    this.drawFaults(pen, place);
    this.drawCursor(pen, place);
    this.items.sort((a, b) => a.row - b.row || a.at - b.at);
    this.drawFocus(pen);
  }

  add(item) {
    this.items.push(item);
  }

  drawFocus(pen) {
    const item = this.current && this.items.find((one) => one.id === this.current.id);
    if (!item) return;
    pen.strokeStyle = ink.ink;
    pen.lineWidth = 1.5;
    pen.strokeRect(item.x - 1, item.y - 1, item.w + 2, item.h + 2);
  }

  drawRows(pen, { width, height, left, right, row, top }) {
    pen.fillStyle = ink.grid;
    this.mission.robots.forEach((_, i) => {
      const y = top + (i + 1) * row;
      if (y > AXIS + LANE && y < height) pen.fillRect(0, Math.round(y) - 1, width, 1);
    });
    const { from, to, x } = this.place;
    pen.fillStyle = ink.grid;
    for (const at of ticks(from, to, (right - left) / 80)) pen.fillRect(Math.round(x(at)), AXIS, 1, height);
    for (const { at, trial } of this.mission.trials) {
      if (trial > 1 && at >= from && at <= to) {
        pen.fillStyle = ink.faint;
        pen.fillRect(Math.round(x(at)), AXIS, 1, height);
      }
    }
  }

  drawNames(pen, { height, left, row, top }) {
    const { robots, scene } = this.mission;
    pen.fillStyle = ink.panel;
    pen.fillRect(0, AXIS, left - 6, height);
    const small = row < 18;
    pen.font = `${this.mission.robots.length > 8 ? 450 : 540} ${small ? 10.5 : 12.5}px ${FONT}`;
    robots.forEach((robot, i) => {
      const y = top + (i + 0.5) * row;
      if (y < AXIS || y > height + row) return;
      const there = scene.robots[robot]?.present;
      const task = scene.robots[robot]?.task;
      const state = there === false ? "gone" : task ? "busy" : "idle";
      sign(pen, state, 15, y, small ? 3.2 : 4.5);
      pen.fillStyle = robot === this.mission.chosen ? ink.accent : there === false ? ink.faint : ink.ink;
      pen.fillText(cut(pen, robot, left - 38), 26, y);
    });
    pen.fillStyle = ink.line;
    pen.fillRect(left - 6, AXIS, 1, height);
  }

  drawAxis(pen, { width, left, right, from, to, x }) {
    pen.fillStyle = ink.panel;
    pen.fillRect(0, 0, width, AXIS);
    pen.fillStyle = ink.line;
    pen.fillRect(0, AXIS - 1, width, 1);
    pen.font = `450 11px ${FONT}`;
    pen.textAlign = "center";
    pen.fillStyle = ink.soft;
    const inside = (at) => x(at) > left + 4 && x(at) < right - 12;
    const { trials } = this.mission;
    if (trials.length > 1) {
      let free = 0;
      for (const { trial, at } of trials) {
        if (!inside(at) || x(at) < free) continue;
        pen.fillText(String(trial), x(at), AXIS / 2);
        free = x(at) + 30;
      }
    } else {
      for (const at of ticks(from, to, (right - left) / 80)) if (inside(at)) pen.fillText(clock(at), x(at), AXIS / 2);
    }
    pen.textAlign = "left";
    pen.fillText(trials.length > 1 ? "trial" : "seconds", 12, AXIS / 2);
  }

  /** Faults have a lane of their own. */
  drawFaults(pen, place) {
    const { left, right, x, width, from, to } = place;
    pen.fillStyle = ink.sunk;
    pen.fillRect(0, AXIS, width, LANE);
    pen.fillStyle = ink.soft;
    pen.font = `450 11px ${FONT}`;
    pen.fillText("faults", 12, AXIS + LANE / 2);
    pen.save();
    pen.beginPath();
    pen.rect(left - 5, AXIS, right - left + 5, place.height);
    pen.clip();
    const shown = [...this.mission.faults.values()].filter((one) => this.mission.begun(one) && one.from <= to && (one.to ?? Infinity) >= from);
    shown.forEach((fault, place) => {
      const [a, b] = [x(fault.from), x(Math.min(fault.to ?? this.mission.shownAt, this.mission.shownAt))];
      const wide = Math.max(b - a, 10);
      pen.fillStyle = tint(ink.bad, 0.22);
      pen.fillRect(a, AXIS + 3, wide, LANE - 6);
      sign(pen, "fault", a + 5, AXIS + LANE / 2, 4.5);
      // The next one begins no earlier, and its sign comes first.
      const room = Math.min(shown[place + 1] ? x(shown[place + 1].from) : right, right) - a - 16;
      pen.fillStyle = ink.ink;
      pen.fillText(cut(pen, fault.text, room), a + 12, AXIS + LANE / 2);
      this.add({ id: `f${fault.id}`, row: -1, at: fault.from, x: a, y: AXIS, w: wide, h: LANE, text: words.fault(fault) });
    });
    pen.restore();
  }

  drawAbsence(pen, { x, row, top, right, left, height }) {
    const since = new Map();
    const shade = (robot, a, b) => {
      const y = top + this.rowOf.get(robot) * row;
      if (y + row < AXIS || y > height) return;
      hatch(pen, Math.max(x(a), left), y + 2, Math.min(x(b), right) - Math.max(x(a), left), row - 5);
    };
    for (const one of this.mission.marks.values()) {
      if (!this.rowOf.has(one.robot) || one.at > this.mission.shownAt) continue;
      if (one.kind === "gone") since.set(one.robot, one.at);
      if (one.kind === "present" && since.has(one.robot)) {
        shade(one.robot, since.get(one.robot), one.at);
        since.delete(one.robot);
      }
    }
    for (const [robot, at] of since) shade(robot, at, this.mission.shownAt);
  }

  drawBars(pen, place) {
    const { x, row, top, from, to, height } = place;
    const thin = row < 18;
    pen.font = `480 ${row > 30 ? 12 : 10.5}px ${FONT}`;
    for (const bar of this.mission.bars.values()) {
      if (bar.from > to || (bar.to ?? Infinity) < from || !this.mission.begun(bar) || !this.rowOf.has(bar.robot)) continue;
      const i = this.rowOf.get(bar.robot);
      const y = top + i * row + (thin ? 1 : 3);
      const h = row - (thin ? 3 : 7);
      if (y + h < AXIS || y > height) continue;
      const ended = bar.to !== null && bar.to <= this.mission.shownAt;
      const [a, b] = [x(bar.from), x(ended ? bar.to : this.mission.shownAt)];
      this.drawBar(pen, bar, { a, w: Math.max(b - a, 2), y, h, ended, thin });
      this.add({ id: `b${bar.id}`, row: i, at: bar.from, x: a, y, w: Math.max(b - a, 6), h, robot: bar.robot, task: bar.task, text: words.bar(bar, ended) });
    }
  }

  drawBar(pen, bar, { a, w, y, h, ended, thin }) {
    const hue = colour(this.mission, bar.task);
    const faint = this.current?.task && this.current.task !== bar.task;
    pen.globalAlpha = faint ? 0.3 : 1;
    pen.fillStyle = tint(hue, 0.26);
    rounded(pen, a, y, w, h, thin ? 2 : 4);
    pen.fillStyle = hue;
    pen.fillRect(a, y, Math.min(3, w), h);
    const end = ended ? bar.end : "";
    const size = Math.min(5.5, h / 2 - 1);
    if (end && w > size * 2 + 4) sign(pen, end, a + w - size - 4, y + h / 2, size);
    pen.fillStyle = ink.ink;
    const room = w - 12 - (end ? size * 2 + 6 : 0);
    const indent = bar.taken ? 14 : 8;
    if (h >= 10) pen.fillText(cut(pen, bar.task, room - indent + 8), a + indent, y + h / 2 + 0.5);
    pen.globalAlpha = 1;
  }

  drawMarks(pen, { x, row, top, from, to }) {
    for (const one of this.mission.marks.values()) {
      if (one.at < from || one.at > to || one.at > this.mission.shownAt + 1e-9 || !this.rowOf.has(one.robot)) continue;
      if (!["takeover", "gone", "present"].includes(one.kind)) continue;
      if (one.kind === "present" && one.at < 0.5) continue;
      const i = this.rowOf.get(one.robot);
      const [a, y] = [x(one.at), top + (i + 0.5) * row];
      const size = Math.min(6.5, row / 2 - 1);
      if (one.kind === "takeover" && this.rowOf.has(one.other)) {
        arrow(pen, a, top + (this.rowOf.get(one.other) + 0.5) * row, y, size);
      }
      // Beside the end of the bar that it cut off.
      const middle = one.kind === "gone" ? a + size + 2 : a;
      sign(pen, one.kind, middle, y, size);
      this.add({ id: `m${one.id}`, row: i, at: one.at, x: middle - size - 2, y: y - size - 2, w: 2 * size + 4, h: 2 * size + 4, robot: one.robot, task: one.task, text: words.mark(one) });
    }
  }

  drawCursor(pen, { x, height, left, right }) {
    const a = x(this.mission.shownAt);
    if (a < left || a > right + 1) return;
    const isLive = this.mission.at === null;
    pen.fillStyle = isLive ? tint(ink.good, 0.7) : ink.ink;
    pen.fillRect(Math.round(a), AXIS - 6, isLive ? 1 : 2, height);
    if (isLive) return;
    pen.beginPath();
    pen.moveTo(a - 5, AXIS - 12);
    pen.lineTo(a + 7, AXIS - 12);
    pen.lineTo(a + 1, AXIS - 3);
    pen.fill();
  }
}

const words = {
  bar(bar, ended) {
    const when = ended ? `${seconds(bar.since)} to ${seconds(bar.since + bar.to - bar.from)}` : `since ${seconds(bar.since)}`;
    const how = ended ? `\nIt ${bar.ended || "ended"}.` : "";
    return `${bar.robot} on ${bar.task}, ${when}${bar.why ? `\n${bar.why}` : ""}${how}`;
  },
  mark: (one) => `${seconds(one.elapsed)}: ${one.text}${one.why ? `\n${one.why}` : ""}`,
  fault: (one) => `fault ${one.name}: ${one.text}\nfrom ${seconds(one.since)}${one.to === null ? "" : ` to ${seconds(one.since + one.to - one.from)}`}`,
};

function ticks(from, to, most) {
  const step = TICKS.find((one) => (to - from) / one <= most) ?? TICKS.at(-1);
  const all = [];
  for (let at = Math.ceil(from / step) * step; at <= to; at += step) all.push(at);
  return all;
}

function clock(at) {
  if (at < 120) return `${Number(at.toFixed(1))}`;
  const [minutes, rest] = [Math.floor(at / 60), Math.round(at % 60)];
  return `${minutes}:${String(rest).padStart(2, "0")}`;
}

function clip(pen, { left, right, height }, top, work) {
  pen.save();
  pen.beginPath();
  pen.rect(left - 5, top, right - left + 9, height);
  pen.clip();
  work();
  pen.restore();
}

function rounded(pen, x, y, w, h, radius) {
  pen.beginPath();
  pen.roundRect(x, y, w, h, Math.min(radius, w / 2));
  pen.fill();
}

function hatch(pen, x, y, w, h) {
  if (w <= 0) return;
  pen.save();
  pen.beginPath();
  pen.rect(x, y, w, h);
  pen.clip();
  pen.strokeStyle = tint(ink.faint, 0.45);
  pen.lineWidth = 1;
  pen.beginPath();
  for (let a = x - h; a < x + w; a += 7) {
    pen.moveTo(a, y + h);
    pen.lineTo(a + h, y);
  }
  pen.stroke();
  pen.restore();
}

function arrow(pen, x, from, to, size) {
  pen.strokeStyle = ink.bad;
  pen.lineWidth = 1.5;
  pen.setLineDash([3, 3]);
  pen.beginPath();
  pen.moveTo(x, from);
  pen.lineTo(x, to + (from > to ? size : -size));
  pen.stroke();
  pen.setLineDash([]);
  pen.fillStyle = ink.bad;
  pen.beginPath();
  pen.arc(x, from, 2.5, 0, 7);
  pen.fill();
}

