// The faults of the mission, and for who holds the token the means to make and to end them.

import { get, make, mark, offer, seconds, tell } from "./dom.js";
import { reorder } from "./decisions.js";
import { base } from "./mission.js";

const SHOWN = 40;

/** What each kind asks for, and the fault that it makes of the answers. */
const KINDS = {
  crash: {
    fields: ["robot", "lasts"],
    lasts: "back after",
    make: ({ robot, lasts }) => ({ fault: { kind: "crash", robot, restart: lasts !== null }, lasts }),
  },
  hang: { fields: ["robot", "lasts"], make: ({ robot, lasts }) => ({ fault: { kind: "hang", robot }, lasts }) },
  stuck: { fields: ["robot", "lasts"], make: ({ robot, lasts }) => ({ fault: { kind: "stuck", robot }, lasts }) },
  loss: {
    fields: ["from", "to", "share", "lasts"],
    make: ({ from, to, share, lasts }) => ({ fault: { link: { from, to }, loss: share }, lasts }),
  },
  delay: {
    fields: ["from", "to", "by", "lasts"],
    make: ({ from, to, by, lasts }) => ({ fault: { link: { from, to }, delay: by }, lasts }),
  },
  partition: {
    fields: ["group", "lasts"],
    make: ({ group, rest, lasts }) => ({ fault: { partition: [group, rest] }, lasts }),
  },
};

export class Faults {
  constructor(mission) {
    this.mission = mission;
    this.token = this.takeToken();
    this.rows = new Map();
    this.answer = get("answer");
    this.build();
  }

  /** The token comes in the part of the address that no browser sends anywhere, and does not stay there. */
  takeToken() {
    const given = new URLSearchParams(location.hash.slice(1)).get("token");
    try {
      if (given) sessionStorage.setItem("token", given);
      if (given) history.replaceState(null, "", location.pathname);
      return given ?? sessionStorage.getItem("token") ?? "";
    } catch {
      return given ?? "";
    }
  }

  build() {
    const kinds = document.querySelector(".kinds");
    for (const kind of Object.keys(KINDS)) {
      const radio = make("input", { type: "radio", name: "kind", value: kind, checked: kind === "crash", onchange: () => this.ask() });
      kinds.append(make("label", {}, radio, make("span", {}, kind)));
    }
    const select = (name, more = {}) => make("select", { name, ...more });
    const number = (name, value, step, most) => make("input", { type: "number", name, value, step, min: 0, max: most });
    this.fields = {
      robot: make("label", {}, "robot", select("robot")),
      from: make("label", {}, "from", select("from")),
      to: make("label", {}, "to", select("to")),
      share: make("label", {}, "share", number("share", "0.3", "0.05", 1)),
      by: make("label", {}, "by", number("by", "0.3", "0.05", 60), "s"),
      group: make("label", {}, "cut off", select("group", { multiple: true })),
      lasts: make("label", {}, make("span", {}, "for"), number("lasts", "", "1", 100000), "s"),
    };
    get("fields").append(...Object.values(this.fields));
    get("inject").addEventListener("submit", (event) => (event.preventDefault(), this.inject()));
    get("heal-all").addEventListener("click", () => this.send("heal", { name: "" }));
    this.ask();
  }

  get kind() {
    return document.querySelector(".kinds input:checked").value;
  }

  ask() {
    const kind = KINDS[this.kind];
    for (const [name, label] of Object.entries(this.fields)) label.hidden = !kind.fields.includes(name);
    tell(this.fields.lasts.firstChild, kind.lasts ?? "for");
    mark(this.fields.lasts.querySelector("input"), "placeholder", this.kind === "crash" ? "never" : "ever");
  }

  inject() {
    const field = (name) => get("inject").elements[name];
    const chosen = [...field("group").selectedOptions].map((option) => option.value);
    const given = {
      robot: field("robot").value,
      from: field("from").value,
      to: field("to").value,
      share: Number(field("share").value),
      by: Number(field("by").value),
      group: chosen,
      rest: this.mission.robots.filter((robot) => !chosen.includes(robot)),
      lasts: field("lasts").value === "" ? null : Number(field("lasts").value),
    };
    this.send("inject", KINDS[this.kind].make(given));
  }

  async send(verb, body) {
    this.say("", "");
    try {
      const response = await fetch(`${base()}chaos/${verb}`, {
        method: "POST",
        headers: { "Content-Type": "application/json", Authorization: `Bearer ${this.token}` },
        body: JSON.stringify(body),
      });
      const { done, text } = await response.json();
      this.say(text, done ? "done" : "refused");
    } catch {
      this.say("The server did not answer.", "refused");
    }
  }

  say(text, is) {
    tell(this.answer, text);
    mark(this.answer, "data-is", is);
  }

  render() {
    const { mission } = this;
    const { about, robots } = mission;
    if (!about) return;
    const may = about.live && this.token !== "";
    get("inject").hidden = !may;
    get("faults-hint").hidden = may || !about.live;
    tell(get("faults-hint"), "To make faults, open the address with the token that the command printed.");
    offer(get("inject").elements.robot, robots);
    offer(get("inject").elements.group, robots);
    for (const end of ["from", "to"]) offer(get("inject").elements[end], ["*", ...robots], ["anybody", ...robots]);
    mark(get("inject-go"), "data-live", String(mission.at === null));
    this.list(may);
  }

  list(may) {
    const { mission } = this;
    const at = mission.shownAt;
    const shown = [...mission.faults.values()].filter((one) => mission.begun(one)).slice(-SHOWN).reverse();
    let inForce = 0;
    const rows = shown.map((fault) => {
      const on = fault.to === null || fault.to > at;
      inForce += on;
      return this.fill(this.row(fault), fault, on, may);
    });
    tell(get("faults-note"), `${inForce} in force`);
    if (!rows.length) rows.push((this.none ??= make("li", { class: "none" }, "No fault so far.")));
    reorder(get("faults-rows"), rows);
  }

  row(fault) {
    if (!this.rows.has(fault.id)) {
      const what = make("span", { class: "what" }, make("b", {}, fault.text), make("small"));
      const heal = make("button", { type: "button", class: "small", onclick: () => this.send("heal", { name: fault.name }) }, "Heal");
      this.rows.set(fault.id, make("li", { class: "fault" }, what, heal));
    }
    return this.rows.get(fault.id);
  }

  fill(row, fault, on, may) {
    mark(row, "data-is", on ? "on" : "over");
    const until = on ? "" : ` to ${seconds(fault.since + fault.to - fault.from)}`;
    tell(row.querySelector("small"), `${fault.name} · from ${seconds(fault.since)}${until}`);
    row.lastChild.hidden = !(may && on && this.mission.at === null);
    return row;
  }
}
