/* Curves with bands over the minutes to come. */

import { draw } from './dom.js';
import { curvePath, frame, tickText, valueAxis } from './plot.js';

/* The closed path of a band between two curves. */
export function bandPath(times, low, high, x, y) {
  const place = (values, i) => `${x(times[i]).toFixed(1)},${y(values[i]).toFixed(1)}`;
  const up = times.map((_, i) => place(high, i));
  const down = times.map((_, i) => place(low, i)).reverse();
  return `M${[...up, ...down].join('L')}Z`;
}

/* Draws series of { minutes, median, low, high, colour }; low and high may be missing. */
export function drawBands(svg, series, { unit, most = null }) {
  const [width, height] = [svg.clientWidth, svg.clientHeight];
  if (!width || !height) return;
  svg.setAttribute('viewBox', `0 0 ${width} ${height}`);
  svg.replaceChildren();
  const value = valueAxis(
    most === null ? series.flatMap((one) => one.high ?? one.median) : [0, most]);
  const time = { from: 0, to: Math.max(...series.flatMap((one) => one.minutes)) };
  const box = frame(width, height, time, value);
  const right = { x: box.left - 6, 'text-anchor': 'end' };
  for (const tick of value.ticks) {
    const y = box.y(tick);
    draw(svg, 'line', { x1: box.left, x2: box.right, y1: y, y2: y, class: tick ? '' : 'axis' });
    draw(svg, 'text', { ...right, y: y + 4 }, tickText(tick, value.step));
  }
  draw(svg, 'text', { ...right, y: 7 }, unit);
  for (const tick of box.timeTicks) {
    const place = { x: box.x(tick), y: box.bottom + 17, 'text-anchor': 'middle' };
    draw(svg, 'text', place, tickText(tick, box.timeStep));
  }
  draw(svg, 'text', { x: box.right, y: height - 2, 'text-anchor': 'end' }, 'minutes from now');
  for (const { minutes, median, low, high, colour } of series) {
    if (low) {
      const d = bandPath(minutes, low, high, box.x, box.y);
      draw(svg, 'path', { d, class: 'band', style: `fill: ${colour}` });
    }
    const d = curvePath(minutes, median, box.x, box.y);
    draw(svg, 'path', { d, style: `stroke: ${colour}` });
  }
}
