/* Draws the rates to set, their validity, and the button that confirms them. */

import { allRates, Confirmation, netRate, postJson, WrongToken } from '../web/confirmation.js';
import { element, find, hasChanged, setText } from '../web/dom.js';
import { duration, isNumber, number, setting, signed } from '../web/formatting.js';

const SHORT_VALIDITY = 0.34;  // below this part the bar changes its colour

const BODY = `
  <p id="no-setpoint">No setpoint yet.</p>
  <p id="order-doubt" class="error" role="alert" hidden></p>
  <p id="safe-title" class="error" role="alert" hidden></p>
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
      <p id="net-rate"></p>
    </details>
  </form>
  <div id="question" role="alertdialog" aria-labelledby="question-text" hidden>
    <p id="question-text"></p>
    <button id="question-yes" type="button">Yes, record them</button>
    <button id="question-no" type="button">No, correct them</button>
  </div>
  <form id="token" hidden>
    <label for="token-text">To confirm, type the token that ./porotwin up shows:</label>
    <input id="token-text" autocomplete="off" autocapitalize="none" spellcheck="false">
    <button type="submit">Use it</button>
  </form>
  <p id="answer" role="status" aria-live="assertive"></p>
  <p id="next-change" role="timer" hidden></p>
  <p id="bottle" hidden></p>
  <p id="reason"></p>`;

export function create(root, declaration, page) {
  root.insertAdjacentHTML('beforeend', BODY);
  const confirmation = new Confirmation({ changed: page.refresh });
  const current = () => page.state.event && page.state.event.panels[declaration.name];
  attachConfirmation(root, confirmation, current, page);
  attachToken(root, confirmation, page);
  return (newest) => {
    const setpoint = newest && later(newest, page.connection.silence);
    document.title = pageTitle(setpoint);
    find('#no-setpoint', root).hidden = Boolean(setpoint);
    for (const id of ['#rates', '#validity', '#confirmation']) find(id, root).hidden = !setpoint;
    setText(find('.caption', root), setpoint ? `setpoint ${setpoint.sequence}` : '');
    setText(find('#reason', root), setpoint ? reason(setpoint) : '');
    renderLine(find('#next-change', root), setpoint ? nextChange(setpoint) : '');
    renderLine(find('#bottle', root), setpoint ? bottleLine(setpoint) : '');
    renderLine(find('#order-doubt', root), setpoint ? setpoint.doubt : '');
    renderLine(find('#safe-title', root), setpoint ? safeTitle(setpoint) : '');
    if (!setpoint) return;
    confirmation.show(setpoint);
    renderRates(root, setpoint);
    renderValidity(root, setpoint, page.connection.lost);
    renderButton(root, setpoint, confirmation, page);
  };
}

function attachConfirmation(root, confirmation, current, page) {
  const post = async (body) => {
    try {
      return await postJson('/confirm', body, page.token.value);
    } catch (error) {
      if (error instanceof WrongToken) page.token.drop();
      throw error;
    }
  };
  const clear = (accepted) => {
    if (!accepted) return;
    find('#confirmation', root).reset();
    find('#confirmation details', root).open = false;
    page.refresh();
  };
  find('#confirmation', root).addEventListener('submit', async (event) => {
    event.preventDefault();
    const setpoint = current();
    if (!setpoint) return;
    const wrong = wrongInput(root);
    if (wrong) {
      confirmation.refuse(`${wrong}: type a number of ml/h`);
      page.refresh();
      return;
    }
    clear(await confirmation.send(setpoint, enteredRates(root), post));
  });
  find('#other-rates', root).addEventListener('input', () => page.refresh());
  find('#question-yes', root).addEventListener('click', async () => {
    clear(await confirmation.decide(true, post));
  });
  find('#question-no', root).addEventListener('click', () => confirmation.decide(false, post));
}

function attachToken(root, confirmation, page) {
  find('#token', root).addEventListener('submit', (event) => {
    event.preventDefault();
    const input = find('#token-text', root);
    if (!page.token.take(input.value)) confirmation.refuse('this is no token');
    input.value = '';
    page.refresh();
  });
}

function renderLine(target, text) {
  target.hidden = !text;
  setText(target, text);
}

/* The setpoint as it is after `silence` seconds without a connection. */
export function later(setpoint, silence) {
  if (!silence || setpoint.remaining_s === null) return setpoint;
  const next = setpoint.next_change;
  const next_change = next && { ...next, in_s: next.in_s - silence };
  return { ...setpoint, next_change, remaining_s: setpoint.remaining_s - silence };
}

/* The next begin or end of an announced pause, in words. */
export function nextChange(setpoint) {
  const next = setpoint.next_change;
  if (!next) return '';
  const told = [...next.rest.map((well) => `${well} rests`), ...next.run.map((well) => `${well} runs`)];
  return `In ${duration(next.in_s)}: ${told.join(', ')}.`;
}

/* The tracer stock in its bottle, in words. */
export function bottleLine(setpoint) {
  const bottle = setpoint.bottle;
  if (!bottle) return '';
  const end = bottle.empty_in_s === null ? '' : `, empty in ${duration(bottle.empty_in_s)}`;
  return bottle.left_ml > 0 ? `Stock in the bottle: ${number(bottle.left_ml, 0)} ml${end}.`
    : 'Stock in the bottle: by the plan it is empty.';
}

