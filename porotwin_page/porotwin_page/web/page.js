/* The page: connects to the server and draws header and panels with every event. */

import { CHECK_PERIOD_MS, Connection } from './connection.js';
import { find, setText } from './dom.js';
import { renderHeader } from './header.js';
import { assemble } from './panels.js';
import { PageState } from './state.js';
import { Theme } from './theme.js';

const darkRoom = matchMedia('(prefers-color-scheme: dark)');

/* What panels may use: the newest event and the curves' points, the theme, the connection, and a
   function that draws everything again. */
const page = {
  state: new PageState(),
  theme: new Theme(() => localStorage, () => darkRoom.matches),
  connection: new Connection({
    open: () => new EventSource('/events'),
    receive: (event) => { page.state.receive(event); render(); },
    changed: () => render(),
    isHidden: () => document.hidden,
  }),
  refresh: () => render(),
};

let renderPanels = () => {};

function render() {
  const { event } = page.state;
  renderHeader(event && event.header, page.connection.lost);
  if (event) renderPanels(event.panels);
}

function applyTheme() {
  document.documentElement.dataset.theme = page.theme.name;
  const button = find('#theme');
  setText(button, `◐ ${page.theme.choice}`);
  button.setAttribute('aria-label', `colours: ${page.theme.choice}; change`);
  render();
}

async function start() {
  find('#theme').addEventListener('click', () => { page.theme.next(); applyTheme(); });
  darkRoom.addEventListener('change', applyTheme);
  applyTheme();
  renderPanels = await assemble(JSON.parse(find('#declarations').textContent), page);
  setInterval(() => page.connection.check(), CHECK_PERIOD_MS);
  document.addEventListener('visibilitychange', () => page.connection.visibilityChanged());
  new ResizeObserver(render).observe(document.body);
  page.connection.connect();
}

start();
