"""Effects of the virtual rig against exact relations; wrong effects are refused."""

import math
from functools import cache

import numpy as np
import pytest
from rig_examples import make_rig, rates

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.model.effect_parameter import Parameter
from porotwin_core.rates.wells import WellRates
from porotwin_core.rig import EffectDescription, Rig
from porotwin_rig.effects import EFFECTS, parse_effects, refuse_slips
from porotwin_rig.effects.definition.asset_effect import AssetEffect
from porotwin_rig.effects.freundlich import dissolved_in_equilibrium
from porotwin_rig.virtual_rig import VirtualRig

CELL = 0.006
COMMANDED = rates(injector=(500.0, 1.0), control1=200.0, producer=-700.0)


def after(
    seconds: float, *effects: str, interval: float = 30.0, commanded: WellRates = COMMANDED
) -> VirtualRig:
    """Return the rig with effects after some time of pumping."""
    asset = VirtualRig(make_rig(), effects=parse_effects(';'.join(effects)), cell=CELL)
    asset.set_rates(commanded)
    for _ in range(round(seconds / interval)):
        asset.advance(interval)
    return asset


@cache
def plain_after(seconds: float) -> VirtualRig:
    """Return the rig without effects, which several tests compare with and none may change."""
    return after(seconds)


def difference(one: VirtualRig, other: VirtualRig) -> float:
    a, b = one.visible(), other.visible()
    return float(np.linalg.norm(a - b) / np.linalg.norm(b))


def centre(asset: VirtualRig) -> tuple[float, float]:
    """Return the centre of the tracer's mass [m]."""
    weight = asset.visible() * asset.mesh.box_area
    total = weight.sum()
    return (
        float((weight * asset.mesh.x[None, :]).sum() / total),
        float((weight * asset.mesh.z[:, None]).sum() / total),
    )


def test_retardation_slows_everything_by_its_factor() -> None:
    retarded = after(900.0, 'retardation:retardation_factor=1.5', interval=45.0)
    plain = plain_after(600.0)
    assert difference(retarded, plain) < 0.03
    assert retarded.total_mass() == pytest.approx(1.5 * plain.total_mass(), rel=1e-6)


def test_porosity_and_retardation_look_the_same_to_the_camera() -> None:
    # but for the molecular diffusion, which acts on another amount of water
    one = after(600.0, 'porosity:factor=1.2')
    assert difference(one, plain_after(600.0)) > 0.1
    other = after(600.0, 'retardation:retardation_factor=1.2')
    assert difference(one, other) < 0.01


def test_decay_loses_what_the_ages_of_the_tracer_say() -> None:
    rate, seconds = 2e-4, 900.0
    asset = after(seconds, f'decay:rate={rate}')
    remaining = from_ml_h(500.0) * (1.0 - math.exp(-rate * seconds)) / rate
    assert asset.total_mass() == pytest.approx(remaining, rel=1e-5)
    assert asset.balance.decayed == pytest.approx(asset.balance.injected - remaining, rel=1e-3)


def test_a_rate_factor_is_the_same_as_another_commanded_rate() -> None:
    weaker = {**COMMANDED, 'injector': rates(injector=(450.0, 1.0))['injector']}
    asset = after(300.0, 'rate:well=injector,factor=0.9')
    assert difference(asset, after(300.0, commanded=weaker)) < 1e-12
    assert asset.measured_rates()['injector'].rate == pytest.approx(from_ml_h(500.0))


def test_pulsation_has_no_net_effect_over_a_whole_period() -> None:
    asset = after(600.0, 'pulsation:well=injector,amplitude=0.3,period=300')
    assert asset.balance.injected == pytest.approx(from_ml_h(500.0) * 600.0, rel=1e-9)
    half = after(150.0, 'pulsation:well=injector,amplitude=0.3,period=300')
    assert half.balance.injected == pytest.approx(
        from_ml_h(500.0) * (150.0 + 0.3 * 300.0 / math.pi)
    )


def test_pump_drift_wears_the_pump_out_linearly() -> None:
    asset = after(600.0, 'pump_drift:well=injector,drift=-1e-4')
    assert asset.balance.injected == pytest.approx(from_ml_h(500.0) * (600.0 - 0.5e-4 * 600.0**2))


def test_fast_exchange_with_resting_water_is_no_effect_and_slow_exchange_less_porosity() -> None:
    fast = after(600.0, 'dual_porosity:immobile_fraction=0.1,exchange_rate=0.5')
    assert difference(fast, plain_after(600.0)) < 0.12  # the exchange in steps disperses a little
    assert centre(fast) == pytest.approx(centre(plain_after(600.0)), abs=2e-3)
    slow = after(600.0, 'dual_porosity:immobile_fraction=0.1,exchange_rate=1e-9')
    reduced = after(600.0, 'porosity:factor=0.9')
    apart = np.linalg.norm(slow.visible() / 0.9 - reduced.visible())
    assert apart < 0.03 * np.linalg.norm(reduced.visible())
    assert slow.total_mass() == pytest.approx(slow.balance.injected)


