import assert from 'node:assert/strict';
import { test } from 'node:test';

import { outlinePath, reachedWords } from '../../porotwin_page/panels/what_if.js';
import { bandPath } from '../../porotwin_page/web/bands.js';

const same = (value) => value;

test('a band goes up along its high end and back along its low one', () => {
  assert.equal(bandPath([0, 1], [2, 3], [4, 5], same, same),
    'M0.0,4.0L1.0,5.0L1.0,3.0L0.0,2.0Z');
});

test('the probability is told for half an hour, or the nearest time', () => {
  const plan = { minutes: [10, 20, 40], reached_percent: [0, 12.4, 80] };
  assert.equal(reachedWords('present', plan), 'present 12 % within 20 min');
  assert.equal(reachedWords('Present', { minutes: [], reached_percent: [] }), '');
});

test('an outline is drawn with its row of the map upward', () => {
  const rig = { width_m: 2, height_m: 1 };
  assert.equal(outlinePath([[0, 0], [1, 0.5]], rig, 200, 100), 'M0.0,100.0L100.0,50.0Z');
});
