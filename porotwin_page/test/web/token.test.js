import assert from 'node:assert/strict';
import { test } from 'node:test';

import { Token, tokenIn } from '../../porotwin_page/web/token.js';

function storage(content = {}) {
  return {
    getItem: (key) => content[key] ?? null,
    setItem: (key, value) => { content[key] = value; },
    removeItem: (key) => { delete content[key]; },
  };
}

test('the token is taken from the address, kept, and removed from the address', () => {
  const kept = storage();
  let forgotten = 0;
  const forget = () => { forgotten += 1; };
  const first = new Token(() => kept, { hash: '#token=k7mq-3xwd-p9ra', forget });
  assert.equal(first.value, 'k7mq-3xwd-p9ra');
  assert.equal(forgotten, 1);
  assert.equal(new Token(() => kept, { hash: '', forget }).value, 'k7mq-3xwd-p9ra');
  assert.equal(forgotten, 1);
});

test('a newer token replaces the one that was kept; a refused one is dropped', () => {
  const kept = storage();
  const token = new Token(() => kept, { hash: '#token=old-token', forget: () => {} });
  token.take('new-token');
  assert.equal(new Token(() => kept, { hash: '' }).value, 'new-token');
  token.drop();
  assert.equal(new Token(() => kept, { hash: '' }).value, '');
});

test('a whole address or the token alone may be typed', () => {
  const cases = [
    ['http://192.168.1.5:8765/#token=abcd-efgh', 'abcd-efgh'],
    [' abcd-efgh ', 'abcd-efgh'],
    ['http://192.168.1.5:8765/', ''],
    ['two words', ''],
    ['', ''],
    ['#token=', ''],
    ['http://192.168.1.5:8765/#token=lab%26rig%2F100%25', 'lab&rig/100%'],
    ['http://192.168.1.5:8765/#token=100%sure', ''],
  ];
  for (const [text, token] of cases) assert.equal(tokenIn(text), token, text);
});

test('without a storage the token holds until the page is closed', () => {
  const forbidden = () => { throw new Error('private window'); };
  const token = new Token(forbidden, { hash: '#token=abcd-efgh', forget: () => {} });
  assert.equal(token.value, 'abcd-efgh');
  token.drop();
  assert.equal(token.value, '');
});
