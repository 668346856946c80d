"""./porotwin what-if."""

import json
from pathlib import Path

import pytest
from cli_examples import porotwin

from porotwin_core.rig import load_rig

SHORT = ('--siblings', '24', '--cells', '330', '--horizon', '2min')


@pytest.mark.slow
@pytest.mark.usefixtures('undrawn')
def test_a_proposal_is_shown_beside_the_present_schedule(experiment: Path, tmp_path: Path) -> None:
    text = (experiment / 'rig.yaml').read_text()
    (tmp_path / 'stocked.yaml').write_text(
        text.replace('control:\n', 'control:\n  stock_ml: 900\n')
    )
    asked = ('what-if', experiment, '--at', '2min', '--rates', 'producer=-300', *SHORT,
             '--rig', tmp_path / 'stocked.yaml')  # fmt: skip
    found = porotwin(*asked, '--output', tmp_path, '--json')
    assert found.returncode == 0, found.stderr
    result = json.loads(found.stdout)
    assert result['proposed']['schedule'][0]['rates_ml_h']['producer'] == pytest.approx(-300.0)
    assert result['present']['schedule'][0]['rates_ml_h']['producer'] == pytest.approx(-500.0)
    assert set(result['proposed']['zone_ml']) == {'low', 'median', 'high'}
    assert Path(result['picture']).is_file()
    assert result['at_s'] == result['seen']['times_s'][0] == 120.0
    assert result['proposed']['schedule'][0]['start_s'] == 120.0
    assert result['proposed']['times_s'][-1] == pytest.approx(240.0)
    assert 800.0 < result['present']['stock_left_ml'] < 900.0
    assert 'refuse' in found.stderr
    shown = porotwin(*asked, '--output', tmp_path)
    assert 'nothing was pumped' in shown.stdout
    assert shown.stdout.splitlines()[-1].startswith('the guard would refuse this proposal, from 2')


@pytest.mark.parametrize(
    ('time', 'told'), [('soon', 'like 35min'), ('30d', 'its last map is from')]
)
def test_a_wrong_time_is_one_line_and_leaves_nothing(
    time: str, told: str, experiment: Path, tmp_path: Path
) -> None:
    well = next(iter(load_rig(experiment).wells))
    asked = ('--at', time, '--rates', f'{well}=3', '--output', tmp_path / 'new')
    found = porotwin('what-if', experiment, *asked)
    assert found.returncode == 2
    assert told in found.stderr
    assert not (tmp_path / 'new').exists()


def test_a_file_as_output_is_refused_before_the_work(experiment: Path, tmp_path: Path) -> None:
    (taken := tmp_path / 'taken').write_text('')
    asked = ('--at', '2min', '--rates', 'control1=3', '--output', taken)
    found = porotwin('what-if', experiment, *asked)
    assert found.returncode == 2
    assert 'is a file; name a folder' in found.stderr
