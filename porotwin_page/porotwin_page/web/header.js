/* The line at the top: rig, newest photograph, connection, worst node. */

import { find, setText } from './dom.js';
import { clockTime, duration } from './formatting.js';

/* The state of the page as level and text. */
export function liveStatus(header, lost) {
  const photo = header && header.photo;
  if (lost) return ['error', 'Not connected, trying again'];
  if (!header) return ['quiet', 'Connecting'];
  if (!photo) return ['quiet', 'Waiting for a photograph'];
  if (header.finished) return ['ok', `Finished: ${header.finished}`];
  if (photo.stale) return ['warn', `Stale: no photograph for ${duration(photo.age_s)}`];
  return ['ok', 'Live'];
}

export function photoLine(photo) {
  if (!photo) return '';
  const interval = duration(photo.interval_s);
  return `photograph ${photo.sequence} · ${clockTime(photo.time_s)} · every ${interval}`;
}

function pill(target, [level, text]) {
  target.className = `pill ${level}`;
  setText(target, text);
}

export function renderHeader(header, lost) {
  const stale = !lost && Boolean(header && header.photo && header.photo.stale);
  document.body.classList.toggle('offline', lost);
  document.body.classList.toggle('stale', stale);
  pill(find('#live'), liveStatus(header, lost));
  if (!header) return;
  setText(find('#rig-name'), header.rig_name);
  setText(find('#photo-line'), photoLine(header.photo));
  pill(find('#nodes'), [header.nodes.level, header.nodes.text]);
}
