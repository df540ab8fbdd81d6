// The matrix of links: rows hear, columns speak. The fill tells what share was lost, a cross that the speaker is silent.

import { cut, get, paper, percent, seconds, sizeOf } from "./dom.js";
import { channels, FONT, ink, tint } from "./palette.js";
import { hideTip, showTip } from "./tip.js";

/** No links: without what objects inherit, as a robot may be called `constructor`. */
const NONE = Object.create(null);

export class Links {
  constructor(mission) {
    this.mission = mission;
    this.place = get("matrix");
    this.canvas = this.place.firstElementChild;
    this.current = null;
    this.place.addEventListener("pointermove", (event) => this.move(event));
    this.place.addEventListener("pointerleave", () => this.leave());
    this.place.addEventListener("blur", () => this.leave());
    this.place.addEventListener("keydown", (event) => this.key(event));
  }

  layout() {
    const { robots } = this.mission;
    const { width, height } = sizeOf(this.place);
    const named = robots.length <= 16;
    const side = named ? Math.min(88, width * 0.26) : 20;
    const head = named ? 24 : 16;
    const cell = Math.max(1, Math.min((width - side - 2) / Math.max(robots.length, 1), named ? 110 : 1e3));
    const row = Math.max(1, Math.min((height - head - 2) / Math.max(robots.length, 1), named ? 52 : cell));
    return { width, height, side, head, cell: named ? cell : Math.min(cell, row), row: named ? row : Math.min(cell, row), named };
  }

  render() {
    const layout = (this.laid = this.layout());
    if (layout.width <= 0 || layout.height <= 0) return;
    const pen = paper(this.canvas, layout.width, layout.height);
    const { robots } = this.mission;
    this.heads(pen, robots, layout);
    const gap = layout.named ? 2 : 0;
    if (layout.named) this.cells(pen, robots, layout, gap);
    else this.mosaic(pen, robots, layout);
    if (this.current) {
      const [i, j] = this.current;
      pen.strokeStyle = ink.ink;
      pen.lineWidth = 1.5;
      pen.strokeRect(layout.side + j * layout.cell - 0.5, layout.head + i * layout.row - 0.5, layout.cell - gap + 1, layout.row - gap + 1);
    }
  }

  /** Whom a robot hears. One that is gone hears nobody, whatever it reported last. */
  heard(hearer) {
    const { links, robots } = this.mission.scene;
    return (robots[hearer]?.present === false ? null : links[hearer]) ?? NONE;
  }

  /** Of a small team, each pair with words. */
  cells(pen, robots, layout, gap) {
    robots.forEach((hearer, i) => {
      const heard = this.heard(hearer);
      robots.forEach((speaker, j) => {
        const x = layout.side + j * layout.cell;
        const y = layout.head + i * layout.row;
        this.cell(pen, i === j ? null : unpack(heard[speaker]), x, y, layout.cell - gap, layout.row - gap, i === j);
      });
    });
  }

  /** Of a large team, each pair as a point of a picture, which is drawn as a whole. */
  mosaic(pen, robots, { side, head, cell, row }) {
    const count = robots.length;
    if (this.picture?.width !== count) this.picture = new OffscreenCanvas(count, count);
    const inner = this.picture.getContext("2d");
    const image = inner.createImageData(count, count);
    const [ground, empty, full, silent] = [ink.grid, ink.sunk, ink.heat, ink.bad].map(channels);
    for (let i = 0; i < count; i++) {
      const heard = this.heard(robots[i]);
      for (let j = 0; j < count; j++) {
        const link = heard[robots[j]];
        const lost = link?.[1] ?? 0;
        const [from, to, share] = !link ? [ground, ground, 0] : link[3] ? [silent, silent, 0] : [empty, full, lost > 0.005 ? 0.12 + 0.88 * lost : 0];
        for (let part = 0; part < 3; part++) image.data[4 * (i * count + j) + part] = from[part] + share * (to[part] - from[part]);
        image.data[4 * (i * count + j) + 3] = 255;
      }
    }
    inner.putImageData(image, 0, 0);
    pen.imageSmoothingEnabled = false;
    pen.drawImage(this.picture, side, head, count * cell, count * row);
  }

  heads(pen, robots, { side, head, cell, row, named }) {
    pen.font = `450 11px ${FONT}`;
    pen.fillStyle = ink.soft;
    if (!named) {
      pen.fillText("speaks →", side, head / 2);
      pen.save();
      pen.translate(9, head + 34);
      pen.rotate(-Math.PI / 2);
      pen.fillText("← hears", -20, 0);
      pen.restore();
      return;
    }
    robots.forEach((robot, i) => {
      pen.textAlign = "left";
      pen.fillText(cut(pen, robot, side - 10), 0, head + (i + 0.5) * row);
      pen.textAlign = "center";
      pen.fillText(cut(pen, robot, cell - 4), side + (i + 0.5) * cell, head / 2);
    });
    pen.textAlign = "left";
  }

