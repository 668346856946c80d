"""The calibration record and its file."""

from copy import deepcopy
from dataclasses import replace
from functools import reduce

import cv2
import numpy as np
import pytest
import yaml

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import Grid
from porotwin_imaging.baseline.baseline import make_baseline
from porotwin_imaging.live.imaging_session import ImagingSession
from porotwin_imaging.tracer.calibration import (
    Calibration,
    Response,
    load_calibration,
    save_calibration,
)
from porotwin_imaging.tracer.tracer_signal import TracerSignal


def test_a_calibration_survives_its_file(tmp_path) -> None:
    sands = np.zeros((30, 50), np.uint8)
    sands[10:] = 1
    hidden = np.zeros((30, 50), np.uint8)
    hidden[:3] = 255
    written = Calibration(
        TracerSignal('absorbance', (0.5, 0.3, 0.2)),
        Response((0.0, 0.4, 1.1), (0.0, 0.5, 1.0), (0.0, 0.02, 0.0)),
        sands, (1.0, 1.25), hidden, {'from': 'test'}, 0.03, (0.01, 0.2),
    )  # fmt: skip
    save_calibration(written, tmp_path / 'calibration.yaml')
    read = load_calibration(tmp_path / 'calibration.yaml')
    assert (read.signal, read.response, read.factors) == (
        written.signal,
        written.response,
        written.factors,
    )
    assert (read.made, read.scale_error) == (written.made, written.scale_error)
    assert read.factor_deviations == (0.01, 0.2)
    np.testing.assert_array_equal(read.sands, sands)
    np.testing.assert_array_equal(read.hidden, hidden)
    # the picture's lower part, painted 1, is the lower part of the rig
    factors = read.factor_map(Grid(25, 15, 1.0, 0.6))
    assert factors[0, 0] == 1.25
    assert factors[-1, 0] == 1.0


def test_a_picture_that_cannot_be_written_is_told(tmp_path) -> None:
    (tmp_path / 'sands.png').mkdir()
    with pytest.raises(IsADirectoryError):
        save_calibration(Calibration(sands=np.zeros((3, 5), np.uint8)), tmp_path / 'c.yaml')


@pytest.mark.parametrize(
    ('text', 'complaint'),
    [
        ('{', 'not readable as YAML'),
        ('schema: 7', 'schema: 7 is not 1 or 2'),
        ('schema: 3', 'update PoroTwin'),
        ('schema: 1', "'scale_error' is missing; calibrate again"),
        ('scale_error: 0.1', "'schema' is missing; calibrate again"),
        ('', 'is empty'),
        ('[1, 2]', 'holds no keys'),
        (
            'schema: 1\nscale_error: 0.1\nsignal: {contrast: difference, weights: [1, 0, 0]}\n'
            'response: {signal: [0, 0.5, 0.4], concentration: [0, 0.5, 1]}',
            'must increase',
        ),
        (
            'schema: 1\nscale_error: 0.1\nsignal: {contrast: difference, weights: [1, 0, 0]}\n'
            'response: {signal: [0, 1], concentration: [0, 1]}\nsands: {file: lost.png}',
            "sands.file: picture 'lost.png' is not beside it",
        ),
        (
            'schema: 2\nscale_error: 0.1\nscale_error: 0.5',
            "'scale_error' stands twice, in the lines",
        ),
    ],
)
def test_a_broken_file_is_named_with_its_fault(tmp_path, text, complaint) -> None:
    path = tmp_path / 'calibration.yaml'
    path.write_text(text)
    with pytest.raises(InputError, match=complaint) as error:
        load_calibration(path)
    assert str(path) in str(error.value)
    assert '\n' not in str(error.value)


def test_the_response_is_linear_beyond_its_ends() -> None:
    response = Response((0.0, 0.5, 1.0), (0.0, 0.8, 1.0))
    np.testing.assert_allclose(
        response.concentration_of(np.array([-0.1, 0.25, 0.75, 1.5])), [-0.16, 0.4, 0.9, 1.2]
    )
    slopes = response.slope_at(np.array([-0.1, 0.2, 0.7, 2.0]))
    np.testing.assert_allclose(slopes, [1.6, 1.6, 0.4, 0.4])


def test_a_file_without_deviations_is_read() -> None:
    calibration = Calibration(scale_error=0.1)
    signal = np.array([0.0, 0.4, 0.8])
    found = calibration.systematic_deviation(signal, np.zeros(3))
    np.testing.assert_allclose(found, [0.0, 0.05, 0.1])


