// The box of a box-pushing mission, seen from above: its two ends on their way, and who pushes where.

import { draw, get, percent, tell } from "./dom.js";

const [LEFT, RIGHT, TOP, BOTTOM] = [52, 372, 62, 146];

export class Box {
  constructor(mission) {
    this.mission = mission;
    this.parts = null;
  }

  render() {
    const { about, scene } = this.mission;
    const ends = about?.ends;
    get("box").hidden = !ends;
    get("panels").classList.toggle("has-box", Boolean(ends));
    if (!ends) return;
    this.parts ??= this.build(ends);
    const at = ends.map((end) => scene.tasks[end]?.progress ?? 0);
    const x = at.map((share) => LEFT + share * (RIGHT - LEFT));
    const { body, ends: dots, labels, slack, pushers } = this.parts;
    move(body, { x1: x[0], x2: x[1] });
    const behind = Math.min(...x);
    move(slack, { x: behind, width: Math.min(about.slack * (RIGHT - LEFT), RIGHT - behind) });
    ends.forEach((end, side) => {
      move(dots[side], { cx: x[side] });
      tell(labels[side], percent(at[side]));
      move(labels[side], { x: x[side] });
      this.push(pushers[side], x[side], side ? BOTTOM : TOP, end, scene.robots);
    });
    const apart = Math.abs(at[0] - at[1]);
    tell(get("box-note"), `ends ${percent(apart)} of the way apart; at most ${percent(about.slack)}`);
  }

  build(ends) {
    const svg = get("box-picture");
    const lane = (y, name) => [
      draw("line", { class: "lane", x1: LEFT, x2: RIGHT, y1: y, y2: y }),
      draw("text", { x: LEFT - 8, y: y === TOP ? y - 26 : y + 34 }, name),
    ];
    const goal = draw("line", { class: "goal", x1: RIGHT, x2: RIGHT, y1: TOP - 26, y2: BOTTOM + 26 });
    const slack = draw("rect", { class: "slack", y: TOP - 16, height: BOTTOM - TOP + 32 });
    const body = draw("line", { class: "body", y1: TOP, y2: BOTTOM });
    const dots = [TOP, BOTTOM].map((y) => draw("circle", { class: "end", cy: y, r: 8 }));
    const labels = [TOP, BOTTOM].map((y) => draw("text", { class: "at", y: y === TOP ? y - 15 : y + 24, "text-anchor": "middle" }));
    const pushers = [draw("g"), draw("g")];
    const goalName = draw("text", { x: RIGHT, y: BOTTOM + 42, "text-anchor": "middle" }, "goal");
    svg.append(slack, ...lane(TOP, ends[0]), ...lane(BOTTOM, ends[1]), goal, goalName, body, ...dots, ...labels, ...pushers);
    return { body, ends: dots, labels, slack, pushers };
  }

  push(group, x, y, end, robots) {
    const names = Object.keys(robots).filter((name) => robots[name].task === end && robots[name].present);
    const key = names.join(" ");
    if (group.dataset.names !== key) {
      group.dataset.names = key;
      group.replaceChildren(
        ...names.flatMap((name, place) => [
          draw("path", { class: "pusher", d: `M ${-17 - 12 * place} -6 l 9 6 l -9 6 z` }),
          draw("text", { x: -22 - 12 * place, y: 4 + 14 * place, "text-anchor": "end" }, name),
        ]),
      );
    }
    move(group, { transform: `translate(${x.toFixed(1)} ${y})` });
  }
}

function move(node, places) {
  for (const [name, value] of Object.entries(places)) node.setAttribute(name, typeof value === "number" ? value.toFixed(1) : value);
}
