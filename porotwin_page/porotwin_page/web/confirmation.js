/* The confirmation of rates: when the button works, its words, the request, and a question. */

export const CHANGE_GUARD_MS = 1500;  // a button must not change its meaning under a finger

const MOST_NAMES = 3;
const NOTHING = { level: '', text: '' };

/* The rates of all wells: those that were entered, and the shown ones for the others. What the
   page shows is what is recorded. */
export function allRates(setpoint, entered) {
  return Object.fromEntries(
    setpoint.wells.map((well) => [well.name, entered[well.name] ?? well.rate_ml_h]));
}

/* More goes in than out by so many ml/h. */
export function netRate(rates) {
  return Object.values(rates).reduce((sum, rate) => sum + rate, 0);
}

export class Confirmation {
  /* now: returns milliseconds; later: calls a function after milliseconds; changed: is called when
     the button changes by itself. */
  constructor({ now = Date.now, later, changed }) {
    // a browser's setTimeout works only as a function of the window
    Object.assign(this, { now, later: later ?? ((call, ms) => setTimeout(call, ms)), changed });
    this.sending = false;
    this.answer = NOTHING;
    this.question = null;  // { text, body }, of the server
    this.rates = null;
    this.guardUntil = 0;
  }

  get guarded() {
    return this.now() < this.guardUntil;
  }

  /* Takes the newest orders; other rates than before block the button for a moment. */
  show(setpoint) {
    const rates = setpoint.wells.map((well) => `${well.name} ${well.rate_ml_h}`).join();
    if (this.rates !== null && this.rates !== rates) {
      this.guardUntil = this.now() + CHANGE_GUARD_MS;
      this.later(this.changed, CHANGE_GUARD_MS + 20);
      this.answer = NOTHING;
      this.question = null;
    }
    if (this.question) this.question.body.sequence = setpoint.sequence;
    this.rates = rates;
  }

  /* Sends the rates of all wells; `entered` [ml/h] are those that differ from the shown ones.
     Returns whether they were accepted. */
  async send(setpoint, entered, post) {
    if (this.sending || this.guarded) return false;
    const { sequence, safe } = setpoint;
    const orders = safe ? 'safe' : 'setpoint';
    return this.request({ sequence, orders, rates_ml_h: allRates(setpoint, entered) }, post);
  }

  /* Answers the question of the server: yes sends the rates again. */
  async decide(yes, post) {
    if (!this.question || this.sending) return false;
    const { body } = this.question;
    this.question = null;
    if (yes) return this.request({ ...body, sure: true }, post);
    this.answer = { level: 'warn', text: 'Not confirmed: correct the rates.' };
    this.changed();
    return false;
  }

  async request(body, post) {
    this.sending = true;
    this.answer = NOTHING;
    this.question = null;
    this.changed();
    let accepted = false;
    try {
      const answer = await post(body);
      if (answer.question) this.question = { text: answer.question, body };
      else this.answer = { level: 'ok', text: answer.message };
      accepted = !answer.question;
    } catch (error) {
      this.refuse(error.message);
    }
    this.sending = false;
    this.changed();
    return accepted;
  }

  refuse(reason) {
    this.answer = { level: 'error', text: `Not confirmed: ${reason}` };
  }

  /* The button: words, small words, and whether it is calm, late or disabled. */
  button(setpoint, { lost = false, entered = 0, token = true } = {}) {
    const changed = setpoint.wells.filter((well) => well.changed);
    const calm = entered === 0 && (changed.length === 0 || setpoint.confirmed);
    const asked = this.question !== null;
    return {
      words: this.words(setpoint, changed, calm, entered),
      calm,
      late: !calm && setpoint.expired && !setpoint.safe,
      disabled: this.sending || this.guarded || lost || asked || !token,
    };
  }

  words(setpoint, changed, calm, entered) {
    const what = setpoint.safe ? 'safe rates' : `setpoint ${setpoint.sequence}`;
    if (this.sending) return ['Sending', ''];
    if (this.guarded) return ['New rates', 'look again before you confirm'];
    if (entered) return ['Done', `with your ${entered === 1 ? 'number' : 'numbers'}`];
    if (calm && setpoint.confirmed) return ['✔ Confirmed', `${what}; press to confirm again`];
    if (calm) return ['✔ Nothing to set', 'press to confirm again'];
    if (setpoint.safe) return ['I have set these', `safe rates: ${namesOf(changed)}`];
    return ['Done', `${namesOf(changed)} set as shown`];
  }
}

function namesOf(wells) {
  if (wells.length > MOST_NAMES) return `${wells.length} pumps`;
  return wells.map((well) => well.name).join(', ');
}

export class WrongToken extends Error {}

/* Sends JSON to `url`; returns the answer or a question. Raises an Error with the server's message
   if it is refused, a WrongToken if the token was. */
export async function postJson(url, body, token) {
  const headers = { 'Content-Type': 'application/json', Authorization: `Bearer ${token}` };
  const response = await fetch(url, { method: 'POST', headers, body: JSON.stringify(body) });
  const answer = await response.json();
  if (response.ok || answer.question) return answer;
  throw response.status === 403 ? new WrongToken(answer.error) : new Error(answer.error);
}
