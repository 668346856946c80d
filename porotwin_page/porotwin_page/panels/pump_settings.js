/* Draws the newest setpoint, its validity, and the button that confirms it. */

import { Confirmation, postJson } from '../web/confirmation.js';
import { element, find, hasChanged, setText } from '../web/dom.js';
import { duration, isNumber, number } from '../web/formatting.js';

const SHORT_VALIDITY = 0.34;  // below this part the bar changes its colour

const BODY = `
  <p id="no-setpoint">No setpoint yet.</p>
  <table id="rates" hidden>
    <thead><tr><th>well</th><th>set to</th><th>before</th></tr></thead>
    <tbody></tbody>
  </table>
  <div id="validity" hidden>
    <div id="validity-bar"><div></div></div>
    <p id="validity-text" role="timer"></p>
  </div>
  <form id="confirmation" hidden>
    <button id="done" type="submit"></button>
    <details>
      <summary>I set something else</summary>
      <div id="other-rates"></div>
    </details>
  </form>
  <p id="answer" role="status" aria-live="assertive"></p>
  <p id="reason"></p>`;

export function create(root, declaration, page) {
  root.insertAdjacentHTML('beforeend', BODY);
  const confirmation = new Confirmation({ changed: page.refresh });
  const current = () => page.state.event.panels[declaration.name];
  find('#confirmation', root).addEventListener('submit', async (event) => {
    event.preventDefault();
    if (!page.state.event || !current()) return;
    const post = (body) => postJson('/confirm', body);
    if (await confirmation.send(current(), enteredRates(root), post)) {
      find('#confirmation', root).reset();
      find('#confirmation details', root).open = false;
    }
  });
  return (setpoint) => {
    document.title = pageTitle(setpoint);
    find('#no-setpoint', root).hidden = Boolean(setpoint);
    for (const id of ['#rates', '#validity', '#confirmation']) find(id, root).hidden = !setpoint;
    setText(find('.caption', root), setpoint ? `setpoint ${setpoint.sequence}` : '');
    setText(find('#reason', root), setpoint ? reason(setpoint) : '');
    if (!setpoint) return;
    confirmation.show(setpoint);
    renderRates(root, setpoint);
    renderValidity(root, setpoint);
    renderButton(root, setpoint, confirmation, page.connection.lost);
  };
}

/* Title of the browser's tab, with the number of pumps to set. */
export function pageTitle(setpoint) {
  if (!setpoint || setpoint.pumps_report || setpoint.confirmed) return 'PoroTwin';
  const count = setpoint.wells.filter((well) => well.changed).length;
  return count ? `(${count}) set the pumps · PoroTwin` : 'PoroTwin';
}

function reason(setpoint) {
  const follow = setpoint.pumps_report ? 'The pumps follow and report by themselves. ' : '';
  return follow + (setpoint.reason ? `Why: ${setpoint.reason}` : '');
}

function enteredRates(root) {
  const inputs = [...root.querySelectorAll('#other-rates input')];
  const entered = inputs.filter((input) => input.value !== '');
  return Object.fromEntries(entered.map((input) => [input.name, input.valueAsNumber]));
}

/* What the well does, in words. */
export function action(well) {
  if (!isNumber(well.rate_ml_h) || well.rate_ml_h === 0) return 'off';
  if (well.rate_ml_h < 0) return 'takes out';
  return well.tracer > 0 ? 'injects tracer' : 'injects water';
}

function renderRates(root, setpoint) {
  const body = find('#rates tbody', root);
  if (!hasChanged(body, [setpoint.wells, setpoint.pumps_report, setpoint.confirmed])) return;
  body.replaceChildren(...setpoint.wells.map((well) => ratesRow(well, setpoint)));
  renderInputs(root, setpoint.wells);
}

function ratesRow(well, setpoint) {
  const span = (className, textContent) => element('span', { className, textContent });
  const changed = setpoint.pumps_report ? 'moved' : 'changed';
  const measured = setpoint.pumps_report ? well.measured_ml_h : null;
  const past = (word, value) => (isNumber(value) ? `${word} ${number(value, 1)}` : '');
  return element('tr', { className: well.changed && !setpoint.confirmed ? changed : '' },
    element('td', {}, span('well', well.name), span('does', action(well))),
    element('td', { className: 'rate' },
      span('digits', number(well.rate_ml_h, 1)), span('unit', ' ml/h')),
    element('td', { className: 'now' },
      span('was', past(setpoint.confirmed ? 'set' : 'was', well.before_ml_h)),
      span('measured', past('measured', measured))));
}

/* One input for every well; entered values survive a new setpoint. */
function renderInputs(root, wells) {
  const box = find('#other-rates', root);
  if (hasChanged(box, wells.map((well) => well.name))) {
    box.replaceChildren(...wells.map((well) => {
      const unit = element('span', { textContent: ' ml/h' });
      const input = element('input', { type: 'number', step: 'any', name: well.name });
      return element('label', {}, element('span', {}, well.name, unit), input);
    }));
  }
  box.querySelectorAll('input').forEach((input, i) => {
    const rate = wells[i].rate_ml_h;
    input.placeholder = isNumber(rate) ? rate.toFixed(1) : '';
  });
}

export function validityText(setpoint) {
  const remaining = setpoint.remaining_s;
  if (remaining > 0) return `valid for ${duration(remaining)}`;
  const consequence = setpoint.pumps_report
    ? 'the rig is at its safe rates' : 'switch the control wells off';
  return `expired ${duration(-remaining)} ago: ${consequence}`;
}

function renderValidity(root, setpoint) {
  const box = find('#validity', root);
  const remaining = setpoint.remaining_s;
  const known = remaining !== null;
  const expired = known && remaining <= 0;
  box.hidden = !known;
  root.classList.toggle('expired-setpoint', expired);
  if (!known) return;
  const part = setpoint.validity_s > 0
    ? Math.min(1, Math.max(0, remaining / setpoint.validity_s)) : 0;
  box.classList.toggle('short', part < SHORT_VALIDITY);
  box.classList.toggle('expired', expired);
  find('#validity-bar div', root).style.width = `${100 * part}%`;
  setText(find('#validity-text', root), validityText(setpoint));
}

function renderButton(root, setpoint, confirmation, lost) {
  find('#confirmation', root).hidden = setpoint.pumps_report;
  const button = find('#done', root);
  const { words, calm, late, disabled } = confirmation.button(setpoint, lost);
  button.classList.toggle('calm', calm);
  button.classList.toggle('late', late);
  button.disabled = disabled;
  if (button.textContent !== words.join('')) {
    button.replaceChildren(words[0], element('small', { textContent: words[1] }));
  }
  const answer = find('#answer', root);
  answer.className = confirmation.answer.level;
  setText(answer, confirmation.answer.text);
}
