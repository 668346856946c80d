"""Names in a recording are words in its report, whatever they contain."""

import re
from pathlib import Path

import pytest
from diagnosis_examples import all_but, commanded, recorded

from lab.blind.blind_cases import SMALL
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.examine import examine
from porotwin_diagnosis.report.report_folder import write_diagnosis
from porotwin_recording.experiment.recording import open_recording

SCRIPT = '<script>alert(1)</script>'


@pytest.mark.usefixtures('undrawn')
def test_names_of_rig_wells_and_folder_are_escaped(tmp_path: Path) -> None:
    less = EffectDescription(name='rate', parameters={'well': 'injector', 'factor': 0.8})
    rates = commanded((0, 'injector', 450, 1.0))
    folder = recorded(tmp_path / '<i>run', less, rates=rates, grid=SMALL.grid(47, 28))
    rig, table = folder / 'rig.yaml', folder / 'rates.csv'
    named = re.sub('^name: .*', f'name: "{SCRIPT}rig"', rig.read_text(), flags=re.M)
    rig.write_text(re.sub(r'\binjector:', f'"{SCRIPT}well":', named))
    table.write_text(table.read_text().replace('injector', f'{SCRIPT}well'))
    recording = open_recording(folder)
    assert f'{SCRIPT}well' in recording.rig.wells
    found = examine([recording], excluded=all_but('porosity', 'rate'))
    (tmp_path / 'out').mkdir()
    write_diagnosis(found, tmp_path / 'out', apply=True)
    page = (tmp_path / 'out' / 'report.html').read_text()
    assert '&lt;script&gt;alert(1)&lt;/script&gt;' in page
    assert '<script' not in page
    assert '<i>run' not in page
