'use strict';

const QUIET_LIMIT_MS = 5000;  // longer without an event: the connection is lost
const RETRY_MS = 1500;
const CHANGE_GUARD_MS = 1500;  // a button does not change its meaning under a finger
const POINTS_KEPT = 2000;

const find = (selector, root = document) => root.querySelector(selector);
const dash = '–';

let state = null;
let points = [];
let firstPoint = 0;  // its number in the page's count
let source = null;
let lastEvent = 0;
let guardUntil = 0;
let sending = false;

/* words and numbers */

const isNumber = (value) => typeof value === 'number' && Number.isFinite(value);

function number(value, digits) {
  if (!isNumber(value)) return dash;
  const text = Math.abs(value).toFixed(digits);
  return value < 0 && Number(text) !== 0 ? '−' + text : text;
}

function short(value) {
  if (!isNumber(value)) return dash;
  const size = Math.abs(value);
  return number(value, size >= 100 ? 0 : size >= 10 ? 1 : size >= 0.095 || size === 0 ? 2 : 3);
}

function duration(seconds) {
  if (!isNumber(seconds)) return dash;
  const whole = Math.max(0, Math.floor(seconds));
  const pad = (value) => String(value).padStart(2, '0');
  if (whole < 60) return `${whole} s`;
  if (whole < 3600) return `${Math.floor(whole / 60)}:${pad(whole % 60)} min`;
  if (whole < 172800) return `${Math.floor(whole / 3600)}:${pad(Math.floor(whole / 60) % 60)} h`;
  return `${Math.floor(whole / 86400)} days`;
}

/* stamps are seconds since 1970, or since a start that the run chose */
function clockTime(seconds) {
  if (!isNumber(seconds)) return dash;
  if (seconds < 1e8) return `t = ${duration(seconds)}`;
  const date = new Date(seconds * 1000);
  const time = date.toLocaleTimeString('en-GB');
  const old = Math.abs(Date.now() / 1000 - seconds) > 86400;
  return old ? `${date.toLocaleDateString('sv-SE')} ${time}` : time;
}

function sinceStart(seconds) {
  if (state.start_s === null || !isNumber(seconds)) return '';
  return `${number((seconds - state.start_s) / 60, 1)} min`;
}

function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/* theme */

const darkRoom = matchMedia('(prefers-color-scheme: dark)');
const THEMES = ['auto', 'light', 'dark'];
let themeChoice = 'auto';
try { themeChoice = localStorage.getItem('porotwin-theme') || 'auto'; } catch { /* private mode */ }

const theme = () => (themeChoice === 'auto' ? (darkRoom.matches ? 'dark' : 'light') : themeChoice);

function applyTheme() {
  document.documentElement.dataset.theme = theme();
  setText(find('#theme'), `◐ ${themeChoice}`);
  find('#theme').setAttribute('aria-label', `colours: ${themeChoice}; change`);
  for (const kind of ['observed', 'forecast', 'difference']) {
    find(`#${kind} .scale img`).src = `/scale/${kind}.png?theme=${theme()}`;
  }
  if (state) render();
}

find('#theme').addEventListener('click', () => {
  themeChoice = THEMES[(THEMES.indexOf(themeChoice) + 1) % THEMES.length];
  try { localStorage.setItem('porotwin-theme', themeChoice); } catch { /* private mode */ }
  applyTheme();
});
darkRoom.addEventListener('change', applyTheme);

/* header */

function pill(element, level, text) {
  element.className = `pill ${level}`;
  setText(element, text);
}

const offline = () => Date.now() - lastEvent > QUIET_LIMIT_MS;

