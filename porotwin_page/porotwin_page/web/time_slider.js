/* The slider over the states of the last hours. */

import { element, find, setText } from './dom.js';
import { clockTime } from './formatting.js';
import { sliderRange } from './past.js';

export function createTimeSlider(region, page) {
  const label = element('label', { htmlFor: 'time-slider', textContent: 'Time' });
  const slider = element('input', { id: 'time-slider', type: 'range', step: 1 });
  const text = element('output', { id: 'time-text' });
  const now = element('button', { id: 'time-now', type: 'button', textContent: 'Newest' });
  const box = element('div', { id: 'time', hidden: true }, label, slider, text, now);
  region.prepend(box);
  slider.addEventListener('input', () => {
    const number = Number(slider.value);
    page.past.select(number >= page.state.event.states.last ? null : number);
  });
  now.addEventListener('click', () => page.past.select(null));
  return () => {
    const { event } = page.state;
    page.past.check(event.states, event.run);
    const range = sliderRange(event.states, page.past.number);
    box.hidden = !range.useful;
    if (!range.useful) return;
    slider.min = range.min;
    slider.max = range.max;
    slider.value = range.value;
    now.disabled = page.past.number === null;
    setText(text, sliderText(page.past, find('body')));
  };
}

function sliderText(past, body) {
  body.classList.toggle('past', past.number !== null);
  if (past.number === null) return 'newest photograph';
  if (!past.content) return 'loading';
  return `photograph ${past.content.sequence} · ${clockTime(past.content.time_s)}`;
}
