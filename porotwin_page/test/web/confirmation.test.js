import assert from 'node:assert/strict';
import { test } from 'node:test';

import { allRates, CHANGE_GUARD_MS, Confirmation, netRate } from '../../porotwin_page/web/confirmation.js';

const well = (name, rate_ml_h, changed = true) => ({ name, rate_ml_h, changed });

function setpoint(rate, properties = {}) {
  return {
    sequence: 7, remaining_s: 60, confirmed: false, expired: false, safe: false, wells: [well('control1', rate)], ...properties,
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

  button(shown, state) {
    return this.confirmation.button(shown, state);
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

test('an expired setpoint makes the button late, but not that of the safe rates', () => {
  const setup = new Setup();
  assert.equal(setup.button(setpoint(120, { expired: true })).late, true);
  assert.equal(setup.button(setpoint(120)).late, false);
  const safe = setup.button(setpoint(0, { expired: true, safe: true }));
  assert.equal(safe.late, false);
  assert.deepEqual(safe.words, ['I have set these', 'safe rates: control1']);
});

test('without a connection or a token nothing can be confirmed', () => {
  assert.equal(new Setup().button(setpoint(120), { lost: true }).disabled, true);
  assert.equal(new Setup().button(setpoint(120), { token: false }).disabled, true);
});

test('numbers that were entered are named on the button, also where nothing was to set', () => {
  const calm = setpoint(120, { wells: [well('control1', 120, false)] });
  const button = new Setup().button(calm, { entered: 2 });
  assert.deepEqual(button.words, ['Done', 'with your numbers']);
  assert.equal(button.calm, false);
});

test('empty fields stand for the shown rates', () => {
  const shown = setpoint(0, { wells: [well('control1', 120), well('producer', -620)] });
  const rates = allRates(shown, { control1: 0 });
  assert.deepEqual(rates, { control1: 0, producer: -620 });
  assert.equal(netRate(rates), -620);
});

test('new rates block the button for a moment', async () => {
  const setup = new Setup();
  setup.confirmation.show(setpoint(120));
  assert.equal(setup.confirmation.guarded, false);
  setup.confirmation.show(setpoint(130));
  assert.equal(setup.button(setpoint(130)).words[0], 'New rates');
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

test('a confirmation sends the setpoint and the rates of all wells', async () => {
  const setup = new Setup();
  const sent = [];
  const post = async (body) => {
    assert.equal(setup.button(setpoint(120)).words[0], 'Sending');
    sent.push(body);
    return { message: 'setpoint 7 confirmed' };
  };
  assert.equal(await setup.confirmation.send(setpoint(120), { control1: 118.5 }, post), true);
  assert.deepEqual(sent,
    [{ sequence: 7, orders: 'setpoint', rates_ml_h: { control1: 118.5 } }]);
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

test('a question blocks the button; a yes sends the same rates again', async () => {
  const setup = new Setup();
  const sent = [];
  const post = async (body) => {
    sent.push(body);
    return body.sure ? { message: 'setpoint 7 confirmed' } : { question: 'Not balanced. Sure?' };
  };
  assert.equal(await setup.confirmation.send(setpoint(120), {}, post), false);
  assert.equal(setup.confirmation.question.text, 'Not balanced. Sure?');
  assert.equal(setup.button(setpoint(120)).disabled, true);
  assert.equal(await setup.confirmation.decide(true, post), true);
  assert.deepEqual(sent[1], { ...sent[0], sure: true });
  assert.equal(setup.confirmation.question, null);
});

test('a no records nothing, and the button works again', async () => {
  const setup = new Setup();
  await setup.confirmation.send(setpoint(120), {}, async () => ({ question: 'Sure?' }));
  assert.equal(await setup.confirmation.decide(false, assert.fail), false);
  assert.match(setup.confirmation.answer.text, /correct the rates/);
  assert.equal(setup.button(setpoint(120)).disabled, false);
});

test('new rates withdraw the question', async () => {
  const setup = new Setup();
  setup.confirmation.show(setpoint(120));
  await setup.confirmation.send(setpoint(120), {}, async () => ({ question: 'Sure?' }));
  setup.confirmation.show(setpoint(130));
  assert.equal(setup.confirmation.question, null);
});

test('a yes confirms the newest setpoint if its rates are those of the question', async () => {
  const setup = new Setup();
  setup.confirmation.show(setpoint(120));
  await setup.confirmation.send(setpoint(120), {}, async () => ({ question: 'Sure?' }));
  setup.confirmation.show(setpoint(120, { sequence: 8 }));
  const sent = [];
  await setup.confirmation.decide(true, async (body) => sent.push(body));
  assert.equal(sent[0].sequence, 8);
});
