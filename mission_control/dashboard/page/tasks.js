// The list of tasks: how far each is, who is on it, who completed it.

import { get, make, mark, seconds, tell } from "./dom.js";

const SIGNS = { done: "✓", busy: "▶", shut: "◇", open: "○" };

export class Tasks {
  constructor(mission) {
    this.mission = mission;
    this.rows = new Map();
    this.list = get("tasks-rows");
    this.onlyOpen = get("tasks-open");
    this.onlyOpen.addEventListener("change", () => this.render());
  }

  render() {
    const { tasks, scene } = this.mission;
    const busy = new Map();
    for (const [robot, { task }] of Object.entries(scene.robots)) {
      if (task) busy.set(task, [...(busy.get(task) ?? []), robot]);
    }
    let done = 0;
    for (const name of tasks) {
      const task = scene.tasks[name] ?? { progress: 0, complete: false, applicable: false };
      done += task.complete;
      this.fill(this.row(name), task, busy.get(name) ?? []);
    }
    tell(get("tasks-note"), `${done} of ${tasks.length} complete`);
  }

  row(name) {
    if (!this.rows.has(name)) {
      const cells = {
        sign: make("span", { class: "sign", "aria-hidden": "true" }),
        name: make("span", { class: "name", title: name }, name),
        bar: make("i"),
        who: make("span", { class: "who" }),
      };
      const track = make("span", { class: "track", "aria-hidden": "true" }, cells.bar);
      cells.row = make("li", { class: "task" }, cells.sign, cells.name, track, cells.who);
      this.list.append(cells.row);
      this.rows.set(name, cells);
    }
    return this.rows.get(name);
  }

  fill(cells, task, robots) {
    const is = task.complete ? "done" : robots.length ? "busy" : task.applicable ? "open" : "shut";
    mark(cells.row, "data-is", is);
    cells.row.hidden = this.onlyOpen.checked && task.complete;
    tell(cells.sign, SIGNS[is]);
    const width = `scaleX(${task.progress})`;
    if (cells.bar.style.transform !== width) cells.bar.style.transform = width;
    const words = {
      done: `${task.at === undefined || task.at === null ? "complete" : seconds(task.at)}${task.by ? ` · ${task.by}` : ""}`,
      busy: `${Math.round(100 * task.progress)} % · ${robots.join(", ")}`,
      open: task.progress > 0 ? `${Math.round(100 * task.progress)} %, nobody on it` : "open",
      shut: "not applicable now",
    };
    tell(cells.who, words[is]);
    mark(cells.who, "title", words[is]);
  }
}