function renderHeader() {
  const photo = state && state.photo;
  const lost = offline();
  const stale = !lost && Boolean(photo && photo.stale);
  document.body.classList.toggle('offline', lost);
  document.body.classList.toggle('stale', stale);
  const live = find('#live');
  if (lost) pill(live, 'error', 'Not connected, trying again');
  else if (!photo) pill(live, 'quiet', 'Waiting for a photograph');
  else if (state.finished) pill(live, 'ok', `Finished: ${state.finished}`);
  else if (stale) pill(live, 'warn', `Stale: no photograph for ${duration(photo.age_s)}`);
  else pill(live, 'ok', 'Live');
  find('#observed .map').dataset.warning = lost ? 'NOT CONNECTED' : 'STALE';
  if (!state) return;
  setText(find('#rig-name'), state.rig ? state.rig.name : '');
  setText(find('#photo-line'), photo
    ? `photograph ${photo.sequence} · ${clockTime(photo.time_s)} · every ${duration(photo.interval_s)}`
    : '');
  const bad = state.health.filter((node) => node.level === 'error');
  const poor = state.health.filter((node) => node.level === 'warn');
  const naming = (nodes) => {
    const line = `${nodes[0].name}: ${nodes[0].message}`;
    const more = nodes.length > 1 ? ` (+${nodes.length - 1})` : '';
    return (line.length > 60 ? `${line.slice(0, 58)}…` : line) + more;
  };
  const nodes = find('#nodes');
  if (bad.length) pill(nodes, 'error', `✖ ${naming(bad)}`);
  else if (poor.length) pill(nodes, 'warn', `▲ ${naming(poor)}`);
  else pill(nodes, 'ok', state.health.length ? `✔ ${state.health.length} nodes` : '');
}

/* pumps */

function does(well) {
  if (!isNumber(well.rate_ml_h) || well.rate_ml_h === 0) return 'off';
  if (well.rate_ml_h < 0) return 'takes out';
  return well.tracer > 0 ? 'injects tracer' : 'injects water';
}

function cell(row, className, text) {
  const td = row.insertCell();
  td.className = className;
  td.textContent = text;
  return td;
}

function ratesRow(body, well, setpoint) {
  const row = body.insertRow();
  if (well.changed && !setpoint.confirmed) row.className = setpoint.pumps_report ? 'moved' : 'changed';
  const name = cell(row, '', '');
  for (const [className, text] of [['well', well.name], ['does', does(well)]]) {
    const span = document.createElement('span');
    span.className = className;
    span.textContent = text;
    name.append(span);
  }
  const rate = cell(row, 'rate', '');
  const digits = document.createElement('span');
  digits.className = 'digits';
  digits.textContent = number(well.rate_ml_h, 1);
  const unit = document.createElement('span');
  unit.className = 'unit';
  unit.textContent = ' ml/h';
  rate.append(digits, unit);
  const now = cell(row, 'now', '');
  const lines = [['was', setpoint.confirmed ? 'set' : 'was', well.before_ml_h],
    ['measured', 'measured', setpoint.pumps_report ? well.measured_ml_h : null]];
  for (const [className, word, value] of lines) {
    const line = document.createElement('span');
    line.className = className;
    line.textContent = isNumber(value) ? `${word} ${number(value, 1)}` : '';
    now.append(line);
  }
}

function otherRates(wells) {
  const box = find('#other-rates');
  const names = wells.map((well) => well.name).join('\n');
  if (box.dataset.names !== names) {
    box.dataset.names = names;
    box.replaceChildren(...wells.map((well) => {
      const label = document.createElement('label');
      const text = document.createElement('span');
      text.textContent = well.name;
      const unit = document.createElement('span');
      unit.textContent = ' ml/h';
      text.append(unit);
      const input = document.createElement('input');
      input.type = 'number';
      input.step = 'any';
      input.name = well.name;
      label.append(text, input);
      return label;
    }));
  }
  wells.forEach((well) => {
    box.querySelectorAll('input').forEach((input) => {
      if (input.name === well.name) input.placeholder = isNumber(well.rate_ml_h) ? well.rate_ml_h.toFixed(1) : '';
    });
  });
}

