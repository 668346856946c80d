/* The page: connects to the server and draws header and panels with every event. */

import { CHECK_PERIOD_MS, Connection } from './connection.js';
import { find, setText } from './dom.js';
import { renderHeader } from './header.js';
import { assemble } from './panels.js';
import { Past } from './past.js';
import { browserVoice, Speech } from './speech.js';
import { offerRigs, PERIOD_MS } from './rigs.js';
import { PageState } from './state.js';
import { Theme } from './theme.js';
import { createTimeSlider } from './time_slider.js';
import { Token } from './token.js';

const darkRoom = matchMedia('(prefers-color-scheme: dark)');

/* What panels may use: the newest event and the curves' points, the earlier state that is shown,
   the theme, the token, the connection, and a function that draws everything again. */
const page = {
  state: new PageState(),
  past: new Past({ load: loadPast, changed: () => render() }),
  theme: new Theme(() => localStorage, () => darkRoom.matches),
  token: new Token(() => sessionStorage, {
    hash: location.hash,
    forget: () => history.replaceState(null, '', location.pathname),
  }),
  speech: new Speech(browserVoice(window), () => localStorage),
  connection: new Connection({
    open: () => new EventSource('/events'),
    receive: (event) => { page.state.receive(event); render(); },
    changed: () => render(),
    isHidden: () => document.hidden,
  }),
  refresh: () => render(),
};

let renderPanels = () => {};

async function loadPast(number) {
  const response = await fetch(`/past?state=${number}`);
  if (!response.ok) throw new Error(await response.text());
  return response.json();
}

function render() {
  const { event } = page.state;
  renderHeader(event && event.header, page.connection.lost);
  if (!event) return;
  renderPanels(event.panels);
  page.speech.say(event.run, event.panels.pump_settings);
}

function applyTheme() {
  document.documentElement.dataset.theme = page.theme.name;
  const button = find('#theme');
  setText(button, `◐ ${page.theme.choice}`);
  button.setAttribute('aria-label', `colours: ${page.theme.choice}; change`);
  render();
}

function applySpeech() {
  const button = find('#speech');
  button.hidden = page.speech.voice === null;
  setText(button, page.speech.on ? 'voice on' : 'voice off');
  button.setAttribute('aria-pressed', page.speech.on);
  button.setAttribute('aria-label', 'speak the rates to set');
  render();
}

async function start() {
  find('#theme').addEventListener('click', () => { page.theme.next(); applyTheme(); });
  find('#speech').addEventListener('click', () => { page.speech.toggle(); applySpeech(); });
  darkRoom.addEventListener('change', applyTheme);
  window.addEventListener('hashchange', () => {
    if (page.token.take(location.hash)) history.replaceState(null, '', location.pathname);
    render();
  });
  applyTheme();
  const renders = await assemble(JSON.parse(find('#declarations').textContent), page);
  const renderSlider = createTimeSlider(find('#maps'), page);
  renderPanels = (contents) => { renderSlider(); renders(contents); };
  applySpeech();
  setInterval(() => page.connection.check(), CHECK_PERIOD_MS);
  document.addEventListener('visibilitychange', () => page.connection.visibilityChanged());
  new ResizeObserver(render).observe(document.body);
  page.connection.connect();
  offerRigs(find('#rigs'));
  setInterval(() => document.hidden || offerRigs(find('#rigs')), PERIOD_MS);
}

start();
