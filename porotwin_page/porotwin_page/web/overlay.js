/* The drawing over a map: zones, wells, labels and a scale bar; no document needed. */

import { setting } from './formatting.js';

const LARGE_RIG_M = 2;  // larger rigs have a longer scale bar
const BAR_M = { small: 0.1, large: 0.5 };
const EDGE_PX = 2;  // an outline on the edge of the rig would be cut in half
const RADIUS_PX = { labelled: 7, plain: 4.5 };
const LABEL_GAP_PX = 14;
const CHARACTER_PX = 8.5;  // width of a bold character of the labels, at most
const LABEL_SIDE = 0.72;  // wells right of this part of the width have their labels on the left

const ZONE_WORDS = {
  'keep out': 'disallowed zone', 'keep in': 'allowed zone', target: 'target zone',
};

/* A shape is [name of the SVG element, attributes, text]. */
export function overlayShapes(rig, rates, { width, height, id, labelled }) {
  const x = (metres) => metres / rig.width_m * width;
  const y = (metres) => height - metres / rig.height_m * height;
  return [
    ...rig.zones.flatMap((zone) => zoneShapes(zone, { x, y, width, height, id, labelled })),
    ...rig.wells.flatMap((well) => wellShapes(well, rates[well.name], x, y, width, labelled)),
    ...(labelled ? barShapes(rig, x, width, height) : []),
  ];
}

function zoneShapes(zone, { x, y, width, height, id, labelled }) {
  const inside = (value, most) => Math.min(Math.max(value, EDGE_PX), most - EDGE_PX);
  const place = ([px, pz]) => `${inside(x(px), width)},${inside(y(pz), height)}`;
  const d = zone.outlines_m.map((line) => `M${line.map(place).join('L')}Z`).join('');
  const fill = zone.kind === 'keep out' ? `url(#${id})` : 'none';
  const shapes = [
    ['path', { d, class: 'zone-halo' }],
    ['path', { d, class: 'zone', 'fill-rule': 'evenodd', style: `fill: ${fill}` }],
  ];
  if (labelled) {
    const points = zone.outlines_m.flat();
    const top = Math.max(...points.map((point) => point[1]));
    const left = Math.min(...points.map((point) => point[0]));
    const corner = { x: Math.max(12, x(left) + 6), y: y(top) + 22, class: 'overlay-text zone-text' };
    shapes.push(['text', corner, ZONE_WORDS[zone.kind]]);
  }
  return shapes;
}

function wellShapes(well, rate, x, y, width, labelled) {
  const cx = x(well.x_m);
  const cy = y(well.z_m);
  const r = labelled ? RADIUS_PX.labelled : RADIUS_PX.plain;
  const shapes = [
    ['circle', { cx, cy, r, class: 'well-halo' }],
    ['circle', { cx, cy, r, class: 'well' }],
  ];
  if (!labelled) return shapes;
  const rateText = rate === undefined ? '' : `${setting(rate)} ml/h`;
  const longest = Math.max(well.name.length, rateText.length) * CHARACTER_PX;
  const fits = cx + LABEL_GAP_PX + longest <= width;
  const onRight = (cx < width * LABEL_SIDE && fits) || cx - LABEL_GAP_PX - longest < 0;
  const place = {
    x: cx + (onRight ? LABEL_GAP_PX : -LABEL_GAP_PX), 'text-anchor': onRight ? 'start' : 'end', class: 'overlay-text',
  };
  shapes.push(['text', { ...place, y: cy - 1 }, well.name]);
  if (rateText) shapes.push(['text', { ...place, y: cy + 14 }, rateText]);
  return shapes;
}

function barShapes(rig, x, width, height) {
  const length = rig.width_m > LARGE_RIG_M ? BAR_M.large : BAR_M.small;
  const right = width - 14;
  const low = height - 12;
  const text = { x: right, y: low - 7, 'text-anchor': 'end', class: 'overlay-text' };
  return [
    ['line', { x1: right - x(length), x2: right, y1: low, y2: low, class: 'bar' }],
    ['text', text, `${length * 100} cm`],
  ];
}
