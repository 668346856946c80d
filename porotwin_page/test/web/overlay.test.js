import assert from 'node:assert/strict';
import { test } from 'node:test';

import { overlayShapes } from '../../porotwin_page/web/overlay.js';

const RIG = {
  width_m: 1,
  height_m: 0.5,
  wells: [{ name: 'injector', x_m: 0.25, z_m: 0.1 }, { name: 'producer', x_m: 0.9, z_m: 0.1 }],
  zones: [{
    kind: 'keep out', outlines_m: [[[0, 0.4], [1, 0.4], [1, 0.5], [0, 0.5], [0, 0.4]]],
  }],
};
const SIZE = { width: 400, height: 200, id: 'hatch' };
const shapes = (labelled, rig = RIG) => overlayShapes(rig, { injector: 500 }, { ...SIZE, labelled });
const texts = (drawn) => drawn.filter(([name]) => name === 'text').map(([, , text]) => text);

test('wells lie where the rig says, with z upward', () => {
  const [, circle] = shapes(false).filter(([name]) => name === 'circle');
  assert.deepEqual([circle[1].cx, circle[1].cy], [100, 160]);
});

test('a large map has labels, rates and a scale bar', () => {
  assert.deepEqual(texts(shapes(true)),
    ['disallowed zone', 'injector', '500.0 ml/h', 'producer', '10 cm']);
  assert.deepEqual(texts(shapes(false)), []);
});

test('labels of wells at the right edge lie on their left', () => {
  const labels = shapes(true).filter(([, , text]) => text === 'injector' || text === 'producer');
  assert.deepEqual(labels.map(([, attributes]) => attributes['text-anchor']), ['start', 'end']);
});

test('a label that would leave a narrow map lies on the other side', () => {
  const rig = { ...RIG, wells: [{ name: 'producer', x_m: 0.66, z_m: 0.1 }] };
  const side = (width) => overlayShapes(rig, { producer: -742 }, { ...SIZE, width, labelled: true })
    .find(([, , text]) => text === 'producer')[1]['text-anchor'];
  assert.deepEqual([side(350), side(300), side(1000)], ['start', 'end', 'start']);
});

test('the outline of the zone stays inside the picture', () => {
  const [, { d }] = shapes(false).find(([name]) => name === 'path');
  assert.equal(d, 'M2,40L398,40L398,2L2,2L2,40Z');
});

test('only a zone to keep out of is hatched', () => {
  const kept = [{ ...RIG.zones[0], kind: 'keep in' }];
  const fills = (rig) => shapes(true, rig).filter(([name]) => name === 'path').at(-1)[1].style;
  assert.deepEqual([fills(RIG), fills({ ...RIG, zones: kept })],
    ['fill: url(#hatch)', 'fill: none']);
});

test('a rig without a zone has none', () => {
  const drawn = shapes(true, { ...RIG, zones: [] });
  assert.equal(drawn.some(([name]) => name === 'path'), false);
});

test('a large rig has a longer bar', () => {
  assert.ok(texts(shapes(true, { ...RIG, width_m: 2.8 })).includes('50 cm'));
});
