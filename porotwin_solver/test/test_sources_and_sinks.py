"""Wells and leaks: the water and tracer that they add to the cells."""

from dataclasses import replace

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.rates.wells import WellRate
from porotwin_solver.adjoint.backward_sweep import by_commands
from porotwin_solver.coefficients.physics import Leak, SourceSink, nominal_physics
from porotwin_solver.transport.sources_and_sinks import SourcesAndSinks


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


CLOSED_RATES = {
    'injector': WellRate(2e-7, 1.0),
    'control2': WellRate(1e-7, 0.0),
    'control1': WellRate(-0.5e-7),
    'producer': WellRate(-2.5e-7),
}


def closed_with(rig, factors):
    """Return the physics of a closed rig whose pumps have rate `factors`."""
    closed = rig.boundaries.model_copy(update={'top': 'closed'})
    physics = nominal_physics(rig, rig.grid(31, 19))
    return replace(physics, boundaries=closed, rate_factors=factors)


def test_in_a_closed_rig_the_sinks_follow_a_weak_pump(rig) -> None:
    delivered = closed_with(rig, {'injector': 0.85}).delivered(CLOSED_RATES)
    assert delivered['injector'] == pytest.approx(1.7e-7)
    assert delivered['producer'] == pytest.approx(-2.5e-7 * 2.7 / 3.0)
    assert sum(delivered.values()) == pytest.approx(0.0, abs=1e-20)
    stopped = closed_with(rig, {'injector': 0.0, 'control2': 0.0}).delivered(CLOSED_RATES)
    assert not any(stopped.values())
    unequal = {**CLOSED_RATES, 'producer': WellRate(-2e-7)}
    left = closed_with(rig, {'injector': 0.85}).delivered(unequal)
    assert sum(left.values()) == pytest.approx(0.9 * 0.5e-7)  # still refused by the flow


def test_derivatives_by_commands_are_those_of_the_delivered_rates(rig) -> None:
    """J = sum of g times the delivered rates, along a change of commands that keeps the balance."""
    physics = closed_with(rig, {'injector': 0.85, 'control1': 1.2})
    weights = {'injector': 1.0, 'control2': -2.0, 'control1': 0.3, 'producer': 4.0}
    change = {'injector': 1e-8, 'control2': 2e-8, 'control1': -0.5e-8, 'producer': -2.5e-8}

    def objective(step: float) -> float:
        moved = {
            name: replace(well, rate=well.rate + step * change[name])
            for name, well in CLOSED_RATES.items()
        }
        return sum(weights[name] * rate for name, rate in physics.delivered(moved).items())

    found = by_commands(physics, CLOSED_RATES, weights)
    along = sum(found[name] * change[name] for name in change)
    assert along == pytest.approx((objective(1e-3) - objective(-1e-3)) / 2e-3, rel=1e-6)
