/* The value of a map under the pointer. */

import { element, setText } from './dom.js';
import { number, signed } from './formatting.js';

const CM = 100;

/* Row (0 at the bottom) and column of a point of a picture; null outside. */
export function cellAt(x, y, { width, height, rows, columns }) {
  if (!(x >= 0 && y >= 0 && x < width && y < height)) return null;
  return {
    row: Math.min(rows - 1, Math.floor((1 - y / height) * rows)),
    column: Math.min(columns - 1, Math.floor(x / width * columns)),
  };
}

/* Place and value of a cell in words; values that are not numbers were not seen. */
export function probeText(cell, values, rig, isSigned) {
  const { rows, columns } = values;
  const value = values.numbers[cell.row * columns + cell.column];
  const shown = isSigned ? signed(value, 3) : number(value, 3);
  const x = number((cell.column + 0.5) / columns * rig.width_m * CM, 1);
  const z = number((cell.row + 0.5) / rows * rig.height_m * CM, 1);
  return `${Number.isNaN(value) ? 'not seen' : shown} at x ${x} cm, z ${z} cm`;
}

/* Loads the values of a map; numbers from the lowest row upward. */
export async function loadValues(url) {
  const response = await fetch(url);
  if (!response.ok) throw new Error(await response.text());
  const [rows, columns] = response.headers.get('X-Shape').split(' ').map(Number);
  return { rows, columns, numbers: new Float32Array(await response.arrayBuffer()) };
}

/* Shows the value under the pointer over `frame`. source: returns { url, rig } of the shown map, or
   null. Values are loaded once for every map, when somebody points at it. */
export function attachProbe(frame, source, isSigned) {
  const text = element('p', { className: 'reading', hidden: true });
  frame.append(text);
  let loaded = { url: null, values: null };
  let point = null;
  const show = () => {
    const map = source();
    if (!point || !map || !map.rig) {
      text.hidden = true;
      return;
    }
    if (loaded.url !== map.url) {
      const wanted = { url: map.url, values: null };
      loaded = wanted;
      loadValues(map.url).then(
        (values) => { wanted.values = values; show(); },
        () => { if (loaded === wanted) loaded = { url: null, values: null }; },
      );
    }
    if (!loaded.values) return;
    const { rows, columns } = loaded.values;
    const size = { width: frame.clientWidth, height: frame.clientHeight, rows, columns };
    const cell = cellAt(point.x, point.y, size);
    text.hidden = cell === null;
    if (cell) setText(text, probeText(cell, loaded.values, map.rig, isSigned));
  };
  frame.addEventListener('pointermove', (event) => {
    const box = frame.getBoundingClientRect();
    point = { x: event.clientX - box.left, y: event.clientY - box.top };
    show();
  });
  frame.addEventListener('pointerleave', () => { point = null; show(); });
  return show;
}