function namesOf(wells) {
  if (wells.length > 3) return `${wells.length} pumps`;
  return wells.map((well) => well.name).join(', ');
}

function renderDone(setpoint) {
  const form = find('#confirmation');
  form.hidden = setpoint.pumps_report;
  const button = find('#done');
  const changed = setpoint.wells.filter((well) => well.changed);
  const calm = changed.length === 0 || setpoint.confirmed;
  const guarded = Date.now() < guardUntil;
  button.classList.toggle('calm', calm);
  button.classList.toggle('late', !calm && isNumber(setpoint.remaining_s) && setpoint.remaining_s <= 0);
  button.disabled = sending || guarded || offline();
  let words = ['Done', `${namesOf(changed)} set as asked`];
  if (calm) words = ['✔ Nothing to set', 'press to confirm again'];
  if (calm && setpoint.confirmed) words = ['✔ Confirmed', `setpoint ${setpoint.sequence}; press to confirm again`];
  if (guarded) words = ['New setpoint', 'look again before you confirm'];
  if (sending) words = ['Sending', ''];
  const small = document.createElement('small');
  small.textContent = words[1];
  if (button.textContent !== words.join('')) button.replaceChildren(words[0], small);
}

function renderValidity(setpoint) {
  const box = find('#validity');
  box.hidden = setpoint.remaining_s === null;
  if (box.hidden) {
    find('#pumps').classList.remove('expired-setpoint');
    return;
  }
  const left = setpoint.remaining_s;
  const share = setpoint.validity_s > 0 ? Math.min(1, Math.max(0, left / setpoint.validity_s)) : 0;
  box.classList.toggle('short', share < 0.34);
  box.classList.toggle('expired', left <= 0);
  find('#pumps').classList.toggle('expired-setpoint', left <= 0);
  find('#validity-bar div').style.width = `${100 * share}%`;
  setText(find('#validity-text'), left > 0
    ? `valid for ${duration(left)}`
    : `expired ${duration(-left)} ago: ${setpoint.pumps_report ? 'the rig is at its safe rates' : 'switch the control wells off'}`);
}

let shownRates = '';

function renderPumps() {
  const setpoint = state.setpoint;
  find('#no-setpoint').hidden = Boolean(setpoint);
  for (const id of ['#rates', '#validity', '#confirmation']) find(id).hidden = !setpoint;
  if (!setpoint) {
    setText(find('#setpoint-line'), '');
    setText(find('#reason'), '');
    return;
  }
  setText(find('#setpoint-line'), `setpoint ${setpoint.sequence}`);
  const asked = setpoint.wells.map((well) => `${well.name} ${well.rate_ml_h}`).join();
  if (renderPumps.asked !== undefined && renderPumps.asked !== asked) {
    guardUntil = Date.now() + CHANGE_GUARD_MS;
    setTimeout(renderPumpsIfAny, CHANGE_GUARD_MS + 20);
    setAnswer('', '');
  }
  renderPumps.asked = asked;
  const text = JSON.stringify([setpoint.wells, setpoint.pumps_report, setpoint.confirmed]);
  if (text !== shownRates) {
    shownRates = text;
    const body = find('#rates tbody');
    body.replaceChildren();
    setpoint.wells.forEach((well) => ratesRow(body, well, setpoint));
    otherRates(setpoint.wells);
  }
  renderValidity(setpoint);
  renderDone(setpoint);
  setText(find('#reason'), (setpoint.pumps_report ? 'The pumps follow and report by themselves. ' : '')
    + (setpoint.reason ? `Why: ${setpoint.reason}` : ''));
}

const renderPumpsIfAny = () => { if (state) renderPumps(); };

function setAnswer(level, text) {
  const answer = find('#answer');
  answer.className = level;
  setText(answer, text);
}

