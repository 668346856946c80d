import assert from 'node:assert/strict';
import { test } from 'node:test';

import { action, pageTitle, validityText } from '../../porotwin_page/panels/pump_settings.js';

const setpoint = (properties) => ({
  pumps_report: false, confirmed: false, remaining_s: 80, wells: [{ changed: true }], ...properties,
});

test('a well is described by the sign of its rate and its fluid', () => {
  assert.equal(action({ rate_ml_h: 0, tracer: 0 }), 'off');
  assert.equal(action({ rate_ml_h: null, tracer: 0 }), 'off');
  assert.equal(action({ rate_ml_h: -620, tracer: 0 }), 'takes out');
  assert.equal(action({ rate_ml_h: 500, tracer: 1 }), 'injects tracer');
  assert.equal(action({ rate_ml_h: 120, tracer: 0 }), 'injects water');
});

test('the title counts the pumps to set', () => {
  assert.equal(pageTitle(setpoint()), '(1) set the pumps · PoroTwin');
  for (const done of [null, setpoint({ confirmed: true }), setpoint({ pumps_report: true }),
    setpoint({ wells: [{ changed: false }] })]) {
    assert.equal(pageTitle(done), 'PoroTwin');
  }
});

test('the validity counts down and tells the consequence of its end', () => {
  assert.equal(validityText(setpoint()), 'valid for 1:20 min');
  assert.equal(validityText(setpoint({ remaining_s: -10 })),
    'expired 10 s ago: switch the control wells off');
  assert.equal(validityText(setpoint({ remaining_s: -10, pumps_report: true })),
    'expired 10 s ago: the rig is at its safe rates');
});
