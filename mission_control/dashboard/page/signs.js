// The small signs of the timeline. Each differs from the others in shape, so that none depends on its colour.

import { ink } from "./palette.js";

/** Those that the legend explains. */
export const SIGNS = {
  done: "complete",
  lost: "lost",
  left: "left or yielded",
  takeover: "takeover",
  gone: "robot gone",
  present: "robot back",
  fault: "fault",
};

const DRAW = {
  done(pen, x, y, s) {
    stroke(pen, ink.good, 2, [[x - s * 0.75, y], [x - s * 0.15, y + s * 0.6], [x + s * 0.8, y - s * 0.6]]);
  },
  lost(pen, x, y, s) {
    stroke(pen, ink.bad, 2, [[x - s * 0.6, y - s * 0.6], [x + s * 0.6, y + s * 0.6]]);
    stroke(pen, ink.bad, 2, [[x + s * 0.6, y - s * 0.6], [x - s * 0.6, y + s * 0.6]]);
  },
  left(pen, x, y, s) {
    stroke(pen, ink.soft, 1.6, [[x + s * 0.8, y], [x - s * 0.7, y]]);
    stroke(pen, ink.soft, 1.6, [[x - s * 0.1, y - s * 0.6], [x - s * 0.7, y], [x - s * 0.1, y + s * 0.6]]);
  },
  takeover(pen, x, y, s) {
    disc(pen, x, y, s, ink.bad);
    stroke(pen, ink.panel, 1.4, [[x - s * 0.5, y - s * 0.25], [x + s * 0.5, y - s * 0.25], [x + s * 0.15, y - s * 0.6]]);
    stroke(pen, ink.panel, 1.4, [[x + s * 0.5, y + s * 0.25], [x - s * 0.5, y + s * 0.25], [x - s * 0.15, y + s * 0.6]]);
  },
  gone(pen, x, y, s) {
    pen.fillStyle = ink.ink;
    pen.beginPath();
    pen.rect(x - s * 0.8, y - s * 0.8, s * 1.6, s * 1.6);
    pen.fill();
    stroke(pen, ink.panel, 1.4, [[x - s * 0.4, y - s * 0.4], [x + s * 0.4, y + s * 0.4]]);
    stroke(pen, ink.panel, 1.4, [[x + s * 0.4, y - s * 0.4], [x - s * 0.4, y + s * 0.4]]);
  },
  present(pen, x, y, s) {
    pen.fillStyle = ink.good;
    polygon(pen, [[x - s * 0.6, y - s * 0.8], [x + s * 0.8, y], [x - s * 0.6, y + s * 0.8]]);
  },
  fault(pen, x, y, s) {
    pen.fillStyle = ink.bad;
    polygon(pen, [[x + s * 0.35, y - s], [x - s * 0.7, y + s * 0.2], [x - s * 0.05, y + s * 0.2], [x - s * 0.35, y + s], [x + s * 0.7, y - s * 0.2], [x + s * 0.05, y - s * 0.2]]);
  },
  busy(pen, x, y, s) {
    disc(pen, x, y, s, ink.accent);
  },
  idle(pen, x, y, s) {
    pen.strokeStyle = ink.faint;
    pen.lineWidth = 1.6;
    pen.beginPath();
    pen.arc(x, y, s - 0.8, 0, 7);
    pen.stroke();
  },
};

/** Draw the sign `name` around (x, y), `size` pixels in each direction. */
export function sign(pen, name, x, y, size) {
  DRAW[name]?.(pen, x, y, size);
}

function disc(pen, x, y, radius, hue) {
  pen.fillStyle = hue;
  pen.beginPath();
  pen.arc(x, y, radius, 0, 7);
  pen.fill();
}

function stroke(pen, hue, width, points) {
  pen.strokeStyle = hue;
  pen.lineWidth = width;
  pen.lineCap = pen.lineJoin = "round";
  pen.beginPath();
  points.forEach(([x, y], i) => (i ? pen.lineTo(x, y) : pen.moveTo(x, y)));
  pen.stroke();
}

function polygon(pen, points) {
  pen.beginPath();
  points.forEach(([x, y], i) => (i ? pen.lineTo(x, y) : pen.moveTo(x, y)));
  pen.closePath();
  pen.fill();
}