def test_denser_tracer_sinks_and_lighter_tracer_rises() -> None:
    _, plain = centre(plain_after(450.0))
    assert centre(after(450.0, 'buoyancy:density_difference=4'))[1] < plain - 0.005
    assert centre(after(450.0, 'buoyancy:density_difference=-4'))[1] > plain + 0.005


def test_settling_tracer_sinks_at_its_velocity_through_resting_water() -> None:
    asset = after(600.0, 'settling:velocity=2e-5')
    before = centre(asset)[1]
    asset.set_rates({})
    for _ in range(20):
        asset.advance(60.0)
    assert centre(asset)[1] == pytest.approx(before - 2e-5 * 1200.0, abs=5e-4)
    assert asset.total_mass() == pytest.approx(asset.balance.injected)


def test_background_flow_carries_the_plume_along() -> None:
    asset = after(600.0, 'background_flow:x_velocity=2e-6,z_velocity=-1e-6')
    x, z = centre(asset)
    asset.set_rates({})
    for _ in range(20):
        asset.advance(60.0)
    moved_x, moved_z = centre(asset)
    assert moved_x - x == pytest.approx(2e-6 / 0.375 * 1200.0, rel=0.01)
    assert moved_z - z == pytest.approx(-1e-6 / 0.375 * 1200.0, rel=0.01)


def test_moved_well_moves_its_plume() -> None:
    short = rates(injector=(500.0, 1.0))
    x, z = centre(after(60.0, commanded=short))
    moved = centre(after(60.0, 'well_position:well=injector,dx=0.018,dz=-0.012', commanded=short))
    assert moved == pytest.approx((x + 0.018, z - 0.012), abs=5e-4)


def test_deeper_middle_takes_more_tracer_over_less_area() -> None:
    plain, deep = plain_after(600.0), after(600.0, 'depth:factor_centre=1.5')
    assert deep.total_mass() == pytest.approx(plain.total_mass(), rel=1e-6)
    assert (deep.visible() > 0.5).sum() < 0.85 * (plain.visible() > 0.5).sum()


def test_leak_out_takes_tracer_along() -> None:
    asset = after(900.0, 'leak:x=0.25,z=0.25,rate=-60')
    assert asset.balance.removed == pytest.approx(from_ml_h(60.0) * 900.0, rel=0.15)
    assert asset.total_mass() == pytest.approx(
        asset.balance.injected - asset.balance.removed, rel=1e-12
    )


def test_tight_streak_shadows_what_lies_behind_it() -> None:
    wall = 'streak:x=0.32,z=0.05,x_end=0.32,z_end=0.45,permeability_factor=1e-3,width=0.01'
    asset, plain = after(1800.0, wall), plain_after(1800.0)
    behind = asset.mesh.x > 0.34
    shadowed, free = (rig.visible()[:, behind].sum() for rig in (asset, plain))
    assert shadowed < 0.2 * free


def test_tight_zone_is_flowed_round() -> None:
    x, z = 0.30, 0.235
    zone = f'heterogeneity:x={x},z={z},radius=0.03,permeability_factor=0.01'
    asset, plain = after(900.0, zone), plain_after(900.0)
    mesh = asset.mesh
    inside = np.hypot(mesh.x[None, :] - x, mesh.z[:, None] - z) < 0.02
    assert asset.visible()[inside].mean() < 0.3
    assert plain.visible()[inside].mean() > 0.9


def test_layer_that_conducts_sideways_stretches_the_plume() -> None:
    asset, plain = after(600.0, 'anisotropy:z_low=0,z_high=0.562,ratio=9'), plain_after(600.0)
    spans = []
    for rig in (asset, plain):
        rows, columns = np.nonzero(rig.visible() > 0.5)
        spans.append(np.ptp(columns) / np.ptp(rows))
    assert spans[0] > 2.0 * spans[1]


def test_swaying_water_table_moves_tracer_and_brings_it_back() -> None:
    asset = plain_after(600.0)
    swaying = after(600.0, 'water_table:amplitude=1e-3,period=1200')
    assert difference(swaying, asset) > 0.02


def test_viscous_tracer_makes_a_difference_and_keeps_its_mass() -> None:
    asset = after(300.0, 'viscosity:viscosity_ratio=2')
    assert difference(asset, plain_after(300.0)) > 0.01
    assert asset.total_mass() == pytest.approx(asset.balance.injected)


