"""The true rig: nominal properties changed by effects."""

import numpy as np
import pytest
from rig_examples import make_rig

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import GRAVITY
from porotwin_rig.effects import EffectSet, parse_effects
from porotwin_rig.mesh import Mesh
from porotwin_rig.true_rig import TrueRig


def true_rig(effects: str = '') -> TrueRig:
    rig = make_rig()
    mesh = Mesh(31, 21, rig.width_m, rig.height_m)
    return EffectSet.checked(parse_effects(effects), rig).applied(TrueRig.nominal(rig, mesh))


def test_without_effects_the_true_rig_is_the_nominal_one() -> None:
    rig = true_rig()
    along_x, along_z = rig.transmissivity
    np.testing.assert_allclose(along_x, 6.57e-10 * 998.0 * GRAVITY / 1e-3 * 0.010)
    np.testing.assert_array_equal(along_x, along_z)
    np.testing.assert_allclose(rig.storage, 0.375 * 0.010)
    assert rig.places['injector'] == (0.235, 0.235, 0.004)


def test_effects_change_what_they_name() -> None:
    rig = true_rig(
        'depth:factor_centre=1.2;porosity:factor=0.9;retardation:retardation_factor=1.5;'
        'anisotropy:z_low=0,z_high=0.6,ratio=4;well_position:well=injector,dx=0.01;'
        'leak:x=0.4,z=0.3,rate=-36'
    )
    middle = rig.mesh.nx // 2
    along_x, along_z = rig.transmissivity
    np.testing.assert_allclose(along_x, 4.0 * along_z)
    assert rig.depth[3, 0] == pytest.approx(0.010)
    assert rig.depth[3, middle] == pytest.approx(0.012, rel=1e-2)
    np.testing.assert_allclose(rig.storage, rig.depth * 0.375 * 0.9 * 1.5)
    assert rig.places['injector'][0] == pytest.approx(0.245)
    assert rig.places['leak'][:2] == (0.4, 0.3)
    assert rig.constant_rates['leak'].rate == pytest.approx(-1e-8)


def test_impossible_properties_are_refused() -> None:
    with pytest.raises(InputError, match=r'porosity 1\.125: must not exceed 1'):
        true_rig('porosity:factor=3')
    with pytest.raises(InputError, match=r"'leak' at .* lies outside the rig"):
        true_rig('leak:x=0.3,z=0.6,rate=-10')
