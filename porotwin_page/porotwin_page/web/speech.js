/* The voice of the browser: speaks every order once, after somebody switched it on. */

const STORAGE_KEY = 'porotwin-speech';

/* 'control 2' for 'control2', so that a voice reads the number by itself. */
const spokenName = (well) => well.replace(/[_-]/g, ' ').replace(/(\d+)$/, ' $1').replace(/ +/g, ' ');

const spokenRate = (rate) => `${rate < 0 ? 'minus ' : ''}${Number(Math.abs(rate).toFixed(3))}`;

/* The orders in words; empty if no pump must be set by hand. */
export function speechText(setpoint) {
  if (setpoint.pumps_report || setpoint.confirmed || setpoint.doubt) return '';
  const changed = setpoint.wells.filter((well) => well.changed);
  if (!changed.length) return '';
  const orders = changed.map((w) => `${spokenName(w.name)} to ${spokenRate(w.rate_ml_h)}`);
  const opening = setpoint.safe ? 'The setpoint has expired. ' : '';
  return `${opening}Set ${orders.join(', ')}.`;
}

export class Speech {
  /* voice: speaks a text; null where the browser has none. storage: keeps the switch. */
  constructor(voice, storage) {
    Object.assign(this, { voice, storage });
    this.on = voice !== null && this.stored();
    this.spoken = null;
  }

  toggle() {
    this.on = !this.on;
    this.spoken = null;
    try {
      this.storage().setItem(STORAGE_KEY, this.on ? 'on' : 'off');
    } catch { /* a private window keeps nothing */ }
  }

  /* Speaks the orders of a setpoint unless they were spoken before. A restarted hub counts from one
     again; the time of the photograph tells its setpoints from earlier ones. */
  say(run, setpoint) {
    if (!this.on || !setpoint) return;
    const key = `${run} ${setpoint.sequence} ${setpoint.time_s} ${setpoint.safe}`;
    if (this.spoken === key) return;
    this.spoken = key;
    const text = speechText(setpoint);
    if (text) this.voice(text);
  }

  stored() {
    try {
      return this.storage().getItem(STORAGE_KEY) === 'on';
    } catch {
      return false;
    }
  }
}

/* A function that speaks with the browser's voice, the newest text first; null without a voice. */
export function browserVoice(window) {
  if (!window.speechSynthesis || !window.SpeechSynthesisUtterance) return null;
  return (text) => {
    const words = new window.SpeechSynthesisUtterance(text);
    words.lang = 'en';
    window.speechSynthesis.cancel();
    window.speechSynthesis.speak(words);
  };
}