def test_dispersion_widens_the_front() -> None:
    wide = after(300.0, 'dispersion:longitudinal_dispersivity=0.005,transverse_dispersivity=0.0005')
    shares = [
        ((field > 0.1) & (field < 0.9)).sum() / (field > 0.1).sum()
        for field in (wide.visible(), plain_after(300.0).visible())
    ]
    assert shares[0] > 2.0 * shares[1]
    assert wide.total_mass() == pytest.approx(wide.balance.injected, rel=1e-4)


def test_sorption_equilibrium_is_met() -> None:
    total = np.array([0.0, 1e-9, 1e-3, 0.2, 1.0])
    dissolved = dissolved_in_equilibrium(total, 0.3, 0.6)
    np.testing.assert_allclose(dissolved + 0.3 * dissolved**0.6, total, rtol=1e-9, atol=1e-15)


def test_freundlich_sorption_hides_tracer_and_keeps_its_mass() -> None:
    asset = after(150.0, 'freundlich:capacity=0.1,exponent=0.6')
    assert asset.visible().sum() < 0.95 * after(150.0).visible().sum()
    assert asset.total_mass() == pytest.approx(asset.balance.injected)


def test_stain_lags_behind_the_tracer() -> None:
    asset = after(300.0, 'stain:delay=120')
    late = asset.visible().sum()
    asset.set_rates({})
    asset.advance(3000.0)
    assert asset.visible().sum() > 1.2 * late


@pytest.mark.parametrize(
    ('text', 'named'),
    [
        ('decay:rate=1e-5;decay:rate=1e-4', 'decay: is given twice'),
        ('rate:well=injector,factor=0.5;rate:well=injector,factor=0.9', 'rate: is given twice'),
        ('leak:x=0.2,z=0.2,rate=-1e6', 'rate is -1e.06 ml/h: the pores of the whole rig hold'),
        ('settling:velocity=5', 'must be at most 0.1'),
    ],
)
def test_a_slip_of_the_hand_in_a_hidden_effect_is_refused(text: str, named: str) -> None:
    with pytest.raises(InputError, match=named):
        refuse_slips(parse_effects(text), make_rig())


def test_effects_of_two_wells_or_two_zones_are_no_slip() -> None:
    zone = 'heterogeneity:x=0.1,z=0.1,radius=0.02,permeability_factor=0.1'
    pumps = 'rate:well=injector,factor=0.5;rate:well=producer,factor=0.9'
    refuse_slips(parse_effects(f'{zone};{zone.replace("0.1", "0.2")};{pumps}'), make_rig())


@pytest.fixture(scope='module')
def coarse_rig() -> VirtualRig:
    """The rig without effects on a coarse mesh, after two minutes."""
    return coarse()


WATERED = {
    'boundaries': {'top': 'closed'},
    'water': {'ditch': {'side': 'left', 'head_m': 0.5}, 'drain': {'side': 'right', 'head_m': 0.49}},
    'water_table': {'fringe_m': 0.02},
}
"""Water whose effects act on no other rig."""


def coarse(*effects: EffectDescription, rig: Rig | None = None) -> VirtualRig:
    """Return the rig with effects on a coarse mesh, after two minutes of pumping."""
    asset = VirtualRig(rig or make_rig(), effects=effects, cell=0.012)
    asset.set_rates(COMMANDED)
    for _ in range(4):
        asset.advance(30.0)
    return asset


@pytest.mark.parametrize('name', EFFECTS)
def test_neutral_parameters_are_no_effect(coarse_rig: VirtualRig, name: str) -> None:
    parameters: dict[str, float | str] = {
        key: parameter.neutral if parameter.default is None else parameter.default
        for key, parameter in EFFECTS[name].parameters.items()
    }
    parameters |= {key: 0.3 for key in ('x', 'z', 'radius') if key in parameters}
    parameters |= {key: 'injector' for key in ('well',) if key in parameters}
    parameters |= {key: 'ditch' for key in ('body',) if key in parameters}
    with pytest.raises(InputError, match=f'effect {name}: changes nothing with'):
        refuse_slips([EffectDescription(name=name, parameters=parameters)], make_rig())
    effect = EffectDescription(name=name, parameters=parameters)
    # effects with shorter steps read the field more often
    if name in ('water_body', 'fringe'):
        watered = make_rig(**WATERED)
        assert difference(coarse(effect, rig=watered), coarse(rig=watered)) == 0.0
        return
    assert difference(coarse(effect), coarse_rig) < 0.12


