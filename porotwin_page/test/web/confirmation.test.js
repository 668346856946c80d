import assert from 'node:assert/strict';
import { test } from 'node:test';

import { CHANGE_GUARD_MS, Confirmation } from '../../porotwin_page/web/confirmation.js';

const well = (name, rate_ml_h, changed = true) => ({ name, rate_ml_h, changed });

function setpoint(rate, properties = {}) {
  return {
    sequence: 7, remaining_s: 60, confirmed: false, wells: [well('control1', rate)], ...properties,
  };
}

class Setup {
  constructor() {
    this.time = 0;
    this.calls = [];
    this.changes = 0;
    this.confirmation = new Confirmation({
      now: () => this.time,
      later: (call, delay) => this.calls.push([call, delay]),
      changed: () => { this.changes += 1; },
    });
  }

  button(shown, lost = false) {
    return this.confirmation.button(shown, lost);
  }
}

test('the button names the pumps that were changed', () => {
  const setup = new Setup();
  const button = setup.button(setpoint(120));
  assert.deepEqual(button.words, ['Done', 'control1 set as shown']);
  assert.deepEqual([button.calm, button.late, button.disabled], [false, false, false]);
  const many = ['a', 'b', 'c', 'd'].map((name) => well(name, 1));
  assert.deepEqual(setup.button(setpoint(0, { wells: many })).words[1], '4 pumps set as shown');
});

test('without a change there is nothing to set', () => {
  const button = new Setup().button(setpoint(120, { wells: [well('control1', 120, false)] }));
  assert.equal(button.words[0], '✔ Nothing to set');
  assert.equal(button.calm, true);
});

test('a confirmed setpoint may be confirmed again', () => {
  const button = new Setup().button(setpoint(120, { confirmed: true }));
  assert.equal(button.words[0], '✔ Confirmed');
  assert.equal(button.disabled, false);
});

test('an expired setpoint makes the button late', () => {
  const setup = new Setup();
  assert.equal(setup.button(setpoint(120, { remaining_s: 0 })).late, true);
  assert.equal(setup.button(setpoint(120, { remaining_s: null })).late, false);
});

test('without a connection nothing can be confirmed', () => {
  assert.equal(new Setup().button(setpoint(120), true).disabled, true);
});

test('new rates block the button for a moment', async () => {
  const setup = new Setup();
  setup.confirmation.show(setpoint(120));
  assert.equal(setup.confirmation.guarded, false);
  setup.confirmation.show(setpoint(130));
  assert.equal(setup.button(setpoint(130)).words[0], 'New setpoint');
  assert.equal(await setup.confirmation.send(setpoint(130), {}, assert.fail), false);
  const [[refresh, delay]] = setup.calls;
  assert.ok(delay > CHANGE_GUARD_MS);
  setup.time = delay;
  refresh();
  assert.equal(setup.changes, 1);
  assert.equal(setup.button(setpoint(130)).disabled, false);
});

test('the same rates do not block the button', () => {
  const setup = new Setup();
  setup.confirmation.show(setpoint(120));
  setup.confirmation.show(setpoint(120, { sequence: 8 }));
  assert.equal(setup.confirmation.guarded, false);
});

test('a confirmation sends the setpoint and the rates that differ', async () => {
  const setup = new Setup();
  const sent = [];
  const post = async (body) => {
    assert.equal(setup.button(setpoint(120)).words[0], 'Sending');
    sent.push(body);
    return { message: 'setpoint 7 confirmed' };
  };
  assert.equal(await setup.confirmation.send(setpoint(120), { control1: 118.5 }, post), true);
  assert.deepEqual(sent, [{ sequence: 7, rates_ml_h: { control1: 118.5 } }]);
  assert.deepEqual(setup.confirmation.answer, { level: 'ok', text: 'setpoint 7 confirmed' });
});

test('a refusal is shown, and the button works again', async () => {
  const setup = new Setup();
  const post = async () => { throw new Error('nobody receives confirmations'); };
  assert.equal(await setup.confirmation.send(setpoint(120), {}, post), false);
  assert.deepEqual(setup.confirmation.answer,
    { level: 'error', text: 'Not confirmed: nobody receives confirmations' });
  assert.equal(setup.button(setpoint(120)).disabled, false);
});
