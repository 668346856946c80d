"""Readings beside the maps separate effects with the same maps."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from diagnosis_examples import candidate, fitted, sample_of

from porotwin_core.model.gauge_reading import GaugeKind, GaugeReading
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.data.sample import Sample
from porotwin_diagnosis.decision.compared_readings import compared_readings
from porotwin_diagnosis.model.fitter import Fitter
from porotwin_diagnosis.model.forward import Forward
from porotwin_diagnosis.model.library import library
from porotwin_diagnosis.thresholds import SYSTEMATIC_MISFIT
from porotwin_solver.model.simulated_readings import simulated_readings

BOTTLE = GaugeReading(2160.0, GaugeKind.OUTFLOW, -270e-6, 5e-6, 'injector')
"""The bottle of the injector has lost 450 ml/h for 36 min, as commanded."""

PORTS = GaugeReading(1800.0, GaugeKind.PRESSURE, 0.0, 1.0, port=(0.2, 0.12), against=(0.36, 0.12))


def with_readings(sample: Sample, *readings: GaugeReading) -> Fitter:
    return Fitter([Forward(replace(sample, readings=readings), point_spread_width=0.3)])


def measured(sample: Sample, *effects: EffectDescription) -> GaugeReading:
    """Return a pressure of the model with `effects`, to 2 %."""
    (value,) = simulated_readings(
        sample.rig, sample.schedule, [PORTS], grid=sample.grid, effects=effects, start=0.0
    )
    return replace(PORTS, value=float(value), deviation=0.02 * abs(float(value)))


def test_a_weighed_bottle_tells_a_denser_sand_from_a_stronger_pump(
    injecting: Path,
) -> None:
    sample = sample_of(injecting)
    for readings, apart in (((), False), ((BOTTLE,), True)):
        fitter = with_readings(sample, *readings)
        porosity, rate = (fitted(fitter, label) for label in ('porosity', 'rate injector'))
        assert (fitter.distance(porosity, rate) > SYSTEMATIC_MISFIT) == apart
        assert (rate.held_out_misfit > 1.5 * porosity.held_out_misfit) == apart
        assert porosity.effects[0].parameters['factor'] == pytest.approx(0.88, abs=0.015)


def test_a_pressure_shows_a_permeability_that_no_map_shows(injecting: Path) -> None:
    sample = sample_of(injecting)
    tighter = EffectDescription(name='permeability', parameters={'factor': 0.8})
    read = measured(sample, tighter)
    fitter = with_readings(sample, read)
    fit = fitter.fit((candidate(fitter.samples, 'permeability'),))
    assert fit.effects[0].parameters['factor'] == pytest.approx(0.8, rel=0.01)
    assert all(one.label != 'permeability' for one in library([sample]))
    (compared,) = compared_readings(fitter.samples, fit.effects, None)
    assert compared.after == pytest.approx(read.value, rel=0.05)
    assert compared.before == pytest.approx(0.8 * read.value, rel=0.05)


def test_a_reading_adds_half_its_square_to_the_log_odds(injecting: Path) -> None:
    sample = sample_of(injecting)
    plain, off = (
        with_readings(sample, *readings).evaluate((), np.zeros(0))
        for readings in ((), (replace(BOTTLE, value=BOTTLE.value - 2.0 * BOTTLE.deviation),))
    )
    for before, after in (
        (plain.fitted_misfit, off.fitted_misfit),
        (plain.held_out_misfit, off.held_out_misfit),
    ):
        log_odds = (after**2 - before**2) / (2.0 * SYSTEMATIC_MISFIT**2)
        assert log_odds == pytest.approx(2.0, rel=1e-6)
