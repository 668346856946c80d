"""Effects that a calibration takes out of the maps."""

import numpy as np
import pytest

from lab.blind.calibration_absorption import (
    MapFigures,
    absorbed_parts,
    absorption_table,
    witness_of,
)


def test_the_absorbed_part_of_each_effect_is_found():
    generator = np.random.default_rng(4)
    plain, one, other = generator.uniform(0.2, 1.0, (3, 500))
    alone = {'decay': plain + 0.3 * one, 'rate': plain + 0.2 * other}
    observed = plain + 0.1 * 0.3 * one + 0.9 * 0.2 * other + 0.01 * generator.standard_normal(500)
    gaps, absorbed = absorbed_parts(observed, plain, alone)
    assert gaps['decay'] == pytest.approx(0.3, rel=0.1)
    assert absorbed == pytest.approx({'decay': 0.9, 'rate': 0.1}, abs=0.02)
    assert MapFigures(0.01, gaps, absorbed).hidden == {'decay'}


def test_an_effect_that_changes_nothing_is_not_absorbed():
    plain = np.linspace(0.2, 1.0, 50)
    gaps, absorbed = absorbed_parts(plain, plain, {'leak': plain})
    assert gaps == {'leak': 0.0}
    assert absorbed == {}


def test_the_table_names_what_would_show_an_effect(tmp_path):
    figures = MapFigures(0.03, {'rate': 0.2, 'decay': 0.1}, {'rate': 0.05, 'decay': 0.6})
    figures.write(tmp_path / 'maps.json')
    assert MapFigures.read(tmp_path / 'maps.json') == figures
    rows = list(absorption_table([figures, figures]))
    assert rows[-1] == '| rate | 2 | 20% | 5% | weigh the water of the pump |'
    assert witness_of('streak') == 'an injection into another well'