  cell(pen, link, x, y, w, h, own) {
    if (own) {
      pen.fillStyle = ink.grid;
      pen.fillRect(x + w / 2 - 2, y + h / 2 - 0.5, Math.min(4, w), 1);
      return;
    }
    pen.fillStyle = ink.sunk;
    pen.fillRect(x, y, w, h);
    if (!link) return;
    const lost = link.lost ?? 0;
    if (lost > 0.005) {
      pen.fillStyle = tint(ink.heat, 0.12 + 0.88 * lost);
      pen.fillRect(x, y, w, h);
    }
    if (link.silent) this.cross(pen, x + w / 2, y + (h > 34 ? h * 0.34 : h / 2), Math.min(w, h, 22) * 0.26);
    if (w > 38 && h > 16) this.words(pen, link, x, y, w, h, lost);
  }

  words(pen, link, x, y, w, h, lost) {
    pen.textAlign = "center";
    pen.font = `520 11.5px ${FONT}`;
    pen.fillStyle = lost > 0.5 ? ink.panel : ink.ink;
    const two = h > 34;
    if (!link.silent) pen.fillText(link.lost === null ? "–" : percent(lost), x + w / 2, y + (two ? h * 0.34 : h / 2));
    if (two) {
      pen.font = `450 10.5px ${FONT}`;
      pen.fillStyle = lost > 0.5 ? ink.panel : ink.soft;
      pen.fillText(link.silence === null ? "never heard" : seconds(link.silence), x + w / 2, y + h * 0.7);
    }
    pen.textAlign = "left";
  }

  cross(pen, x, y, size) {
    pen.strokeStyle = ink.bad;
    pen.lineWidth = Math.max(1, size / 2.6);
    pen.lineCap = "round";
    pen.beginPath();
    pen.moveTo(x - size, y - size);
    pen.lineTo(x + size, y + size);
    pen.moveTo(x + size, y - size);
    pen.lineTo(x - size, y + size);
    pen.stroke();
  }

  move(event) {
    const { left, top } = this.canvas.getBoundingClientRect();
    const j = Math.floor((event.clientX - left - this.laid.side) / this.laid.cell);
    const i = Math.floor((event.clientY - top - this.laid.head) / this.laid.row);
    this.go(i, j, event.clientX, event.clientY);
  }

  go(i, j, x, y, aloud = false) {
    const { robots } = this.mission;
    if (!robots[i] || !robots[j]) return this.leave();
    this.current = [i, j];
    showTip(this.describe(robots[i], robots[j]), x, y, { aloud });
    this.render();
  }

  describe(hearer, speaker) {
    if (hearer === speaker) return hearer;
    if (this.mission.scene.robots[hearer]?.present === false) return `${hearer} hears nobody: it is not there.`;
    const link = unpack(this.heard(hearer)[speaker]);
    if (!link) return `${hearer} hears ${speaker}: nothing is known. They may share no task.`;
    const lost = link.lost === null ? "it is not known how much was lost" : `${percent(link.lost)} lost of late`;
    const silence = link.silence === null ? "not heard in this trial" : `last heard ${seconds(link.silence)} ago`;
    return `${hearer} hears ${speaker}: ${link.received} messages, ${lost}\n${silence}${link.silent ? "; taken to have ceased" : ""}`;
  }

  leave() {
    hideTip();
    if (!this.current) return;
    this.current = null;
    this.render();
  }

  key(event) {
    const steps = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] };
    if (event.key === "Escape") return this.leave();
    if (!(event.key in steps)) return;
    event.preventDefault();
    const most = this.mission.robots.length - 1;
    const bound = (value) => Math.min(Math.max(value, 0), most);
    const [i, j] = this.current ? this.current.map((value, axis) => bound(value + steps[event.key][axis])) : [0, Math.min(1, most)];
    const { left, top } = this.canvas.getBoundingClientRect();
    const { side, head, cell, row } = this.laid;
    this.go(i, j, left + side + (j + 0.5) * cell, top + head + (i + 0.7) * row, true);
  }
}

/** What the server tells of one pair, with names. */
function unpack(link) {
  if (!link) return null;
  const [received, lost, silence, silent] = link;
  return { received, lost, silence, silent };
}
