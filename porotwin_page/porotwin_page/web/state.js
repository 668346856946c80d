/* The newest event of the server, and all points of the curves. */

export const POINTS_KEPT = 1440;  // as HISTORY_LENGTH of the server

export class PageState {
  constructor() {
    this.event = null;
    this.points = [];
    this.firstPoint = 0;  // number of points[0] in the server's count
  }

  /* Takes an event. Its history replaces all points from number `begin` on; its panels are those
     that changed. */
  receive(event) {
    const known = this.event && this.event.run === event.run ? this.event.panels : {};
    this.event = { ...event, panels: { ...known, ...event.panels } };
    const history = event.history;
    if (history.reset) {
      this.points = [];
      this.firstPoint = history.begin;
    }
    this.points.length = Math.min(this.points.length, history.begin - this.firstPoint);
    this.points.push(...history.points);
    const surplus = Math.max(0, this.points.length - POINTS_KEPT);
    this.points.splice(0, surplus);
    this.firstPoint += surplus;
  }
}
