/* A panel with curves over time.

   The library uPlot would draw axes and curves, about 150 lines here. It draws on a canvas: colours of
   themes, titles of marks and the tests of paths would need code of their own. */

import { draw, element, find, hasChanged, setText } from './dom.js';
import { clockTime, number, short } from './formatting.js';
import {
  asSteps, curvePath, curvesOf, frame, mainStretch, nearestIndex, tickText, timeAxis, valueAxis,
} from './plot.js';
import { POINTS_KEPT } from './state.js';

const COLOURS = 6;  // --s0 to --s5 in page.css
const colour = (curve) => `var(--s${curve.position % COLOURS})`;

export function create(root, declaration, page) {
  const svg = draw(root, 'svg', { role: 'img' });
  const reading = element('p', { className: 'reading', hidden: true });
  root.append(reading);
  const caption = find('.caption', root);
  let view = null;
  attachReading(svg, reading, () => view, declaration);
  return () => {
    const size = [svg.clientWidth, svg.clientHeight];
    const { event, points } = page.state;
    const last = points[points.length - 1];
    const pastTime = page.past.content ? page.past.content.time_s : null;
    const drawn = [event.run, event.history.end, points.length, last, event.start_s,
      event.marks.length, page.theme.name, size, pastTime];
    if (!size[0] || !size[1] || !hasChanged(svg, drawn)) return;
    svg.dataset.points = points.length;
    svg.setAttribute('viewBox', `0 0 ${size[0]} ${size[1]}`);
    svg.replaceChildren();
    const stretch = mainStretch(points);
    const curves = curvesOf(stretch, declaration.name);
    view = curves.length
      ? drawCurves(svg, size, curves, declaration, { event, points: stretch, pastTime }) : null;
    if (!view) drawNothing(svg, size);
    const others = points.length - stretch.length;
    caption.replaceChildren(...legend(curves, declaration), ...remark(others));
    const text = curves.length ? caption.textContent : 'no values yet';
    svg.setAttribute('aria-label', `${declaration.title}: ${text}`);
  };
}

function remark(others) {
  if (!others) return [];
  const what = others === 1 ? '1 photograph has' : `${others} photographs have`;
  return [element('span', { className: 'remark', textContent: `${what} a time far from these` })];
}

/* Shows all values at the time under the pointer. */
function attachReading(svg, text, current, declaration) {
  const leave = () => {
    text.hidden = true;
    find('.cursor', svg)?.remove();
  };
  svg.addEventListener('pointermove', (event) => {
    const view = current();
    leave();
    if (!view) return;
    const at = view.box.time(event.clientX - svg.getBoundingClientRect().left);
    const index = nearestIndex(view.times, at);
    if (index < 0) return;
    const x = view.box.x(view.times[index]);
    draw(svg, 'line', { x1: x, x2: x, y1: view.box.top, y2: view.box.bottom, class: 'cursor' });
    setText(text, readingText(view.curves, view.points[index], index, declaration));
    text.hidden = false;
  });
  svg.addEventListener('pointerleave', leave);
}

/* Time and values of one point in words. */
export function readingText(curves, point, index, declaration) {
  const values = curves.map((curve) => (
    `${curve.name} ${valueText(curve.values[index], declaration)}`.trim()));
  return `${clockTime(point.time_s)}: ${values.join(', ')} ${declaration.unit}`;
}

function valueText(value, declaration) {
  return declaration.digits === null ? short(value) : number(value, declaration.digits);
}

function drawNothing(svg, [width, height]) {
  const middle = { x: width / 2, y: height / 2, 'text-anchor': 'middle' };
  draw(svg, 'text', middle, 'no values yet');
}

function drawCurves(svg, [width, height], curves, declaration, state) {
  const { event, points } = state;
  const time = timeAxis(points, event.start_s, points.length >= POINTS_KEPT);
  const value = valueAxis(curves.flatMap((curve) => curve.values).filter((v) => v !== null));
  const box = frame(width, height, time, value);
  drawValueAxis(svg, box, value, declaration.unit);
  drawTimeAxis(svg, box, time, height);
  drawMarks(svg, box, time, event.marks);
  for (const curve of curves) {
    const [times, values] = declaration.steps
      ? asSteps(time.times, curve.values) : [time.times, curve.values];
    const dash = isDashed(curve, curves, declaration) ? '; stroke-dasharray: 7 5' : '';
    const style = `stroke: ${colour(curve)}${dash}`;
    draw(svg, 'path', { d: curvePath(times, values, box.x, box.y), style });
  }
  if (state.pastTime !== null) drawPast(svg, box, time, state.pastTime);
  return { box, curves, points, times: time.times };
}

/* The time of the earlier state whose maps are shown. */
function drawPast(svg, box, time, pastTime) {
  const at = (pastTime - time.start) / time.seconds;
  if (at < time.from || at > time.to) return;
  const x = box.x(at);
  draw(svg, 'line', { x1: x, x2: x, y1: box.top, y2: box.bottom, class: 'past' });
}

function drawValueAxis(svg, box, value, unit) {
  const right = { x: box.left - 6, 'text-anchor': 'end' };
  for (const tick of value.ticks) {
    const y = box.y(tick);
    const line = { x1: box.left, x2: box.right, y1: y, y2: y, class: tick === 0 ? 'axis' : '' };
    draw(svg, 'line', line);
    draw(svg, 'text', { ...right, y: y + 4 }, tickText(tick, value.step));
  }
  draw(svg, 'text', { ...right, y: 7 }, unit);
}

function drawTimeAxis(svg, box, time, height) {
  for (const tick of box.timeTicks) {
    const place = { x: box.x(tick), y: box.bottom + 17, 'text-anchor': 'middle' };
    draw(svg, 'text', place, tickText(tick, box.timeStep));
  }
  draw(svg, 'text', { x: box.right, y: height - 2, 'text-anchor': 'end' }, time.label);
}

/* Interruptions of the sequence of photographs. */
function drawMarks(svg, box, time, marks) {
  for (const mark of marks) {
    const at = (mark.time_s - time.start) / time.seconds;
    if (at < time.from || at > time.to) continue;
    const x = box.x(at);
    const line = draw(svg, 'line', { x1: x, x2: x, y1: box.top, y2: box.bottom, class: 'mark' });
    draw(line, 'title', {}, mark.reason);
  }
}

/* A curve is dashed only beside others. */
function isDashed(curve, curves, declaration) {
  return curves.length > 1 && declaration.dashed.includes(curve.name);
}

/* The names of the curves with their last values; units only once if there are many. */
function legend(curves, declaration) {
  return curves.map((curve, i) => {
    const last = curve.values[curve.values.length - 1];
    const value = valueText(last, declaration);
    const unit = curves.length < 3 || i === curves.length - 1 ? declaration.unit : '';
    const dashed = isDashed(curve, curves, declaration) ? ' dashed' : '';
    const key = element('span', {
      className: `key${dashed}${curves.length === 1 ? ' alone' : ''}`,
      textContent: `${curve.name} ${value} ${unit}`.trim(),
    });
    key.style.color = colour(curve);
    return key;
  });
}
