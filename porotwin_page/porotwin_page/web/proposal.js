/* Proposed rates of the control wells, and the question what they would do. */

export const PAUSE_MS = 250;  // a slider that moves asks only when it rests
const RETRY_MS = 1000;  // while the server answers another browser
const ROUND_OFF = 1e-6;

/* The rate of one well within its own limit and what the others leave of the limit for all. */
export function clamped(rates, well, value, { max_rate_ml_h: most, max_total_ml_h: total }) {
  const others = Object.entries(rates)
    .reduce((sum, [name, rate]) => (name === well ? sum : sum + rate), 0);
  const left = Math.max(0, total - others);
  return Math.max(0, Math.min(value, most, Math.floor(left * 10 + ROUND_OFF) / 10));
}

/* The rates of the control wells in a forecast. */
export function presentRates({ wells, present }) {
  return Object.fromEntries(wells.map((well) => [well, present.rates_ml_h[well] ?? 0]));
}

export class Proposal {
  /* ask: returns a promise of the answer to rates; changed: is called with every change;
     later, never: as setTimeout and clearTimeout. */
  constructor({ ask, changed, later = (call, ms) => setTimeout(call, ms),
    never = (timer) => clearTimeout(timer) }) {
    Object.assign(this, { ask, changed, later, never });
    this.rates = null;  // null: nothing is proposed
    this.answer = null;
    this.fault = '';
    this.asking = false;
    this.timer = null;
    this.state = null;
  }

  /* Proposes another rate of one well. */
  set(well, value, content) {
    this.rates ??= presentRates(content);
    this.rates[well] = clamped(this.rates, well, value, content);
    this.askLater(PAUSE_MS);
    this.changed();
  }

  /* Proposes nothing any more. */
  reset() {
    this.never(this.timer);
    Object.assign(this, { rates: null, answer: null, fault: '', timer: null });
    this.changed();
  }

  /* Takes the time of the newest forecast: the question is asked again from there. */
  follow(time) {
    if (this.state === time) return;
    this.state = time;
    if (this.rates && !this.fault) this.askLater(0);
  }

  askLater(ms) {
    this.never(this.timer);
    this.timer = this.later(() => { this.timer = null; this.send(); }, ms);
  }

  async send() {
    if (!this.rates) return;
    if (this.asking) {
      this.askLater(PAUSE_MS);
      return;
    }
    this.asking = true;
    this.changed();
    const asked = this.rates;
    try {
      const answer = await this.ask({ ...asked });
      if (this.rates) Object.assign(this, { answer, fault: '' });
    } catch (error) {
      if (error.busy) this.askLater(RETRY_MS);
      else if (this.rates) Object.assign(this, { answer: null, fault: error.message });
    }
    this.asking = false;
    this.changed();
  }
}
