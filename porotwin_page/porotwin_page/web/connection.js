/* The stream of events: opened, watched, and opened again after a loss. */

export const QUIET_LIMIT_MS = 5000;  // the server sends every second; longer silence is a loss
export const CHECK_PERIOD_MS = 1500;

const CLOSED = 2;  // EventSource.CLOSED

export class Connection {
  /* open: returns a new EventSource; receive: takes an event; changed: is called after a loss;
     isHidden: whether nobody looks at the page; now: returns milliseconds. */
  constructor({ open, receive, changed, isHidden, now = Date.now }) {
    Object.assign(this, { open, receive, changed, isHidden, now });
    this.source = null;
    this.lastEvent = now();
    this.lastRetry = null;
  }

  get lost() {
    return this.now() - this.lastEvent > QUIET_LIMIT_MS;
  }

  /* Time since the last event [s], once the connection is lost; before, the page is up to date. */
  get silence() {
    return this.lost ? (this.now() - this.lastEvent) / 1000 : 0;
  }

  connect() {
    if (this.source) this.source.close();
    this.source = this.open();
    this.source.onmessage = (message) => {
      this.lastEvent = this.now();
      this.receive(JSON.parse(message.data));
    };
  }

  /* Opens a lost stream again, also where the browser has given up. */
  check() {
    if (this.isHidden()) return;
    const closed = !this.source || this.source.readyState === CLOSED;
    if (!closed && !this.lost) return;
    this.changed();
    if (closed || this.lastRetry === null || this.now() - this.lastRetry > QUIET_LIMIT_MS) {
      this.lastRetry = this.now();
      this.connect();
    }
  }

  /* A hidden page needs no stream. Shown again, it is as old as its last event until the next one. */
  visibilityChanged() {
    if (this.isHidden()) {
      if (this.source) this.source.close();
    } else {
      this.lastRetry = this.now();
      this.connect();
      this.changed();
    }
  }
}
