/* A panel with curves over time. */

import { draw, element, find, hasChanged } from './dom.js';
import { number, short } from './formatting.js';
import { asSteps, curvePath, curvesOf, frame, tickText, timeAxis, valueAxis } from './plot.js';
import { POINTS_KEPT } from './state.js';

const COLOURS = 6;  // --s0 to --s5 in page.css
const colour = (curve) => `var(--s${curve.position % COLOURS})`;

export function create(root, declaration, page) {
  const svg = draw(root, 'svg', { role: 'img' });
  const caption = find('.caption', root);
  return () => {
    const size = [svg.clientWidth, svg.clientHeight];
    const { event, points } = page.state;
    const last = points[points.length - 1];
    const drawn = [event.run, event.history.end, points.length, last, event.start_s,
      event.marks.length, page.theme.name, size];
    if (!size[0] || !size[1] || !hasChanged(svg, drawn)) return;
    svg.dataset.points = points.length;
    svg.setAttribute('viewBox', `0 0 ${size[0]} ${size[1]}`);
    svg.replaceChildren();
    const curves = curvesOf(points, declaration.name);
    if (curves.length) drawCurves(svg, size, curves, declaration, page.state);
    else drawNothing(svg, size);
    caption.replaceChildren(...legend(curves, declaration));
    const text = curves.length ? caption.textContent : 'no values yet';
    svg.setAttribute('aria-label', `${declaration.title}: ${text}`);
  };
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
    const value = declaration.digits === null ? short(last) : number(last, declaration.digits);
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
