/* An earlier state that the user looks at: its number, and its maps from the server. */

export class Past {
  /* load: returns a promise of the state with a number; changed: is called when it is there. */
  constructor({ load, changed }) {
    Object.assign(this, { load, changed });
    this.number = null;  // null: the page shows the newest state
    this.content = null;
    this.loading = false;
    this.run = null;  // of the server that counts the states
  }

  /* Selects a state, or null for the newest. At most one request is on its way. */
  async select(number) {
    this.number = number;
    if (number === null) this.content = null;
    this.changed();
    if (this.loading) return;
    this.loading = true;
    while (this.number !== null && this.content?.number !== this.number) {
      const wanted = this.number;
      try {
        const content = await this.load(wanted);
        if (this.number !== null) this.content = { ...content, number: wanted };
      } catch {
        if (this.number === wanted) {  // it is no longer kept
          this.number = null;
          this.content = null;
        }
      }
    }
    this.loading = false;
    this.changed();
  }

  /* Returns to the newest state if the server no longer has the selected one; a new run of the
     server counts its states from one again. */
  check(states, run) {
    const restarted = this.run !== run;
    this.run = run;
    if (this.number === null) return;
    if (restarted || this.number < states.first || this.number > states.last) this.select(null);
  }
}

/* Where the slider stands among the states that are kept, and whether there is anything to slide. */
export function sliderRange(states, number) {
  const { first, last } = states;
  return { min: first, max: last, value: number ?? last, useful: last > first };
}
