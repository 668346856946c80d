"""Pumps: commanded, metered and true rates."""

import pytest
from rig_examples import make_rig, rates

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import to_ml_h
from porotwin_rig.effects import EffectSet, parse_effects
from porotwin_rig.pumps import Pumps, RunningPumps, balanced


def running(effects: str = '') -> RunningPumps:
    rig = make_rig()
    return RunningPumps(
        rig, Pumps({'producer': 0.99}), EffectSet.checked(parse_effects(effects), rig)
    )


def test_meters_show_the_delivery_and_not_the_effects() -> None:
    pumps = running('rate:well=injector,factor=0.9')
    pumps.command(rates(injector=(500.0, 1.0), producer=-500.0))
    assert pumps.measured == {}
    pumps.start()
    assert to_ml_h(pumps.measured['injector'].rate) == pytest.approx(500.0)
    assert to_ml_h(pumps.measured['producer'].rate) == pytest.approx(-495.0)
    true = pumps.true_rates(0.0, 30.0)
    assert to_ml_h(true['injector'].rate) == pytest.approx(450.0)
    assert true['injector'].concentration == 1.0


def test_factors_of_several_effects_multiply() -> None:
    pumps = running('rate:well=injector,factor=0.9;pump_drift:well=injector,drift=-1e-3')
    pumps.command(rates(injector=100.0, control1=50.0))
    pumps.start()
    true = pumps.true_rates(100.0, 300.0)
    assert to_ml_h(true['injector'].rate) == pytest.approx(100.0 * 0.9 * 0.8)
    assert to_ml_h(true['control1'].rate) == pytest.approx(50.0)


def test_an_onset_within_an_interval_counts_for_its_rest() -> None:
    pumps = running(
        'rate:well=injector,factor=0.5,since=120;stock_strength:well=injector,factor=0.4,since=160'
    )
    pumps.command(rates(injector=(100.0, 1.0)))
    pumps.start()
    before, both = pumps.true_rates(0.0, 100.0), pumps.true_rates(100.0, 200.0)
    assert before == pumps.measured
    assert to_ml_h(both['injector'].rate) == pytest.approx(100.0 * (0.2 + 0.8 * 0.5))
    assert both['injector'].concentration == pytest.approx(0.6 + 0.4 * 0.4)


def test_water_leaves_a_tube_before_the_tracer_behind_it() -> None:
    pumps = running('dead_volume:well=injector,volume=5')
    pumps.command(rates(injector=(360.0, 1.0)))  # 0.1 ml/s
    pumps.start()
    spans = [(0.0, 30.0), (30.0, 70.0), (70.0, 80.0)]
    left = [pumps.true_rates(*span)['injector'].concentration for span in spans]
    assert left == pytest.approx([0.0, 0.5, 1.0])
    pumps.command(rates(injector=(360.0, 0.0)))
    pumps.start()
    left = [pumps.true_rates(*span)['injector'].concentration for span in [(80, 130), (130, 140)]]
    assert left == pytest.approx([1.0, 0.0])


def test_unknown_wells_are_refused() -> None:
    with pytest.raises(InputError, match="unknown well 'nowhere'"):
        running().command(rates(nowhere=1.0))


def test_sinks_of_a_closed_rig_take_out_what_is_injected() -> None:
    found = balanced(rates(injector=300.0, control1=200.0, producer=-1000.0))
    assert to_ml_h(found['producer'].rate) == pytest.approx(-500.0)
    assert to_ml_h(found['injector'].rate) == pytest.approx(300.0)
    assert all(rate.rate == 0.0 for rate in balanced(rates(injector=300.0)).values())