@pytest.mark.parametrize(
    ('text', 'complaint'),
    [
        ('magnetism:field=1', "'magnetism' is not known"),
        ('decay:speed=1', "decay: unknown parameter 'speed'"),
        ('decay:rate=fast', "decay: rate = 'fast': give a number"),
        ('rate:well=nowhere,factor=1', "unknown well 'nowhere'"),
        ('decay:rate=nan', "decay: rate = 'nan': give a number"),
        ('well_position:well=injector,dx=-0.285', r"'injector' at \(-0.05, 0.235\) m lies outside"),
        ('leak:x=0.3,z=0.6,rate=-10', "'leak' at .* lies outside the rig of 0.934 x 0.562 m"),
        ('leek:x=0.3', "'leek' is not known; did you mean 'leak'"),
        ('leak:x=0.3,z=0.2', r"parameter 'rate' \[ml/h\] is missing; it needs x, z, rate"),
        ('leak:x=300,z=0.2,rate=-9', r'x = 300: the rig is 0.934 m wide; was this in mm\? write'),
        ('heterogeneity:x=0.3,z=20', 'the rig is 0.562 m high; was this in mm or cm'),
        ('water_level:left=2', 'left = 2: the rig is 0.562 m high; was this in mm or cm'),
        ('water_level:top=0.002', 'only the top is open, so that no flow depends on'),
        ('porosity:factor=0', 'factor = 0: must be at least 0.01'),
        ('porosity:factor=3', 'porosity 1.125: must not exceed 1'),
        ('viscosity:viscosity_ratio=0', 'viscosity_ratio = 0: must be at least 0.001'),
        ('dual_porosity:immobile_fraction=1', 'immobile_fraction = 1: must be at most 0.95'),
        ('dual_porosity:immobile_fraction=1.2', 'immobile_fraction = 1.2: must be at most 0.95'),
        ('retardation:retardation_factor=0.5', 'retardation_factor = 0.5: must be at least 1'),
        ('buoyancy:density_difference=1e12', r'difference = 1e\+12: must be at most 1000'),
        ('pulsation:well=injector,amplitude=0.1,period=0', 'period = 0: must be greater than 0'),
    ],
)
def test_wrong_effects_are_refused_by_name(text: str, complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        VirtualRig(make_rig(), effects=parse_effects(text), cell=0.02)


def test_of_an_effect_that_is_not_repeatable_the_last_one_counts() -> None:
    thin = 'dispersion:longitudinal_dispersivity=0,transverse_dispersivity=0,diffusion=1e-9'
    thick = thin.replace('longitudinal_dispersivity=0', 'longitudinal_dispersivity=0.01')
    assert difference(after(300.0, thick, thin), after(300.0, thin)) == 0.0


def test_effects_that_add_up_act_together() -> None:
    twice = after(300.0, 'porosity:factor=0.9', 'porosity:factor=0.9')
    assert difference(twice, after(300.0, 'porosity:factor=0.81')) < 1e-9
    leaks = after(300.0, 'leak:x=0.3,z=0.3,rate=-40', 'leak:x=0.3,z=0.3,rate=-60')
    assert difference(leaks, after(300.0, 'leak:x=0.3,z=0.3,rate=-100')) < 1e-9


def test_an_incomplete_effect_is_refused_in_one_line() -> None:
    parameters = {'strength': Parameter(unit='-', default=0.0)}
    with pytest.raises(InputError, match="effect 'idle' is incomplete: give one of on_rig"):
        AssetEffect(name='idle', parameters=parameters)
    with pytest.raises(InputError, match="a change of one well needs 'well'"):
        AssetEffect(name='idle', parameters=parameters, rate_factor=lambda _v, _a, _b: 1.0)


def test_text_without_values_is_refused() -> None:
    with pytest.raises(InputError, match='write NAME:PARAM=VALUE'):
        parse_effects('decay:rate')


def test_effects_as_text_and_as_descriptions_are_the_same() -> None:
    assert parse_effects('rate:well=injector,factor=0.9; decay:rate=1e-4') == (
        EffectDescription(name='rate', parameters={'well': 'injector', 'factor': 0.9}),
        EffectDescription(name='decay', parameters={'rate': 1e-4}),
    )


def test_unknown_well_is_refused() -> None:
    with pytest.raises(InputError, match="unknown well 'nowhere'"):
        VirtualRig(make_rig(), cell=0.02).set_rates(rates(nowhere=1.0))


def test_a_closed_rig_cannot_leak() -> None:
    rig = make_rig(boundaries={'top': 'closed'})
    with pytest.raises(InputError, match='sides are all closed'):
        VirtualRig(rig, effects=parse_effects('leak:x=0.4,z=0.3,rate=-20'), cell=CELL)
