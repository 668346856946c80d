"""Quantities of interest of a map."""

import math

import numpy as np
import pytest

from porotwin_solver.coefficients.quantities import QUANTITIES
from porotwin_solver.model.model import Model


def test_quantities_of_an_injection_match_its_volume_and_place(rig, rates) -> None:
    model = Model(rig, rig.grid(93, 56), preset='fast')
    found = model.predict(model.initial_condition(), rates, 600.0)
    volume = model.quantity_of_interest('tracer_volume', found)
    assert volume == pytest.approx(600.0 * rates['injector'].rate, rel=1e-12)
    assert model.quantity_of_interest('max_concentration', found) == pytest.approx(1.0)
    assert model.quantity_of_interest('plume_centroid_x', found) == pytest.approx(0.235, abs=0.02)
    assert model.quantity_of_interest('plume_centroid_z', found) == pytest.approx(0.235, abs=0.02)
    area = 600.0 * rates['injector'].rate / (0.010 * 0.375)
    assert model.quantity_of_interest('plume_area', found) == pytest.approx(area, rel=0.3)
    assert math.isnan(model.quantity_of_interest('plume_centroid_x', np.zeros((56, 93))))


def test_all_quantities_have_a_unit_and_a_value(rig) -> None:
    model = Model(rig, rig.grid(17, 11), preset='fast')
    for name, (unit, _) in QUANTITIES.items():
        assert unit
        assert math.isfinite(model.quantity_of_interest(name, np.full((11, 17), 0.5)))
