import assert from 'node:assert/strict';
import { test } from 'node:test';

import { element } from '../../porotwin_page/web/dom.js';

globalThis.document = {
  createElement: (name) => ({ name, parts: [], append(...parts) { this.parts.push(...parts); } }),
};

test('a long name may go on after its underscores, and only there', () => {
  const shown = (text) => element('span', {}, text).parts.map((part) => part.name ?? part);
  assert.deepEqual(shown('injector_upper_left'), ['injector_', 'wbr', 'upper_', 'wbr', 'left']);
  assert.deepEqual(shown('control2'), ['control2']);
  assert.deepEqual(shown(''), ['']);
});
