"""./porotwin rehearse."""

import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from cli_examples import one_well_rig, porotwin

from porotwin_core.rig import load_rig
from porotwin_recording.experiment.bag_conversion import import_experiment
from porotwin_recording.experiment.catalogue import catalogue_entry
from porotwin_recording.experiment.recording import open_recording
from porotwin_recording.tables.concentration import open_maps

RIG = one_well_rig(0.2, 0.1)
RATES = 'time_s,well,rate_ml_h,concentration\n0,injector,200,1\n240,injector,0,\n'


def design(folder: Path) -> Path:
    """Return a folder with the rig and the rates of an experiment to plan."""
    folder.mkdir()
    (folder / 'rig.yaml').write_text(RIG)
    (folder / 'rates.csv').write_text(RATES)
    return folder


def test_a_rehearsal_is_a_recording_that_does_not_name_its_effects(tmp_path: Path) -> None:
    planned, plain, described = (tmp_path / name for name in ('planned', 'plain', 'described'))
    folder = design(tmp_path / 'design')
    words = ('rehearse', folder, '--photo-interval-s', '60', '--grid', '30x15')
    effect = ('--effect', 'leak:x=0.15,z=0.05,rate=-50')
    result = porotwin(*words, '--output', planned, *effect, '--json')
    assert result.returncode == 0, result.stderr
    answer = json.loads(result.stdout)
    assert answer['maps'] == 5
    np.testing.assert_allclose(answer['injected_m3'], 200e-6 / 15, rtol=1e-3)
    assert load_rig(planned).effects == ()
    assert porotwin(*words, '--output', plain).returncode == 0
    leaking, tight = open_recording(planned), open_recording(plain)
    assert str(leaking.grid) == '30x15'
    assert list(leaking.times) == [0.0, 60.0, 120.0, 180.0, 240.0]
    assert leaking.commanded == tight.commanded
    np.testing.assert_array_equal(leaking.concentration[0], tight.concentration[0])
    assert np.abs(leaking.concentration[-1] - tight.concentration[-1]).max() > 0.1
    assert 'leak' not in ''.join(
        path.read_text(encoding='utf-8') for path in planned.iterdir() if path.suffix != '.nc'
    )
    # an effect of the description acts too
    known = 'effects:\n  - name: porosity\n    parameters: {factor: 0.5}\n'
    (folder / 'rig.yaml').write_text(RIG + known)
    assert porotwin(*words, '--output', described).returncode == 0
    wider = open_recording(described).concentration[-1].sum()
    assert wider > 1.5 * tight.concentration[-1].sum()


def test_a_photographed_rehearsal_is_imaged_like_a_real_one(tmp_path: Path) -> None:
    folder, output = design(tmp_path / 'design'), tmp_path / 'photographed'
    words = ('rehearse', folder, '--photo-interval-s', '60', '--photo-width-px', '400')
    result = porotwin(*words, '--output', output)
    assert result.returncode == 0, result.stderr
    assert './porotwin calibrate' in result.stdout
    recording = open_recording(output)
    assert recording.maps is None
    assert [photo.role for photo in recording.photos] == ['baseline', *4 * ['state']]
    assert recording.rig.camera is not None
    maps = tmp_path / 'maps.nc'
    result = porotwin('image', output, '--output', maps, '--grid', '30x15')
    assert result.returncode == 0, result.stderr
    assert recording.is_virtual
    assert open_maps(maps, recording.rig).origin.is_virtual
    import_experiment(output, tmp_path / 'bag')
    entries = [catalogue_entry(path) for path in (output, tmp_path / 'bag')]
    assert [entry.virtual for entry in entries] == [True, True]


def test_a_wrong_plan_is_refused_in_one_line_and_leaves_nothing(tmp_path: Path) -> None:
    folder = design(tmp_path / 'design')
    output = tmp_path / 'planned'
    for wrong, complaint in (
        (('--grid', 'many'), 'write columns x rows'),
        (('--grid', '30x15', '--photo-width-px', '400'), 'photographs have no cells yet'),
        (('--effect', 'leek:x=1'), "'leek' is not known; did you mean 'leak'?"),
        (('--effect', 'leak:x=0.15,z=0.05'), "leak: parameter 'rate' [ml/h] is missing"),
        (('--effect', 'leak:x=0.15,z=0.05,rate=0'), 'leak: changes nothing with rate = 0'),
        (('--effect', 'leak:x=150,z=0.05,rate=-9'), 'm wide; was this in mm? write it in m'),
        (('--effect', 'leak:q=1'), "unknown parameter 'q'"),
        (('--photo-interval-s', '500'), 'is longer than the experiment of 240 s'),
        (('--duration-min', '40000', '--photo-interval-s', '1'), 'give a larger --photo-interval'),
    ):
        result = porotwin('rehearse', folder, '--output', output, *wrong)
        assert result.returncode == 2
        assert complaint in result.stderr
        assert len(result.stderr.strip().splitlines()) == 1
        assert not output.exists()
    (folder / 'rates.csv').write_text('time_s,well,rate_ml_h,concentration\n0,injector,200,1\n')
    result = porotwin('rehearse', folder, '--output', output)
    assert result.returncode == 2
    assert 'give --duration-min' in result.stderr
    (folder / 'rates.csv').unlink()
    result = porotwin('rehearse', folder, '--output', output)
    assert result.returncode == 2
    assert 'write one beside rig.yaml (docs/formats.md shows one)' in result.stderr


def test_the_last_lines_name_the_ways_out_and_the_hidden_effects(tmp_path: Path) -> None:
    folder, output = design(tmp_path / 'design'), tmp_path / 'planned'
    effect = 'leak:x=0.13,z=0.05,rate=-150'
    words = ('--photo-interval-s', '60', '--effect', effect)
    told = porotwin('rehearse', folder, '--output', output, *words).stdout.splitlines()
    assert 'ml of it removed by a leak or open sides' in told[0]
    assert told[1] == f'hidden: {effect}'
    assert 'maps are too few for a diagnosis' in told[2]


def test_a_rehearsal_that_was_killed_begins_again(tmp_path: Path) -> None:
    folder, output = design(tmp_path / 'design'), tmp_path / 'planned'
    words = ['rehearse', str(folder), '--output', str(output), '--photo-interval-s', '1']
    call = subprocess.Popen([sys.executable, '-m', 'porotwin_cli', *words, '--duration-min', '300'])
    unfinished = tmp_path / '.planned.partial'
    try:
        while not (unfinished / 'concentration.nc.partial').exists():
            assert call.poll() is None
            time.sleep(0.05)
    finally:
        call.kill()
        call.wait()
    assert not output.exists()
    told = porotwin('runs', tmp_path)
    assert 'unfinished' in told.stdout
    assert 'is the beginning of maps that are not complete' in told.stderr
    checked = porotwin('check', unfinished, '--output', tmp_path / 'check.png')
    assert 'concentration.nc.partial is the beginning of maps' in checked.stdout
    diagnosed = porotwin('diagnose', unfinished, '--output', tmp_path / 'report')
    assert diagnosed.returncode == 2
    assert 'maps that are not complete; wait for the command' in diagnosed.stderr
    result = porotwin(*words[:-1], '60')
    assert result.returncode == 0, result.stderr
    assert len(open_recording(output).times) == 5
    assert not unfinished.exists()
