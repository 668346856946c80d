import assert from 'node:assert/strict';
import { test } from 'node:test';

import { browserVoice, Speech, speechText } from '../../porotwin_page/web/speech.js';

const setpoint = (properties) => ({
  sequence: 7, time_s: 210, pumps_report: false, confirmed: false, safe: false, doubt: '',
  wells: [
    { name: 'control2', rate_ml_h: 120, changed: true },
    { name: 'producer', rate_ml_h: -620.5, changed: true },
    { name: 'injector', rate_ml_h: 500, changed: false },
  ],
  ...properties,
});

function setup(stored = null) {
  const said = [];
  const kept = { 'porotwin-speech': stored };
  const storage = {
    getItem: (key) => kept[key], setItem: (key, value) => { kept[key] = value; },
  };
  return { said, kept, speech: new Speech((text) => said.push(text), () => storage) };
}

test('only the pumps to set are spoken', () => {
  assert.equal(speechText(setpoint()), 'Set control 2 to 120, producer to minus 620.5.');
  assert.match(speechText(setpoint({ safe: true })), /^The setpoint has expired\. Set /);
  for (const silent of [{ pumps_report: true }, { confirmed: true }, { doubt: 'x' }, { wells: [] }]) {
    assert.equal(speechText(setpoint(silent)), '');
  }
});

test('every order is spoken once, after somebody switched the voice on', () => {
  const { said, speech } = setup();
  speech.say('a', setpoint());
  assert.deepEqual(said, []);
  speech.toggle();
  speech.say('a', setpoint());
  speech.say('a', setpoint());
  assert.equal(said.length, 1);
  speech.say('a', setpoint({ sequence: 8 }));
  speech.say('a', setpoint({ sequence: 8, safe: true }));
  assert.equal(said.length, 3);
  speech.toggle();
  speech.say('a', setpoint({ sequence: 9 }));
  assert.equal(said.length, 3);
});

test('the first order of a restarted hub is spoken, although its number is not new', () => {
  const { said, speech } = setup('on');
  speech.say('a', setpoint({ sequence: 1 }));
  speech.say('a', setpoint({ sequence: 1, time_s: 240 }));
  assert.equal(said.length, 2);
});

test('the switch is kept, and off at first', () => {
  const { kept, speech } = setup();
  assert.equal(speech.on, false);
  speech.toggle();
  assert.equal(kept['porotwin-speech'], 'on');
  assert.equal(setup('on').speech.on, true);
});

test('a browser without a voice has no switch', () => {
  assert.equal(browserVoice({}), null);
  assert.equal(new Speech(null, () => { throw new Error('none'); }).on, false);
});

test('the voice of the browser speaks the newest text first', () => {
  const calls = [];
  const voice = browserVoice({
    SpeechSynthesisUtterance: class { constructor(text) { this.text = text; } },
    speechSynthesis: { cancel: () => calls.push('cancel'), speak: (w) => calls.push(w.text) },
  });
  voice('Set control 2 to 120.');
  assert.deepEqual(calls, ['cancel', 'Set control 2 to 120.']);
});
