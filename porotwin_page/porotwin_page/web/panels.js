/* Puts the panels that the server declares into their regions of the page. */

import * as chart from './chart.js';
import { element, find } from './dom.js';
import * as lines from './lines.js';
import * as map from './map.js';

const DRAWINGS = { chart, lines, map };

/* The module that draws a panel: a common one, or the panel's own beside its Python file. */
function drawingOf(declaration) {
  if (declaration.drawing in DRAWINGS) return DRAWINGS[declaration.drawing];
  return import(`../panels/${declaration.name}.js`);
}

/* The frame of a panel: its title and an empty caption. */
function panelElement(declaration) {
  const { name, title, drawing, large } = declaration;
  const classes = ['panel', `panel-${drawing}`, large ? 'large' : '', title ? '' : 'untitled'];
  const root = element('section', { id: name, className: classes.filter(Boolean).join(' ') });
  if (!title) return root;
  root.setAttribute('aria-labelledby', `${name}-title`);
  const heading = element('h2', { id: `${name}-title`, textContent: title });
  const caption = element('p', { className: 'caption' });
  root.append(element('div', { className: 'title' }, heading, caption));
  return root;
}

/* Draws one panel. A fault in its script is shown there, and ends no other panel. */
export function draw(root, render, content) {
  try {
    render(content);
    delete root.dataset.fault;
  } catch (error) {
    console.error(error);
    root.dataset.fault = 'This panel cannot be drawn. Reload the page.';
  }
}

/* Returns a function that draws all panels from their contents by name. */
export async function assemble(declarations, page) {
  const renders = await Promise.all(declarations.map(async (declaration) => {
    const root = panelElement(declaration);
    find(`#${declaration.region}`).append(root);
    const drawing = await drawingOf(declaration);
    return [declaration.name, root, drawing.create(root, declaration, page)];
  }));
  return (contents) => {
    for (const [name, root, render] of renders) draw(root, render, contents[name]);
  };
}