find('#confirmation').addEventListener('submit', async (event) => {
  event.preventDefault();
  if (sending || !state || !state.setpoint || Date.now() < guardUntil) return;
  const rates = {};
  find('#other-rates').querySelectorAll('input').forEach((input) => {
    if (input.value !== '') rates[input.name] = input.valueAsNumber;
  });
  const body = JSON.stringify({ sequence: state.setpoint.sequence, rates_ml_h: rates });
  sending = true;
  renderPumps();
  try {
    const response = await fetch('/confirm', {
      method: 'POST', headers: { 'Content-Type': 'application/json' }, body,
    });
    const answer = await response.json();
    if (!response.ok) throw new Error(answer.error);
    setAnswer('ok', answer.message);
    find('#confirmation').reset();
    find('#confirmation details').open = false;
  } catch (error) {
    setAnswer('error', `Not confirmed: ${error.message}`);
  }
  sending = false;
  renderPumps();
});

/* maps */

const SVG = 'http://www.w3.org/2000/svg';

function draw(parent, name, attributes, text) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text !== undefined) element.textContent = text;
  parent.append(element);
  return element;
}

function renderOverlay(figure, rig, withText) {
  const svg = find('svg', figure);
  const width = svg.clientWidth;
  const height = svg.clientHeight;
  if (!width || !height) return;
  const rates = Object.fromEntries((state.setpoint ? state.setpoint.wells : []).map((well) => [well.name, well]));
  const key = JSON.stringify([width, height, rig, rates, withText]);
  if (svg.dataset.key === key) return;
  svg.dataset.key = key;
  svg.setAttribute('viewBox', `0 0 ${width} ${height}`);
  svg.replaceChildren();
  const x = (metres) => metres / rig.width_m * width;
  const y = (metres) => height - metres / rig.height_m * height;
  if (rig.zone_m.length) {
    const id = `zone-hatch-${figure.id}`;
    const pattern = draw(draw(svg, 'defs', {}), 'pattern', {
      id, width: 12, height: 12, patternUnits: 'userSpaceOnUse', patternTransform: 'rotate(45)',
    });
    draw(pattern, 'line', { x1: 0, y1: 0, x2: 0, y2: 12, class: 'zone-hatch' });
    // the outline along the rig's edge would be cut in half
    const inset = (value, most) => Math.min(Math.max(value, 2), most - 2);
    const corners = rig.zone_m.map(([px, pz]) => `${inset(x(px), width)},${inset(y(pz), height)}`).join(' ');
    draw(svg, 'polygon', { points: corners, class: 'zone-halo' });
    draw(svg, 'polygon', { points: corners, class: 'zone', style: `fill: url(#${id})` });
    if (withText) {
      const top = Math.max(...rig.zone_m.map((point) => point[1]));
      draw(svg, 'text', { x: 12, y: y(top) + 22, class: 'overlay-text zone-text' }, 'disallowed zone');
    }
  }
  for (const well of rig.wells) {
    const radius = withText ? 7 : 4.5;
    const cx = x(well.x_m);
    const cy = y(well.z_m);
    draw(svg, 'circle', { cx, cy, r: radius, class: 'well-halo' });
    draw(svg, 'circle', { cx, cy, r: radius, class: 'well' });
    if (!withText) continue;
    const rate = rates[well.name];
    const right = cx < width * 0.72;
    const place = { x: cx + (right ? 14 : -14), 'text-anchor': right ? 'start' : 'end', class: 'overlay-text' };
    draw(svg, 'text', { ...place, y: cy - 1 }, well.name);
    if (rate) draw(svg, 'text', { ...place, y: cy + 14 }, `${number(rate.rate_ml_h, 1)} ml/h`);
  }
  if (withText) {
    const length = rig.width_m > 2 ? 0.5 : 0.1;
    const from = width - 14 - x(length);
    draw(svg, 'line', { x1: from, x2: width - 14, y1: height - 12, y2: height - 12, class: 'bar' });
    draw(svg, 'text', { x: width - 14, y: height - 19, 'text-anchor': 'end', class: 'overlay-text' },
      `${length * 100} cm`);
  }
}

