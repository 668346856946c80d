/* Draws what is expected with the present rates, and with those of the sliders. */

import { drawBands } from '../web/bands.js';
import { WrongToken } from '../web/confirmation.js';
import { draw, element, find, hasChanged, setText } from '../web/dom.js';
import { clockTime, isNumber, number } from '../web/formatting.js';
import { nearestIndex } from '../web/plot.js';
import { overlayShapes } from '../web/overlay.js';
import { presentRates, Proposal } from '../web/proposal.js';

const PRESENT = 'var(--s0)';
const PROPOSED = 'var(--s1)';
const SOON_MIN = 30;  // of the words about the probability

const BODY = `
  <div class="columns"><div>
  <p class="caption-line"><span class="key present">present rates</span>
    <span class="key proposed" hidden>proposed</span></p>
  <h3>Tracer in the zone, with 90 % bands</h3>
  <svg class="zone-chart" role="img"></svg>
  <h3>Probability that the zone is reached</h3>
  <svg class="reached-chart" role="img"></svg>
  <p class="words"></p>
  </div><div>
  <div class="plume"><svg aria-hidden="true"></svg></div>
  <p class="plume-words"></p>
  <fieldset>
    <legend>What if</legend>
    <div class="sliders"></div>
    <p class="together"></p>
    <button type="button" class="quiet reset">back to the present rates</button>
    <p class="fault error" role="status" hidden></p>
    <p class="promise"></p>
  </fieldset>
  </div></div>`;

export function create(root, declaration, page) {
  root.insertAdjacentHTML('beforeend', BODY);
  const proposal = new Proposal({ ask: (rates) => ask(rates, page), changed: page.refresh });
  const current = () => page.state.event && page.state.event.panels[declaration.name];
  find('.reset', root).addEventListener('click', () => proposal.reset());
  return (content) => {
    root.hidden = !content;
    if (!content) return;
    proposal.follow(content.present.time_s);
    setText(find('.caption', root), `from ${clockTime(content.present.time_s)}`);
    renderSliders(root, content, proposal, current);
    renderCharts(root, content, proposal.answer, page.theme.name);
    renderPlume(root, content, proposal.answer, page);
    renderWords(root, content, proposal, page);
  };
}

class Busy extends Error {
  busy = true;
}

/* Asks the server what rates would do. */
async function ask(rates, page) {
  const headers = {
    'Content-Type': 'application/json', Authorization: `Bearer ${page.token.value}`,
  };
  const body = JSON.stringify({ rates_ml_h: rates });
  const response = await fetch('/what-if', { method: 'POST', headers, body });
  const answer = await response.json();
  if (response.ok) return answer;
  if (response.status === 429) throw new Busy(answer.error);
  throw response.status === 403 ? new WrongToken(answer.error) : new Error(answer.error);
}

function renderSliders(root, content, proposal, current) {
  const box = find('.sliders', root);
  const { wells, max_rate_ml_h: most, step_ml_h: step } = content;
  find('fieldset', root).hidden = !wells.length;
  if (hasChanged(box, [wells, most, step])) {
    box.replaceChildren(...wells.map((well) => slider(well, most, step, (value) => {
      const newest = current();
      if (newest) proposal.set(well, value, newest);
    })));
  }
  const rates = proposal.rates ?? presentRates(content);
  for (const row of box.children) {
    const input = find('input', row);
    const rate = rates[input.name];
    // a slider under a finger is moved by the finger alone
    if (document.activeElement !== input || Number(input.value) > rate) input.value = rate;
    setText(find('output', row), `${number(rate, step < 1 ? 1 : 0)} ml/h`);
  }
}

function slider(well, most, step, moved) {
  const input = element('input', { type: 'range', name: well, min: 0, max: most, step });
  input.addEventListener('input', () => moved(input.valueAsNumber));
  return element('label', {}, element('span', {}, well), input, element('output'));
}

function renderCharts(root, { present }, answer, theme) {
  const plans = [[present, PRESENT], ...(answer ? [[answer, PROPOSED]] : [])];
  const [zone, reached] = [find('.zone-chart', root), find('.reached-chart', root)];
  const drawn = [present, answer, theme, zone.clientWidth];
  if (!zone.clientWidth || !hasChanged(zone, drawn)) return;
  drawBands(zone, plans.map(([one, colour]) => ({
    minutes: one.minutes, ...one.zone_ml, colour,
  })), { unit: 'ml' });
  drawBands(reached, plans.map(([one, colour]) => ({
    minutes: one.minutes, median: one.reached_percent, colour,
  })), { unit: '%', most: 100 });
}

/* The probability that the zone is reached soon, in words. */
export function reachedWords(name, { minutes, reached_percent: percent }) {
  const index = nearestIndex(minutes, SOON_MIN);
  if (index < 0 || !isNumber(percent[index])) return '';
  return `${name} ${number(percent[index], 0)} % within ${number(minutes[index], 0)} min`;
}

function renderPlume(root, { present }, answer, page) {
  const { rig, run } = page.state.event;
  const svg = find('.plume svg', root);
  if (!rig) return;
  svg.parentElement.style.aspectRatio = `${rig.width_m} / ${rig.height_m}`;
  const [width, height] = [svg.clientWidth, svg.clientHeight];
  if (!width || !hasChanged(svg, [run, present, answer, width])) return;
  svg.setAttribute('viewBox', `0 0 ${width} ${height}`);
  svg.replaceChildren();
  const settings = { width, height, id: 'zone-hatch-observed', labelled: false };
  for (const shape of overlayShapes(rig, {}, settings)) draw(svg, ...shape);
  const path = (outlines, className) => draw(svg, 'path', {
    d: outlines.map((line) => outlinePath(line, rig, width, height)).join(''), class: className,
  });
  path(present.now, 'plume-now');
  path(present.outlines, 'plume-present');
  if (answer) path(answer.outlines, 'plume-proposed');
}

export function outlinePath(line, rig, width, height) {
  const points = line.map(([x, z]) => (
    `${(x / rig.width_m * width).toFixed(1)},${(height - z / rig.height_m * height).toFixed(1)}`));
  return points.length ? `M${points.join('L')}Z` : '';
}

function renderWords(root, content, proposal, page) {
  const { present } = content;
  const { answer, fault, asking, rates } = proposal;
  find('.proposed', root).hidden = !answer;
  const words = [reachedWords('present', present), answer ? reachedWords('proposed', answer) : ''];
  setText(find('.words', root), `The zone is reached: ${words.filter(Boolean).join('; ')}`);
  setText(find('.plume-words', root),
    `Outline of the plume in ${number(present.outline_minutes, 0)} min; dashed: now`);
  const sum = Object.values(rates ?? presentRates(content)).reduce((all, rate) => all + rate, 0);
  const state = asking ? ', asking' : '';
  setText(find('.together', root),
    `together ${number(sum, 0)} of ${number(content.max_total_ml_h, 0)} ml/h${state}`);
  find('.reset', root).hidden = !rates;
  find('.fault', root).hidden = !fault;
  setText(find('.fault', root), fault ? `No answer: ${fault}` : '');
  const token = page.token.value ? '' : 'To ask, the page needs the token of ./porotwin up. ';
  const hub = content.controlled ? 'The hub goes on choosing the rates by itself. ' : '';
  const note = answer && answer.note ? ` (${answer.note})` : '';
  setText(find('.promise', root), `${token}${hub}Nothing is pumped from here.${note}`);
  for (const input of root.querySelectorAll('input')) input.disabled = !page.token.value;
}
