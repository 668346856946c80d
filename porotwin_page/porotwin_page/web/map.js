/* A panel with a map of the rig: the picture, the overlay and the colour scale. */

import { draw, element, find, hasChanged, setText } from './dom.js';
import { afterStart, clockTime, DASH, number, signed } from './formatting.js';
import { overlayShapes } from './overlay.js';
import { attachProbe } from './probe.js';

export function create(root, declaration, page) {
  const pictures = element('div', { className: 'pictures' });
  const empty = element('p', { className: 'none', textContent: declaration.empty });
  const frame = element('div', { className: 'map' }, pictures);
  const svg = draw(frame, 'svg', { 'aria-hidden': 'true' });
  frame.append(empty);
  const scale = scaleBar(declaration);
  root.append(frame, scale.bar);
  let shown = null;
  const probe = attachProbe(frame, () => shown, declaration.signed);
  return (newest) => {
    const { event } = page.state;
    const { content, rates, query } = selected(newest, declaration.name, page);
    scale.render(content, page.theme.name);
    frame.classList.toggle('shown', Boolean(content));
    if (event.rig) frame.style.aspectRatio = `${event.rig.width_m} / ${event.rig.height_m}`;
    const words = content ? caption(content, declaration, event.start_s) : '';
    setText(find('.caption', root), words);
    const version = content ? `v=${event.run}-${content.number}${query}` : '';
    shown = content && { url: `/values/${declaration.name}?${version}`, rig: event.rig };
    probe();
    if (!content) return;
    const url = `/map/${declaration.name}.png?theme=${page.theme.name}&${version}`;
    showPicture(pictures, url, declaration.title);
    if (event.rig) renderOverlay(svg, event.rig, rates, declaration);
  };
}

/* The map to show: the newest, or that of the earlier state which the user looks at. */
export function selected(newest, name, { state, past }) {
  if (past.number === null || !past.content) {
    return { content: newest, rates: state.event.rates_ml_h, query: '' };
  }
  const { number: state_number, panels, rates_ml_h: rates } = past.content;
  return { content: panels[name], rates, query: `&state=${state_number}` };
}

/* Time of the map and notes about it. */
export function caption(content, declaration, startSeconds, nowMs = Date.now()) {
  const time = clockTime(content.time_s, nowMs);
  return [
    declaration.time_prefix ? `${declaration.time_prefix} ${time}` : time,
    declaration.large ? afterStart(content.time_s, startSeconds) : '',
    ...content.notes,
  ].filter(Boolean).join(' · ');
}

function scaleBar(declaration) {
  const low = element('span', { className: 'low' });
  const image = element('img', { alt: '' });
  const high = element('span', { className: 'high' });
  const unit = element('span', { className: 'unit', textContent: declaration.unit });
  const bar = element('div', { className: 'scale' }, low, image, high, unit);
  const limit = (value) => (declaration.signed ? signed(value, 2) : number(value, 0));
  const render = (content, theme) => {
    const url = `/scale/${declaration.name}.png?theme=${theme}`;
    if (hasChanged(image, url)) image.src = url;
    setText(low, content ? limit(content.low) : DASH);
    setText(high, content ? limit(content.high) : DASH);
  };
  return { bar, render };
}

/* A new picture replaces the old one when it is loaded, so that nothing flickers. */
function showPicture(box, url, title) {
  if (box.dataset.url === url) return;
  box.dataset.url = url;
  const image = new Image();
  image.alt = title;
  image.onload = () => { if (box.dataset.url === url) box.replaceChildren(image); };
  image.onerror = () => { if (box.dataset.url === url) delete box.dataset.url; };
  image.src = url;
}

function renderOverlay(svg, rig, rates, declaration) {
  const width = svg.clientWidth;
  const height = svg.clientHeight;
  if (!width || !height || !hasChanged(svg, [width, height, rig, rates])) return;
  svg.setAttribute('viewBox', `0 0 ${width} ${height}`);
  svg.replaceChildren();
  const id = `zone-hatch-${declaration.name}`;
  const pattern = draw(draw(svg, 'defs', {}), 'pattern', {
    id, width: 12, height: 12, patternUnits: 'userSpaceOnUse', patternTransform: 'rotate(45)',
  });
  draw(pattern, 'line', { x1: 0, y1: 0, x2: 0, y2: 12, class: 'zone-hatch' });
  const settings = { width, height, id, labelled: declaration.large };
  for (const shape of overlayShapes(rig, rates, settings)) draw(svg, ...shape);
}
