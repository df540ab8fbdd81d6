// What happened and what the robots decided, each with its explanation, newest first. Choosing one goes to its instant.

import { get, make, mark, seconds, tell } from "./dom.js";

const SHOWN = 120;

export class Decisions {
  constructor(mission) {
    this.mission = mission;
    this.list = get("decisions-rows");
    this.list.tabIndex = 0;
    this.list.addEventListener("keydown", (event) => this.step(event));
    this.key = "";
  }

  /** Up and down go from one to the next: Tab passes all of them at once. */
  step(event) {
    if (event.key !== "ArrowDown" && event.key !== "ArrowUp") return;
    event.preventDefault();
    const rows = [...this.list.querySelectorAll("button")];
    const next = rows.indexOf(document.activeElement) + (event.key === "ArrowDown" ? 1 : -1);
    rows[Math.min(Math.max(next, 0), rows.length - 1)]?.focus();
  }

  render() {
    const { told } = this.mission;
    const at = this.mission.shownAt + 1e-6;
    let end = told.length;
    if (this.mission.at !== null) end = told.findLastIndex((one) => one.from <= at) + 1;
    const key = `${end} ${told[0]?.id} ${told[end - 1]?.id}`;
    if (key === this.key) return;
    this.key = key;
    const shown = told.slice(Math.max(0, end - SHOWN), end).reverse();
    const kept = new Map([...this.list.children].map((row) => [row.dataset.id, row]));
    const rows = shown.map((one) => kept.get(String(one.id)) ?? this.row(one));
    if (!rows.length) rows.push(make("li", { class: "none" }, "Nothing has happened yet."));
    reorder(this.list, rows);
  }

  row(one) {
    const time = make("time", {}, seconds(one.elapsed));
    const go = make("button", { type: "button", tabindex: "-1", onclick: () => this.mission.show(one.from) }, time, make("span", {}, one.text));
    return make("li", { class: `told-${one.kind}`, "data-id": one.id }, go);
  }
}

/** Put `rows` into the list and move only what has to move, so that the focus stays where it is. */
export function reorder(list, rows) {
  const wanted = new Set(rows);
  for (const row of [...list.children]) if (!wanted.has(row)) row.remove();
  let place = list.firstChild;
  for (const row of rows) {
    if (row === place) place = place.nextSibling;
    else list.insertBefore(row, place);
  }
}
