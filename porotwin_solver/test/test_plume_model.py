"""Plumes of an injection for several dispersivities."""

import numpy as np
import pytest

from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import Schedule, WellRate
from porotwin_solver.model.plume_model import plume_model


def test_volumes_follow_the_factor_and_fronts_the_dispersivity(make_rig) -> None:
    rig = make_rig()
    well = next(iter(rig.wells))
    schedule = Schedule.constant({well: WellRate(from_ml_h(1000.0), 1.0)})
    plumes = plume_model(rig, schedule, [300.0, 600.0], cells=1500)
    sharp, more, spread = plumes(1.0, 0.0), plumes(1.1, 0.0), plumes(1.0, 5e-3)
    assert len(sharp) == 2
    assert more[1].sum() == pytest.approx(1.1 * sharp[1].sum(), rel=1e-6)
    front = [np.sum(plume[1] * (1 - plume[1])) for plume in (sharp, spread)]
    assert front[1] > 1.3 * front[0]
