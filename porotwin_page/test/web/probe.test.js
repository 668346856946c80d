import assert from 'node:assert/strict';
import { test } from 'node:test';

import { cellAt, probeText } from '../../porotwin_page/web/probe.js';

const SIZE = { width: 300, height: 200, rows: 2, columns: 3 };

test('the lowest row is at the bottom of the picture', () => {
  assert.deepEqual(cellAt(10, 190, SIZE), { row: 0, column: 0 });
  assert.deepEqual(cellAt(299.9, 0, SIZE), { row: 1, column: 2 });
});

test('outside the picture there is no cell', () => {
  for (const [x, y] of [[-1, 5], [300, 5], [5, -1], [5, 200], [NaN, 5]]) {
    assert.equal(cellAt(x, y, SIZE), null);
  }
});

test('a cell has a place and a value', () => {
  const rig = { width_m: 0.9, height_m: 0.4 };
  const values = { rows: 2, columns: 3, numbers: [0.25, -0.5, NaN, 0, 0, 0] };
  const text = (column, isSigned) => probeText({ row: 0, column }, values, rig, isSigned);
  assert.equal(text(0, false), '0.250 at x 15.0 cm, z 10.0 cm');
  assert.equal(text(1, true), '−0.500 at x 45.0 cm, z 10.0 cm');
  assert.equal(text(2, false), 'not seen at x 75.0 cm, z 10.0 cm');
});
