"""Wells and leaks: the water and tracer that they add to the cells."""

from dataclasses import replace

import pytest

from porotwin_core.errors import InputError
from porotwin_core.wells import WellRate
from porotwin_solver.physics import Leak, SourceSink, nominal_physics
from porotwin_solver.sources_and_sinks import SourcesAndSinks


def test_sources_add_up_to_the_rates(rig, rates) -> None:
    sources = SourcesAndSinks(nominal_physics(rig, rig.grid(31, 19))).sources(rates)
    injected = rates['injector'].rate + rates['control2'].rate
    assert sources.inflow.sum() == pytest.approx(injected, rel=1e-14)
    assert sources.tracer.sum() == pytest.approx(rates['injector'].rate, rel=1e-14)
    assert sources.outflow.sum() == pytest.approx(-rates['producer'].rate, rel=1e-14)
    assert sources.net.sum() == pytest.approx(0.0, abs=1e-14 * injected)


def test_the_active_rate_is_the_commanded_one_times_the_rate_factor(rig) -> None:
    physics = replace(
        nominal_physics(rig, rig.grid(31, 19)),
        rate_factors={'injector': 0.9},
        leaks=(Leak(SourceSink(0.4, 0.3), -1e-8),),
    )
    rates = {'injector': WellRate(1e-7, 1.0), 'producer': WellRate(0.0)}
    active = SourcesAndSinks(physics).active(rates)
    assert [source.rate for source in active] == [0.9 * 1e-7, -1e-8]
    assert active[0].source_sink == physics.wells['injector']


def test_the_mean_over_a_disc_is_the_transpose_of_its_source(rig, rates) -> None:
    """<field, source of rate 1> = mean of the field over the disc."""
    physics = nominal_physics(rig, rig.grid(31, 19))
    wells = SourcesAndSinks(physics)
    field = physics.grid.x[None, :] + physics.grid.z[:, None]
    unit = wells.sources({'injector': WellRate(1.0)}).inflow
    mean = wells.disc_mean(physics.wells['injector'], field)
    assert mean == pytest.approx((field * unit).sum(), rel=1e-13)


def test_a_rate_for_an_unknown_well_is_refused(rig) -> None:
    wells = SourcesAndSinks(nominal_physics(rig, rig.grid(31, 19)))
    with pytest.raises(InputError, match="unknown well 'pump'; known: injector"):
        wells.sources({'pump': WellRate(1e-7)})
