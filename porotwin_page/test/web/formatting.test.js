import assert from 'node:assert/strict';
import { test } from 'node:test';

import {
  afterStart, clockTime, DASH, duration, number, short, signed,
} from '../../porotwin_page/web/formatting.js';

test('numbers have fixed digits and a real minus sign', () => {
  assert.equal(number(-620, 1), '−620.0');
  assert.equal(number(0.04, 1), '0.0');
  assert.equal(number(-0.04, 1), '0.0');
  assert.equal(number(null, 1), DASH);
  assert.equal(number(NaN, 1), DASH);
});

test('signed numbers show a plus', () => {
  assert.equal(signed(0.2, 2), '+0.20');
  assert.equal(signed(-0.2, 2), '−0.20');
  assert.equal(signed(0, 2), '0.00');
  assert.equal(signed(null, 2), DASH);
});

test('short numbers have about three digits', () => {
  const cases = [[123.4, '123'], [12.34, '12.3'], [1.234, '1.23'], [0.0123, '0.012'], [0, '0.00']];
  for (const [value, text] of cases) assert.equal(short(value), text);
  assert.equal(short(undefined), DASH);
});

test('durations change their unit', () => {
  const cases = [[-3, '0 s'], [59.9, '59 s'], [80, '1:20 min'], [3660, '1:01 h'],
    [172800, '2 days']];
  for (const [seconds, text] of cases) assert.equal(duration(seconds), text);
  assert.equal(duration(null), DASH);
});

test('stamps that count from a start are durations', () => {
  assert.equal(clockTime(360), 't = 6:00 min');
});

test('absolute stamps of another day show the date', () => {
  const stamp = 1.7e9;
  const sameDay = clockTime(stamp, (stamp + 60) * 1000);
  assert.match(sameDay, /^\d\d:\d\d:\d\d$/);
  assert.match(clockTime(stamp, (stamp + 90000) * 1000), /^2023-11-1\d \d\d:\d\d:\d\d$/);
});

test('the time since the start is shown for absolute stamps only', () => {
  assert.equal(afterStart(1.7e9 + 90, 1.7e9), 'after 1.5 min');
  assert.equal(afterStart(90, 0), '');
  assert.equal(afterStart(1.7e9, null), '');
  assert.equal(afterStart(1.7e9, 3600), '');
  assert.equal(afterStart(1.7e9, 1.8e9), '');
});
