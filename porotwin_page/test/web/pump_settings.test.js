import assert from 'node:assert/strict';
import { test } from 'node:test';

import {
  action, bottleLine, later, netText, nextChange, pageTitle, safeTitle, validityText,
} from '../../porotwin_page/panels/pump_settings.js';

const setpoint = (properties) => ({
  sequence: 7, pumps_report: false, confirmed: false, expired: false, safe: false, doubt: '',
  remaining_s: 80, wells: [{ changed: true }], ...properties,
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
    setpoint({ wells: [{ changed: false }] }), setpoint({ doubt: 'from elsewhere' })]) {
    assert.equal(pageTitle(done), 'PoroTwin');
  }
});

test('the validity counts down and tells the time since its end', () => {
  assert.equal(validityText(setpoint()), 'valid for 1:20 min');
  assert.equal(validityText(setpoint({ remaining_s: -10 })), 'expired 10 s ago');
});

test('after the end all wells are to be set, and nothing green hides it', () => {
  const expired = (properties) => safeTitle(setpoint({ expired: true, ...properties }));
  assert.equal(safeTitle(setpoint()), '');
  assert.match(expired({ safe: true }), /Set the safe rates, at every well:$/);
  assert.match(expired({ safe: true, confirmed: true }), /The safe rates are set\.$/);
  assert.match(expired({ safe: true, wells: [{ changed: false }] }), /are set\.$/);
  assert.match(expired({ pumps_report: true }), /The rig is at its safe rates\.$/);
  assert.match(expired({}), /not known: rig\.yaml has no control section\.$/);
  assert.equal(expired({ doubt: 'from elsewhere' }), '');
});

test('the validity goes on without a connection', () => {
  assert.equal(later(setpoint(), 30).remaining_s, 50);
  assert.equal(later(setpoint({ remaining_s: null }), 30).remaining_s, null);
  assert.match(validityText(later(setpoint(), 90), true), /not connected: do not follow/);
  assert.match(validityText(setpoint(), true), /valid for 1:20 min, but not connected/);
});

test('the sum of rates is told', () => {
  assert.match(netText({ injector: 850, producer: -500 }), /Together: \+350\.0 ml\/h/);
});

test('the next pause counts down, also without a connection', () => {
  const next_change = { in_s: 80, rest: ['injector1'], run: ['injector2'] };
  const shown = setpoint({ next_change });
  assert.equal(nextChange(shown), 'In 1:20 min: injector1 rests, injector2 runs.');
  assert.equal(nextChange(later(shown, 30)), 'In 50 s: injector1 rests, injector2 runs.');
  assert.equal(nextChange(setpoint({ next_change: null })), '');
});

test('the stock in the bottle is told until it is empty', () => {
  const bottle = { left_ml: 240.2, empty_in_s: 600 };
  assert.equal(bottleLine(setpoint({ bottle })), 'Stock in the bottle: 240 ml, empty in 10:00 min.');
  const enough = { ...bottle, empty_in_s: null };
  assert.equal(bottleLine(setpoint({ bottle: enough })), 'Stock in the bottle: 240 ml.');
  const none = { left_ml: 0, empty_in_s: -5 };
  assert.equal(bottleLine(setpoint({ bottle: none })), 'Stock in the bottle: by the plan it is empty.');
  assert.equal(bottleLine(setpoint({ bottle: null })), '');
});
