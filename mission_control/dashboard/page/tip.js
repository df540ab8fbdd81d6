// One tooltip for all drawings; what it says is also said to screen readers when it came by keyboard.

import { get, tell } from "./dom.js";

const tip = get("tip");

/** Show `text` beside the point (x, y) of the window. */
export function showTip(text, x, y, { aloud = false } = {}) {
  tell(tip, text);
  tip.hidden = false;
  const { width, height } = tip.getBoundingClientRect();
  const left = x + 14 + width > window.innerWidth - 8 ? x - width - 14 : x + 14;
  tip.style.left = `${Math.max(8, Math.min(left, window.innerWidth - width - 8))}px`;
  tip.style.top = `${Math.max(8, Math.min(y + 16, window.innerHeight - height - 8))}px`;
  if (aloud) tell(get("said"), text);
}

export function hideTip() {
  tip.hidden = true;
}
