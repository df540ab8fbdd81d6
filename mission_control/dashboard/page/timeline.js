// The timeline: a row for each robot, a bar for each of its attempts at a task, and signs for what befell it.
//
// It is drawn on a canvas as large as what is seen of it, so a long mission of a hundred robots costs no more than what fits
// on the screen. What is drawn is found again by place, for the mouse, and in the order of rows and time, for the keyboard.

import { get, make, paper, sizeOf } from "./dom.js";
import { ink } from "./palette.js";
import { sign, SIGNS } from "./signs.js";
import { AXIS, Drawing, LANE } from "./timeline_drawing.js";
import { hideTip, showTip } from "./tip.js";

const LEAST_SPAN = 5;
const AT_FIRST = 30;

export class Timeline {
  constructor(mission) {
    this.mission = mission;
    this.plot = get("timeline-plot");
    this.canvas = this.plot.querySelector("canvas");
    this.spacer = this.plot.querySelector(".spacer");
    this.span = null; // seconds shown; null: all
    this.end = null; // the instant at the right edge; null: it follows
    this.items = [];
    this.current = null;
    this.drag = null;
    this.listen();
  }

  listen() {
    const { plot } = this;
    plot.addEventListener("scroll", () => this.render());
    plot.addEventListener("pointermove", (event) => this.move(event));
    plot.addEventListener("pointerdown", (event) => this.press(event));
    plot.addEventListener("pointerup", (event) => this.release(event));
    plot.addEventListener("pointercancel", () => (this.drag = null));
    plot.addEventListener("pointerleave", () => this.drag ?? this.leave());
    plot.addEventListener("blur", () => this.leave());
    plot.addEventListener("keydown", (event) => this.key(event));
    plot.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    get("zoom-in").addEventListener("click", () => this.zoom(0.5));
    get("zoom-out").addEventListener("click", () => this.zoom(2));
    get("zoom-all").addEventListener("click", () => this.showAll());
  }

  showAll() {
    this.span = this.end = null;
    this.render();
  }

  zoom(factor, around = this.mission.shownAt) {
    const { from, to } = this.window();
    const span = Math.max(LEAST_SPAN, (to - from) * factor);
    if (span >= this.mission.now * 1.05 && factor > 1) return this.showAll();
    const share = Math.min(1, Math.max(0, (around - from) / (to - from)));
    this.span = span;
    this.end = this.mission.at === null && around >= this.mission.now ? null : around + (1 - share) * span;
    this.render();
  }

  /** From when to when is shown. */
  window() {
    const all = Math.max(this.mission.now * 1.04, AT_FIRST);
    if (this.span === null) return { from: 0, to: all };
    let to = this.end ?? this.mission.shownAt + 0.08 * this.span;
    to = Math.max(to, this.span);
    return { from: to - this.span, to };
  }

  rowHeight() {
    const count = this.mission.robots.length;
    return count <= 8 ? 34 : count <= 20 ? 26 : count <= 50 ? 18 : 14;
  }

  layout() {
    const { robots } = this.mission;
    const { width } = sizeOf(this.plot);
    const row = this.rowHeight();
    const full = AXIS + LANE + Math.max(robots.length, 3) * row + 8;
    const height = Math.min(full, Math.max(260, Math.round(window.innerHeight * 0.5)));
    const left = width < 560 ? 92 : 122;
    if (this.height !== height || this.full !== full) {
      this.plot.style.height = `${height}px`;
      this.spacer.style.height = `${full - height}px`;
      [this.height, this.full] = [height, full];
    }
    const { from, to } = this.window();
    const scale = (width - left - 10) / (to - from);
    const x = (at) => left + (at - from) * scale;
    return { width, height, left, right: width - 10, row, from, to, x, top: AXIS + LANE - this.plot.scrollTop, scale };
  }

  render() {
    legend();
    const place = (this.place = this.layout());
    if (!place.width) return;
    const pen = paper(this.canvas, place.width, place.height);
    const drawing = new Drawing(this.mission, place, this.current);
    drawing.draw(pen);
    this.items = drawing.items;
  }

  find(x, y) {
    if (x < this.place.left - 6) return null;
    for (let i = this.items.length - 1; i >= 0; i--) {
      const one = this.items[i];
      if (one.id[0] === "m" && inside(one, x, y)) return one;
    }
    return this.items.findLast((one) => inside(one, x, y)) ?? null;
  }

  at(x) {
    const { left, right, from, to } = this.place;
    return from + (Math.min(Math.max(x, left), right) - left) / this.place.scale;
  }

  point(event) {
    const { left, top } = this.canvas.getBoundingClientRect();
    return [event.clientX - left, event.clientY - top];
  }