/* the new picture takes the old one's place when it is there, so that nothing flickers */
function showPicture(box, url) {
  if (box.dataset.url === url) return;
  box.dataset.url = url;
  const image = new Image();
  image.alt = box.closest('figure').querySelector('h2').textContent;
  image.onload = () => { if (box.dataset.url === url) box.replaceChildren(image); };
  image.onerror = () => { if (box.dataset.url === url) delete box.dataset.url; };
  image.src = url;
}

function renderMap(kind, words) {
  const figure = find(`#${kind}`);
  const shown = state.maps[kind];
  const frame = find('.map', figure);
  frame.classList.toggle('shown', Boolean(shown));
  if (state.rig) frame.style.aspectRatio = `${state.rig.width_m} / ${state.rig.height_m}`;
  setText(find('.when', figure), shown ? words(shown) : '');
  if (!shown) return;
  showPicture(find('.pictures', figure), `/map/${kind}.png?theme=${theme()}&v=${state.run}-${shown.number}`);
  if (state.rig) renderOverlay(figure, state.rig, kind === 'observed');
}

function renderMaps() {
  renderMap('observed', (shown) => [
    clockTime(shown.time_s), shown.time_s < 1e8 ? '' : `after ${sinceStart(shown.time_s)}`,
    shown.unseen_percent ? `${short(shown.unseen_percent)} % not seen (hatched)` : '',
  ].filter(Boolean).join(' · '));
  renderMap('forecast', (shown) => `for ${clockTime(shown.time_s)} · ${state.corrected ? 'corrected' : 'not corrected'}`);
  renderMap('difference', (shown) => clockTime(shown.time_s));
  const difference = state.maps.difference;
  setText(find('#difference .low'), difference ? number(-difference.limit, 2) : dash);
  setText(find('#difference .high'), difference ? `+${number(difference.limit, 2)}` : dash);
  const remarks = [...(state.photo ? state.photo.remarks : []), ...state.remarks];
  if (state.photo && !state.photo.calibrated && !/calibrat/i.test(remarks.join())) {
    remarks.push('not calibrated: the scale of the concentration is a default');
  }
  if (state.corrected === false && state.correction) remarks.push(`forecast not corrected: ${state.correction}`);
  const list = find('#remarks');
  if (list.dataset.text !== remarks.join('\n')) {
    list.dataset.text = remarks.join('\n');
    list.replaceChildren(...remarks.map((text) => {
      const item = document.createElement('li');
      item.textContent = text;
      return item;
    }));
  }
}

/* curves */

function niceStep(range, count) {
  const raw = range / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  return [1, 2, 5, 10].map((factor) => factor * power).find((step) => step >= raw);
}

function ticks(low, high, count) {
  const step = niceStep(high - low, count);
  const values = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i += 1) values.push(i * step);
  return values;
}

function tickText(value, step) {
  return number(value, Math.min(6, Math.max(0, -Math.floor(Math.log10(step) + 1e-9))));
}

function curvePath(times, values, x, y) {
  let path = '';
  let pen = false;
  values.forEach((value, i) => {
    if (!isNumber(value)) { pen = false; return; }
    path += `${pen ? 'L' : 'M'}${x(times[i]).toFixed(1)},${y(value).toFixed(1)}`;
    // a lone point between gaps is drawn as a dot
    if (!pen && !isNumber(values[i + 1])) path += 'h0.01';
    pen = true;
  });
  return path;
}

function steps(times, values) {
  const outTimes = [];
  const outValues = [];
  values.forEach((value, i) => {
    if (i > 0) { outTimes.push(times[i]); outValues.push(values[i - 1]); }
    outTimes.push(times[i]);
    outValues.push(value);
  });
  return [outTimes, outValues];
}

