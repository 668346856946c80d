import assert from 'node:assert/strict';
import { test } from 'node:test';

import {
  asSteps, curvePath, curvesOf, frame, mainStretch, nearestIndex, niceStep, ticks, tickText, timeAxis,
  valueAxis,
} from '../../porotwin_page/web/plot.js';

const same = (value) => value;
const point = (time_s, values) => ({ time_s, values: { error: values } });

test('steps are 1, 2 or 5 times a power of ten', () => {
  assert.deepEqual([niceStep(10, 5), niceStep(11, 5), niceStep(0.9, 3), niceStep(60, 5)],
    [2, 5, 0.5, 20]);
});

test('ticks cover the range', () => {
  assert.deepEqual(ticks(0, 6, 5), [0, 2, 4, 6]);
  assert.deepEqual(ticks(-1000, 500, 3), [-1000, -500, 0, 500]);
});

test('ticks have the digits of their step', () => {
  assert.equal(tickText(0.5, 0.5), '0.5');
  assert.equal(tickText(-20, 20), '−20');
});

test('a path has gaps, and a single point becomes a dot', () => {
  const times = [0, 1, 2, 3, 4];
  assert.equal(curvePath(times, [1, 2, null, 3, null], same, same),
    'M0.0,1.0L1.0,2.0M3.0,3.0h0.01');
});

test('steps hold a value until the next time', () => {
  assert.deepEqual(asSteps([0, 10], [1, 2]), [[0, 10, 10], [1, 1, 2]]);
});

test('short runs count in minutes from the start', () => {
  const axis = timeAxis(
    [{ time_s: 1.8e9 }, { time_s: 1.8e9 + 300 }], 1.8e9, false);
  assert.deepEqual(axis.times, [0, 5]);
  assert.deepEqual([axis.from, axis.to], [0, 5]);
  assert.match(axis.label, /minutes/);
});

test('stamps from the start of a run are shown as in the header', () => {
  assert.deepEqual(timeAxis([{ time_s: 1200 }, { time_s: 1800 }], 1200, false).times, [20, 30]);
});

test('long runs count in hours', () => {
  const axis = timeAxis([{ time_s: 0 }, { time_s: 36000 }], 0, false);
  assert.deepEqual(axis.times, [0, 10]);
  assert.match(axis.label, /hours/);
});

test('the first minutes have an axis of two minutes', () => {
  assert.deepEqual(timeAxis([{ time_s: 0 }], 0, false).to, 2);
  assert.deepEqual(timeAxis([], null, false).to, 2);
});

test('a history that was cut begins at its first point', () => {
  assert.equal(timeAxis([{ time_s: 600 }, { time_s: 1200 }], 0, true).from, 10);
});

const every30s = (first, count) => (
  Array.from({ length: count }, (_, i) => ({ time_s: first + 30 * i })));

test('photographs with wrong times do not stretch the axis', () => {
  const now = 1.8e9;
  const good = every30s(now, 10);
  const old = { time_s: 3600 };
  const future = { time_s: 2.1e9 };
  assert.deepEqual(mainStretch([...good.slice(0, 5), old, ...good.slice(5)]), good);
  assert.deepEqual(mainStretch([old, ...good]), good);
  assert.deepEqual(mainStretch([...good, old]), good);
  assert.deepEqual(mainStretch([...good.slice(0, 7), future, ...good.slice(7)]), good);
  assert.deepEqual(mainStretch([]), []);
  assert.equal(timeAxis(good, 3600, false).start, now);
});

test('a clock that was set is a new stretch after some photographs', () => {
  const before = every30s(1.8e9, 10);
  const after = every30s(1.7e9, 3);
  assert.deepEqual(mainStretch([...before, ...after.slice(0, 2)]), before);
  assert.deepEqual(mainStretch([...before, ...after]), after);
});

test('a night without photographs is no wrong clock', () => {
  const points = [...every30s(1.8e9, 5), ...every30s(1.8e9 + 12 * 3600, 5)];
  assert.deepEqual(mainStretch(points), points);
});

test('the nearest time is found', () => {
  assert.deepEqual([nearestIndex([0, 1, 2], 1.4), nearestIndex([0, 1, 2], 9), nearestIndex([], 1)],
    [1, 2, -1]);
});

test('the value axis contains zero and ends at ticks', () => {
  const axis = valueAxis([3, 7]);
  assert.deepEqual([axis.low, axis.high], [0, 10]);
  assert.deepEqual(valueAxis([0, 0]).high, 1);
  assert.deepEqual(valueAxis([-820, 500]).low, -1000);
});

test('the frame maps the ranges to pixels', () => {
  const box = frame(300, 200, { from: 0, to: 10 }, { low: 0, high: 1 });
  assert.deepEqual([box.x(0), box.x(10)], [box.left, box.right]);
  assert.equal(box.time(box.x(4)), 4);
  assert.deepEqual([box.y(0), box.y(1)], [box.bottom, box.top]);
});

test('curves keep their position when another one has no values', () => {
  const points = [point(0, { corrected: null, alone: 1 }), point(1, { corrected: null, alone: 2 })];
  assert.deepEqual(curvesOf(points, 'error'), [{ name: 'alone', position: 1, values: [1, 2] }]);
});

test('a curve that begins later has gaps', () => {
  const points = [point(0, {}), point(1, { well: 3 })];
  assert.deepEqual(curvesOf(points, 'error')[0].values, [null, 3]);
  assert.deepEqual(curvesOf(points, 'other'), []);
});
