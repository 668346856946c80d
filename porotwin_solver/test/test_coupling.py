"""The flow that the tracer drives."""

from dataclasses import replace

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.rates.wells import WellRate
from porotwin_solver.coefficients.physics import nominal_physics
from porotwin_solver.model import coupling
from porotwin_solver.model.coupling import Coupling


def test_viscosities_too_far_apart_are_refused(rig) -> None:
    physics = nominal_physics(rig, rig.grid(30, 20))
    coupled = Coupling(replace(physics, viscosity_ratio=50.0), max_iterations=5)
    concentration = np.random.default_rng(5).uniform(0.0, 1.0, (20, 30))
    with pytest.raises(InputError, match='viscosity_ratio 50: the pressure does not converge in 5'):
        coupled.flux({next(iter(rig.wells)): WellRate(1e-7)}, concentration)


def test_multigrid_gives_the_flux_of_the_preconditioned_iteration(rig, monkeypatch) -> None:
    physics = replace(
        nominal_physics(rig, rig.grid(90, 60)), viscosity_ratio=0.2, density_difference=1.0
    )
    concentration = np.random.default_rng(5).uniform(0.0, 1.0, (60, 90))
    rates = {next(iter(rig.wells)): WellRate(1e-7)}
    monkeypatch.setattr(coupling, 'TOLERANCE', 1e-8)
    small = Coupling(physics).flux(rates, concentration)
    monkeypatch.setattr(coupling, 'LARGEST_PRECONDITIONED', 0)
    large = Coupling(physics).flux(rates, concentration)
    np.testing.assert_allclose(large.x, small.x, atol=1e-7 * np.abs(small.x).max())
    np.testing.assert_allclose(large.divergence(), 0.0, atol=1e-14 * 1e-7)


def test_the_flux_follows_rates_that_change(rig) -> None:
    physics = replace(nominal_physics(rig, rig.grid(30, 20)), viscosity_ratio=0.2)
    concentration = np.random.default_rng(5).uniform(0.0, 1.0, (20, 30))
    first, second = (WellRate(1e-7), WellRate(-3e-7))
    name = next(iter(rig.wells))
    kept = Coupling(physics)
    kept.flux({name: first}, concentration)
    again = kept.flux({name: second}, concentration)
    fresh = Coupling(physics).flux({name: second}, concentration)
    np.testing.assert_allclose(again.x, fresh.x, atol=1e-14 * 1e-7)


def test_where_multigrid_does_not_converge_the_factor_of_water_helps(rig, monkeypatch) -> None:
    physics = nominal_physics(rig, rig.grid(91, 61))
    permeability = np.full(physics.grid.shape, 1e-10)
    permeability[::2] = 1e-16
    physics = replace(physics, viscosity_ratio=0.5, permeability=permeability)
    concentration = np.random.default_rng(5).uniform(0.0, 1.0, physics.grid.shape)
    rates = {next(iter(rig.wells)): WellRate(1e-7)}
    small = Coupling(physics).flux(rates, concentration)
    monkeypatch.setattr(coupling, 'LARGEST_PRECONDITIONED', 0)
    monkeypatch.setattr(coupling, 'WORTHWHILE_ITERATIONS', 1)
    again = Coupling(physics).flux(rates, concentration)
    np.testing.assert_array_equal(again.x, small.x)


def test_the_tolerance_changes_a_flux_by_less_than_any_scheme_errs(rig, monkeypatch) -> None:
    physics = replace(
        nominal_physics(rig, rig.grid(60, 40)), viscosity_ratio=0.3, density_difference=2.0
    )
    concentration = np.zeros(physics.grid.shape)
    concentration[10:30, 5:30] = 1.0
    rates = {next(iter(rig.wells)): WellRate(1e-7)}
    usual = Coupling(physics).flux(rates, concentration)
    monkeypatch.setattr(coupling, 'TOLERANCE', 1e-12)
    exact = Coupling(physics).flux(rates, concentration)
    np.testing.assert_allclose(usual.x, exact.x, atol=1e-6 * np.abs(exact.x).max())
    np.testing.assert_allclose(usual.divergence(), 0.0, atol=1e-14 * 1e-7)
