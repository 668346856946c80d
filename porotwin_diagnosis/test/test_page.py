"""The report page: its sections and pictures for every kind of verdict."""

import io
import re
from dataclasses import replace

import numpy as np
import pytest
from diagnosis_examples import all_but, commanded, recorded
from diagnosis_results import naming, twice
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
    assert 'confidence 90 %' in verdict_said
    assert text.count('data:image/png;base64,') == 4
    assert '0.873 … 0.887' in text
    assert 'weigh the water that fills the rig' in text
    assert '<td>inject tracer</td>' in text


def test_a_page_fits_a_telephone_and_needs_no_other_file(coarse_denser, tmp_path):
    text, _ = page(coarse_denser, tmp_path)
    assert '<meta name="viewport"' in text
    assert 'http' not in text
    assert 'src="data:image' in text


def test_what_is_odd_in_the_recordings_stands_at_the_top(coarse_denser, tmp_path):
    summary = diagnosis_json(coarse_denser)
    assert 'Odd in the recordings' not in page(coarse_denser, tmp_path)[0]
    summary['remarks'] = ['run: imaging.csv: the clocks <differ>; compare them']
    text, _ = page(coarse_denser, tmp_path, summary)
    assert 'run: imaging.csv: the clocks &lt;differ&gt;; compare them' in text
    assert text.index('Odd in the recordings') < text.index('class="first')


def test_a_rig_whose_name_says_rig_is_not_called_a_rig_rig(coarse_denser, tmp_path):
    recording = coarse_denser.recordings[0]
    named = replace(recording, rig=recording.rig.model_copy(update={'name': 'bench rig'}))
    text, _ = page(replace(coarse_denser, recordings=(named,)), tmp_path)
    assert '<h1>Sim-to-real gap: bench rig</h1>' in text


def test_effects_that_the_model_has_already_are_told(coarse_denser, tmp_path):
    recording = coarse_denser.recordings[0]
    leak = EffectDescription(name='leak', parameters={'x': 0.3, 'z': 0.2, 'rate': -20.0})
    known = replace(recording, rig=recording.rig.with_effects([leak]))
    text, _ = page(replace(coarse_denser, recordings=(known,)), tmp_path)
    assert 'The model as it is has the effects of rig.yaml: ' in text
    assert 'look there first' not in text
    weaker = EffectDescription(name='porosity', parameters={'factor': 0.9})
    known = replace(recording, rig=recording.rig.with_effects([weaker]))
    _, said = page(replace(coarse_denser, recordings=(known,)), tmp_path)
    assert 'The rig.yaml describes porosity already' in said


def test_effects_without_a_row_are_named(coarse_denser, tmp_path):
    text, _ = page(replace(coarse_denser, excluded=('clock',)), tmp_path)
    (named,) = re.findall(r'nothing in it points to them: [^.]*', text)
    assert 'leak' in named
    assert 'clock' not in named


def test_the_history_of_the_rig_stands_in_the_answer(coarse_denser, tmp_path):
    summary = {
        **diagnosis_json(coarse_denser),
        'belief': {'porosity': 0.495, 'retardation': 0.4949},
    }
    summary['history'] = ['porosity factor drifts: 0.95 on 2026-11-23, 0.88 now']
    text, _ = page(coarse_denser, tmp_path, summary)
    assert 'They found: <b>porosity or retardation</b> (50 % each).' in text
    assert 'porosity factor drifts' in text


def test_beside_an_effect_without_a_probable_rival_no_experiment_is_asked_for(
    coarse_denser, tmp_path
):
    verdict = replace(coarse_denser.verdict, probabilities={'porosity': 1.0, 'leak': 1e-5})
    text, _ = page(replace(coarse_denser, verdict=verdict, proposals=()), tmp_path)
    assert 'no experiment is needed to tell them apart' in text


def test_no_gap_says_first_which_effects_could_not_have_been_seen(coarse_denser, tmp_path):
    verdict = Verdict('none', 0.9, coarse_denser.evidence.findings.null, (), (), {'porosity': 0.1})
    text, verdict_said = page(replace(coarse_denser, verdict=verdict), tmp_path)
    assert verdict_said.startswith('<b>No gap</b> (confidence')
    assert 'Next experiment' not in text
    assert text.index('would have shown') < text.index('Effects that were tried')
    assert '0.97 %' in text


def test_the_remainder_of_an_unexplained_gap_is_drawn(coarse_denser, tmp_path):
    worst = coarse_denser.evidence.findings.singles[1]
    verdict = Verdict('unexplained', 0.9, worst, (), (), {'porosity': 0.1})
    text, _ = page(replace(coarse_denser, verdict=verdict), tmp_path)
    assert text.count('data:image/png;base64,') == 5
    assert 'The remainder' in text


def test_a_camera_effect_has_no_place_where_it_arises(coarse_denser, tmp_path):
    text, _ = page(naming(coarse_denser, 'clock', {'offset': -60.0}), tmp_path)
    assert 'this map names no place in the rig, because the gap is made by the camera' in text
    assert 'means nothing here' in text
    assert 'Where the gap arises' not in text
    assert 'hot spots' not in text
    assert text.count('data:image/png;base64,') == 3


def test_where_it_arises_stands_on_the_first_screen(coarse_denser, tmp_path):
    text, _ = page(naming(coarse_denser, 'leak', {'x': 0.33, 'z': 0.3, 'rate': -20.0}), tmp_path)
    first = text.split('<div class="first placed">')[1].split('</figure>')[0]
    assert 'At x = 0.330 m, z = 0.300 m.' in first
    assert 'Where the gap arises' in first
    assert 'Light blue: the place of the named effect.' in first


def test_without_a_gap_there_is_no_map_of_where_it_arises(coarse_denser, tmp_path):
    verdict = Verdict('none', 0.9, coarse_denser.evidence.findings.null, (), (), {})
    text, _ = page(replace(coarse_denser, verdict=verdict), tmp_path)
    assert '<div class="first"><table class="answer">' in text
    assert 'Where the gap arises' not in text


def test_wide_tables_and_pictures_scroll_by_themselves(coarse_denser, tmp_path):
    text, _ = page(coarse_denser, tmp_path)
    assert text.count('<div class="wide"><img') == text.count('<img')
    assert text.count('<div class="wide"><table>') == text.count('<table>')
    assert '@media print' in text


def test_each_of_several_recordings_has_its_errors_and_its_course(coarse_denser, tmp_path):
    text, _ = page(twice(coarse_denser), tmp_path)
    assert text.count('data:image/png;base64,') == 6
    assert '<th class="n">gap closed</th>' in text


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
