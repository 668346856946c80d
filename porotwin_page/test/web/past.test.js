import assert from 'node:assert/strict';
import { test } from 'node:test';

import { Past, sliderRange } from '../../porotwin_page/web/past.js';

class Setup {
  constructor() {
    this.requests = [];
    this.past = new Past({
      load: (number) => new Promise((resolve, reject) => {
        this.requests.push({ number, resolve: () => resolve({ time_s: 30 * number }), reject });
      }),
      changed: () => {},
    });
  }
}

test('the state that was selected last is loaded, one request at a time', async () => {
  const { past, requests } = new Setup();
  const done = past.select(3);
  past.select(4);
  past.select(5);
  assert.deepEqual(requests.map((request) => request.number), [3]);
  requests[0].resolve();
  await new Promise(setImmediate);
  assert.deepEqual(requests.map((request) => request.number), [3, 5]);
  requests[1].resolve();
  await done;
  assert.deepEqual(past.content, { number: 5, time_s: 150 });
});

test('the newest state needs no request, and drops the one on its way', async () => {
  const { past, requests } = new Setup();
  const done = past.select(3);
  past.select(null);
  requests[0].resolve();
  await done;
  assert.deepEqual([past.number, past.content, requests.length], [null, null, 1]);
});

test('a state that is no longer kept leads back to the newest', async () => {
  const { past, requests } = new Setup();
  const done = past.select(3);
  requests[0].reject(new Error('gone'));
  await done;
  assert.equal(past.number, null);
  past.check({ first: 2, last: 9 }, 'a');
  past.number = 3;
  past.check({ first: 2, last: 9 }, 'a');
  assert.equal(past.number, 3);
  past.check({ first: 4, last: 9 }, 'a');
  assert.equal(past.number, null);
});

test('a restarted server gives another state the same number, so the newest is shown', () => {
  const { past } = new Setup();
  past.check({ first: 1, last: 9 }, 'a');
  past.number = 3;
  past.content = { number: 3, time_s: 90 };
  past.check({ first: 1, last: 5 }, 'b');
  assert.deepEqual([past.number, past.content], [null, null]);
});

test('there is something to slide from two states on', () => {
  assert.deepEqual(sliderRange({ first: 3, last: 9 }, null),
    { min: 3, max: 9, value: 9, useful: true });
  assert.equal(sliderRange({ first: 3, last: 9 }, 5).value, 5);
  assert.equal(sliderRange({ first: 1, last: 1 }, null).useful, false);
  assert.equal(sliderRange({ first: 0, last: 0 }, null).useful, false);
});
