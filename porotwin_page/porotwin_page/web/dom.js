/* Short forms for reading and changing the document. */

const SVG = 'http://www.w3.org/2000/svg';

export const find = (selector, root = document) => root.querySelector(selector);

/* Sets a text only if it differs, so that a selection in it survives. */
export function setText(target, text) {
  if (target.textContent !== text) target.textContent = text;
}

/* A new element with properties and children, which are elements or texts. A long name may go on in
   the next line after its underscores. */
export function element(name, properties = {}, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children.flatMap(breakable));
  return made;
}

function breakable(child) {
  if (typeof child !== 'string' || !child.includes('_')) return [child];
  const parts = child.split(/(?<=_)/);
  return parts.flatMap((part, number) => number ? [document.createElement('wbr'), part] : [part]);
}

/* A new SVG element at the end of `parent`. */
export function draw(parent, name, attributes, text) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key === 'style') made.style.cssText = value;  // the page's policy forbids the attribute
    else made.setAttribute(key, value);
  }
  if (text !== undefined) made.textContent = text;
  parent.append(made);
  return made;
}

/* Returns whether `value` differs from the last call with this element, and remembers it. */
export function hasChanged(target, value) {
  const key = JSON.stringify(value);
  if (target.dataset.key === key) return false;
  target.dataset.key = key;
  return true;
}
