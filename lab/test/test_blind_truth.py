"""The truth of a case: the stronger effect of a pair, and names that look the same."""

from dataclasses import replace

import numpy as np
import pytest
from blind_examples import case_of_kind, clean_maps, predicted, stated

from lab.blind.blind_cases import draw_case
from lab.blind.blind_score import score_case
from lab.blind.blind_truth import CaseTruth, truth_of
from porotwin_core.rig import EffectDescription


def test_only_the_stronger_effect_of_a_pair_is_right(tmp_path):
    effects = (
        EffectDescription(name='decay', parameters={'rate': 2e-5}),
        EffectDescription(name='depth', parameters={'factor_centre': 1.3}),
    )
    case = replace(
        draw_case(4, 1),
        effects=effects,
        right=('decay', 'depth'),
        duration=900.0,
        cell_m=0.01,
        element_m=0.005,
    )
    times = [300.0, 600.0, 900.0]
    nothing = clean_maps(tmp_path / 'nothing.nc', replace(case, effects=()), times)[1:]
    everything = clean_maps(tmp_path / 'clean.nc', case, times)[1:]
    predicted(tmp_path, case, times[1:], everything, nothing, everything)
    stated(tmp_path, 'decay', 0.9, ['decay'], [('rate', 2e-5)])
    truth_of(case, tmp_path, tmp_path / 'clean.nc').write(tmp_path / 'truth.json')
    truth = CaseTruth.read(tmp_path / 'truth.json')
    assert truth.strongest == ('depth',)
    assert truth.before > 0.03 > truth.after == 0.0
    assert truth.imitation is None, 'a member of the pair need not imitate it'
    assert truth.gap_closed == pytest.approx(truth.before / (truth.before - 0.02), rel=1e-3)
    stated(tmp_path, 'decay', 0.9, ['decay', 'depth'])
    score = score_case(case, tmp_path, truth)
    assert not score.right
    assert score.all_found


def test_an_effect_that_looks_the_same_as_one_left_out_is_no_wrong_name(tmp_path):
    """A bulge of a few per cent looks like a lower porosity; it does not look like a late clock."""
    bulge = EffectDescription(name='depth', parameters={'factor_centre': 0.95})
    case = replace(
        draw_case(4, 1),
        kind='left out',
        effects=(bulge,),
        right=('unexplained',),
        withheld=('depth',),
        duration=900.0,
        cell_m=0.01,
        element_m=0.005,
    )
    times = np.array([600.0, 900.0])
    maps = clean_maps(tmp_path / 'clean.nc', case, times)
    scores = {}
    for name, parameter, value in (
        ('porosity', 'factor', 0.967),
        ('clock', 'offset', 200.0),
        ('retardation', 'retardation_factor', -1.0),
    ):
        place = stated(tmp_path / name, name, 0.9, [name], [(parameter, value)])
        predicted(place, case, times, maps, 0.9 * maps, maps)
        truth_of(case, place, tmp_path / 'clean.nc').write(place / 'truth.json')
        scores[name] = score_case(case, place, CaseTruth.read(place / 'truth.json'))
    assert scores['porosity'].right and scores['porosity'].imitated
    assert not scores['clock'].right
    assert not scores['retardation'].right, 'an effect that the rig refuses imitates nothing'


def test_a_small_effect_named_where_none_is_stays_wrong(tmp_path):
    none = replace(case_of_kind('none'), duration=900.0, cell_m=0.01, element_m=0.01)
    times = np.array([600.0, 900.0])
    maps = clean_maps(tmp_path / 'clean.nc', none, times)
    place = stated(tmp_path / 'stated', 'porosity', 0.9, ['porosity'], [('factor', 1.001)])
    predicted(place, none, times, maps, 0.9 * maps, maps)
    assert not score_case(none, place, truth_of(none, place, tmp_path / 'clean.nc')).right
