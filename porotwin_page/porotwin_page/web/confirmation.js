/* The confirmation of a setpoint: when the button works, its words, and the request. */

export const CHANGE_GUARD_MS = 1500;  // a button must not change its meaning under a finger

const MOST_NAMES = 3;

export class Confirmation {
  /* now: returns milliseconds; later: calls a function after milliseconds; changed: is called when
     the button changes by itself. */
  constructor({ now = Date.now, later = setTimeout, changed }) {
    Object.assign(this, { now, later, changed });
    this.sending = false;
    this.answer = { level: '', text: '' };
    this.rates = null;
    this.guardUntil = 0;
  }

  get guarded() {
    return this.now() < this.guardUntil;
  }

  /* Takes the newest setpoint; other rates than before block the button for a moment. */
  show(setpoint) {
    const rates = setpoint.wells.map((well) => `${well.name} ${well.rate_ml_h}`).join();
    if (this.rates !== null && this.rates !== rates) {
      this.guardUntil = this.now() + CHANGE_GUARD_MS;
      this.later(this.changed, CHANGE_GUARD_MS + 20);
      this.answer = { level: '', text: '' };
    }
    this.rates = rates;
  }

  /* Sends the confirmation; `otherRates` [ml/h] are the wells that differ from the setpoint.
     Returns whether it was accepted. */
  async send(setpoint, otherRates, post) {
    if (this.sending || this.guarded) return false;
    this.sending = true;
    this.changed();
    let accepted = false;
    try {
      const answer = await post({ sequence: setpoint.sequence, rates_ml_h: otherRates });
      this.answer = { level: 'ok', text: answer.message };
      accepted = true;
    } catch (error) {
      this.answer = { level: 'error', text: `Not confirmed: ${error.message}` };
    }
    this.sending = false;
    this.changed();
    return accepted;
  }

  /* The button: words, small words, and whether it is calm, late or disabled. */
  button(setpoint, lost) {
    const changed = setpoint.wells.filter((well) => well.changed);
    const calm = changed.length === 0 || setpoint.confirmed;
    const expired = setpoint.remaining_s !== null && setpoint.remaining_s <= 0;
    return {
      words: this.words(setpoint, changed, calm),
      calm,
      late: !calm && expired,
      disabled: this.sending || this.guarded || lost,
    };
  }

  words(setpoint, changed, calm) {
    if (this.sending) return ['Sending', ''];
    if (this.guarded) return ['New setpoint', 'look again before you confirm'];
    if (calm && setpoint.confirmed) {
      return ['✔ Confirmed', `setpoint ${setpoint.sequence}; press to confirm again`];
    }
    if (calm) return ['✔ Nothing to set', 'press to confirm again'];
    return ['Done', `${namesOf(changed)} set as shown`];
  }
}

function namesOf(wells) {
  if (wells.length > MOST_NAMES) return `${wells.length} pumps`;
  return wells.map((well) => well.name).join(', ');
}

/* Sends JSON to `url`; raises an Error with the server's message if it is refused. */
export async function postJson(url, body) {
  const response = await fetch(url, {
    method: 'POST', headers: { 'Content-Type': 'application/json' }, body: JSON.stringify(body),
  });
  const answer = await response.json();
  if (!response.ok) throw new Error(answer.error);
  return answer;
}