  press(event) {
    const [x, y] = this.point(event);
    if (event.button !== 0 || !this.place) return;
    if (x < this.place.left - 6) return this.choose(y);
    this.drag = { x, scrubs: y < AXIS, end: this.place.to, moved: false };
    if (this.drag.scrubs) this.mission.show(this.at(x));
    this.plot.setPointerCapture(event.pointerId);
  }

  choose(y) {
    const robot = this.mission.robots[Math.floor((y - this.place.top) / this.place.row)];
    if (robot && y > AXIS + LANE) this.mission.choose(robot);
  }

  move(event) {
    const [x, y] = this.point(event);
    if (this.drag?.scrubs) return this.mission.show(this.at(x));
    if (this.drag) {
      this.drag.moved ||= Math.abs(x - this.drag.x) > 4;
      if (this.drag.moved && this.span !== null) {
        this.end = this.drag.end - (x - this.drag.x) / this.place.scale;
        this.render();
      }
      return;
    }
    this.pointAt(this.find(x, y), event.clientX, event.clientY);
  }

  release(event) {
    const { drag } = this;
    this.drag = null;
    if (!drag || drag.scrubs || drag.moved) return;
    const [x, y] = this.point(event);
    const found = this.find(x, y);
    if (found?.robot) this.mission.choose(found.robot);
    this.mission.show(this.at(x));
  }

  pointAt(item, x, y, aloud = false) {
    const changes = item?.id !== this.current?.id;
    this.current = item;
    if (item) showTip(item.text, x, y, { aloud });
    else hideTip();
    this.plot.style.cursor = item ? "pointer" : "";
    if (changes) this.render();
  }

  leave() {
    hideTip();
    if (this.current) {
      this.current = null;
      this.render();
    }
  }

  wheel(event) {
    if (!event.ctrlKey && !event.metaKey) return;
    event.preventDefault();
    this.zoom(event.deltaY > 0 ? 1.25 : 0.8, this.at(this.point(event)[0]));
  }

  key(event) {
    const steps = { ArrowLeft: -1, ArrowRight: 1 };
    const rows = { ArrowUp: -1, ArrowDown: 1 };
    if (event.key in steps) this.step(steps[event.key]);
    else if (event.key in rows) this.stepRow(rows[event.key]);
    else if (event.key === "Enter" && this.current) this.mission.show(this.current.at);
    else if (event.key === "Escape") this.leave();
    else if (event.key === "+" || event.key === "=") this.zoom(0.5);
    else if (event.key === "-") this.zoom(2);
    else if (event.key === "0") this.showAll();
    else return;
    event.preventDefault();
    event.stopPropagation();
  }

  step(by) {
    const here = this.items.findIndex((one) => one.id === this.current?.id);
    const next = here < 0 ? (by > 0 ? 0 : this.items.length - 1) : here + by;
    this.go(this.items[Math.min(Math.max(next, 0), this.items.length - 1)]);
  }

  stepRow(by) {
    if (!this.current) return this.step(by);
    const { row, at } = this.current;
    const rows = [...new Set(this.items.map((one) => one.row))];
    const next = rows[rows.indexOf(row) + by];
    const there = this.items.filter((one) => one.row === next);
    there.sort((a, b) => Math.abs(a.at - at) - Math.abs(b.at - at));
    this.go(there[0]);
  }

  go(item) {
    if (!item) return;
    const { row } = this.place;
    if (item.row >= 0) {
      const y = AXIS + LANE + item.row * row;
      if (y - this.plot.scrollTop < AXIS + LANE) this.plot.scrollTop = item.row * row;
      if (y + row - this.plot.scrollTop > this.height) this.plot.scrollTop = y + row - this.height;
    }
    this.render();
    const found = this.items.find((one) => one.id === item.id) ?? item;
    const { left, top } = this.canvas.getBoundingClientRect();
    this.pointAt(found, left + Math.max(found.x, this.place.left) + 4, top + found.y + found.h - 8, true);
  }
}

function inside(one, x, y) {
  return x >= one.x && x <= one.x + one.w && y >= one.y && y <= one.y + one.h;
}

let drawnIn = "";

/** The legend is drawn once, and again in another theme. */
function legend() {
  if (drawnIn === ink.ink) return;
  drawnIn = ink.ink;
  const list = get("legend");
  list.replaceChildren();
  for (const [name, text] of Object.entries(SIGNS)) {
    const canvas = make("canvas");
    list.append(make("li", {}, canvas, text));
    const pen = paper(canvas, 18, 14);
    sign(pen, name, 9, 7, 5);
  }
}
