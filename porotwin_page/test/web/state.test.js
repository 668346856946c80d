import assert from 'node:assert/strict';
import { test } from 'node:test';

import { PageState, POINTS_KEPT } from '../../porotwin_page/web/state.js';

const event = (begin, points, reset = false, panels = {}, run = 'a') => (
  { run, panels, history: { reset, begin, points } });

test('new points replace all points from their number on', () => {
  const state = new PageState();
  state.receive(event(5, ['a', 'b'], true));
  state.receive(event(6, ['B', 'c']));
  assert.deepEqual(state.points, ['a', 'B', 'c']);
  assert.equal(state.firstPoint, 5);
});

test('a reset drops all points', () => {
  const state = new PageState();
  state.receive(event(0, ['a', 'b'], true));
  state.receive(event(2, ['c'], true));
  assert.deepEqual(state.points, ['c']);
});

test('the number of points is bounded', () => {
  const state = new PageState();
  state.receive(event(0, Array.from({ length: POINTS_KEPT }, (_, i) => i), true));
  state.receive(event(POINTS_KEPT, [POINTS_KEPT]));
  assert.equal(state.points.length, POINTS_KEPT);
  assert.equal(state.points[0], 1);
  assert.equal(state.firstPoint, 1);
  state.receive(event(POINTS_KEPT, ['newest']));
  assert.equal(state.points[POINTS_KEPT - 1], 'newest');
});

test('panels that did not change are kept, but not those of another server', () => {
  const state = new PageState();
  state.receive(event(0, [], true, { one: 1, two: 2 }));
  state.receive(event(0, [], false, { two: 3 }));
  assert.deepEqual(state.event.panels, { one: 1, two: 3 });
  state.receive(event(0, [], true, { one: 4 }, 'b'));
  assert.deepEqual(state.event.panels, { one: 4 });
});