/* Title of the browser's tab, with the number of pumps to set. */
export function pageTitle(setpoint) {
  const done = !setpoint || setpoint.pumps_report || setpoint.confirmed || setpoint.doubt;
  if (done) return 'PoroTwin';
  const count = setpoint.wells.filter((well) => well.changed).length;
  return count ? `(${count}) set the pumps · PoroTwin` : 'PoroTwin';
}

function reason(setpoint) {
  const follow = setpoint.pumps_report ? 'The pumps follow and report by themselves. ' : '';
  const why = setpoint.reason && !setpoint.safe ? `Why: ${setpoint.reason}` : '';
  return follow + why;
}

/* What to do after the end of a setpoint; empty while it is valid. */
export function safeTitle(setpoint) {
  if (!setpoint.expired || setpoint.doubt) return '';
  const over = `Setpoint ${setpoint.sequence} has expired and none followed.`;
  if (setpoint.pumps_report) return `${over} The rig is at its safe rates.`;
  if (!setpoint.safe) return `${over} The safe rates are not known: rig.yaml has no control section.`;
  if (setpoint.wells.some((well) => well.changed) && !setpoint.confirmed) {
    return `${over} Set the safe rates, at every well:`;
  }
  return `${over} The safe rates are set.`;
}

/* Name of a well with a text that is no number; the browser gives such a text as empty. */
function wrongInput(root) {
  const inputs = [...root.querySelectorAll('#other-rates input')];
  return inputs.find((input) => input.validity.badInput)?.name;
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
  const { wells, pumps_report: report, confirmed, doubt } = setpoint;
  if (!hasChanged(body, [wells, report, confirmed, doubt])) return;
  body.replaceChildren(...wells.map((well) => ratesRow(well, setpoint)));
  renderInputs(root, wells);
}

function ratesRow(well, setpoint) {
  const span = (className, textContent) => element('span', { className }, textContent);
  const changed = setpoint.pumps_report ? 'moved' : 'changed';
  const marked = well.changed && !setpoint.confirmed && !setpoint.doubt;
  const measured = setpoint.pumps_report ? well.measured_ml_h : null;
  const past = (word, value, text) => (isNumber(value) ? `${word} ${text(value)}` : '');
  return element('tr', { className: marked ? changed : '' },
    element('td', {}, span('well', well.name), span('does', action(well))),
    element('td', { className: 'rate' },
      span('digits', setting(well.rate_ml_h)), span('unit', ' ml/h')),
    element('td', { className: 'now' },
      span('was', past(setpoint.confirmed ? 'set' : 'was', well.before_ml_h, setting)),
      span('measured', past('measured', measured, (rate) => number(rate, 1)))));
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
    input.placeholder = isNumber(rate) ? setting(rate) : '';
  });
}

/* The sum of all rates that a confirmation would record. */
export function netText(rates) {
  return `An empty field means the rate above. Together: ${signed(netRate(rates), 1)} ml/h.`;
}

export function validityText(setpoint, lost = false) {
  const remaining = setpoint.remaining_s;
  if (remaining > 0) return `valid for ${duration(remaining)}${lost ? ', but not connected' : ''}`;
  const past = `expired ${duration(-remaining)} ago`;
  return lost && !setpoint.expired
    ? `${past}, and the page is not connected: do not follow these rates` : past;
}

function renderValidity(root, setpoint, lost) {
  const box = find('#validity', root);
  const remaining = setpoint.remaining_s;
  const known = remaining !== null;
  const expired = known && remaining <= 0;
  box.hidden = !known || Boolean(setpoint.doubt);
  const notToFollow = (expired && !setpoint.safe && !setpoint.pumps_report) || setpoint.doubt;
  root.classList.toggle('expired-setpoint', Boolean(notToFollow));
  root.classList.toggle('safe-rates', setpoint.safe);
  if (!known) return;
  const part = setpoint.validity_s > 0
    ? Math.min(1, Math.max(0, remaining / setpoint.validity_s)) : 0;
  box.classList.toggle('short', part < SHORT_VALIDITY);
  box.classList.toggle('expired', expired);
  find('#validity-bar div', root).style.width = `${100 * part}%`;
  setText(find('#validity-text', root), validityText(setpoint, lost));
}

function renderButton(root, setpoint, confirmation, page) {
  const byHand = !setpoint.pumps_report && !setpoint.doubt;
  find('#confirmation', root).hidden = !byHand;
  find('#token', root).hidden = !byHand || Boolean(page.token.value);
  const rates = enteredRates(root);
  const state = {
    lost: page.connection.lost,
    entered: Object.keys(rates).length,
    token: Boolean(page.token.value),
  };
  const button = find('#done', root);
  const { words, calm, late, disabled } = confirmation.button(setpoint, state);
  button.classList.toggle('calm', calm);
  button.classList.toggle('late', late);
  button.disabled = disabled;
  if (button.textContent !== words.join('')) {
    button.replaceChildren(words[0], element('small', { textContent: words[1] }));
  }
  setText(find('#net-rate', root), netText(allRates(setpoint, rates)));
  find('#question', root).hidden = !confirmation.question;
  setText(find('#question-text', root), confirmation.question ? confirmation.question.text : '');
  const answer = find('#answer', root);
  answer.className = confirmation.answer.level;
  setText(answer, confirmation.answer.text);
}
