// Time: the slider, playing, and the way back to the present.

import { get, mark, seconds, tell } from "./dom.js";

const STEP = 1; // seconds, by a key
const TICK = 100; // ms, while playing

export class Transport {
  constructor(mission) {
    this.mission = mission;
    this.slider = get("slider");
    this.playing = 0;
    this.slider.addEventListener("input", () => mission.show(Number(this.slider.value)));
    get("live").addEventListener("click", () => this.live());
    get("play").addEventListener("click", () => this.play());
    document.addEventListener("keydown", (event) => this.key(event));
  }

  key(event) {
    const typing = event.target.closest("input:not([type=range]), select, textarea, button, [role=application]");
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const { mission } = this;
    const free = { l: () => this.live(), L: () => this.live(), ",": () => mission.show(mission.shownAt - STEP), ".": () => mission.show(mission.shownAt + STEP) };
    const bound = { " ": () => this.play(), Home: () => mission.show(0), End: () => this.live() };
    const act = event.target.closest("input:not([type=range]), select, textarea") ? undefined : (free[event.key] ?? (typing ? undefined : bound[event.key]));
    if (act) {
      event.preventDefault();
      act();
      this.render(); // at once: the next key may be one that the slider itself takes
    }
  }

  live() {
    this.stop();
    this.mission.live();
  }

  play() {
    if (this.playing) {
      this.stop();
      this.mission.show(this.mission.shownAt);
      return;
    }
    const { mission } = this;
    if (mission.at === null && !mission.about?.live) mission.show(0);
    if (mission.at === null) {
      mission.show(mission.now);
      return;
    }
    if (mission.at >= mission.now) mission.show(0);
    this.playing = setInterval(() => this.tick(), TICK);
    this.render();
  }

  tick() {
    const { mission } = this;
    if (mission.at === null) return this.stop();
    const next = mission.at + (TICK / 1000) * Number(get("rate").value);
    if (next >= mission.now) this.live();
    else mission.show(next);
  }

  stop() {
    clearInterval(this.playing);
    this.playing = 0;
    this.render();
  }

  render() {
    const { mission } = this;
    const isLive = mission.at === null;
    mark(this.slider, "max", String(Math.max(mission.now, 0.1)));
    this.slider.value = String(mission.shownAt);
    const { trial, elapsed } = mission.place(mission.shownAt);
    const words = mission.trials.length > 1 ? `trial ${trial} · ${seconds(elapsed)}` : seconds(elapsed);
    tell(get("instant"), words);
    mark(this.slider, "aria-valuetext", `${words} of ${seconds(mission.now)}`);
    mark(get("live"), "aria-pressed", String(isLive));
    tell(get("live").lastChild, mission.about && !mission.about.live ? "End" : "Live");
    const runs = this.playing || (isLive && mission.about?.live);
    tell(get("play"), runs ? "❚❚" : "▶");
    mark(get("play"), "aria-label", runs ? "Stop here" : "Play from here");
  }
}
