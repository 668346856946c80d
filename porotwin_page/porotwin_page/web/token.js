/* The token of confirmations: taken from the address that `./porotwin up` shows, kept by the tab. */

const STORAGE_KEY = 'porotwin-token';

/* The token in a text: after token= in an address, or the text itself; empty if there is none. */
export function tokenIn(text) {
  const found = /[#&?]token=([^&\s]*)/.exec(text);
  if (!found && text.includes('/')) return '';  // an address without a token
  const token = (found ? decoded(found[1]) : text).trim();
  return /^[\x21-\x7e]+$/.test(token) ? token : '';
}

/* The text that `quoted` stands for; empty if somebody changed it to nonsense. */
function decoded(quoted) {
  try {
    return decodeURIComponent(quoted);
  } catch {
    return '';
  }
}

export class Token {
  /* storage: keeps the token, may be forbidden; address: its fragment is read and removed. */
  constructor(storage, { hash, forget }) {
    this.storage = storage;
    this.value = this.stored();
    if (hash.includes('token=')) {
      this.take(hash);
      forget();
    }
  }

  /* Keeps the token in `text`, an address or the token alone; returns whether there is one. */
  take(text) {
    const token = tokenIn(text);
    if (!token) return false;
    this.value = token;
    try {
      this.storage().setItem(STORAGE_KEY, token);
    } catch { /* a private window keeps nothing */ }
    return true;
  }

  /* Forgets a token that was refused. */
  drop() {
    this.value = '';
    try {
      this.storage().removeItem(STORAGE_KEY);
    } catch { /* nothing was kept */ }
  }

  stored() {
    try {
      return this.storage().getItem(STORAGE_KEY) ?? '';
    } catch {
      return '';
    }
  }
}
