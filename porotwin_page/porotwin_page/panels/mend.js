/* Draws an offer to mend the model, and sends the answer. */

import { element, find, setText } from '../web/dom.js';
import { clockTime } from '../web/formatting.js';

const BODY = `
  <p><span class="sentence"></span>
    <a class="report" href="/report" target="_blank" rel="noopener">Report of the diagnosis</a></p>
  <div class="answers">
    <button type="button" class="accept">accept</button>
    <button type="button" class="refuse">refuse</button>
    <span class="need-token">To answer, the page needs the token of ./porotwin up.</span>
  </div>
  <p class="fault error" role="status" hidden></p>`;

/* What the caption says about an offer; one without an answer is a notice. */
export function captionText({ state, open, sequence, time_s: time, confidence_percent: sure }) {
  if (state !== 'offered') return `offer ${sequence}`;
  const kind = open ? 'offer' : 'notice';
  return `${kind} ${sequence}, ${sure} % sure, from photographs until ${clockTime(time)}`;
}

/* Sends an answer; returns the fault in words, or an empty text. */
export async function send(sequence, accept, token, ask = fetch) {
  const headers = { 'Content-Type': 'application/json', Authorization: `Bearer ${token}` };
  try {
    const body = JSON.stringify({ sequence, accept });
    const response = await ask('/mend', { method: 'POST', headers, body });
    return response.ok ? '' : (await response.json()).error;
  } catch {
    return 'the page does not reach the twin';
  }
}

export function create(root, declaration, page) {
  root.append(element('div', { innerHTML: BODY }));
  root.hidden = true; // until an offer is known
  const own = { sending: false, fault: '', sequence: 0 };
  const answer = async (accept) => {
    own.sending = true;
    page.refresh();
    own.fault = await send(own.sequence, accept, page.token.value);
    own.sending = false;
    page.refresh();
  };
  find('.accept', root).addEventListener('click', () => answer(true));
  find('.refuse', root).addEventListener('click', () => answer(false));
  return (offer) => {
    root.hidden = !offer;
    if (!offer) return;
    if (offer.sequence !== own.sequence) Object.assign(own, { sequence: offer.sequence, fault: '' });
    root.className = `panel panel-script mend-${offer.state.replace(' ', '-')}`;
    setText(find('.caption', root), captionText(offer));
    setText(find('.sentence', root), offer.sentence);
    find('.report', root).hidden = !offer.report;
    find('.answers', root).hidden = !offer.open;
    find('.need-token', root).hidden = Boolean(page.token.value);
    for (const button of root.querySelectorAll('button')) {
      button.disabled = own.sending || page.connection.lost || !page.token.value;
    }
    find('.fault', root).hidden = !own.fault;
    setText(find('.fault', root), own.fault);
  };
}