def test_scale_shape_and_sand_add_up_to_the_systematic_deviation() -> None:
    response = Response((0.0, 0.5, 1.0), (0.0, 0.5, 1.0), (0.0, 0.04, 0.0))
    calibration = Calibration(response=response, scale_error=0.03)
    found = calibration.systematic_deviation(np.array([0.5, 1.0]), np.array([0.0, 0.4]))
    np.testing.assert_allclose(found, np.hypot([0.015, 0.03], [0.04, 0.4]))


def test_the_deviation_of_a_factor_follows_its_sand() -> None:
    picture = np.zeros((30, 50), np.uint8)
    picture[10:] = 1
    calibration = Calibration(sands=picture, factors=(1.0, 1.2), factor_deviations=(0.01, 0.3))
    found = calibration.factor_deviation_map(Grid(25, 15, 1.0, 0.6))
    assert (found[0, 0], found[-1, 0]) == (0.3, 0.01)


def test_a_file_of_schema_1_still_loads(tmp_path) -> None:
    path = tmp_path / 'calibration.yaml'
    path.write_text(
        'schema: 1\nscale_error: 0.02\nsignal: {contrast: difference, weights: [1, 0, 0]}\n'
        'response: {signal: [0, 0.8], concentration: [0, 1]}'
    )
    read = load_calibration(path)
    assert read.response.deviation == ()
    assert read.factor_deviations == ()


WHOLE = {
    'schema': 2,
    'scale_error': 0.02,
    'signal': {'contrast': 'absorbance', 'weights': [1.0, 0.0, 0.0]},
    'response': {'signal': [0, 0.6, 1.9], 'concentration': [0, 0.4, 1], 'deviation': [0, 0.1, 0]},
    'sands': {'file': 'sands.png', 'factors': [1.0, 1.5], 'deviations': [0.01, 0.3]},
}
NAN, INF = float('nan'), float('inf')


@pytest.mark.parametrize(
    ('key', 'value'),
    [
        ('schema', '2'),
        ('schema', True),
        *(('scale_error', value) for value in (NAN, INF, -0.1, True, 'small', None)),
        *(('signal.contrast', value) for value in ('foo', None, ['absorbance'])),
        *(('signal.weights', v) for v in ([0, 0, 0], [NAN, 1, 0], [INF, 0, 0], [True, 0, 0], 3)),
        ('signal.weights', [1.0, 0.0]),
        ('signal.absorbance', [0, 0, 0]),
        *(('response.signal', [0, 0.5, value]) for value in (NAN, INF, 'much')),
        *(('response.concentration', v) for v in ([0, 0, 0], [0, NAN, 1], [0, 40, 100])),
        *(('response.deviation', [0, value, 0]) for value in (NAN, INF, -0.1, True)),
        *(('sands.factors', [1.0, value]) for value in (0, -1, NAN, INF, True, 10**400)),
        *(('sands.factors', value) for value in ([], [1.0], None, 1.0)),
        *(('sands.deviations', value) for value in ([0.1], [0.1, NAN], [0.1, -1], [0.1, INF])),
    ],
)
def test_a_damaged_value_is_named_with_its_key_and_remedy(tmp_path, key, value) -> None:
    cv2.imwrite(str(tmp_path / 'sands.png'), np.eye(20, dtype=np.uint8))
    data = deepcopy(WHOLE)
    *parents, last = key.split('.')
    reduce(dict.__getitem__, parents, data)[last] = value
    path = tmp_path / 'calibration.yaml'
    path.write_text(yaml.safe_dump(data))
    with pytest.raises(InputError) as error:
        load_calibration(path)
    line = str(error.value)
    assert line.startswith(f'{path}: {key}: ')
    assert line.count(str(path)) == 1
    assert 'calibrate again' in line
    assert '\n' not in line


def test_the_undamaged_file_is_read(tmp_path) -> None:
    cv2.imwrite(str(tmp_path / 'sands.png'), np.eye(20, dtype=np.uint8))
    path = tmp_path / 'calibration.yaml'
    path.write_text(yaml.safe_dump(WHOLE))
    assert load_calibration(path).factors == (1.0, 1.5)


def written_file(folder, data):
    """Write `data` as a calibration with a picture of two sands; return its path."""
    cv2.imwrite(str(folder / 'sands.png'), np.eye(20, dtype=np.uint8))
    path = folder / 'calibration.yaml'
    path.write_text(yaml.safe_dump(data))
    return path


