/* Numbers, durations and times as text. */

export const DASH = '–';

/* Stamps above this are seconds since 1970, below it seconds since the start of a run. */
export const FIRST_ABSOLUTE_STAMP_S = 1e9;

const DAY_S = 86400;
const LONGEST_RUN_S = 30 * DAY_S;

export const isNumber = (value) => typeof value === 'number' && Number.isFinite(value);

/* A number with fixed digits and a real minus sign. */
export function number(value, digits) {
  if (!isNumber(value)) return DASH;
  const text = Math.abs(value).toFixed(digits);
  return value < 0 && Number(text) !== 0 ? `−${text}` : text;
}

/* A rate in ml/h as a person sets it at a pump: with one to three decimals, as many as it has. */
export function setting(value) {
  return number(value, 3).replace(/0{1,2}$/, '');
}

/* A number with its sign, also a positive one. */
export function signed(value, digits) {
  return isNumber(value) && value > 0 ? `+${number(value, digits)}` : number(value, digits);
}

/* A number with about three significant digits. */
export function short(value) {
  if (!isNumber(value)) return DASH;
  const size = Math.abs(value);
  if (size >= 100) return number(value, 0);
  if (size >= 10) return number(value, 1);
  return number(value, size >= 0.095 || size === 0 ? 2 : 3);
}

export function duration(seconds) {
  if (!isNumber(seconds)) return DASH;
  const whole = Math.max(0, Math.floor(seconds));
  const pad = (value) => String(value).padStart(2, '0');
  if (whole < 60) return `${whole} s`;
  if (whole < 3600) return `${Math.floor(whole / 60)}:${pad(whole % 60)} min`;
  if (whole < 2 * DAY_S) return `${Math.floor(whole / 3600)}:${pad(Math.floor(whole / 60) % 60)} h`;
  return `${Math.floor(whole / DAY_S)} days`;
}

/* The local time of a stamp, with the date if it is more than a day away. */
export function clockTime(seconds, nowMs = Date.now()) {
  if (!isNumber(seconds)) return DASH;
  if (seconds < FIRST_ABSOLUTE_STAMP_S) return `t = ${duration(seconds)}`;
  const date = new Date(seconds * 1000);
  const time = date.toLocaleTimeString('en-GB');
  const isOtherDay = Math.abs(nowMs / 1000 - seconds) > DAY_S;
  return isOtherDay ? `${date.toLocaleDateString('sv-SE')} ${time}` : time;
}

/* The time since the start of the experiment; empty for stamps that count from it, and for a start
   with a wrong clock. */
export function afterStart(seconds, startSeconds) {
  if (!isNumber(seconds) || !isNumber(startSeconds) || seconds < FIRST_ABSOLUTE_STAMP_S) return '';
  if (seconds < startSeconds || seconds - startSeconds > LONGEST_RUN_S) return '';
  return `after ${number((seconds - startSeconds) / 60, 1)} min`;
}