function drawChart(figure, series, unit) {
  const svg = find('svg', figure);
  const width = svg.clientWidth;
  const height = svg.clientHeight;
  if (!width || !height) return;
  svg.setAttribute('viewBox', `0 0 ${width} ${height}`);
  svg.replaceChildren();
  const left = 50, right = 8, top = 18, bottom = 34;
  const start = state.start_s ?? (points.length ? points[0].time_s : 0);
  const times = points.map((point) => (point.time_s - start) / 60);
  const hours = times.length > 0 && times[times.length - 1] > 300;
  const scaled = hours ? times.map((time) => time / 60) : times;
  const first = scaled.length ? Math.min(0, scaled[0]) : 0;
  const from = scaled.length && points.length >= POINTS_KEPT ? scaled[0] : first;
  const to = Math.max(scaled.length ? scaled[scaled.length - 1] : 1, from + (hours ? 1 / 30 : 2));
  const all = series.flatMap((curve) => curve.values).filter(isNumber);
  let high = all.reduce((most, value) => Math.max(most, value), 0);
  let low = all.reduce((least, value) => Math.min(least, value), 0);
  const caption = find('figcaption p', figure);
  if (all.length === 0) {
    caption.replaceChildren();
    draw(svg, 'text', { x: width / 2, y: height / 2, 'text-anchor': 'middle' }, 'no values yet');
    svg.setAttribute('aria-label', `${find('h2', figure).textContent}: no values yet`);
    return;
  }
  if (high === low) high = low + 1;
  const yStep = niceStep(high - low, 3);
  high = Math.ceil(high / yStep - 1e-9) * yStep;
  low = Math.floor(low / yStep + 1e-9) * yStep;
  const x = (value) => left + (value - from) / (to - from) * (width - left - right);
  const y = (value) => height - bottom - (value - low) / (high - low) * (height - top - bottom);
  for (const value of ticks(low, high, 3)) {
    draw(svg, 'line', { x1: left, x2: width - right, y1: y(value), y2: y(value), class: value === 0 ? 'axis' : '' });
    draw(svg, 'text', { x: left - 6, y: y(value) + 4, 'text-anchor': 'end' }, tickText(value, yStep));
  }
  draw(svg, 'text', { x: left - 6, y: 7, 'text-anchor': 'end' }, unit);
  const xStep = niceStep(to - from, 5);
  for (const value of ticks(from, to, 5)) {
    draw(svg, 'text', { x: x(value), y: height - bottom + 17, 'text-anchor': 'middle' }, tickText(value, xStep));
  }
  draw(svg, 'text', { x: width - right, y: height - 2, 'text-anchor': 'end' },
    hours ? 'hours since the start' : 'minutes since the start');
  for (const mark of state.marks) {
    const at = (mark.time_s - start) / (hours ? 3600 : 60);
    if (at < from || at > to) continue;
    const line = draw(svg, 'line', { x1: x(at), x2: x(at), y1: top, y2: height - bottom, class: 'mark' });
    draw(line, 'title', {}, mark.reason);
  }
  for (const curve of series) {
    const [curveTimes, values] = curve.steps ? steps(scaled, curve.values) : [scaled, curve.values];
    const style = `stroke: var(${curve.colour})${curve.dashed ? '; stroke-dasharray: 7 5' : ''}`;
    draw(svg, 'path', { d: curvePath(curveTimes, values, x, y), style });
  }
  caption.replaceChildren(...series.map((curve, i) => {
    const key = document.createElement('span');
    key.className = `key${curve.dashed ? ' dashed' : ''}${series.length === 1 ? ' alone' : ''}`;
    key.style.color = `var(${curve.colour})`;
    const last = curve.values[curve.values.length - 1];
    const value = curve.digits === undefined ? short(last) : number(last, curve.digits);
    const ending = series.length < 3 || i === series.length - 1 ? unit : '';
    key.textContent = `${curve.name} ${value} ${ending}`.trim();
    return key;
  }));
  svg.setAttribute('aria-label', `${find('h2', figure).textContent}: ${caption.textContent}`);
}

