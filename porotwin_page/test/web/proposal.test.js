import assert from 'node:assert/strict';
import { test } from 'node:test';

import { clamped, PAUSE_MS, presentRates, Proposal } from '../../porotwin_page/web/proposal.js';

const CONTENT = {
  wells: ['control1', 'control2'],
  max_rate_ml_h: 500,
  max_total_ml_h: 600,
  present: { time_s: 100, rates_ml_h: { injector: 500, control1: 120, control2: 0 } },
};

class Setup {
  constructor() {
    this.timers = [];
    this.requests = [];
    this.proposal = new Proposal({
      ask: (rates) => new Promise((resolve, reject) => {
        this.requests.push({ rates, resolve, reject });
      }),
      changed: () => {},
      later: (call, ms) => this.timers.push({ call, ms }),
      never: (timer) => { if (timer) this.timers[timer - 1].call = () => {}; },
    });
  }

  async pass() {
    const due = this.timers.map((timer) => timer.call);
    for (const timer of this.timers) timer.call = () => {};
    due.forEach((call) => call());
    await new Promise(setImmediate);
  }
}

test('a slider stays within its own limit and the limit of all', () => {
  assert.equal(clamped({ control1: 0, control2: 0 }, 'control1', 700, CONTENT), 500);
  assert.equal(clamped({ control1: 0, control2: 450 }, 'control1', 300, CONTENT), 150);
  assert.equal(clamped({ control1: 500, control2: 0 }, 'control1', 480, CONTENT), 480);
});

test('the sliders begin at the present rates', () => {
  assert.deepEqual(presentRates(CONTENT), { control1: 120, control2: 0 });
});

test('a slider that moves asks once, when it rests', async () => {
  const setup = new Setup();
  setup.proposal.set('control1', 200, CONTENT);
  setup.proposal.set('control1', 240, CONTENT);
  assert.equal(setup.timers[0].ms, PAUSE_MS);
  await setup.pass();
  assert.deepEqual(setup.requests.map((one) => one.rates), [{ control1: 240, control2: 0 }]);
  setup.requests[0].resolve({ minutes: [1] });
  await new Promise(setImmediate);
  assert.deepEqual(setup.proposal.answer, { minutes: [1] });
});

test('a refusal is shown, and a busy server is asked again', async () => {
  const setup = new Setup();
  setup.proposal.set('control1', 200, CONTENT);
  await setup.pass();
  setup.requests[0].reject(Object.assign(new Error('busy'), { busy: true }));
  await new Promise(setImmediate);
  assert.equal(setup.proposal.fault, '');
  await setup.pass();
  setup.requests[1].reject(new Error('nobody can tell'));
  await new Promise(setImmediate);
  assert.equal(setup.proposal.fault, 'nobody can tell');
});

test('a new photograph asks again, and nothing proposed asks nothing', async () => {
  const setup = new Setup();
  setup.proposal.follow(100);
  await setup.pass();
  assert.equal(setup.requests.length, 0);
  setup.proposal.set('control2', 50, CONTENT);
  setup.proposal.follow(130);
  await setup.pass();
  assert.equal(setup.requests.length, 1);
  setup.proposal.reset();
  setup.requests[0].resolve({ minutes: [1] });
  await new Promise(setImmediate);
  assert.equal(setup.proposal.answer, null);
});

test('a question that was taken back leaves no refusal', async () => {
  const setup = new Setup();
  setup.proposal.set('control1', 200, CONTENT);
  await setup.pass();
  setup.proposal.reset();
  setup.requests[0].reject(new Error('nobody can tell'));
  await new Promise(setImmediate);
  assert.equal(setup.proposal.fault, '');
});
