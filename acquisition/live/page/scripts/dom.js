// Elements of the page: find, make, change only where something is different.

export const by = (id) => document.getElementById(id);

export function make(tag, properties = {}, ...children) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children.filter((child) => child !== null));
  return element;
}

export function makeSvg(tag, attributes) {
  const element = document.createElementNS('http://www.w3.org/2000/svg', tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  return element;
}

export function write(id, text) {
  const element = by(id);
  if (element.textContent !== text) element.textContent = text;
}

export function show(id, visible) {
  by(id).hidden = !visible;
}

// Children of an element, made anew only if `content` (plain data) has changed: focus, selected text
// and scroll position survive a scan that goes on.
const shown = new WeakMap();
export function fill(element, content, makeChildren) {
  const key = JSON.stringify(content);
  if (shown.get(element) === key) return;
  shown.set(element, key);
  element.replaceChildren(...makeChildren(content));
}