function renderCurves() {
  const of = (key) => points.map((point) => point[key]);
  const wells = points.length ? [...new Set(points.flatMap((point) => Object.keys(point.rates_ml_h)))] : [];
  const anyCorrection = points.some((point) => isNumber(point.corrected_percent));
  const charts = {
    error: [[
      { name: 'model alone', values: of('predicted_percent'), colour: '--second', dashed: anyCorrection },
      ...(anyCorrection ? [{ name: 'corrected', values: of('corrected_percent'), colour: '--first' }] : []),
    ], '%'],
    zone: [[{ name: '', values: of('zone_ml'), colour: '--first' }], 'ml'],
    rates: [wells.map((well, i) => ({
      name: well, values: points.map((point) => point.rates_ml_h[well] ?? null), colour: `--s${i % 6}`, steps: true, digits: 0,
    })), 'ml/h'],
    cycle: [[{ name: '', values: of('cycle_s'), colour: '--first' }], 's'],
  };
  document.querySelectorAll('.chart').forEach((figure) => drawChart(figure, ...charts[figure.dataset.chart]));
}

/* nodes */

const LIGHTS = { ok: '✔', warn: '▲', error: '✖', quiet: '·' };

function renderHealth() {
  find('#health ul').replaceChildren(...state.health.map((node) => {
    const item = document.createElement('li');
    item.className = node.level;
    const parts = { light: LIGHTS[node.level] || '·', name: node.name, said: node.message, age: isNumber(node.age_s) ? `${duration(node.age_s)} ago` : '' };
    for (const [className, text] of Object.entries(parts)) {
      const span = document.createElement('span');
      span.className = className;
      span.textContent = text;
      item.append(span);
    }
    return item;
  }));
}

/* all of it */

let drawnCurves = '';

function render() {
  renderHeader();
  renderPumps();
  renderMaps();
  renderHealth();
  const curves = JSON.stringify([state.run, state.history.end, points.length, points[points.length - 1], state.start_s, state.marks.length, theme(), innerWidth]);
  if (curves !== drawnCurves) {
    drawnCurves = curves;
    renderCurves();
  }
  const todo = state.setpoint && !state.setpoint.pumps_report && !state.setpoint.confirmed
    ? state.setpoint.wells.filter((well) => well.changed).length : 0;
  document.title = todo ? `(${todo}) set the pumps · PoroTwin` : 'PoroTwin';
}

function receive(event) {
  lastEvent = Date.now();
  state = JSON.parse(event.data);
  const history = state.history;
  if (history.reset) {
    points = [];
    firstPoint = history.begin;
  }
  points.length = Math.min(points.length, history.begin - firstPoint);
  points.push(...history.points);
  firstPoint += points.splice(0, points.length - POINTS_KEPT).length;
  render();
}

function connect() {
  if (source) source.close();
  source = new EventSource('/events');
  source.onmessage = receive;
}

/* a lost stream is opened again here, also where the browser has given up; a hidden page needs none */
setInterval(() => {
  if (document.hidden) return;
  if (!source || source.readyState === EventSource.CLOSED || offline()) {
    renderHeader();
    renderPumpsIfAny();
    if (!connect.at || Date.now() - connect.at > QUIET_LIMIT_MS || source.readyState === EventSource.CLOSED) {
      connect.at = Date.now();
      connect();
    }
  }
}, RETRY_MS);
document.addEventListener('visibilitychange', () => {
  if (document.hidden) { if (source) source.close(); } else { lastEvent = Date.now(); connect(); }
});
new ResizeObserver(() => { if (state) render(); }).observe(document.body);

lastEvent = Date.now();
applyTheme();
connect();
