/* Tests of the answer to an offer. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { captionText, send } from '../../porotwin_page/panels/mend.js';

test('an answer is sent with the token, and a refusal is told', async () => {
  const sent = [];
  const ask = async (path, request) => {
    sent.push([path, request.headers.Authorization, request.body]);
    return { ok: false, json: async () => ({ error: 'offer 2 is accepted already' }) };
  };
  assert.equal(await send(2, true, 'token', ask), 'offer 2 is accepted already');
  assert.deepEqual(sent, [['/mend', 'Bearer token', '{"sequence":2,"accept":true}']]);
  assert.equal(await send(2, false, 'token', async () => ({ ok: true })), '');
  const lost = async () => { throw new TypeError('network'); };
  assert.equal(await send(2, true, 'token', lost), 'the page does not reach the twin');
});

test('the caption tells how sure an open offer is', () => {
  const offer = { state: 'offered', open: true, sequence: 3, time_s: 60, confidence_percent: 97 };
  assert.match(captionText(offer), /^offer 3, 97 % sure, from photographs until /);
  assert.match(captionText({ ...offer, open: false }), /^notice 3, 97 % sure, from photographs /);
  assert.equal(captionText({ ...offer, state: 'taken back' }), 'offer 3');
});
