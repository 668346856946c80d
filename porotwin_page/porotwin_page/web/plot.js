/* The geometry of a chart: ranges, ticks and paths; no drawing. */

import { FIRST_ABSOLUTE_STAMP_S, isNumber, number } from './formatting.js';

const MARGIN = { left: 50, right: 8, top: 18, bottom: 34 };  // px
const TICKS_Y = 3;
const TICKS_X = 5;
const LONG_RUN_MIN = 300;  // longer runs count in hours
const SHORTEST_RANGE_MIN = 2;
const LONGEST_PAUSE_S = 86400;  // a longer step between two photographs is a wrong clock
const FEWEST_POINTS = 3;  // fewer points with other times are photographs with wrong times

/* The smallest step 1, 2 or 5 times a power of ten that divides `range` into at most `count`. */
export function niceStep(range, count) {
  const raw = range / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  return [1, 2, 5, 10].map((factor) => factor * power).find((step) => step >= raw);
}

/* All multiples of the nice step from `low` to `high`. */
export function ticks(low, high, count) {
  const step = niceStep(high - low, count);
  const values = [];
  const first = Math.ceil(low / step - 1e-9) + 0;  // no negative zero
  for (let i = first; i * step <= high + 1e-9 * step; i += 1) values.push(i * step);
  return values;
}

/* A tick's value with the digits that its step needs. */
export function tickText(value, step) {
  return number(value, Math.min(6, Math.max(0, -Math.floor(Math.log10(step) + 1e-9))));
}

/* The path of a curve; values that are not numbers are gaps. */
export function curvePath(times, values, x, y) {
  let path = '';
  let drawing = false;
  values.forEach((value, i) => {
    if (!isNumber(value)) {
      drawing = false;
      return;
    }
    path += `${drawing ? 'L' : 'M'}${x(times[i]).toFixed(1)},${y(value).toFixed(1)}`;
    // a single point between gaps becomes a dot
    if (!drawing && !isNumber(values[i + 1])) path += 'h0.01';
    drawing = true;
  });
  return path;
}

/* A curve that holds every value until the next time. */
export function asSteps(times, values) {
  const stepTimes = [];
  const stepValues = [];
  values.forEach((value, i) => {
    if (i > 0) {
      stepTimes.push(times[i]);
      stepValues.push(values[i - 1]);
    }
    stepTimes.push(times[i]);
    stepValues.push(value);
  });
  return [stepTimes, stepValues];
}

/* The points of one stretch of time. A photograph with a wrong time is a stretch of its own: the
   newest stretch of some points is shown, or else the longest. */
export function mainStretch(points) {
  const stretches = [];
  points.forEach((point, i) => {
    const step = i ? point.time_s - points[i - 1].time_s : NaN;
    if (step >= 0 && step <= LONGEST_PAUSE_S) stretches[stretches.length - 1].push(point);
    else stretches.push([point]);
  });
  const resumed = joined(stretches);
  const last = resumed.findLast((stretch) => stretch.length >= FEWEST_POINTS);
  if (last) return last;
  return resumed.reduce((most, next) => (next.length >= most.length ? next : most), []);
}

/* A stretch that goes on where an earlier one stopped, after points with wrong times, is the same. */
function joined(stretches) {
  const made = [];
  for (const stretch of stretches) {
    const before = made.find((other) => {
      const step = stretch[0].time_s - other[other.length - 1].time_s;
      return step >= 0 && step <= LONGEST_PAUSE_S;
    });
    if (before) before.push(...stretch);
    else made.push([...stretch]);
  }
  return made;
}

/* Number of the time nearest to `at`; -1 without times. */
export function nearestIndex(times, at) {
  let nearest = -1;
  times.forEach((time, i) => {
    if (nearest < 0 || Math.abs(time - at) < Math.abs(times[nearest] - at)) nearest = i;
  });
  return nearest;
}

/* Time axis of points with time_s: the unit, the time of every point in it, and the range. Stamps
   that count from the start of a run, as in the header of the page, are shown as they are. */
export function timeAxis(points, startSeconds, cutOff) {
  const earliest = points.length ? points[0].time_s : 0;
  const known = startSeconds !== null && startSeconds !== undefined
    && startSeconds <= earliest && earliest - startSeconds <= LONGEST_PAUSE_S;
  const told = known ? startSeconds : earliest;
  const start = earliest < FIRST_ABSOLUTE_STAMP_S ? 0 : told;
  const minutes = points.map((point) => (point.time_s - start) / 60);
  const inHours = minutes.length > 0 && minutes[minutes.length - 1] > LONG_RUN_MIN;
  const seconds = inHours ? 3600 : 60;
  const times = inHours ? minutes.map((time) => time / 60) : minutes;
  const first = times.length ? Math.min(0, times[0]) : 0;
  const from = times.length && cutOff ? times[0] : first;
  const shortest = inHours ? SHORTEST_RANGE_MIN / 60 : SHORTEST_RANGE_MIN;
  const to = Math.max(times.length ? times[times.length - 1] : 1, from + shortest);
  const label = inHours ? 'hours since the start' : 'minutes since the start';
  return { start, seconds, times, from, to, label };
}

/* Range of the values, with 0 inside and nice ends. */
export function valueAxis(values) {
  let high = values.reduce((most, value) => Math.max(most, value), 0);
  let low = values.reduce((least, value) => Math.min(least, value), 0);
  if (high === low) high = low + 1;
  const step = niceStep(high - low, TICKS_Y);
  high = Math.ceil(high / step - 1e-9) * step;
  low = Math.floor(low / step + 1e-9) * step;
  return { low, high, step, ticks: ticks(low, high, TICKS_Y) };
}

/* The frame of a chart of `width` x `height` px: maps values to pixels. */
export function frame(width, height, time, value) {
  const { left, right, top, bottom } = MARGIN;
  const inner = { width: width - left - right, height: height - top - bottom };
  return {
    left,
    right: width - right,
    top,
    bottom: height - bottom,
    x: (at) => left + (at - time.from) / (time.to - time.from) * inner.width,
    time: (x) => time.from + (x - left) / inner.width * (time.to - time.from),
    y: (at) => height - bottom - (at - value.low) / (value.high - value.low) * inner.height,
    timeTicks: ticks(time.from, time.to, TICKS_X),
    timeStep: niceStep(time.to - time.from, TICKS_X),
  };
}

/* The curves of a chart: name and values over all points; curves without values are left out.
   `position` selects the colour, so that a curve keeps it. */
export function curvesOf(points, chart) {
  const names = [...new Set(points.flatMap((point) => Object.keys(point.values[chart] ?? {})))];
  return names
    .map((name, position) => ({
      name, position, values: points.map((point) => (point.values[chart] ?? {})[name] ?? null),
    }))
    .filter((curve) => curve.values.some(isNumber));
}
