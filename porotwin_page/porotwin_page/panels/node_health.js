/* Draws the state of every node. */

import { element, find } from '../web/dom.js';
import { duration, isNumber } from '../web/formatting.js';

const LIGHTS = { ok: '✔', warn: '▲', error: '✖', silent: '✖', quiet: '·' };

function line(node) {
  const parts = {
    light: LIGHTS[node.level],
    name: node.name,
    message: node.message,
    age: isNumber(node.age_s) ? `${duration(node.age_s)} ago` : '',
  };
  const spans = Object.entries(parts)
    .map(([className, textContent]) => element('span', { className }, textContent));
  return element('li', { className: node.level }, ...spans);
}

export function create(root) {
  root.append(element('ul'));
  return (nodes) => find('ul', root).replaceChildren(...nodes.map(line));
}
