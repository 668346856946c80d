import assert from 'node:assert/strict';
import { mock, test } from 'node:test';

import { draw } from '../../porotwin_page/web/panels.js';

test('a panel whose script fails says so, until it draws again', () => {
  mock.method(console, 'error', () => {});
  const root = { dataset: {} };
  draw(root, () => { throw new TypeError('the content has another form'); }, {});
  assert.match(root.dataset.fault, /Reload the page/);
  draw(root, () => {}, {});
  assert.deepEqual(root.dataset, {});
});
