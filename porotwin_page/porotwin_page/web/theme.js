/* Colours for light and dark rooms: the choice of the browser, or of the user. */

const CHOICES = ['auto', 'light', 'dark'];
const STORAGE_KEY = 'porotwin-theme';

export class Theme {
  /* storage: keeps the choice, may be forbidden; isDark: what the browser prefers. */
  constructor(storage, isDark) {
    this.storage = storage;
    this.isDark = isDark;
    this.choice = this.stored();
  }

  get name() {
    if (this.choice !== 'auto') return this.choice;
    return this.isDark() ? 'dark' : 'light';
  }

  next() {
    this.choice = CHOICES[(CHOICES.indexOf(this.choice) + 1) % CHOICES.length];
    try {
      this.storage().setItem(STORAGE_KEY, this.choice);
    } catch { /* a private window keeps nothing */ }
  }

  stored() {
    try {
      const choice = this.storage().getItem(STORAGE_KEY);
      return CHOICES.includes(choice) ? choice : 'auto';
    } catch {
      return 'auto';
    }
  }
}
