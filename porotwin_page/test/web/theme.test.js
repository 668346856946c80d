import assert from 'node:assert/strict';
import { test } from 'node:test';

import { Theme } from '../../porotwin_page/web/theme.js';

function storage(content = {}) {
  return {
    getItem: (key) => content[key] ?? null,
    setItem: (key, value) => { content[key] = value; },
  };
}

test('the automatic theme follows the browser', () => {
  let dark = false;
  const theme = new Theme(() => storage(), () => dark);
  assert.equal(theme.name, 'light');
  dark = true;
  assert.equal(theme.name, 'dark');
});

test('a choice overrules the browser and is stored', () => {
  const kept = storage();
  const theme = new Theme(() => kept, () => true);
  theme.next();
  assert.deepEqual([theme.choice, theme.name], ['light', 'light']);
  assert.equal(new Theme(() => kept, () => true).name, 'light');
  theme.next();
  theme.next();
  assert.equal(theme.choice, 'auto');
});

test('without a storage the choice holds until the page is closed', () => {
  const forbidden = () => { throw new Error('private window'); };
  const theme = new Theme(forbidden, () => false);
  theme.next();
  theme.next();
  assert.equal(theme.name, 'dark');
});
