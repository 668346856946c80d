/* Draws the log of setpoints, the newest line first. */

import { element, find, hasChanged } from '../web/dom.js';
import { clockTime, setting } from '../web/formatting.js';

const EMPTY = 'No setpoint yet.';

/* What happened, in words. */
export function eventText({ event, sequence }) {
  if (event === 'expired') return `setpoint ${sequence} expired; safe rates`;
  return event === 'reported' ? 'confirmed at the pumps' : `setpoint ${sequence}`;
}

/* The rates of a line; `before` are those of the same kind of line before it. A well that did not
   change is left out, but not in the first line. */
export function ratesText(rates, before) {
  const entries = Object.entries(rates);
  if (!entries.length) return 'rates not known';
  const changed = before ? entries.filter(([well, rate]) => rate !== before[well]) : entries;
  if (!changed.length) return 'the same rates';
  return `${changed.map(([well, rate]) => `${well} ${setting(rate)}`).join(', ')} ml/h`;
}

/* The rates of the line before `index` with the same kind of event: lines are newest first. */
export function ratesBefore(lines, index) {
  const reported = lines[index].event === 'reported';
  const found = lines.slice(index + 1).find((line) => (line.event === 'reported') === reported);
  return found ? found.rates_ml_h : null;
}

export function create(root) {
  const list = element('ol', { tabIndex: 0, ariaLabel: 'log of setpoints, newest first' });
  root.append(list, element('p', { className: 'none', textContent: EMPTY }));
  return (lines) => {
    find('.none', root).hidden = lines.length > 0;
    list.hidden = lines.length === 0;
    if (!hasChanged(list, [lines[0], lines.length])) return;
    list.replaceChildren(...lines.map((line, i) => {
      const rates = ratesText(line.rates_ml_h, ratesBefore(lines, i));
      const span = (className, textContent) => element('span', { className }, textContent);
      return element('li', { className: line.event }, span('time', clockTime(line.clock_s)),
        span('event', eventText(line)), span('rates', rates));
    }));
  };
}
