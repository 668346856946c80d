import assert from 'node:assert/strict';
import { test } from 'node:test';

import { caption } from '../../porotwin_page/web/map.js';

const START = 1.7e9;
const NOW = (START + 120) * 1000;

test('a caption has the time, its prefix and the notes', () => {
  const content = { time_s: 90, notes: ['corrected'] };
  assert.equal(caption(content, { time_prefix: 'for', large: false }, 0, NOW),
    'for t = 1:30 min · corrected');
});

test('a large map shows the time since the start', () => {
  const content = { time_s: START + 60, notes: [] };
  const text = caption(content, { time_prefix: '', large: true }, START, NOW);
  assert.match(text, /^\d\d:\d\d:\d\d · after 1\.0 min$/);
});
