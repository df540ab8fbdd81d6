// What the page knows: the connection to the server, and all that came over it, put together.
//
// The server sends what changed since the last time, and goes on only when that was acknowledged, so a slow page gets less
// often what is newer, and never a queue. Of the past it is asked for one instant at a time, the latest that is wanted.

const RETRY = 1000; // in ms

export class Mission {
  constructor(changed) {
    this.changed = changed;
    this.about = null;
    this.connected = false;
    this.chosen = ""; // the robot whose motivation is shown
    this.at = null; // the instant shown; null: the present
    this.asked = false;
    this.robots = [];
    this.tasks = [];
    this.taskPlace = new Map();
    this.reset();
    this.connect();
  }

  reset() {
    this.now = 0;
    this.present = scene();
    this.past = null;
    this.trials = [];
    this.bars = new Map();
    this.marks = new Map();
    this.faults = new Map();
    this.told = [];
    this.curves = { robot: "", points: [], factors: bare({}) };
  }

  /** The state that is shown: of the present, or of the instant that was chosen. */
  get scene() {
    return this.at === null ? this.present : (this.past?.scene ?? this.present);
  }

  get shownCurves() {
    return this.at === null ? this.curves : (this.past?.curves ?? this.curves);
  }

  /** The instant that is shown, in seconds on the timeline. */
  get shownAt() {
    return this.at ?? this.now;
  }

  connect() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}${base()}watch`);
    this.socket = socket;
    socket.onmessage = ({ data }) => this.take(JSON.parse(data));
    socket.onclose = () => {
      this.connected = false;
      this.asked = false;
      this.changed();
      setTimeout(() => this.connect(), RETRY);
    };
  }

  say(message) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  take(message) {
    if (message.kind === "hello") {
      this.reset();
      this.about = message;
      this.connected = true;
      if (this.chosen) this.say({ robot: this.chosen });
      if (this.at !== null) this.ask();
    } else if (message.kind === "update") {
      this.update(message);
    } else if (message.kind === "past") {
      this.asked = false;
      if (this.at !== null) {
        this.past = { ...message, scene: { ...bare(message.scene, 2), links: bare(message.scene.links, 2) }, curves: curvesOf(message.curves) };
        if (message.at !== this.at || message.curves.robot !== this.chosen) this.ask();
      }
    }
    this.changed(message.number);
  }

  update(message) {
    this.now = message.now;
    for (const name of ["robots", "tasks"]) {
      if (message[name]) this[name] = message[name];
    }
    if (message.tasks) this.taskPlace = new Map(this.tasks.map((task, place) => [task, place]));
    if (message.trials) this.trials = message.trials;
    for (const [name, value] of Object.entries(message.scene ?? {})) {
      if (name === "figures") this.present.figures = value;
      else Object.assign(this.present[name], name === "links" ? bare(value, 2) : value);
    }
    for (const name of ["bars", "marks", "faults"]) {
      for (const one of message[name] ?? []) this[name].set(one.id, one);
    }
    if (message.told) this.told.push(...message.told);
    if (message.forgotten) this.forget(message.forgotten);
    if (message.curves) this.follow(curvesOf(message.curves));
  }

  /** The server no longer keeps what is older than these. */
  forget({ bars, marks, told }) {
    for (const [kept, least] of [[this.bars, bars], [this.marks, marks]]) {
      for (const id of kept.keys()) {
        if (id >= least) break;
        kept.delete(id);
      }
    }
    while (this.told.length && this.told[0].id < told) this.told.shift();
  }

  follow(curves) {
    if (curves.robot !== this.curves.robot) this.curves = { robot: curves.robot, points: [], factors: bare({}) };
    this.curves.points.push(...curves.points);
    this.curves.points.splice(0, this.curves.points.length - 400);
    if (curves.factors) this.curves.factors = curves.factors;
  }

  choose(robot) {
    if (robot === this.chosen) return;
    this.chosen = robot;
    this.say({ robot });
    if (this.at !== null) this.ask();
    this.changed();
  }

  /** Show an instant of the past, in seconds on the timeline. */
  show(at) {
    this.at = Math.max(0, Math.min(at, this.now));
    this.ask();
    this.changed();
  }

  live() {
    this.at = this.past = null;
    this.changed();
  }

  ask() {
    if (this.asked) return;
    this.asked = true;
    this.say({ show: this.at, robot: this.chosen });
  }

  /** The trial of an instant, and the time since it began. */
  place(at) {
    let found = this.trials[0] ?? { trial: 1, at: 0 };
    for (const one of this.trials) if (one.at <= at + 1e-9) found = one;
    return { trial: found.trial, elapsed: Math.max(0, at - found.at) };
  }

  /** Whether `one`, a fault or a bar, has begun by the instant shown. */
  begun(one) {
    return one.from <= this.shownAt + 1e-9;
  }
}

function scene() {
  return bare({ figures: {}, robots: {}, tasks: {}, links: {} }, 2);
}

/** The record without what every object of JavaScript inherits: robots and tasks may be called `constructor` or `__proto__`. */
function bare(record, depth = 1) {
  const copy = Object.assign(Object.create(null), record);
  if (depth > 1) for (const name of Object.keys(copy)) copy[name] = bare(copy[name], depth - 1);
  return copy;
}

function curvesOf({ robot, points, factors }) {
  return { robot, points: points.map(([at, sets]) => [at, bare(sets)]), factors: factors && bare(factors) };
}

/** The path under which the page lives, with a slash at the end. */
export function base() {
  return location.pathname.replace(/[^/]*$/, "");
}