@pytest.mark.parametrize(
    ('change', 'complaint'),
    [
        (
            {'hiden': {'file': 'hidden.png'}},
            "unknown key 'hiden'; correct or remove it; did you mean 'hidden'?",
        ),
        ({'signal': {**WHOLE['signal'], 'wieghts': [1, 0, 0]}}, "'signal.wieghts'; correct"),
        ({'sands': {**WHOLE['sands'], 'factor': [1.0]}}, "did you mean 'sands.factors'"),
        ({'response': {'signal': [0, 1]}}, "'response.concentration' is missing"),
        ({'hidden': {}}, "'hidden.file' is missing"),
        ({'hidden': 'hidden.png'}, 'is no section; write it as hidden: {file: hidden.png}'),
        ({'hidden': {'file': '../hidden.png'}}, 'is no name of a picture beside this file'),
        ({'hidden': {'file': 3}}, 'is no name of a picture beside this file'),
        ({'signal': None}, 'signal: None is no section'),
        ({'made': 'by hand'}, "made: 'by hand' is no section"),
        ({'made': {'rig': 'small'}}, 'made.rig: needs name, width_m, height_m'),
        ({'made': {'rig': {'name': 'a', 'width_m': '1', 'height_m': 1}}}, 'made.rig.width_m'),
    ],
)
def test_a_wrong_key_is_named_in_plain_words(tmp_path, change, complaint) -> None:
    path = written_file(tmp_path, WHOLE | change)
    with pytest.raises(InputError) as error:
        load_calibration(path)
    line = str(error.value)
    assert line.startswith(f'{path}: ')
    assert complaint in line
    assert 'Error' not in line
    assert '\n' not in line


def test_a_missing_picture_is_told_without_a_warning_of_opencv(tmp_path, capfd) -> None:
    path = written_file(tmp_path, WHOLE)
    (tmp_path / 'sands.png').unlink()
    with pytest.raises(InputError, match=r"picture 'sands\.png' is not beside it"):
        load_calibration(path)
    assert capfd.readouterr() == ('', '')


def test_a_folder_is_answered_with_the_file_in_it(tmp_path) -> None:
    with pytest.raises(InputError, match=r'is a folder; name the file in it: .*calibration\.yaml'):
        load_calibration(tmp_path)


@pytest.mark.parametrize(('width', 'agrees'), [(1.0, True), (1.009, True), (1.02, False)])
def test_a_calibration_of_another_rig_is_refused(
    laboratory, empty_photograph, tmp_path, width, agrees
) -> None:
    rig = laboratory.rig
    made_on = {'name': 'other', 'width_m': width * rig.width_m, 'height_m': rig.height_m}
    calibration = load_calibration(written_file(tmp_path, WHOLE | {'made': {'rig': made_on}}))
    if agrees:
        make_baseline(rig, rig.grid(90, 50), [empty_photograph], calibration=calibration)
        return
    with pytest.raises(InputError, match="made on the rig 'other'") as error:
        make_baseline(rig, rig.grid(90, 50), [empty_photograph], calibration=calibration)
    assert '\n' not in str(error.value)
    with pytest.raises(InputError, match='use a calibration of this rig'):
        ImagingSession(rig, rig.grid(90, 50), calibration=calibration)


@pytest.mark.parametrize(
    ('made_on', 'code'), [(None, 'unknown_rig'), ('other', 'other_rig'), ('test', None)]
)
def test_a_calibration_that_may_be_of_another_rig_is_told(
    laboratory, empty_photograph, made_on, code
) -> None:
    rig = laboratory.rig
    size = {'width_m': rig.width_m, 'height_m': rig.height_m}
    made = {'from': 'run 3'} | ({'rig': {'name': made_on, **size}} if made_on else {})
    calibration = Calibration(made=made)
    doubt = calibration.doubt_about(rig)
    assert (doubt and doubt.code) == code
    baseline = make_baseline(rig, rig.grid(90, 50), [empty_photograph], calibration=calibration)
    assert (str(doubt) in baseline.remarks) == (code is not None)


def test_errors_of_scale_and_shape_do_not_average_out_over_the_cells() -> None:
    response = Response((0.0, 1.0), (0.0, 1.0), (0.02, 0.02))
    two = replace(Calibration(response=response), scale_error=0.03, factor_deviations=(0.04, 0.0))
    sands = np.repeat([[0, 1]], 50, axis=0).astype(np.uint8)
    one, even = np.ones((50, 2)), 1e-6 * np.ones((50, 2))
    parts = (0.03, 0.02, 0.5 * 0.04)  # half of the tracer is in the first sand
    assert two.mass_deviation(one, sands, even) == pytest.approx(np.linalg.norm(parts))
    assert two.mass_deviation(0.0 * one, sands, even) == 0.0
