/* A panel with lines of text. */

import { element, hasChanged } from './dom.js';

export function create(root) {
  const list = element('ul');
  root.append(list);
  root.hidden = true; // until there are lines
  return (lines) => {
    root.hidden = lines.length === 0;
    if (!hasChanged(list, lines)) return;
    list.replaceChildren(...lines.map((text) => element('li', { textContent: text })));
  };
}
