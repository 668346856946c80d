"""Interfaces of sands, for drawings."""

from pathlib import Path

import numpy as np
import pytest

from porotwin_core.rig import load_rig, rig_from_maps
from porotwin_core.rig.sand_interfaces import LEVELS_OF_A_MAP, SAME_SAND, interfaces

RIGS = Path(__file__).resolve().parents[2] / 'rigs'

DATA = {
    'name': 'box',
    'width_m': 0.6,
    'height_m': 0.4,
    'wells': {'in': {'x_m': 0.3, 'z_m': 0.2}},
    'viscosity_pa_s': 1e-3,
    'density_kg_m3': 1000.0,
}


def of_map(permeability):
    return interfaces(
        rig_from_maps(DATA, {'depth_m': 0.01, 'porosity': 0.4, 'permeability_m2': permeability})
    )


def test_one_sand_has_no_interface():
    assert of_map(1e-9) is None


def test_two_sands_meet_between_their_permeabilities():
    layers = np.repeat([1e-10, 1e-9], 10)[:, None] * np.ones((1, 30))
    found = of_map(layers)
    assert found.levels == pytest.approx([np.log(10**-9.5)], abs=SAME_SAND)
    rows = found.grid.z[np.abs(np.diff(found.logarithm[:, 0], append=np.log(1e-9))) > 1.0]
    assert rows == pytest.approx(0.2, abs=2 * found.grid.dz)


@pytest.mark.parametrize(('ratio', 'sands'), [(1.04, 2), (1.005, 1)])
def test_sands_differ_for_a_picture_as_for_a_diagnosis(ratio, sands):
    """At 1.04 a diagnosis and the imaging saw two sands, and pictures one."""
    layers = np.repeat([1e-10, ratio * 1e-10], 10)[:, None] * np.ones((1, 30))
    found = of_map(layers)
    assert (1 if found is None else len(found.levels) + 1) == sands


def test_a_map_of_many_values_has_a_few_levels():
    values = 10.0 ** np.linspace(-10, -9, 30)
    assert len(of_map(np.ones((20, 1)) * values).levels) == LEVELS_OF_A_MAP


def test_the_described_rigs_can_be_drawn():
    assert interfaces(load_rig(RIGS / 'small')) is None
    assert len(interfaces(load_rig(RIGS / 'two_sands')).levels) == 1
