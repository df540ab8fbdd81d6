// Making and changing elements. Names and texts from the bus go through here, and become text or attributes, never HTML.

/** An element with attributes and children; a child that is no node becomes text. */
export function make(tag, attributes = {}, ...children) {
  return furnish(document.createElement(tag), attributes, children);
}

/** The same in SVG. */
export function draw(tag, attributes = {}, ...children) {
  return furnish(document.createElementNS("http://www.w3.org/2000/svg", tag), attributes, children);
}

function furnish(node, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (value !== undefined && value !== false) node.setAttribute(name, value === true ? "" : value);
  }
  node.append(...children.map((child) => (child instanceof Node ? child : String(child))));
  return node;
}

export const get = (id) => document.getElementById(id);

/** Change a text only where it differs, so that what stays the same costs nothing. */
export function tell(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

/** The same for an attribute. */
export function mark(node, name, value) {
  if (node.getAttribute(name) !== value) node.setAttribute(name, value);
}

/** The options of a select, kept as they are if they are the same. */
export function offer(select, values, labels = values) {
  const key = values.join("\n");
  if (select.dataset.offers === key) return;
  select.dataset.offers = key;
  const chosen = select.value;
  select.replaceChildren(...values.map((value, i) => make("option", { value }, labels[i])));
  if (values.includes(chosen)) select.value = chosen;
}

/** A canvas as large as its place and as sharp as the screen: its context, width and height in CSS pixels. */
export function paper(canvas, width, height) {
  const sharp = window.devicePixelRatio || 1;
  const [w, h] = [Math.round(width * sharp), Math.round(height * sharp)];
  if (canvas.width !== w || canvas.height !== h) {
    canvas.width = w;
    canvas.height = h;
    canvas.style.height = `${height}px`;
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(sharp, 0, 0, sharp, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.textBaseline = "middle";
  pen.textRendering = "geometricPrecision";
  return pen;
}

const sizes = new WeakMap();
const observer = new ResizeObserver((entries) => {
  for (const { target } of entries) sizes.set(target, { width: target.clientWidth, height: target.clientHeight });
});

/** The inner size of an element, as it was when it changed last: to ask each time would make the browser lay out the page. */
export function sizeOf(element) {
  if (!sizes.has(element)) {
    sizes.set(element, { width: element.clientWidth, height: element.clientHeight });
    observer.observe(element);
  }
  return sizes.get(element);
}

/** `text` cut so that it fits into `width` pixels; empty where not even a few letters do. */
export function cut(pen, text, width) {
  if (width < 14) return "";
  if (pen.measureText(text).width <= width) return text;
  let [few, many] = [0, text.length];
  while (few < many) {
    const half = (few + many + 1) >> 1;
    if (pen.measureText(`${text.slice(0, half)}…`).width <= width) few = half;
    else many = half - 1;
  }
  return few > 1 ? `${text.slice(0, few)}…` : "";
}

export const seconds = (value, digits = 1) => `${value.toFixed(digits)} s`;
export const percent = (share) => `${Math.round(share * 100)} %`;
