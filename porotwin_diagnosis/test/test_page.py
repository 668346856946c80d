"""The report page: its sections and pictures for every kind of verdict."""

import io
import re
from dataclasses import replace

import numpy as np
import pytest
from diagnosis_examples import all_but, commanded, recorded
from diagnosis_results import naming, no_gap, on_rig, twice, with_effects
from matplotlib.image import imsave

from lab.blind.blind_cases import SMALL
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.decision.verdict import Verdict
from porotwin_diagnosis.examine import DiagnosisSettings, examine
from porotwin_diagnosis.report.diagnosis_json import diagnosis_json
from porotwin_diagnosis.report.page import write_report
from porotwin_diagnosis.report.report_folder import write_diagnosis
from porotwin_recording.experiment.recording import open_recording
from porotwin_recording.tables.photos import Photo

pytestmark = pytest.mark.usefixtures('undrawn')


def page(result, folder, summary=None):
    """Return a page without its line breaks, and its verdict."""
    write_report(folder / 'report.html', result, summary or diagnosis_json(result))
    text = ' '.join((folder / 'report.html').read_text(encoding='utf-8').split())
    return text, text.split('<p class="verdict">')[1].split('</p>')[0]


def test_a_found_effect_is_said_in_words_with_its_interval(coarse_denser, tmp_path):
    text, verdict_said = page(coarse_denser, tmp_path)
    assert verdict_said.startswith('<b>Porosity</b>: the porosity is 12 % lower than nominal')
    assert text.count('data:image/png;base64,') == 4
    assert 'weigh the water that fills the rig' in text
    assert '<td>inject tracer</td>' in text


def test_a_page_fits_a_telephone_and_needs_no_other_file(coarse_denser, tmp_path):
    text, _ = page(coarse_denser, tmp_path)
    assert '<meta name="viewport"' in text
    assert 'http' not in text
    assert 'src="data:image' in text
    assert text.count('<div class="wide"><img') == text.count('<img')
    assert text.count('<div class="wide"><table>') == text.count('<table>')
    assert '@media print' in text


def test_what_is_odd_in_the_recordings_stands_at_the_top(coarse_denser, tmp_path):
    assert 'Odd in the recordings' not in page(coarse_denser, tmp_path)[0]
    remarks = ('run: imaging.csv: the clocks <differ>; compare them',)
    text, _ = page(replace(coarse_denser, remarks=remarks), tmp_path)
    assert 'run: imaging.csv: the clocks &lt;differ&gt;; compare them' in text
    assert text.index('Odd in the recordings') < text.index('class="first')


def test_name_effects_and_history_of_the_rig_stand_on_the_page(coarse_denser, tmp_path):
    named = coarse_denser.recordings[0].rig.model_copy(update={'name': 'bench rig'})
    summary = diagnosis_json(coarse_denser)
    summary['history'] = ['porosity factor drifts: 0.95 on 2026-11-23, 0.88 now']
    leak = EffectDescription(name='leak', parameters={'x': 0.3, 'z': 0.2, 'rate': -20.0})
    text, _ = page(with_effects(on_rig(coarse_denser, named), leak), tmp_path, summary)
    assert '<h1>Sim-to-real gap: bench rig</h1>' in text  # no rig rig
    assert 'porosity factor drifts' in text
    assert 'The model as it is has the effects of rig.yaml: ' in text


def test_beside_an_effect_without_rival_no_experiment_is_asked_for(coarse_denser, tmp_path):
    verdict = replace(coarse_denser.verdict, probabilities={'porosity': 1.0, 'leak': 1e-5})
    text, _ = page(replace(coarse_denser, verdict=verdict, proposals=()), tmp_path)
    assert 'no experiment is needed to tell them apart' in text


def test_no_gap_says_first_which_effects_could_not_have_been_seen(coarse_denser, tmp_path):
    text, verdict_said = page(no_gap(coarse_denser), tmp_path)
    assert verdict_said.startswith('<b>No gap</b> (confidence')
    assert 'Next experiment' not in text
    assert text.index('would have shown') < text.index('Effects that were tried')
    assert '0.97 %' in text


def test_every_kind_of_verdict_has_its_pictures(coarse_denser, tmp_path):
    worst = coarse_denser.evidence.findings.singles[1]
    verdict = Verdict('unexplained', 0.9, worst, (), (), {'porosity': 0.1})
    for result, pictures, is_placed in (
        (twice(coarse_denser), 6, True),
        (replace(coarse_denser, verdict=verdict), 5, True),
        (no_gap(coarse_denser), 3, False),
        (naming(coarse_denser, 'clock', {'offset': -60.0}), 3, False),
    ):
        text, _ = page(result, tmp_path)
        assert text.count('data:image/png;base64,') == pictures
        assert ('<div class="first placed">' in text) == is_placed
        assert ('<th class="n">gap closed</th>' in text) == (len(result.recordings) > 1)


def test_where_it_arises_stands_on_the_first_screen(coarse_denser, tmp_path):
    text, _ = page(naming(coarse_denser, 'leak', {'x': 0.33, 'z': 0.3, 'rate': -20.0}), tmp_path)
    first = text.split('<div class="first placed">')[1].split('</figure>')[0]
    assert 'At x = 0.330 m, z = 0.300 m.' in first
    assert 'Where the gap arises' in first


def test_the_last_photograph_comes_first_and_a_broken_one_is_left_out(coarse_denser, tmp_path):
    buffer = io.BytesIO()
    imsave(buffer, np.zeros((90, 160, 3), dtype=np.uint8), format='jpg')
    good = Photo(60.0, 'state', 'a.jpg', buffer.getvalue)
    broken = Photo(60.0, 'state', 'b.jpg', lambda: b'no photograph')
    for photo, pictures in ((good, 1), (broken, 0)):
        recording = replace(coarse_denser.recordings[0], photos=(photo,))
        text, _ = page(replace(coarse_denser, recordings=(recording,)), tmp_path)
        assert text.count('data:image/jpeg;base64,') == pictures


SCRIPT = '<script>alert(1)</script>'


def test_names_of_rig_wells_and_folder_are_escaped(tmp_path):
    less = EffectDescription(name='rate', parameters={'well': 'injector', 'factor': 0.8})
    rates = commanded((0, 'injector', 450, 1.0))
    folder = recorded(tmp_path / '<i>run', less, rates=rates, grid=SMALL.grid(47, 28))
    rig, table = folder / 'rig.yaml', folder / 'rates.csv'
    named = re.sub('^name: .*', f'name: "{SCRIPT}rig"', rig.read_text(), flags=re.M)
    rig.write_text(re.sub(r'\binjector:', f'"{SCRIPT}well":', named))
    table.write_text(table.read_text().replace('injector', f'{SCRIPT}well'))
    recording = open_recording(folder)
    assert f'{SCRIPT}well' in recording.rig.wells
    found = examine([recording], DiagnosisSettings(excluded=all_but('porosity', 'rate')))
    (tmp_path / 'out').mkdir()
    write_diagnosis(found, tmp_path / 'out', apply=True)
    page = (tmp_path / 'out' / 'report.html').read_text()
    assert '&lt;script&gt;alert(1)&lt;/script&gt;' in page
    assert '<script' not in page
    assert '<i>run' not in page
