import assert from 'node:assert/strict';
import { test } from 'node:test';

import { eventText, ratesBefore, ratesText } from '../../porotwin_page/panels/setpoint_log.js';

const line = (event, rates_ml_h, sequence = 7) => ({ event, rates_ml_h, sequence });

test('events are told in words', () => {
  assert.equal(eventText(line('setpoint')), 'setpoint 7');
  assert.equal(eventText(line('expired')), 'setpoint 7 expired; safe rates');
  assert.equal(eventText(line('reported', {}, null)), 'confirmed at the pumps');
});

test('a line has the rates that changed since the line of the same kind before it', () => {
  const lines = [
    line('setpoint', { a: 1, b: -2 }), line('reported', { a: 1, b: -1 }),
    line('expired', { a: 0, b: -2 }),
  ];
  assert.equal(ratesText(lines[0].rates_ml_h, ratesBefore(lines, 0)), 'a 1.0 ml/h');
  assert.equal(ratesText(lines[1].rates_ml_h, ratesBefore(lines, 1)), 'a 1.0, b −1.0 ml/h');
  assert.equal(ratesText({ a: 1 }, { a: 1 }), 'the same rates');
  assert.equal(ratesText({}, null), 'rates not known');
});
