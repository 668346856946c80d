import assert from 'node:assert/strict';
import { test } from 'node:test';

import { liveStatus, photoLine } from '../../porotwin_page/web/header.js';

const photo = { sequence: 3, time_s: 60, age_s: 95, interval_s: 30, stale: false };
const header = (properties) => ({ photo, finished: null, ...properties });

test('the most serious state of the page is shown', () => {
  const stale = header({ photo: { ...photo, stale: true } });
  assert.deepEqual(liveStatus(header(), false), ['ok', 'Live']);
  assert.deepEqual(liveStatus(stale, false), ['warn', 'Stale: no photograph for 1:35 min']);
  assert.equal(liveStatus(stale, true)[0], 'error');
  assert.deepEqual(liveStatus(header({ finished: 'done' }), false), ['ok', 'Finished: done']);
  assert.deepEqual(liveStatus(header({ photo: null }), false),
    ['quiet', 'Waiting for a photograph']);
  assert.deepEqual(liveStatus(null, false), ['quiet', 'Connecting']);
});

test('the photograph is described in one line', () => {
  assert.equal(photoLine(photo), 'photograph 3 · t = 1:00 min · every 30 s');
  assert.equal(photoLine(null), '');
});
