import assert from 'node:assert/strict';
import { test } from 'node:test';

import { Connection, QUIET_LIMIT_MS } from '../../porotwin_page/web/connection.js';

class Setup {
  constructor() {
    this.time = 0;
    this.hidden = false;
    this.sources = [];
    this.received = [];
    this.changes = 0;
    this.connection = new Connection({
      open: () => {
        const source = { readyState: 1, close() { this.readyState = 2; } };
        this.sources.push(source);
        return source;
      },
      receive: (event) => this.received.push(event),
      changed: () => { this.changes += 1; },
      isHidden: () => this.hidden,
      now: () => this.time,
    });
    this.connection.connect();
  }

  get newest() { return this.sources[this.sources.length - 1]; }

  send(event) { this.newest.onmessage({ data: JSON.stringify(event) }); }
}

test('events are decoded and passed on', () => {
  const setup = new Setup();
  setup.send({ run: 'a' });
  assert.deepEqual(setup.received, [{ run: 'a' }]);
});

test('silence is a loss, and the stream is opened again', () => {
  const setup = new Setup();
  setup.time = QUIET_LIMIT_MS;
  setup.connection.check();
  assert.equal(setup.connection.lost, false);
  assert.equal(setup.sources.length, 1);
  setup.time += 1;
  setup.connection.check();
  assert.equal(setup.connection.lost, true);
  assert.equal(setup.sources.length, 2);
  assert.equal(setup.sources[0].readyState, 2);
  assert.equal(setup.changes, 1);
});

test('an open attempt has time to answer', () => {
  const setup = new Setup();
  setup.time = QUIET_LIMIT_MS + 1;
  setup.connection.check();
  setup.time += 1500;
  setup.connection.check();
  assert.equal(setup.sources.length, 2);
  setup.time += QUIET_LIMIT_MS;
  setup.connection.check();
  assert.equal(setup.sources.length, 3);
});

test('an attempt that the browser gave up is repeated at once', () => {
  const setup = new Setup();
  setup.time = QUIET_LIMIT_MS + 1;
  setup.connection.check();
  setup.newest.readyState = 2;
  setup.time += 1500;
  setup.connection.check();
  assert.equal(setup.sources.length, 3);
});

test('an event ends a loss', () => {
  const setup = new Setup();
  setup.time = QUIET_LIMIT_MS + 1;
  setup.connection.check();
  setup.send({});
  assert.equal(setup.connection.lost, false);
});

test('a hidden page closes its stream and opens it again when it is shown', () => {
  const setup = new Setup();
  setup.hidden = true;
  setup.connection.visibilityChanged();
  assert.equal(setup.newest.readyState, 2);
  setup.time = 10 * QUIET_LIMIT_MS;
  setup.connection.check();
  assert.equal(setup.sources.length, 1);
  setup.hidden = false;
  setup.connection.visibilityChanged();
  assert.equal(setup.sources.length, 2);
});

test('a page that was hidden for long is not up to date before the next event', () => {
  const setup = new Setup();
  setup.send({});
  setup.hidden = true;
  setup.connection.visibilityChanged();
  setup.time = 3600000;
  setup.hidden = false;
  setup.connection.visibilityChanged();
  assert.equal(setup.connection.lost, true);
  assert.equal(setup.connection.silence, 3600);
  assert.equal(setup.changes, 1);
  setup.connection.check();
  assert.equal(setup.sources.length, 2);  // the new stream has time to answer
  setup.send({});
  assert.equal(setup.connection.lost, false);
});
